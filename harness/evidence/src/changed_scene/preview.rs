//! A coarse preview of a changed scene, from its geometry alone.

use basecode::{Camera, Frame, MaterialModel, Result, Scene, Vec3};
use renderer_api as api;

use super::ChangedScene;
use crate::bsdf;
use crate::expected::{SurfacePoint, Visibility};

/// Width in pixels of the film that is looked at.
const WIDTH: usize = 64;
/// Directions closer to a surface than this cosine tell too little.
const MIN_COSINE: f32 = 0.05;
/// A lobe above this fraction of its peak is a highlight, as in [`crate::expected`].
const HIGHLIGHT: f32 = 0.1;

/// At least so much of the film is in the light, in shadow, near the peak of a highlight, away from
/// edges. A thousandth is about ten pixels.
const LEAST_LIT: f64 = 0.15;
const LEAST_SHADOWED: f64 = 0.01;
const LEAST_HIGHLIGHT: f64 = 0.0013;
/// At least so much of it shows lit surfaces of each model that the scene has.
const LEAST_OF_MODEL: f64 = 0.02;
/// The median of what is lit lies in this range [W m^-2 sr^-1].
const MEDIAN: [f32; 2] = [0.02, 1.0];
/// Least distance of light and eye from every surface, relative to their distance from the point looked at.
const CLEARANCE: f32 = 0.08;
/// The frustum that holds the shadows opens by at most this much more than on the original.
const WIDER: f32 = 5.0 * std::f32::consts::PI / 180.0;
/// The film's shape differs from the original's by at least this fraction.
const OTHER_SHAPE: f32 = 0.08;

/// What is seen, away from edges.
#[derive(Clone, Copy, Debug, Default)]
pub struct ScenePreview {
    /// Fraction of the film that is in the light.
    pub lit: f64,
    /// Fraction that faces light and viewer but lies in shadow.
    pub shadowed: f64,
    /// Fraction that is near the peak of a highlight.
    pub highlight: f64,
    /// Fractions that show lit diffuse and lit Phong surfaces.
    pub of_model: [f64; 2],
    /// Median radiance of what is lit, the channels' mean [W m^-2 sr^-1].
    pub median: f32,
    /// Half the angle of the cone from the light that holds every shadow in view, in radians.
    pub shadow_cone: f32,
    /// The same for all that faces the light, in shadow or not, in radians.
    pub facing_cone: f32,
    /// Distance of the light, and of the eye, from the nearest surface, as fractions of its distance
    /// from the point looked at.
    pub clearance: [f32; 2],
    /// Width over height of the film.
    pub aspect: f32,
}

impl ScenePreview {
    /// Looks at `scene` as `draw` changes it.
    ///
    /// # Errors
    /// When the camera has no frame.
    pub fn new(scene: &Scene, draw: &ChangedScene) -> Result<Self> {
        let [width, height] = draw.film;
        let rows = (WIDTH * height / width).max(1);
        let camera = Camera::new(draw.camera, WIDTH, rows)?;
        let seen = (0..WIDTH * rows).map(|index| {
            let ray = camera.ray((index % WIDTH) as f32 + 0.5, (index / WIDTH) as f32 + 0.5);
            Seen::of(scene, draw, SurfacePoint::cast_under(scene, draw.light, ray)?)
        });
        let seen: Vec<Option<Seen>> = seen.collect();
        let mut preview = Self { aspect: width as f32 / height as f32, ..Self::default() };
        let pixel = 1.0 / (WIDTH * rows) as f64;
        let (mut radiance, mut facing, mut dark) = (Vec::new(), Vec::new(), Vec::new());
        for (index, own) in seen.iter().enumerate() {
            let Some(own) = own else { continue };
            facing.push(own.from_light);
            if own.visibility == Visibility::Blocked {
                dark.push(own.from_light);
            }
            if !is_interior(&seen, index, rows) {
                continue;
            }
            match own.visibility {
                Visibility::Unsure => continue,
                Visibility::Blocked => preview.shadowed += pixel,
                Visibility::Clear => {
                    preview.lit += pixel;
                    preview.of_model[usize::from(own.phong)] += pixel;
                    preview.highlight += if own.highlight { pixel } else { 0.0 };
                    radiance.push(own.radiance);
                }
            }
        }
        radiance.sort_by(f32::total_cmp);
        preview.median = radiance.get(radiance.len() / 2).copied().unwrap_or(0.0);
        preview.shadow_cone = half_angle(&dark);
        preview.facing_cone = half_angle(&facing);
        preview.clearance = [draw.light, draw.camera.eye]
            .map(|point| clearance(scene, point) / point.distance(draw.camera.at));
        Ok(preview)
    }

    /// Why this is not worth asking a renderer about, if so; `original` is the unchanged scene.
    pub fn problem(&self, original: &Self, bonus: bool) -> Option<&'static str> {
        let too_few = |own: f64, least: f64, had: f64| had > 0.0 && own < least;
        let problems = [
            (
                (self.aspect / original.aspect - 1.0).abs() < OTHER_SHAPE,
                "the film has the original's shape",
            ),
            (self.clearance[0] < CLEARANCE, "the light is too near to a surface"),
            (self.clearance[1] < CLEARANCE, "the camera is too near to a surface"),
            (too_few(self.lit, LEAST_LIT, original.lit), "too little is lit"),
            (too_few(self.shadowed, LEAST_SHADOWED, original.shadowed), "too little is in shadow"),
            (too_few(self.highlight, LEAST_HIGHLIGHT, original.highlight), "no highlight is seen"),
            (
                (0..2).any(|m| too_few(self.of_model[m], LEAST_OF_MODEL, original.of_model[m])),
                "a kind of material is not seen",
            ),
            (!(MEDIAN[0]..=MEDIAN[1]).contains(&self.median), "it is too dark or too bright"),
            (
                bonus
                    && (self.shadow_cone > original.shadow_cone + WIDER
                        || self.facing_cone > original.facing_cone + WIDER),
                "one frustum does not hold the shadows",
            ),
        ];
        problems.into_iter().find(|(is_so, _)| *is_so).map(|(_, why)| why)
    }
}

