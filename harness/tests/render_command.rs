//! `umbra render` on scenes as exporters, hands and other programs leave them: the right picture, or
//! an error that names the user's own file and line. Means were made with independent readers.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use basecode::Image;
use basecode::exr_io::read_exr;

/// A floor of 4x4 units, a lamp 2 units above it, and vertices of one more triangle.
const VERTICES: &str =
    "v -2 0 2\nv 2 0 2\nv 2 0 -2\nv -2 0 -2\nv -0.1 2 -0.1\nv 0.1 2 -0.1\nv 0 2 0.1\n";
const LAMP: &str = "usemtl light\nf 5 6 7\n";
const MTL: &str =
    "newmtl floor\nillum 7\nKd 0.5 0.4 0.3\nnewmtl light\nillum 7\nKd 0 0 0\nKe 20 20 20\n";
const TEXTURED: &str =
    "newmtl floor\nillum 7\nKd 1 1 1\nmap_Kd t.png\nnewmtl light\nillum 7\nKd 0 0 0\nKe 20 20 20\n";
const TOML: &str = "[input]\nobjfile = \"s.obj\"\n[camera]\neye = [0.0, 3.0, 4.0]\nat = [0.0, 0.0, 0.0]\n\
                    up = [0.0, 1.0, 0.0]\nfov = 50.0\n[film]\nwidth = 64\nheight = 48\n[renderer]\nspp = 4\n";

/// The mesh whose floor is these faces.
fn mesh(floor: &str) -> String {
    format!("mtllib m.mtl\n{VERTICES}usemtl floor\n{floor}{LAMP}")
}

fn plain() -> String {
    mesh("f 1 2 3\nf 1 3 4\n")
}

/// A scene folder of its own, removed in the end.
struct Scene(tempfile::TempDir);

impl Scene {
    fn new(obj: &str, mtl: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("s.toml"), TOML).unwrap();
        fs::write(folder.path().join("s.obj"), obj).unwrap();
        fs::write(folder.path().join("m.mtl"), mtl).unwrap();
        fs::write(folder.path().join("t.png"), include_bytes!("golden/noise.png")).unwrap();
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Runs `umbra render` in the scene's folder: exit code and standard error.
    fn run(&self, arguments: &[&str]) -> (i32, String) {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let run = Command::new(env!("CARGO_BIN_EXE_umbra"))
            .current_dir(self.0.path())
            .args(["render", "--plugin", "reference", "--adapter", "software", "--root"])
            .arg(root)
            .args(arguments)
            .output()
            .unwrap();
        (run.status.code().unwrap(), String::from_utf8_lossy(&run.stderr).into_owned())
    }

    fn image(&self) -> Image {
        let (code, said) = self.run(&["s.toml", "--output", "o.exr"]);
        assert_eq!(code, 0, "{said}");
        read_exr(self.path("o.exr")).unwrap()
    }

    /// What is said of a scene that cannot be rendered.
    fn error(&self) -> String {
        let (code, said) = self.run(&["s.toml", "--output", "o.exr"]);
        assert_eq!(code, 2, "{said}");
        for foreign in ["/scene/", "Some(", "Failed("] {
            assert!(!said.contains(foreign), "{said}");
        }
        said
    }
}

fn mean(image: &Image) -> f64 {
    let sum: f64 = image.pixels.iter().map(|p| f64::from(p.element_sum())).sum();
    sum / (3 * image.pixels.len()) as f64
}

#[track_caller]
fn assert_mean(image: &Image, right: f64) {
    let found = mean(image);
    assert!((found - right).abs() < 1.5e-5, "mean {found}, right is {right}");
}

/// Pixels that differ by more than a thousandth of the brightest value.
fn differing(a: &Image, b: &Image) -> usize {
    let brightest = b.pixels.iter().fold(0.0f32, |max, p| max.max(p.max_element()));
    let differ = |(a, b): (&basecode::Vec3, &basecode::Vec3)| {
        (*a - *b).abs().max_element() > 1e-3 * brightest
    };
    a.pixels.iter().zip(&b.pixels).filter(|pair| differ(*pair)).count()
}

