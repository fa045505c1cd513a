//! Martin Newell's teapot and teacup as data, z up.
//!
//! The numbers are those of `fg_teapot_data.h` in freeglut 3.4.0 (from the `teasetorig` archive of Juhana Kouhia and
//! Philip Schneider, 1990; the bottom of the teapot was added later), compared with `TeapotGeometry.js` of three.js.
//! The layout is ours: most of the patches are a profile swept through four quarter turns, so we keep the profile.

/// Four control points (radius, height) of a cubic that is swept around the z axis.
pub type Profile = [[f64; 2]; 4];
/// A bicubic patch of the half of a tube with y <= 0: `[along the tube][across it]`.
pub type HalfTube = [[[f64; 3]; 4]; 4];

/// A quarter turn from (1, 0) to (0, 1) has the control points (1, 0), (1, K), (K, 1), (0, 1).
///
/// A circle's best K is 0.5523, so the teapot is not quite round. The published knob has .45 for .448 in one place.
pub const QUARTER_TURN_K: f64 = 0.56;

/// The knob's top, down over lid, rim and body, to the center of the bottom.
///
/// The flat seat between lid and rim is ours: it closes the gap of a tenth that the published lid leaves.
pub const TEAPOT_PROFILES: [Profile; 7] = [
    [[0.0, 3.15], [0.8, 3.15], [0.0, 2.85], [0.2, 2.7]],
    [[0.2, 2.7], [0.4, 2.55], [1.3, 2.55], [1.3, 2.4]],
    straight([1.3, 2.4], [1.4, 2.4]),
    [[1.4, 2.4], [1.3375, 2.53125], [1.4375, 2.53125], [1.5, 2.4]],
    [[1.5, 2.4], [1.75, 1.875], [2.0, 1.35], [2.0, 0.9]],
    [[2.0, 0.9], [2.0, 0.45], [1.5, 0.225], [1.5, 0.15]],
    [[1.5, 0.15], [1.5, 0.075], [1.425, 0.0], [0.0, 0.0]],
];

/// The handle from top to bottom.
pub const TEAPOT_HANDLE: [HalfTube; 2] = [
    [
        [[-1.6, 0.0, 2.025], [-1.6, -0.3, 2.025], [-1.5, -0.3, 2.25], [-1.5, 0.0, 2.25]],
        [[-2.3, 0.0, 2.025], [-2.3, -0.3, 2.025], [-2.5, -0.3, 2.25], [-2.5, 0.0, 2.25]],
        [[-2.7, 0.0, 2.025], [-2.7, -0.3, 2.025], [-3.0, -0.3, 2.25], [-3.0, 0.0, 2.25]],
        [[-2.7, 0.0, 1.8], [-2.7, -0.3, 1.8], [-3.0, -0.3, 1.8], [-3.0, 0.0, 1.8]],
    ],
    [
        [[-2.7, 0.0, 1.8], [-2.7, -0.3, 1.8], [-3.0, -0.3, 1.8], [-3.0, 0.0, 1.8]],
        [[-2.7, 0.0, 1.575], [-2.7, -0.3, 1.575], [-3.0, -0.3, 1.35], [-3.0, 0.0, 1.35]],
        [[-2.5, 0.0, 1.125], [-2.5, -0.3, 1.125], [-2.65, -0.3, 0.9375], [-2.65, 0.0, 0.9375]],
        [[-2.0, 0.0, 0.9], [-2.0, -0.3, 0.9], [-1.9, -0.3, 0.6], [-1.9, 0.0, 0.6]],
    ],
];

/// The spout from the body to its lip, which is folded inwards.
pub const TEAPOT_SPOUT: [HalfTube; 2] = [
    [
        [[1.7, 0.0, 1.425], [1.7, -0.66, 1.425], [1.7, -0.66, 0.6], [1.7, 0.0, 0.6]],
        [[2.6, 0.0, 1.425], [2.6, -0.66, 1.425], [3.1, -0.66, 0.825], [3.1, 0.0, 0.825]],
        [[2.3, 0.0, 2.1], [2.3, -0.25, 2.1], [2.4, -0.25, 2.025], [2.4, 0.0, 2.025]],
        [[2.7, 0.0, 2.4], [2.7, -0.25, 2.4], [3.3, -0.25, 2.4], [3.3, 0.0, 2.4]],
    ],
    [
        [[2.7, 0.0, 2.4], [2.7, -0.25, 2.4], [3.3, -0.25, 2.4], [3.3, 0.0, 2.4]],
        [[2.8, 0.0, 2.475], [2.8, -0.25, 2.475], [3.525, -0.25, 2.49375], [3.525, 0.0, 2.49375]],
        [[2.9, 0.0, 2.475], [2.9, -0.15, 2.475], [3.45, -0.15, 2.5125], [3.45, 0.0, 2.5125]],
        [[2.8, 0.0, 2.4], [2.8, -0.15, 2.4], [3.2, -0.15, 2.4], [3.2, 0.0, 2.4]],
    ],
];

/// The center of the cup's inside, up its wall, over the rim, down and out along the saucer, and back underneath.
///
/// The first and the last profile are ours: they close the cup's bottom and the saucer's, which are published open.
pub const TEACUP_PROFILES: [Profile; 8] = [
    straight([0.0, 0.16023], [0.96136, 0.16023]),
    [[0.96136, 0.16023], [1.44205, 0.96136], [1.44205, 1.92273], [1.44205, 2.72386]],
    [[1.44205, 2.72386], [1.44205, 3.12443], [1.60227, 3.12443], [1.60227, 2.72386]],
    [[1.60227, 2.72386], [1.60227, 1.92273], [1.60227, 0.96136], [1.12159, 0.16023]],
    [[1.12159, 0.16023], [1.92273, 0.16023], [2.56364, 0.48068], [3.20455, 0.48068]],
    [[3.20455, 0.48068], [3.525, 0.48068], [3.525, 0.32045], [3.20455, 0.32045]],
    [[3.20455, 0.32045], [2.56364, 0.32045], [1.92273, 0.0], [1.12159, 0.0]],
    straight([1.12159, 0.0], [0.0, 0.0]),
];

/// The cup's handle from top to bottom.
pub const TEACUP_HANDLE: [HalfTube; 1] = [[
    [
        [-1.60227, 0.0, 2.48352],
        [-1.60227, -0.16023, 2.48352],
        [-1.60227, -0.16023, 2.72386],
        [-1.60227, 0.0, 2.72386],
    ],
    [
        [-2.72386, 0.0, 3.04432],
        [-2.72386, -0.16023, 3.04432],
        [-2.88409, -0.16023, 3.36477],
        [-2.88409, 0.0, 3.36477],
    ],
    [
        [-2.72386, 0.0, 1.84261],
        [-2.72386, -0.16023, 1.84261],
        [-3.20455, -0.16023, 1.68239],
        [-3.20455, 0.0, 1.68239],
    ],
    [
        [-1.44205, 0.0, 1.28182],
        [-1.44205, -0.16023, 1.28182],
        [-1.44205, -0.16023, 1.04148],
        [-1.44205, 0.0, 1.04148],
    ],
]];

/// A straight profile from `a` to `b`.
const fn straight(a: [f64; 2], b: [f64; 2]) -> Profile {
    let third = [(b[0] - a[0]) / 3.0, (b[1] - a[1]) / 3.0];
    [a, [a[0] + third[0], a[1] + third[1]], [b[0] - third[0], b[1] - third[1]], b]
}
