//! What a camera sees, before any shading: the surface buffer of a scene.

use basecode::{Camera, Frame, Mat4, Ray, Result, Scene, SurfaceInteraction, Vec3, vec2};

/// Where one camera ray meets the scene, and how the light stands there.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// The camera ray.
    pub ray: Ray,
    /// Index of the shape.
    pub shape: usize,
    /// Index of the triangle within the shape.
    pub primitive: usize,
    /// The point, world space.
    pub position: Vec3,
    /// Shading normal, world space.
    pub normal: Vec3,
    /// Unit direction toward the viewer, local shading frame.
    pub wo: Vec3,
    /// Unit direction toward the light, local shading frame.
    pub wi: Vec3,
    /// Distance to the light, scene units.
    pub distance: f32,
    /// What lies between the point and the light.
    pub visibility: Visibility,
}

/// Whether a surface point and the light see each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visibility {
    /// Nothing lies between, with a margin.
    Clear,
    /// Something lies between, with a margin.
    Blocked,
    /// It depends on the epsilon of the shadow ray.
    Unsure,
}

impl SurfacePoint {
    /// Whether both directions face the surface, as every BSDF here demands.
    pub fn faces_both(&self) -> bool {
        Frame::cos_theta(self.wo) > 0.0 && Frame::cos_theta(self.wi) > 0.0
    }

    /// What is shown of its triangle at its place on the film where values are interpolated there without perspective.
    /// `to_clip` leads to clip space. Nothing for a triangle that is in part behind the viewer.
    pub fn without_perspective(&self, scene: &Scene, to_clip: Mat4) -> Option<Self> {
        let shape = &scene.shapes()[self.shape];
        let corners = shape.triangles[self.primitive].map(|corner| corner as usize);
        let clip = corners.map(|corner| to_clip * shape.positions[corner].extend(1.0));
        if clip.iter().any(|clip| clip.w <= Camera::NEAR) {
            return None;
        }
        let [a, b, c] = clip.map(|clip| vec2(clip.x, clip.y) / clip.w);
        let at = to_clip.project_point3(self.position).truncate();
        let area = (b - a).perp_dot(c - a);
        let weights =
            [(b - at).perp_dot(c - at), (c - at).perp_dot(a - at)].map(|part| part / area);
        let weights = [weights[0], weights[1], 1.0 - weights[0] - weights[1]];
        let blended = |of: &[Vec3]| -> Vec3 {
            corners.iter().zip(weights).map(|(&corner, weight)| weight * of[corner]).sum()
        };
        let normal = blended(&shape.normals).try_normalize()?;
        Some(Self { position: blended(&shape.positions), normal, ..*self })
    }

    /// Casts one camera ray.
    pub fn cast(scene: &Scene, ray: Ray) -> Option<Self> {
        Self::cast_under(scene, scene.first_light_position(), ray)
    }

    /// As [`SurfacePoint::cast`], with the light elsewhere.
    pub fn cast_under(scene: &Scene, light: Vec3, ray: Ray) -> Option<Self> {
        let hit = scene.intersect(&ray)?;
        let to_light = light - hit.p;
        let distance = to_light.length();
        let direction = to_light / distance;
        Some(Self {
            ray,
            shape: hit.shape,
            primitive: hit.primitive,
            position: hit.p,
            normal: hit.frame_ns.n,
            wo: hit.wo,
            wi: hit.frame_ns.to_local(direction),
            distance,
            visibility: visibility(scene, &hit, direction, distance),
        })
    }
}

/// Shadow rays that leave a surface start somewhere between these distances from it, in scene
/// units times the distance of the light: the original's epsilon is 1e-3, students use 1e-5 to 5e-3.
/// Near a light, or in a large or small scene, the distance is that at which [`UNIT`] is one.
const NEAREST_START: f32 = 1e-5;
/// The farther one.
pub const FARTHEST_START: f32 = 5e-3;
/// The unit of length over a hit's epsilon: one where a point is seen from five units away.
const UNIT: f32 = 2e3;
/// A triangle that the light grazes or leaves while its shading normal still faces it shadows
/// itself or not, as a renderer's epsilons want: the faceted terminator. Cosine to the triangle.
const TERMINATOR: f32 = 0.02;
/// How far from its end a shadow ray may stop, relative to its length.
const END_MARGIN: f32 = 5e-3;

fn visibility(
    scene: &Scene,
    hit: &SurfaceInteraction,
    direction: Vec3,
    distance: f32,
) -> Visibility {
    let from =
        |origin, start: f32, end: f32| scene.occluded(&Ray::segment(origin, direction, start, end));
    let unit = distance.max(UNIT * hit.epsilon);
    let near = NEAREST_START * unit;
    let far = FARTHEST_START * unit;
    let outside = hit.ng * hit.ng.dot(hit.frame_ns.n).signum();
    if outside.dot(direction) < TERMINATOR
        && Frame::cos_theta(hit.frame_ns.to_local(direction)) > 0.0
    {
        return Visibility::Unsure;
    }
    // Some students lift the origin along the normal instead of starting later on the ray.
    let lifted = hit.p + far * outside;
    let short = distance * (1.0 - END_MARGIN);
    let answers = [
        from(hit.p, near, distance * (1.0 - 1e-5)),
        from(hit.p, far, short),
        from(lifted, near, short),
    ];
    match answers {
        [true, true, true] => Visibility::Blocked,
        [false, false, false] => Visibility::Clear,
        _ => Visibility::Unsure,
    }
}

/// What each pixel's center sees; row-major, row 0 on top.
#[derive(Clone, Debug)]
pub struct SurfaceBuffer {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// The ray and, if it meets something, the point, for each pixel.
    pub pixels: Vec<(Ray, Option<SurfacePoint>)>,
}

impl SurfaceBuffer {
    /// Casts the center ray of every pixel of a film of `width` x `height`.
    ///
    /// # Errors
    /// When the film is empty or the scene's camera has no frame.
    pub fn new(scene: &Scene, width: usize, height: usize) -> Result<Self> {
        let camera = scene.camera(width, height)?;
        let centers = (0..width * height).map(|index| {
            let ray = camera.ray((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
            (ray, SurfacePoint::cast(scene, ray))
        });
        Ok(Self { width, height, pixels: centers.collect() })
    }
}

/// What the corners, edges and centers of all pixels see: (2 width + 1) x (2 height + 1) points,
/// half a pixel apart.
pub(super) struct Lattice {
    width: usize,
    points: Vec<Option<SurfacePoint>>,
}

impl Lattice {
    pub(super) fn new(scene: &Scene, camera: &Camera, width: usize, height: usize) -> Self {
        use rayon::prelude::*;
        let (columns, rows) = (2 * width + 1, 2 * height + 1);
        let points = (0..columns * rows).into_par_iter().map(|index| {
            let (x, y) = ((index % columns) as f32 * 0.5, (index / columns) as f32 * 0.5);
            SurfacePoint::cast(scene, camera.ray(x, y))
        });
        Self { width: columns, points: points.collect() }
    }

    /// The 3x3 points of pixel (`x`, `y`), its center in the middle.
    pub(super) fn around(&self, x: usize, y: usize) -> [&Option<SurfacePoint>; 9] {
        std::array::from_fn(|i| &self.points[(2 * y + i / 3) * self.width + 2 * x + i % 3])
    }
}