#[test]
fn lines_and_points_are_not_drawn() {
    let right = Scene::new(&plain(), MTL).image();
    assert_mean(&right, 0.12981);
    let strokes = "v -1 0.5 0\nv 1 0.5 0\nv 1 1.5 0\n";
    for more in ["l 8 9 10\n", "l 8 9\nl 8 9 10 8 9\n", "p 8 9 10\n", "f 8 9\n"] {
        let scene = Scene::new(&plain().replace(LAMP, &format!("{strokes}{more}{LAMP}")), MTL);
        assert_eq!(scene.image().pixels, right.pixels, "{more}");
        let (_, said) = scene.run(&["s.toml", "--output", "o.exr"]);
        assert!(said.contains("warning: s.obj:15: ") && said.contains("no area"), "{said}");
    }
}

#[test]
fn concave_polygons_cover_what_they_enclose() {
    let arrow = |floor: &str| {
        mesh(floor).replace("v 2 0 2\nv 2 0 -2\nv -2 0 -2", "v 0 0 -1.6\nv 2 0 2\nv 0 0 -2")
    };
    let right = Scene::new(&arrow("f 2 3 4\nf 2 4 1\n"), MTL).image();
    assert_mean(&right, 0.00508);
    for outline in ["f 1 2 3 4\n", "f 2 3 4 1\n", "f 3 4 1 2\n", "f 4 1 2 3\n"] {
        assert_eq!(differing(&Scene::new(&arrow(outline), MTL).image(), &right), 0, "{outline}");
    }
}

#[test]
fn a_face_without_texture_coordinates_or_normals_concerns_itself_alone() {
    let uvs = "v 5 0 5\nv 6 0 5\nv 6 0 4\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    let textured = |more: &str| mesh(&format!("{uvs}f 1/1 2/2/ 3/3\nf 1/1 3/3 4/4\n{more}"));
    let right = Scene::new(&textured(""), TEXTURED).image();
    assert_mean(&right, 0.09578);
    assert_eq!(Scene::new(&textured("f 8 9 10\n"), TEXTURED).image().pixels, right.pixels);

    // The floor's normal leans; one face outside the picture has none.
    let lean = |more: &str| {
        mesh(&format!("{uvs}vn 0 0.8 0.6\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n{more}"))
    };
    let right = Scene::new(&lean(""), MTL).image();
    assert!(differing(&right, &Scene::new(&plain(), MTL).image()) > 1000);
    assert_eq!(Scene::new(&lean("f 8 9 10\n"), MTL).image().pixels, right.pixels);
}

#[test]
fn options_of_maps_are_applied_or_refused() {
    let uvs = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    let obj = mesh(&format!("{uvs}f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"));
    let with = |statement: &str| Scene::new(&obj, &TEXTURED.replace("map_Kd t.png", statement));
    let right = with("map_Kd -s 2 2 2 t.png").image();
    assert_mean(&right, 0.09740);
    // The same by texture coordinates.
    let twice = Scene::new(&obj.replace("vt 1 ", "vt 2 ").replace(" 1\n", " 2\n"), TEXTURED);
    assert!(differing(&twice.image(), &right) <= 3, "texel borders alone may round differently");
    let once = with("map_Kd t.png").image();
    for same in
        ["-s 1 1 t.png", "-s 1 t.png", "-o 0 0 0 -mm 0 1 t.png", "\"t.png\"", "t.png # tiles"]
    {
        assert_eq!(with(&format!("map_Kd {same}")).image().pixels, once.pixels, "{same}");
    }
    assert!(differing(&with("map_Kd -o 0.5 0.5 t.png").image(), &once) > 500);
    let spaces = with("map_Kd -s 2 2 my tiles.png");
    fs::rename(spaces.path("t.png"), spaces.path("my tiles.png")).unwrap();
    assert_eq!(spaces.image().pixels, right.pixels);
    for (statement, expected) in [
        (
            "map_Kd -mm 0.2 0.8 t.png",
            "m.mtl:4: material \"floor\": map_Kd: the option -mm is not supported",
        ),
        (
            "map_Kd -bm 2 t.png",
            "m.mtl:4: material \"floor\": map_Kd: the option -bm is not supported",
        ),
        (
            "map_Kd none.png",
            "m.mtl:4: material \"floor\": map_Kd: cannot read the texture none.png",
        ),
        ("Kd -1 0 0", "m.mtl:4: material \"floor\": Kd is"),
        ("Ks 0 nan 0", "m.mtl:4: material \"floor\": Ks is"),
        ("Ns -5", "m.mtl:4: material \"floor\": Ns is"),
        ("Ke 0 0 -1", "m.mtl:4: material \"floor\": Ke is"),
    ] {
        let said = with(statement).error();
        assert!(said.starts_with(&format!("umbra: {expected}")), "{said}");
    }
}

