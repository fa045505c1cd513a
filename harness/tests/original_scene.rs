//! A scene folder in the manner of the original course, dropped anywhere: `umbra render` must draw it, offline and
//! realtime. Its files are as modelers and hands left them there. They have CRLF line ends, groups, faces counted from
//! the end, a triangle without area, materials without `Ks` or `Ns`, `illum` 5 and 8, unknown keys, and a light 2e-6
//! wide.

use std::path::{Path, PathBuf};
use std::process::Command;

use basecode::Image;
use basecode::exr_io::read_exr;

const LIGHT: [f64; 3] = [1.0, 2.0, 0.0];
const INTENSITY: [f64; 3] = [30.0, 24.0, 12.0];
const FLOOR: [f64; 3] = [0.5, 0.6, 0.7];
const MIXTURE: [f64; 3] = [0.3, 0.6, 0.9];
const MIRROR: [f64; 3] = [0.8, 0.4, 0.2];
/// Side of the film in pixels; the camera looks straight down from y = 5 with a field of 60 degrees.
const SIDE: usize = 96;

/// Horizontal squares: material, height, range of x, range of z.
const SQUARES: [(&str, f64, [f64; 2], [f64; 2]); 4] = [
    ("floor", 0.0, [-4.0, 4.0], [-4.0, 4.0]),
    ("floor", 1.0, [-0.6, -0.2], [-0.2, 0.2]),
    ("mirror", 0.2, [1.4, 2.0], [1.4, 2.0]),
    ("mixture", 0.2, [-2.0, -1.4], [1.4, 2.0]),
];

fn obj() -> String {
    let mut text = "# Exported\nmtllib ./strange.mtl\n\n".to_owned();
    for (index, (material, y, [x0, x1], [z0, z1])) in SQUARES.iter().enumerate() {
        text += &format!("g square_{index}\nusemtl {material}\ns off\n");
        for (x, z) in [(x0, z1), (x1, z1), (x1, z0), (x0, z0)] {
            text += &format!("v {x:.6} {y:.6} {z:.6}\n");
        }
        text += "f -4 -3 -2 -1\nf -4 -3 -3\n";
    }
    text += "o light\nusemtl light\n";
    for (x, z) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        text +=
            &format!("v {:.7} {:.7} {:.7}\n", LIGHT[0] + 1e-6 * x, LIGHT[1], LIGHT[2] + 1e-6 * z);
    }
    (text + "vn 0.0000 -1.0000 0.0000\nf -4//1 -3//1 -2//1 -1//1\n").replace('\n', "\r\n")
}

fn mtl() -> String {
    let color = |key: &str, [r, g, b]: [f64; 3]| format!("{key} {r} {g} {b}\n");
    let (floor, mirror, mixture) = (color("Kd", FLOOR), color("Kd", MIRROR), color("Kd", MIXTURE));
    let light = color("Ke", INTENSITY);
    format!(
        "# Exported\nnewmtl floor\nKa 1 1 1\n{floor}Ni 1.000000\nd 1.0\nTr 0.0\nTf 1 1 1\nillum 7\n\n\
         newmtl mirror\n{mirror}Ks 1 1 1\nillum 5\nnewmtl mixture\n{mixture}illum 8\n\
         newmtl light\nKd 0 0 0\n{light}illum 7\n"
    )
    .replace('\n', "\r\n")
}

fn toml(realtime: bool, bonus: bool) -> String {
    format!(
        "[input]\r\nobjfile = \"../mesh/strange.obj\"\r\n[camera]\r\neye = [0, 5, 0]\r\nat = [0.0, 0.0, 0.0]\r\n\
         up = [0.0, 0.0, -1.0]\r\nfov = 60\r\n[film]\r\nwidth = {SIDE}\r\nheight = {SIDE}\r\ngamma = 2.2\r\n\
         [renderer]\r\nrealtime = {realtime}\r\nbonus = {bonus}\r\ntype = \"{}\"\r\nspp = 1\r\naov = true\r\n",
        if realtime { "direct" } else { "simple" }
    )
}

