//! Small scenes that show what the four of the assignment cannot.

mod geometry;
mod materials;

use super::exporting::File;
use super::mesh::Mesh;
use super::scene::{Camera, Scene};
use glam::DVec3;

/// Width and height of a probe's film unless the probe needs more.
const FILM: [u32; 2] = [128, 96];

/// A probe and one line on what it shows.
type Probe = (fn() -> Scene, &'static str);

/// Every probe in the order of the table.
const PROBES: [Probe; 14] = [
    (
        materials::scale,
        "Kd + Ks over 1 in one channel or in all, beside spheres where `scale` is 1: a missing, inverted or misplaced `scale`, `scale` on a diffuse material",
    ),
    (
        materials::exponents,
        "strips of exponent 1, 9.8, 101.5, 50 and 2, seen at grazing angles, cos alpha < 0 at their far end: pow before clamp, NaN, n + 1 for n + 2",
    ),
    (
        materials::coloured,
        "a dim, coloured light on coloured Kd and Ks, nothing above 1: swapped channels, a light or material taken as grey",
    ),
    (
        materials::textured,
        "map_Kd and map_Ks with texture coordinates from below 0 to above 1, not symmetric: constant albedo, flipped v, clamp for wrap-around",
    ),
    (
        materials::open,
        "bumpy diffuse and Phong strips without any occluder, everything in view lit: unshadowed radiance alone, whatever the shadows do; a sample that is not at the pixel's centre",
    ),
    (
        geometry::behind,
        "a plate beyond the light along the shadow rays, a shelf nearer than 1 with an occluder close to the light, a floor beyond 2: missing max_t, max_t = r^2",
    ),
    (
        geometry::emitter,
        "a large hexagon as emitter whose index mean is not the mean of its corners, its centroid or its first corner: light position, emitter that shadows its own light",
    ),
    (
        geometry::backfaces,
        "surfaces that face the camera but not the light, the light but not the camera, neither, both; an open bowl: missing test of wo or wi, abs of a cosine",
    ),
    (
        geometry::contact,
        "occluders 0.02 and 0.2 above the floor and a fin that stands on it: a shadow epsilon of 0.1, peter-panning",
    ),
    (
        geometry::near_light,
        "leaves at 94 % and 97.5 % of the way from the floor to the light, their shadows on diffuse and Phong surfaces: a shadow ray that ends too early",
    ),
    (
        geometry::both_shadows,
        "shadows that fall on a diffuse floor, a Phong floor and a Phong sphere, all within one frustum of 30 degrees: a shadow map that one of the two shaders does not look up",
    ),
    (
        materials::speckled,
        "map_Kd and map_Ks whose largest values sum to more than 1, whose averages to less, in one channel alone: `scale` from the average, at the point or by channel",
    ),
    (
        materials::mirror,
        "two mirrors (`illum 5`) beside diffuse and Phong spheres: black offline, a plain diffuse Kd in realtime",
    ),
    (
        geometry::rows,
        "vertical stripes, the same in every row but for the noise of their edges: one seed for all rows, a sampler shared by threads",
    ),
];

/// Every probe scene.
pub fn all() -> Vec<Scene> {
    PROBES.iter().map(|(scene, _)| scene()).collect()
}

/// The table of the probes.
pub fn readme() -> File {
    let mut text = String::from(
        "# Probe scenes\n\nMade by `xtask scenes`. Each shows faults that the four scenes of the assignment hide. One point light each, offline at 16 spp (`open`: 1) and realtime;\n\
         `both_shadows` with shadows in realtime as well.\n\n\
         | scene | film | light at | what it shows |\n|---|---|---|---|\n",
    );
    for (scene, shows) in PROBES {
        let scene = scene();
        let light = scene.light().map(|x| (x * 1000.0).round() / 1000.0);
        let [width, height] = scene.film;
        text += &format!(
            "| `{}` | {width}x{height} | {}, {}, {} | {shows} |\n",
            scene.name, light.x, light.y, light.z
        );
    }
    File { path: "probes/README.md".to_string(), bytes: text.into_bytes() }
}

/// An empty probe scene.
fn probe(name: &'static str, eye: DVec3, at: DVec3, fov_deg: f64) -> Scene {
    Scene::new(&format!("probes/{name}"), name, Camera { eye, at, fov_deg }, FILM)
}

/// Several meshes as one.
fn joined(meshes: impl IntoIterator<Item = Mesh>) -> Mesh {
    meshes.into_iter().fold(Mesh::default(), Mesh::join)
}