#[test]
fn errors_name_the_user_s_own_file_and_line() {
    let flor = plain().replace("usemtl floor", "usemtl flor");
    for (obj, expected) in [
        (flor.clone(), "s.obj:9: material \"flor\" is not in m.mtl (it has: floor, light)"),
        (plain().replace("m.mtl", "n.mtl"), "s.obj:1: cannot read the material file n.mtl"),
        (plain().replace("f 1 3 4", "f 1 3 40"), "s.obj:11: f uses v number 40, the file has 7"),
        (
            plain().replace("v 2 0 2", "v 2 zero 2"),
            "s.obj:3: v has \"zero\" where a number is expected",
        ),
    ] {
        let said = Scene::new(&obj, MTL).error();
        assert!(said.starts_with(&format!("umbra: {expected}")), "{said}");
    }
    // As it was given: absolute, or through another folder.
    let scene = Scene::new(&flor, MTL);
    let absolute = scene.path("s.toml");
    let (_, said) = scene.run(&[absolute.to_str().unwrap(), "--output", "o.exr"]);
    assert!(said.starts_with(&format!("umbra: {}:9: ", scene.path("s.obj").display())), "{said}");
    let (_, said) = scene.run(&["./s.toml", "--output", "o.exr"]);
    assert!(said.starts_with("umbra: ./s.obj:9: "), "{said}");
    fs::write(scene.path("s.toml"), TOML.replace("fov = 50.0", "fov = 0")).unwrap();
    assert!(scene.error().starts_with("umbra: s.toml:7: camera.fov is 0"));
    fs::write(scene.path("s.toml"), TOML.replace("eye = [0.0, 3.0, 4.0]", "eye = [0, 0, 0]"))
        .unwrap();
    assert!(scene.error().starts_with("umbra: s.toml:4: camera eye"));
    fs::write(scene.path("s.toml"), TOML.replace("up = [0.0, 1.0", "up = [0.0, 3.0, 4.0] #"))
        .unwrap();
    assert!(scene.error().starts_with("umbra: s.toml:4: camera eye"));
    for (mesh, expected) in [
        ("gone.obj", "No such file or directory\n"),
        ("S.OBJ", "there is s.obj: upper and lower case count\n"),
        ("Meshes/s.obj", "there is meshes: upper and lower case count\n"),
    ] {
        fs::create_dir_all(scene.path("meshes")).unwrap();
        fs::write(scene.path("s.toml"), TOML.replace("s.obj", mesh)).unwrap();
        let said = scene.error();
        let start = format!("umbra: s.toml:2: cannot read the mesh {mesh}: ");
        assert!(said.starts_with(&start) && said.ends_with(expected), "{said}");
    }
    fs::write(scene.path("s.toml"), TOML.replace("spp = 4", "ssp = 4")).unwrap();
    assert!(scene.error().starts_with("umbra: warning: s.toml:12: unknown key renderer.ssp\n"));
    let (_, said) = scene.run(&["s.obj", "--output", "o.exr"]);
    assert!(said.starts_with("umbra: s.obj:1: expected a scene's TOML file: "), "{said}");
    // What the renderer would not see.
    let outside = Scene::new(&plain(), &TEXTURED.replace("t.png", "../mesh/t.png"));
    fs::create_dir(outside.path("mesh")).unwrap();
    fs::rename(outside.path("t.png"), outside.path("mesh/t.png")).unwrap();
    fs::create_dir(outside.path("obj")).unwrap();
    for file in ["s.obj", "m.mtl"] {
        fs::rename(outside.path(file), outside.path("obj").join(file)).unwrap();
    }
    fs::write(outside.path("s.toml"), TOML.replace("s.obj", "obj/s.obj")).unwrap();
    let said = outside.error();
    assert!(
        said.starts_with("umbra: obj/m.mtl:4: obj/../mesh/t.png: a renderer sees only the folder"),
        "{said}"
    );
    let kind = TOML.replace("spp = 4", "type = \"glass\"");
    let scene = Scene::new(&plain(), MTL);
    fs::write(scene.path("s.toml"), kind).unwrap();
    let said = scene.error();
    assert!(
        said.starts_with("umbra: s.toml:") && said.contains("renderer.type is \"glass\""),
        "{said}"
    );
}