/// What one pixel shows, where it faces light and viewer.
struct Seen {
    shape: usize,
    visibility: Visibility,
    phong: bool,
    highlight: bool,
    /// Unit direction from the light.
    from_light: Vec3,
    /// Radiance when the light is visible, the channels' mean [W m^-2 sr^-1].
    radiance: f32,
}

impl Seen {
    fn of(scene: &Scene, draw: &ChangedScene, point: SurfacePoint) -> Option<Self> {
        let SurfacePoint { shape, wo, wi, distance, visibility, .. } = point;
        let material = scene.material_of(shape);
        let grazes = |w| Frame::cos_theta(w) < MIN_COSINE;
        if material.is_emitter() || grazes(wo) || grazes(wi) {
            return None;
        }
        let surface = draw.surfaces[scene.shapes()[shape].material];
        let phong = material.model == MaterialModel::Phong;
        let value = api::MaterialValue {
            model: if phong { api::MATERIAL_PHONG } else { api::MATERIAL_DIFFUSE },
            diffuse: surface.diffuse.into(),
            specular: surface.specular.into(),
            exponent: surface.exponent,
        };
        let f = bsdf::value(&value, 1.0, wo.into(), wi.into()).map(|f| f as f32);
        let incident = draw.intensity / (distance * distance);
        let mirrored = Vec3::new(-wo.x, -wo.y, wo.z);
        let lobe = wi.dot(mirrored).max(0.0).powf(surface.exponent);
        Some(Self {
            shape,
            visibility,
            phong,
            highlight: phong && lobe > HIGHLIGHT,
            from_light: (point.position - draw.light).normalize_or_zero(),
            radiance: (incident * Vec3::from(f)).element_sum() / 3.0,
        })
    }
}

/// Whether the pixels on all four sides show the same shape in the same light.
fn is_interior(seen: &[Option<Seen>], index: usize, rows: usize) -> bool {
    let (x, y) = (index % WIDTH, index / WIDTH);
    let state = |index: usize| seen[index].as_ref().map(|seen| (seen.shape, seen.visibility));
    x > 0
        && y > 0
        && x + 1 < WIDTH
        && y + 1 < rows
        && [index - 1, index + 1, index - WIDTH, index + WIDTH]
            .iter()
            .all(|&near| state(near) == state(index))
}

/// Half the angle of the cone around the mean of unit directions that holds them all [rad].
fn half_angle(directions: &[Vec3]) -> f32 {
    let axis = directions.iter().sum::<Vec3>().normalize_or_zero();
    directions.iter().map(|d| d.dot(axis).clamp(-1.0, 1.0).acos()).fold(0.0, f32::max)
}

/// Distance from a point to the nearest surface that is no emitter.
fn clearance(scene: &Scene, point: Vec3) -> f32 {
    let shapes = scene.shapes().iter().enumerate();
    let solid = shapes.filter(|(index, _)| !scene.material_of(*index).is_emitter());
    let triangles =
        solid.flat_map(|(_, shape)| (0..shape.triangles.len()).map(|t| shape.corners(t)));
    triangles.map(|corners| point.distance(nearest(point, corners))).fold(f32::INFINITY, f32::min)
}

/// The point of a triangle that is nearest to `p`: Ericson, "Real-Time Collision Detection", 2005,
/// section 5.1.5.
fn nearest(p: Vec3, [a, b, c]: [Vec3; 3]) -> Vec3 {
    let (ab, ac) = (b - a, c - a);
    let along = |from: Vec3| (ab.dot(p - from), ac.dot(p - from));
    let ((d1, d2), (d3, d4), (d5, d6)) = (along(a), along(b), along(c));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    a + ab * (vb / (va + vb + vc)) + ac * (vc / (va + vb + vc))
}

#[cfg(test)]
mod tests {
    use basecode::vec3;

    use super::*;

    #[test]
    fn the_nearest_point_lies_inside_on_an_edge_or_in_a_corner() {
        let triangle = [Vec3::ZERO, vec3(2.0, 0.0, 0.0), vec3(0.0, 2.0, 0.0)];
        for (p, expected) in [
            (vec3(0.5, 0.5, 3.0), vec3(0.5, 0.5, 0.0)),
            (vec3(1.0, -4.0, 1.0), vec3(1.0, 0.0, 0.0)),
            (vec3(-4.0, 1.0, 1.0), vec3(0.0, 1.0, 0.0)),
            (vec3(2.0, 2.0, -1.0), vec3(1.0, 1.0, 0.0)),
            (vec3(-1.0, -1.0, 0.0), Vec3::ZERO),
            (vec3(5.0, -1.0, 0.0), vec3(2.0, 0.0, 0.0)),
            (vec3(-1.0, 5.0, 0.0), vec3(0.0, 2.0, 0.0)),
        ] {
            assert!(nearest(p, triangle).distance(expected) < 1e-6, "{p}");
        }
    }

    #[test]
    fn a_cone_holds_all_directions() {
        let at = |degrees: f32| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            vec3(sin, 0.0, cos)
        };
        assert_eq!(half_angle(&[]), 0.0);
        assert!((half_angle(&[at(10.0), at(50.0)]).to_degrees() - 20.0).abs() < 1e-2);
    }
}