/// Writes the folder and draws one of its scenes.
fn render(folder: &Path, name: &str, toml: &str) -> Image {
    for inside in ["tinyrender", "mesh"] {
        std::fs::create_dir_all(folder.join(inside)).unwrap();
    }
    let scene = folder.join(format!("tinyrender/{name}.toml"));
    std::fs::write(&scene, toml).unwrap();
    std::fs::write(folder.join("mesh/strange.obj"), obj()).unwrap();
    std::fs::write(folder.join("mesh/strange.mtl"), mtl()).unwrap();
    let output = folder.join(format!("{name}.exr"));
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_umbra"))
        .args(["render", "--plugin", "reference", "--adapter", "software", "--root"])
        .args([root, Path::new("--output"), &output, &scene])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{said}");
    for key in ["film.gamma", "renderer.aov"] {
        assert!(said.contains(&format!(": unknown key {key}\n")), "{said}");
    }
    read_exr(&output).unwrap()
}

/// A new folder, removed in the end.
fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("strange");
    (folder, path)
}

/// The radiance of a Lambertian square at (x, y, z) that the light reaches, W sr^-1 m^-2.
fn lit(albedo: [f64; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    let to_light = [LIGHT[0] - x, LIGHT[1] - y, LIGHT[2] - z];
    let r2: f64 = to_light.iter().map(|d| d * d).sum();
    let cos = to_light[1] / r2.sqrt();
    std::array::from_fn(|c| INTENSITY[c] / r2 * albedo[c] / std::f64::consts::PI * cos)
}

/// The pixel that shows the point (x, y, z), and the point on the same square at that pixel's center.
fn pixel([x, y, z]: [f64; 3]) -> ((usize, usize), [f64; 3]) {
    let half = (5.0 - y) * 30f64.to_radians().tan();
    let scale = SIDE as f64 / 2.0 / half;
    let index = |v: f64| (v * scale + SIDE as f64 / 2.0).floor();
    let center = |v: f64| (index(v) + 0.5 - SIDE as f64 / 2.0) / scale;
    ((index(x) as usize, index(z) as usize), [center(x), y, center(z)])
}

#[track_caller]
fn assert_shows(image: &Image, at: [f64; 3], radiance: impl Fn([f64; 3]) -> [f64; 3]) {
    let ((column, row), point) = pixel(at);
    let found = image.pixels[row * image.width + column].to_array();
    let expected = radiance(point);
    for (found, expected) in found.map(f64::from).into_iter().zip(expected) {
        let error = (found - expected).abs();
        assert!(error <= 2e-3 * expected, "{at:?}: {found} where {expected} is right");
    }
}

#[test]
fn a_scene_of_the_original_course_renders_offline() {
    let (_keep, folder) = folder();
    let image = render(&folder, "strange_offline", &toml(false, false));
    assert_eq!((image.width, image.height), (SIDE, SIDE));
    for at in [[0.5, 0.0, -1.5], [-2.5, 0.0, -2.5], [1.0, 0.0, 0.9]] {
        assert_shows(&image, at, |p| lit(FLOOR, p));
    }
    assert_shows(&image, [-0.4, 1.0, 0.0], |p| lit(FLOOR, p));
    assert_shows(&image, [-1.7, 0.2, 1.7], |p| lit(MIXTURE, p));
    // Behind the small square the floor lies in shadow; a mirror has no BSDF.
    assert_shows(&image, [-1.8, 0.0, 0.0], |_| [0.0; 3]);
    assert_shows(&image, [1.7, 0.2, 1.7], |_| [0.0; 3]);
}

#[test]
fn a_scene_of_the_original_course_renders_realtime_with_and_without_shadows() {
    let (_keep, folder) = folder();
    for (name, bonus) in [("strange_realtime", false), ("strange_realtime_bonus", true)] {
        let image = render(&folder, name, &toml(true, bonus));
        assert_shows(&image, [0.5, 0.0, -1.5], |p| lit(FLOOR, p));
        assert_shows(&image, [-1.7, 0.2, 1.7], |p| lit(MIXTURE, p));
        assert_shows(&image, [1.7, 0.2, 1.7], |p| lit(MIRROR, p));
        let under = [-1.8, 0.0, 0.0];
        assert_shows(&image, under, |p| if bonus { [0.0; 3] } else { lit(FLOOR, p) });
    }
}