#[test]
fn forms_that_exporters_write_are_read() {
    let right = Scene::new(&plain(), MTL).image();
    let latin1 = [b"# gr\xfcn\n", plain().as_bytes()].concat();
    for (name, obj) in [
        ("bom", format!("\u{feff}{}", plain()).into_bytes()),
        ("comment", plain().replace("v 2 0 2\n", "v 2 0 2 # corner\n").into_bytes()),
        ("indent", plain().replace('\n', "\n  ").into_bytes()),
        ("tab", plain().replace("mtllib ", "mtllib\t").into_bytes()),
        ("latin1", latin1),
        ("cr", plain().replace('\n', "\r").into_bytes()),
        ("colours", plain().replace("v 2 0 2\n", "v 2 0 2 1 0 0\n").into_bytes()),
    ] {
        let scene = Scene::new("", MTL);
        fs::write(scene.path("s.obj"), obj).unwrap();
        assert_eq!(scene.image().pixels, right.pixels, "{name}");
    }
}

#[test]
fn places_on_another_machine_are_looked_for_beside_the_file() {
    let right = Scene::new(&plain(), MTL).image();
    let scene = Scene::new("", MTL);
    let here = scene.path("m.mtl").display().to_string();
    for place in ["C:\\Users\\ada\\m.mtl", "/home/ada/a2/m.mtl", "\\\\server\\a2\\m.mtl", &here] {
        fs::write(scene.path("s.obj"), plain().replace("m.mtl", place)).unwrap();
        assert_eq!(scene.image().pixels, right.pixels, "{place}");
        let (_, said) = scene.run(&["s.toml", "--output", "o.exr"]);
        assert!(said.contains(&format!("s.obj:1: {place} is absolute; taken is m.mtl")), "{said}");
    }
    let uvs = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    let obj = mesh(&format!("{uvs}f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"));
    let right = Scene::new(&obj, TEXTURED).image();
    let with = |place: &str| Scene::new(&obj, &TEXTURED.replace("t.png", place));
    assert_eq!(with("-s 1 1 D:/a/t.png").image().pixels, right.pixels);
    for (statement, expected) in [
        ("/home/ada/gone.png", "; /home/ada/gone.png is absolute, so it was looked for here"),
        ("T.PNG", "; there is t.png: upper and lower case count"),
        ("t.png -s 2 2", "-s 2 2 stands behind the file, expected options before it"),
        (
            "m.mtl",
            "cannot decode the texture m.mtl: expected PNG, JPEG, TGA or BMP, found something else",
        ),
    ] {
        let said = with(statement).error();
        assert!(said.trim_end().ends_with(expected), "{said}");
    }
}

#[test]
fn what_is_no_mesh_is_told_from_one_without_faces() {
    for (obj, expected) in [
        (
            "<!doctype html>\n",
            "it has no vertex (v) and no face (f), and begins as a web page does: is it an OBJ file?",
        ),
        ("solid cube\n", "begins with \"solid cube\""),
        ("\u{1f}\u{8b}\u{8}", "begins with \"???\""),
        (
            "v 0 0 0\nv 0 0 1\n",
            "s.obj: mesh holds no triangle: it has 2 vertices (v) and no face (f)",
        ),
    ] {
        let said = Scene::new(obj, MTL).error();
        assert!(said.contains(expected), "{said}");
    }
    let right = Scene::new(&plain(), MTL).image();
    let upper = plain().replace("v ", "V ").replace("f ", "F ").replace("usemtl ", "USEMTL ");
    assert_eq!(Scene::new(&upper, MTL).image().pixels, right.pixels);
    let glowing = MTL.replacen("Kd ", "Ke 1 1 1\nKd ", 1);
    let (_, said) = Scene::new(&plain(), &glowing).run(&["s.toml", "--output", "o.exr"]);
    assert!(said.contains("s.obj: 2 shapes emit light; the light is the first"), "{said}");
    let clear = MTL.replacen("Kd ", "d -halo 0.5\nTr 0\nKd ", 1);
    let (_, said) = Scene::new(&plain(), &clear).run(&["s.toml", "--output", "o.exr"]);
    assert!(said.contains("m.mtl:3: d is ignored") && !said.contains("Tr is"), "{said}");
}

