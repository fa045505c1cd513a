//! Small scenes that show mistakes which the assignment's four scenes cannot.

mod geometry;
mod materials;

use super::exporting::ExportedFile;
use super::mesh::Mesh;
use super::scene::{Camera, Scene};
use glam::DVec3;

/// Width and height of a probe's film unless the probe needs more.
const FILM: [u32; 2] = [128, 96];

/// Samples per pixel of a probe's image unless the probe needs others: rays and BSDFs that are asked about decide,
/// the image only confirms.
const SPP: u32 = 4;

/// A probe, and what it holds and shows.
type Probe = (fn() -> Scene, &'static str);

/// Every probe in the order of the list.
const PROBES: [Probe; 14] = [
    (
        materials::scale,
        "Kd + Ks exceeds 1 in one channel or in all, beside spheres where `scale` is 1. It shows \
         a missing, inverted or misplaced `scale`, and `scale` on a diffuse material.",
    ),
    (
        materials::exponents,
        "Strips of exponent 1, 9.8, 101.5, 50 and 2, seen at grazing angles. At their far end cos \
         alpha is negative. It shows a power before the clamp, NaN, and n + 1 for n + 2.",
    ),
    (
        materials::coloured,
        "A dim, colored light on colored Kd and Ks, with no value above 1. It shows swapped \
         channels, and a light or material taken as grey. The MTL file lists the materials in another order \
         than the shapes, and one has its largest Kd and its largest Ks in different channels.",
    ),
    (
        materials::textured,
        "`map_Kd` and `map_Ks` with texture coordinates from below 0 to above 1. The textures are \
         not symmetric. It shows a constant albedo, a flipped v, and a clamp instead of \
         wrap-around.",
    ),
    (
        materials::open,
        "Bumpy diffuse and Phong strips without any occluder, all of them lit. It shows \
         unshadowed radiance alone, whatever the shadows do, and a sample that is not at the \
         pixel's center.",
    ),
    (
        geometry::behind,
        "A plate beyond the light along the shadow rays, a shelf nearer than 1 with an occluder \
         close to the light, and a floor beyond 2. It shows a missing `max_t`, and `max_t` = r^2.",
    ),
    (
        geometry::emitter,
        "A large hexagon as the emitter. Its index mean differs from the mean of its corners, \
         from its centroid and from its first corner. It shows a wrong light position, and an \
         emitter that shadows its own light.",
    ),
    (
        geometry::backfaces,
        "Surfaces that face the camera but not the light, the light but not the camera, neither, \
         or both, and an open bowl. It shows a missing test of `wo` or `wi`, and `abs` of a \
         cosine.",
    ),
    (
        geometry::contact,
        "Occluders 0.02 and 0.2 above the floor, and a fin that stands on it. It shows a shadow \
         epsilon of 0.1 and peter-panning.",
    ),
    (
        geometry::near_light,
        "Leaves at 94 % and 97.5 % of the way from the floor to the light, with shadows on \
         diffuse and Phong surfaces. It shows a shadow ray that ends too early.",
    ),
    (
        geometry::both_shadows,
        "Shadows that fall on a diffuse floor, a Phong floor and a Phong sphere. All lie within \
         one frustum of 30 degrees. It shows a shadow map that one of the two shaders does not \
         look up.",
    ),
    (
        materials::speckled,
        "The largest values of `map_Kd` and `map_Ks` sum to more than 1, their averages to less, \
         in one channel alone. It shows a `scale` from the average, at the point, or by channel.",
    ),
    (
        materials::mirror,
        "Two mirrors (`illum 5`) beside diffuse and Phong spheres. A mirror is black offline, and \
         a plain diffuse Kd in realtime.",
    ),
    (
        geometry::rows,
        "Vertical stripes, the same in every row but for the noise of their edges. It shows one \
         seed for all rows, and a sampler that threads share.",
    ),
];

/// Every probe scene.
pub fn all() -> Vec<Scene> {
    PROBES.iter().map(|(scene, _)| scene()).collect()
}

/// The list of the probes, for people.
pub fn readme() -> ExportedFile {
    let mut text = String::from(
        "# Probe scenes\n\n\
         `xtask scenes` makes these scenes and this page from `xtask/src/scenes/probes`. Each shows faults that the four\n\
         scenes of the assignment hide. Each has one point light, an offline version at 4 samples per pixel and a realtime\n\
         version. `open` has 1 sample per pixel. `both_shadows` has a realtime version with shadows as well.\n\n",
    );
    for (scene, shows) in PROBES {
        let scene = scene();
        let light = scene.light().map(|x| (x * 1000.0).round() / 1000.0);
        let [width, height] = scene.film;
        let (name, [x, y, z]) = (&scene.name, light.to_array());
        text += &item(&format!("**`{name}`** ({width}x{height}, light at {x}, {y}, {z}). {shows}"));
    }
    ExportedFile { path: "probes/README.md".to_string(), bytes: text.into_bytes() }
}

/// An item of a Markdown list, in lines of at most 120 columns.
fn item(text: &str) -> String {
    let (mut item, mut width) = (String::from("-"), 1);
    for word in text.split(' ') {
        if width + 1 + word.chars().count() > 120 {
            item += "\n ";
            width = 1;
        }
        item += " ";
        item += word;
        width += 1 + word.chars().count();
    }
    item + "\n"
}

/// An empty probe scene.
fn probe(name: &'static str, eye: DVec3, at: DVec3, fov_deg: f64) -> Scene {
    let scene = Scene::new(&format!("probes/{name}"), name, Camera { eye, at, fov_deg }, FILM);
    Scene { spp: SPP, ..scene }
}

/// Several meshes as one.
fn joined(meshes: impl IntoIterator<Item = Mesh>) -> Mesh {
    meshes.into_iter().fold(Mesh::default(), Mesh::join)
}
