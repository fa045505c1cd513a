//! A scene with other light, camera, materials and film, drawn from a seed; and what it shows.

mod preview;

use std::f32::consts::{LN_2, PI, TAU};

use basecode::{CameraConfig, Frame, MaterialModel, Sampler, Scene, Vec3, vec3};

pub use preview::ScenePreview;

/// The light stands within this angle of where it stood, seen from the point looked at.
const LIGHT_TURN: f32 = 40.0 * PI / 180.0;
/// Its distance from there, as factors.
const LIGHT_DISTANCE: [f32; 2] = [0.8, 1.25];
/// Its intensity, beside what makes up for its distance, and how much each channel keeps.
const INTENSITY: [f32; 2] = [0.8, 1.4];
const TINT: [f32; 2] = [0.6, 1.0];
/// The camera moves around the point looked at by at most these angles, to the side and up or down.
const CAMERA_TURN: [f32; 2] = [25.0 * PI / 180.0, 12.0 * PI / 180.0];
const CAMERA_DISTANCE: [f32; 2] = [0.85, 1.15];
/// The point looked at moves along each axis by at most this fraction of the camera's distance.
const AIM: f32 = 0.04;
const FOV: [f32; 2] = [0.85, 1.2];
/// Each channel of an albedo, as a factor, and where it must lie afterwards unless it was 0.
const ALBEDO: [f32; 2] = [0.6, 1.4];
const ALBEDO_RANGE: [f32; 2] = [0.04, 0.95];
/// An exponent is halved or doubled at most.
const EXPONENT_LOG: f32 = LN_2;
/// Width and height of the film in pixels: small, because everything is drawn on it.
const WIDTH: [f32; 2] = [96.0, 160.0];
const HEIGHT: [f32; 2] = [76.0, 112.0];

/// A changed scene: all that differs from the original. Every number has at most four decimals, so
/// that the files say exactly what was looked at.
#[derive(Clone, Debug, PartialEq)]
pub struct ChangedScene {
    /// Position of the point light, world space.
    pub light: Vec3,
    /// Its radiant intensity [W sr^-1].
    pub intensity: Vec3,
    /// The camera.
    pub camera: CameraConfig,
    /// Width and height of the film in pixels.
    pub film: [usize; 2],
    /// For each of the scene's materials.
    pub surfaces: Vec<Surface>,
}

/// The numbers of a material. A texture stays as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Diffuse albedo Kd.
    pub diffuse: Vec3,
    /// Specular albedo Ks.
    pub specular: Vec3,
    /// Phong exponent Ns.
    pub exponent: f32,
}

impl ChangedScene {
    /// The scene as it is.
    pub fn original(scene: &Scene) -> Self {
        let surface = |material: &basecode::Material| Surface {
            diffuse: material.diffuse.average(),
            specular: material.specular.average(),
            exponent: material.exponent,
        };
        let config = scene.config();
        Self {
            light: scene.first_light_position(),
            intensity: scene.first_light_intensity(),
            camera: config.camera,
            film: [config.width, config.height],
            surfaces: scene.materials().iter().map(surface).collect(),
        }
    }

    /// A change of `scene` that depends on the seed alone.
    pub fn new(scene: &Scene, seed: u64) -> Self {
        let sampler = Sampler::new(seed);
        let between = |[low, high]: [f32; 2]| low + (high - low) * sampler.next_1d();
        let original = Self::original(scene);
        let CameraConfig { eye, at, up, fov_y_deg } = original.camera;

        let to_light = original.light - at;
        let cos = 1.0 - sampler.next_1d() * (1.0 - LIGHT_TURN.cos());
        let (y, x) = (TAU * sampler.next_1d()).sin_cos();
        let sin = (1.0 - cos * cos).sqrt();
        let turned = Frame::from_normal(to_light.normalize()).to_world(vec3(sin * x, sin * y, cos));
        let farther = between(LIGHT_DISTANCE);
        let light = at + turned * (to_light.length() * farther);
        let tint = vec3(between(TINT), between(TINT), between(TINT));
        let intensity = original.intensity * tint * (farther * farther * between(INTENSITY));

        let from = eye - at;
        let distance = from.length();
        let [side, height] = CAMERA_TURN.map(|most| between([-most, most]));
        let azimuth = from.x.atan2(from.z) + side;
        // Never straight from above or below, where the camera has no frame.
        let elevation = ((from.y / distance).asin() + height).clamp(-1.3, 1.3);
        let aim = || between([-AIM, AIM]) * distance;
        let at = at + vec3(aim(), aim(), aim());
        let level = vec3(azimuth.sin(), 0.0, azimuth.cos()) * elevation.cos();
        let eye = at + (level + Vec3::Y * elevation.sin()) * (distance * between(CAMERA_DISTANCE));
        let fov_y_deg = fov_y_deg * between(FOV);
        let film = [WIDTH, HEIGHT].map(|side| between(side).round() as usize);

        let albedo = |value: Vec3| {
            let changed = value * vec3(between(ALBEDO), between(ALBEDO), between(ALBEDO));
            let [low, high] = ALBEDO_RANGE;
            rounded(changed.clamp(value.min(Vec3::splat(low)), Vec3::splat(high)))
        };
        let surfaces = scene.materials().iter().zip(&original.surfaces);
        let surfaces = surfaces.map(|(material, old)| match material.model {
            _ if material.is_emitter() => *old,
            MaterialModel::Phong => Surface {
                diffuse: albedo(old.diffuse),
                specular: albedo(old.specular),
                exponent: (old.exponent * between([-EXPONENT_LOG, EXPONENT_LOG]).exp()).max(1.0),
            },
            _ => Surface { diffuse: albedo(old.diffuse), ..*old },
        });
        let surfaces = surfaces.map(|new| Surface { exponent: decimals(new.exponent, 1), ..new });
        Self {
            light: rounded(light),
            intensity: rounded(intensity),
            camera: CameraConfig {
                eye: rounded(eye),
                at: rounded(at),
                up,
                fov_y_deg: decimals(fov_y_deg, 2),
            },
            film,
            surfaces: surfaces.collect(),
        }
    }
}

/// A number with so many decimals, as a file that states it is read.
fn decimals(value: f32, decimals: usize) -> f32 {
    format!("{value:.decimals$}").parse().unwrap_or(value)
}

fn rounded(v: Vec3) -> Vec3 {
    vec3(decimals(v.x, 4), decimals(v.y, 4), decimals(v.z, 4))
}