#[test]
fn slips_in_a_scene_file_are_told_in_plain_words() {
    let right = Scene::new(&plain(), MTL);
    let folder = right.path("").file_name().unwrap().to_string_lossy().into_owned();
    let expected = right.image();
    fs::write(right.path("s.toml"), TOML.replace("s.obj", &format!("../{folder}/s.obj"))).unwrap();
    assert_eq!(
        right.image().pixels,
        expected.pixels,
        "a way that leaves the folder and comes back"
    );
    for (from, to, expected) in [
        (
            "[0.0, 3.0, 4.0]",
            "[0, 3, 4, 1]",
            "s.toml:4: camera.eye has 4 numbers, expected 3: [x, y, z]",
        ),
        (
            "[0.0, 3.0, 4.0]",
            "[0, 3]",
            "s.toml:4: eye: invalid length 2, expected 3 numbers: [x, y, z]",
        ),
        (
            "spp = 4",
            "spp = 99999999999999999999",
            "s.toml:12: spp: out of range: integer `99999999999999999999`, expected a whole",
        ),
        (
            "s.obj",
            "C:/scenes/s.obj",
            "s.toml:2: input.objfile is C:/scenes/s.obj but must be relative",
        ),
    ] {
        let scene = Scene::new(&plain(), MTL);
        fs::write(scene.path("s.toml"), TOML.replacen(from, to, 1)).unwrap();
        let said = scene.error();
        assert!(said.contains(expected), "{said}");
    }
    let (code, said) =
        Scene::new(&plain(), MTL).run(&["s.toml", "--output", "o.exr", "--spp", "0"]);
    assert!(code == 2 && said.contains("0 is not in 1..="), "{said}");
    for (size, expected) in [
        ("16384x4097", "expected at most 67108864 pixels, found 67125248"),
        ("16385x1", "expected at most 16384 pixels a side, found 16385"),
        ("1x5000000000", "expected at most 16384 pixels a side, found 5000000000"),
        ("0x1", "expected WIDTHxHEIGHT such as 640x480, found 0x1"),
        ("640", "expected WIDTHxHEIGHT such as 640x480, found 640"),
    ] {
        let (code, said) =
            Scene::new(&plain(), MTL).run(&["s.toml", "--output", "o.exr", "--size", size]);
        assert!(code == 2 && said.contains(expected), "{said}");
    }
}

/// The scene `scale` times as large, its light as bright.
fn scaled(obj: &str, scale: f64) -> Scene {
    let resized = obj.lines().map(|line| match line.strip_prefix("v ") {
        Some(numbers) => {
            let numbers = numbers.split(' ').map(|n| scale * n.parse::<f64>().unwrap());
            format!("v {}\n", numbers.map(|n| n.to_string()).collect::<Vec<_>>().join(" "))
        }
        None => format!("{line}\n"),
    });
    let intensity = 20.0 * scale * scale;
    let light = format!("Ke {intensity} {intensity} {intensity}");
    let scene = Scene::new(&resized.collect::<String>(), &MTL.replace("Ke 20 20 20", &light));
    let eye = format!("eye = [0.0, {}, {}]", 3.0 * scale, 4.0 * scale);
    fs::write(scene.path("s.toml"), TOML.replace("eye = [0.0, 3.0, 4.0]", &eye)).unwrap();
    scene
}

/// Above the floor: a table very close to it, a wall that stands on it, a roof of facets with soft
/// normals.
fn occluders() -> String {
    let vertices = "v -1 0.004 0\nv -0.2 0.004 0\nv -0.6 0.004 -0.8\n\
                    v 0.3 0 0\nv 1.2 0 -0.3\nv 1.2 0.7 -0.3\nv 0.3 0.7 0\n\
                    v 0 0.5 1\nv 0.6 0.3 1.2\nv -0.6 0.3 1.2\nv 0 0.3 0.4\n\
                    vn 0 1 0\nvn 0.6 0.8 0\nvn -0.6 0.8 0\nvn 0 0.8 -0.6\n";
    let faces = "f 8 9 10\nf 11 12 13 14\nf 15//1 16//2 18//4\nf 15//1 18//4 17//3\n";
    plain().replace(LAMP, &format!("{vertices}{faces}{LAMP}"))
}

const SCALES: [f64; 7] = [1e-3, 1e-2, 0.1, 30.0, 1e2, 3e3, 1e4];

#[test]
fn a_scene_of_any_size_gives_the_same_picture() {
    for (obj, right) in [(plain(), Some(0.12981)), (occluders(), None)] {
        let expected = scaled(&obj, 1.0).image();
        right.into_iter().for_each(|right| assert_mean(&expected, right));
        for scale in SCALES {
            let image = scaled(&obj, scale).image();
            let (wrong, mean) = (differing(&image, &expected), mean(&image));
            assert!(wrong <= 3, "{scale} times as large: {wrong} pixels differ, mean {mean}");
        }
    }
}

#[test]
fn the_grader_sees_the_same_lit_and_shadowed_points_at_any_size() {
    let sights = |scale: f64| {
        let scene =
            umbra::expected::load_scene(&scaled(&occluders(), scale).path("s.toml")).unwrap();
        let buffer = umbra::expected::SurfaceBuffer::new(&scene, 64, 48).unwrap();
        let sight =
            |(_, point): &(_, Option<umbra::expected::SurfacePoint>)| point.map(|p| p.visibility);
        buffer.pixels.iter().map(sight).collect::<Vec<_>>()
    };
    let expected = sights(1.0);
    for sight in [umbra::expected::Visibility::Clear, umbra::expected::Visibility::Blocked] {
        assert!(expected.iter().filter(|found| **found == Some(sight)).count() > 50, "{sight:?}");
    }
    for scale in SCALES {
        let wrong = sights(scale).iter().zip(&expected).filter(|(a, b)| a != b).count();
        assert!(wrong <= 3, "{scale} times as large: {wrong} points are seen otherwise");
    }
}

#[test]
fn a_scene_without_a_light_renders_with_normal_and_says_what_lacks() {
    let dark = MTL.replace("Ke 20 20 20", "Ke 0 0 0");
    let scene = Scene::new(&plain(), &dark);
    let said = scene.error();
    assert!(said.contains("the scene has no light: no shape of s.obj has"), "{said}");
    let direct = TOML.replace("spp = 4", "realtime = true");
    fs::write(scene.path("s.toml"), &direct).unwrap();
    let said = scene.error();
    assert!(said.contains("the scene has no light: no shape of s.obj has"), "{said}");
    for renderer in ["type = \"normal\"\nspp = 1", "type = \"normal\"\nrealtime = true"] {
        fs::write(scene.path("s.toml"), TOML.replace("spp = 4", renderer)).unwrap();
        let middle = scene.image().pixels[24 * 64 + 32];
        assert!((middle - basecode::vec3(0.0, 1.0, 0.0)).length() < 1e-3, "{renderer}: {middle}");
    }
}

#[test]
fn an_image_is_written_as_its_name_says_or_refused() {
    let scene = Scene::new(&plain(), MTL);
    let image = scene.image();
    let (code, said) = scene.run(&["s.toml", "--output", "o.PNG"]);
    assert!(code == 0 && said.contains("o.PNG: 8-bit sRGB, linear values clamped"), "{said}");
    let picture = image::open(scene.path("o.PNG")).unwrap().into_rgb8();
    assert_eq!(picture.dimensions(), (64, 48));
    let level = |value: f32| {
        let value = value.clamp(0.0, 1.0);
        let encoded = if value <= 0.003_130_8 {
            12.92 * value
        } else {
            1.055 * value.powf(1.0 / 2.4) - 0.055
        };
        (255.0 * encoded).round() as i32
    };
    for (pixel, shown) in image.pixels.iter().zip(picture.pixels()) {
        for c in 0..3 {
            assert!((level(pixel[c]) - i32::from(shown.0[c])).abs() <= 1);
        }
    }
    for (output, expected) in [
        ("o.jpg", "umbra: o.jpg: the name of an image ends in .exr or .png"),
        ("o", "umbra: o: the name of an image ends in .exr or .png"),
        ("none/o.exr", "umbra: none/o.exr: there is no folder none"),
    ] {
        let (code, said) = scene.run(&["s.toml", "--output", output]);
        assert!(code == 2 && said.starts_with(expected), "{said}");
        assert!(!scene.path(output).exists());
    }
}

#[cfg(unix)]
#[test]
fn a_folder_whose_name_is_not_utf_8_holds_scenes_like_any_other() {
    use std::os::unix::ffi::OsStrExt;
    let right = Scene::new(&plain(), MTL).image();
    let scene = Scene::new(&plain(), MTL);
    let folder = scene.path("").join(std::ffi::OsStr::from_bytes(b"d\xff"));
    fs::create_dir(&folder).unwrap();
    for file in ["s.toml", "s.obj", "m.mtl"] {
        fs::rename(scene.path(file), folder.join(file)).unwrap();
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let output = scene.path("o.exr");
    let run = Command::new(env!("CARGO_BIN_EXE_umbra"))
        .args(["render", "--plugin", "reference", "--root"])
        .args([root, &folder.join("s.toml"), Path::new("--output"), &output])
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    assert_eq!(read_exr(output).unwrap().pixels, right.pixels);
}

#[cfg(unix)]
#[test]
fn a_link_to_a_scene_is_the_scene_and_a_link_out_of_it_is_named() {
    use std::os::unix::fs::symlink;
    let right = Scene::new(&plain(), MTL).image();
    let scene = Scene::new(&plain(), MTL);
    fs::create_dir(scene.path("link")).unwrap();
    symlink("../s.toml", scene.path("link/s.toml")).unwrap();
    let draw = || scene.run(&["link/s.toml", "--output", "o.exr"]);
    assert_eq!(draw().0, 0, "{}", draw().1);
    assert_eq!(read_exr(scene.path("o.exr")).unwrap().pixels, right.pixels);
    // Beside the link lies another mesh, which is not the scene's.
    fs::write(scene.path("link/s.obj"), plain()).unwrap();
    fs::write(scene.path("link/m.mtl"), MTL).unwrap();
    fs::write(scene.path("s.obj"), plain().replace("f 1 3 4", "f 1 3 40")).unwrap();
    let (code, said) = draw();
    let real = scene.path("s.obj").canonicalize().unwrap();
    let expected = format!("umbra: {}:11: f uses v number 40", real.display());
    assert!(code == 2 && said.starts_with(&expected), "{said}");

    let uvs = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    let obj = mesh(&format!("{uvs}f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"));
    let other = tempfile::tempdir().unwrap();
    for (file, place) in [("s.obj", ""), ("m.mtl", "s.obj:1: "), ("t.png", "m.mtl:4: ")] {
        let scene = Scene::new(&obj, TEXTURED);
        let target = other.path().canonicalize().unwrap().join(file);
        fs::rename(scene.path(file), &target).unwrap();
        symlink(&target, scene.path(file)).unwrap();
        let said = scene.error();
        let target = target.display();
        let expected = format!("umbra: {place}{file}: is a link to {target}; a renderer sees only");
        assert!(said.starts_with(&expected), "{said}");
    }
}

#[test]
fn a_pipe_in_the_place_of_a_file_is_refused_not_waited_for() {
    let uvs = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    let obj = mesh(&format!("{uvs}f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"));
    for (file, expected) in [
        ("s.toml", "umbra: s.toml: cannot read the scene"),
        ("s.obj", "cannot read the mesh"),
        ("m.mtl", "umbra: s.obj:1: cannot read the material file m.mtl"),
        ("t.png", "umbra: m.mtl:4: material \"floor\": map_Kd: cannot read the texture t.png"),
    ] {
        let scene = Scene::new(&obj, TEXTURED);
        fs::remove_file(scene.path(file)).unwrap();
        assert!(Command::new("mkfifo").arg(scene.path(file)).status().unwrap().success());
        let said = scene.error();
        assert!(said.contains(expected), "{said}");
        assert!(said.contains(": expected a file, found a pipe or device"), "{said}");
        fs::remove_file(scene.path(file)).unwrap();
        fs::create_dir(scene.path(file)).unwrap();
        assert!(scene.error().contains(": expected a file, found a folder"));
    }
    let scene = Scene::new(&plain(), MTL);
    assert!(Command::new("mkfifo").arg(scene.path("config.json")).status().unwrap().success());
    scene.image();
}

#[test]
fn an_output_that_cannot_be_written_is_refused_before_any_work() {
    // Work would find that there is no mesh.
    let scene = Scene::new("", MTL);
    fs::create_dir(scene.path("d.exr")).unwrap();
    fs::create_dir(scene.path("d.png")).unwrap();
    let pipe = Command::new("mkfifo").arg(scene.path("p.exr")).status().unwrap();
    assert!(pipe.success());
    for (output, expected) in [
        ("d.exr", "umbra: d.exr: expected a file, found a folder"),
        ("d.png", "umbra: d.png: expected a file, found a folder"),
        ("p.exr", "umbra: p.exr: expected a file, found a pipe or device"),
        ("/proc/x.exr", "umbra: /proc/x.exr: "),
    ] {
        let (code, said) = scene.run(&["s.toml", "--output", output]);
        assert!(code == 2 && said.starts_with(expected), "{said}");
        assert!(!said.contains("s.obj"), "{said}");
    }
    // What is there stays when there is no image, and nothing is left behind.
    fs::write(scene.path("old.exr"), "old").unwrap();
    for output in ["old.exr", "new.exr"] {
        let (_, said) = scene.run(&["s.toml", "--output", output]);
        assert!(said.contains("s.obj: mesh holds no triangle"), "{said}");
    }
    assert_eq!(fs::read(scene.path("old.exr")).unwrap(), b"old");
    assert!(!scene.path("new.exr").exists());
}

#[test]
fn a_realtime_frame_is_drawn_without_a_word_and_what_lies_out_of_range_is_said() {
    let realtime = |scale: f64| {
        let scene = scaled(&plain(), scale);
        let toml = fs::read_to_string(scene.path("s.toml")).unwrap();
        fs::write(scene.path("s.toml"), toml.replace("spp = 4", "realtime = true")).unwrap();
        scene.run(&["s.toml", "--output", "o.exr"])
    };
    assert_eq!(realtime(1.0), (0, String::new()));
    assert_eq!(realtime(0.01), (0, String::new()));
    assert_eq!(realtime(100.0), (0, String::new()));
    // All of the picture, and a part of it, at either end.
    for scale in [3000.0, 200.0, 2e-3, 1e-3] {
        let (code, said) = realtime(scale);
        let expected = "umbra: warning: s.obj: what is in view reaches from ";
        assert!(code == 0 && said.starts_with(expected), "{scale}: {said}");
    }
    // A floor that begins behind the camera is in view from where the film's edge meets it.
    let under =
        TOML.replace("spp = 4", "realtime = true").replace("0.0, 3.0, 4.0", "0.0, 0.5, 0.0");
    for (at, expected) in [
        ("0.0, 0.5, -1.0", ""),
        (
            "0.0, 9.0, -9.0",
            "umbra: warning: s.obj: nothing of it is in view\numbra: warning: o.exr: the image is black all over\n",
        ),
    ] {
        let scene = Scene::new(&plain(), MTL);
        fs::write(
            scene.path("s.toml"),
            under.replace("at = [0.0, 0.0, 0.0]", &format!("at = [{at}]")),
        )
        .unwrap();
        let found = scene.run(&["s.toml", "--output", "o.exr"]);
        assert_eq!(found, (0, expected.to_owned()), "{at}");
    }
}

#[test]
fn a_plugin_that_cannot_be_loaded_is_named_with_the_loader_s_reason() {
    let scene = Scene::new(&plain(), MTL);
    fs::write(scene.path("renderer.so"), "not a library").unwrap();
    let run = |plugin: &str| {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let run = Command::new(env!("CARGO_BIN_EXE_umbra"))
            .current_dir(scene.0.path())
            .args(["render", "s.toml", "--output", "o.exr", "--plugin", plugin, "--root"])
            .arg(root)
            .output()
            .unwrap();
        assert_eq!(run.status.code(), Some(2));
        String::from_utf8_lossy(&run.stderr).into_owned()
    };
    let said = run("renderer.so");
    assert!(said.contains("cannot load the plugin renderer.so: "), "{said}");
    assert!(!said.contains("dlopen failed") && !said.contains("/plugin/"), "{said}");
    let said = run("src");
    assert!(said.starts_with("umbra: plugin src: there is no such file"), "{said}");
    fs::create_dir(scene.path("src")).unwrap();
    let said = run("src");
    assert!(said.starts_with("umbra: plugin src: it is a folder, expected a library"), "{said}");
}
