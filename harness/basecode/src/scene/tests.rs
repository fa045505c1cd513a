use std::fs;
use std::path::PathBuf;

use glam::{Vec3, vec3};

use super::*;

/// A scene folder under the system's temporary one, removed in the end.
struct TestFolder(PathBuf);

impl TestFolder {
    fn new(name: &str, obj: &str, mtl: &str) -> Self {
        let path = std::env::temp_dir().join(format!("basecode-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        fs::write(path.join("s.toml"), "[input]\nobjfile = \"s.obj\"\n").unwrap();
        fs::write(path.join("s.obj"), obj).unwrap();
        fs::write(path.join("s.mtl"), mtl).unwrap();
        Self(path)
    }

    fn load(&self) -> Result<Scene> {
        Scene::load(&self.0.join("s.toml"), &|_| Box::new(Black))
    }

    fn error(&self) -> String {
        self.load().err().expect("the scene is broken").to_string()
    }
}

impl Drop for TestFolder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// A unit square in z = 0 seen from +z, and an emitting triangle whose first vertex counts twice.
const OBJ: &str = "mtllib s.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vn 0 0 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
o square
usemtl grey
f 1/1/1 2/2/1 3/3/1 4/4/1
v 0 0 4
v 3 0 4
v 0 3 4
v -3 0 4
o lamp
usemtl lamp
f 5 6 7
f 5 7 8
";
const MTL: &str = "newmtl grey
Kd 0.5 0.25 0.125
illum 7
newmtl lamp
Kd 0 0 0
Ke 10 20 30
illum 7
";

#[test]
fn a_scene_loads_with_its_light_and_is_hit_where_it_should_be() {
    let scene = TestFolder::new("good", OBJ, MTL).load().unwrap();
    assert_eq!(scene.first_light_intensity(), vec3(10.0, 20.0, 30.0));
    // Index list 5 6 7 5 7 8: vertices 5 and 7 count twice.
    assert_eq!(scene.first_light_position(), vec3(0.0, 1.0, 4.0));
    let hit = scene.intersect(&Ray::new(vec3(0.25, 0.75, 2.0), -Vec3::Z)).unwrap();
    assert_eq!((hit.t, hit.shape), (2.0, 0));
    assert!((hit.uv - glam::vec2(0.25, 0.75)).length() < 1e-6);
    assert_eq!((hit.ng, hit.frame_ns.n, hit.wo), (Vec3::Z, Vec3::Z, Vec3::Z));
    let behind = scene.intersect(&Ray::new(vec3(0.25, 0.75, -2.0), Vec3::Z)).unwrap();
    assert_eq!(Frame::cos_theta(behind.wo), -1.0, "back faces are hit and looked at from behind");
}

#[test]
fn a_ray_respects_both_ends_and_emitters_never_block() {
    let scene = TestFolder::new("ends", OBJ, MTL).load().unwrap();
    let origin = vec3(0.5, 0.5, 2.0);
    let segment = |min_t, max_t| Ray::segment(origin, -Vec3::Z, min_t, max_t);
    assert!(scene.occluded(&segment(0.0, 2.5)) && scene.intersect(&segment(0.0, 2.5)).is_some());
    assert!(!scene.occluded(&segment(0.0, 1.5)) && scene.intersect(&segment(0.0, 1.5)).is_none());
    assert!(!scene.occluded(&segment(2.5, 9.0)) && scene.intersect(&segment(2.5, 9.0)).is_none());
    let up = Ray::new(origin, Vec3::Z);
    assert_eq!(scene.intersect(&up).map(|hit| hit.shape), Some(1));
    assert!(!scene.occluded(&up));
}

#[test]
fn mistakes_in_mesh_and_materials_name_file_and_line() {
    for (name, obj, mtl, expected) in [
        ("nan", OBJ.replace("v 1 1 0", "v 1 nan 0"), MTL.to_owned(), "s.obj:4: v is not finite"),
        (
            "face",
            OBJ.replace("f 5 6 7", "f 5 6 99"),
            MTL.to_owned(),
            "s.obj:20: f uses v number 99, the file has 8",
        ),
        (
            "before",
            OBJ.replace("f 5 6 7", "f -50 6 7"),
            MTL.to_owned(),
            "s.obj:20: f uses v number -50, the file has 8 before it",
        ),
        (
            "vnbefore",
            OBJ.replace("f 1/1/1", "f 1/1/-99999999999999999999"),
            MTL.to_owned(),
            "s.obj:13: f uses vn number -99999999999999999999, the file has 1 before it",
        ),
        (
            "billions",
            OBJ.replace("f 5 6 7", "f 5 6 7000000000"),
            MTL.to_owned(),
            "s.obj:20: f uses v number 7000000000, the file has 8",
        ),
        (
            "vtbillions",
            OBJ.replace("3/3/1", "3/99999999999999999999/1"),
            MTL.to_owned(),
            "s.obj:13: f uses vt number 99999999999999999999, the file has 4",
        ),
        (
            "last",
            OBJ.replace("f 5 6 7", "f 5 6 4294967295"),
            MTL.to_owned(),
            "s.obj:20: f uses v number 4294967295, the file has 8",
        ),
        (
            "word corner",
            OBJ.replace("f 5 6 7", "f 5 6 7x"),
            MTL.to_owned(),
            "s.obj:20: f has \"7x\" where a corner is expected",
        ),
        (
            "vt",
            OBJ.replace("f 1/1/1", "f 1/9/1"),
            MTL.to_owned(),
            "s.obj:13: f uses vt number 9, the file has 4",
        ),
        (
            "zero",
            OBJ.replace("f 5 6 7", "f 0 6 7"),
            MTL.to_owned(),
            "s.obj:20: f has \"0\" where a corner is expected",
        ),
        (
            "flor",
            OBJ.replace("usemtl grey", "usemtl flor"),
            MTL.to_owned(),
            "s.obj:12: material \"flor\" is not in s.mtl (it has: grey, lamp)",
        ),
        (
            "nolib",
            OBJ.replace("mtllib s.mtl", ""),
            MTL.to_owned(),
            "s.obj:12: material \"grey\" is in no material file",
        ),
        ("w", OBJ.replace("v 1 1 0", "v 1 1 0 w"), MTL.to_owned(), "s.obj:4: v has \"w\" where"),
        ("short", OBJ.replace("v 1 1 0", "v 1 1"), MTL.to_owned(), "s.obj:4: v has 2 numbers"),
        (
            "nsneg",
            OBJ.to_owned(),
            MTL.replace("illum 7\nnew", "Ns -1\nnew"),
            "s.mtl:3: material \"grey\": Ns is",
        ),
        (
            "ksinf",
            OBJ.to_owned(),
            MTL.replace("illum 7\nnew", "Ks 0 inf 0\nnew"),
            "s.mtl:3: material \"grey\": Ks is",
        ),
        (
            "keneg",
            OBJ.to_owned(),
            MTL.replace("Ke 10", "Ke -10"),
            "s.mtl:6: material \"lamp\": Ke is",
        ),
        (
            "illum",
            OBJ.to_owned(),
            MTL.replace("illum 7\nnew", "illum x\nnew"),
            "s.mtl:3: material \"grey\": illum is",
        ),
        ("word", OBJ.replace("v 1 1 0", "v 1 one 0"), MTL.to_owned(), "s.obj:4"),
        (
            "nameless",
            OBJ.replace("usemtl grey", "usemtl \"\""),
            MTL.to_owned(),
            "s.obj:12: usemtl names no material",
        ),
        (
            "typo",
            OBJ.to_owned(),
            MTL.replace("newmtl grey", "newmlt grey"),
            "s.mtl:1: 1 newmlt statement is ignored",
        ),
        (
            "vertex",
            OBJ.replace("v -3 0 4", "vertex -3 0 4"),
            MTL.to_owned(),
            "s.obj:17: 1 vertex statement is ignored",
        ),
        (
            "web page",
            OBJ.to_owned(),
            "<html>\n".into(),
            "s.mtl has no newmtl and begins as a web page does: is it an MTL file?",
        ),
        ("zeros", OBJ.to_owned(), "\0".repeat(9), "s.mtl has no newmtl and begins with zeros"),
        (
            "mesh",
            OBJ.to_owned(),
            "\n v 0 0 0".into(),
            "s.mtl has no newmtl and begins with \"v 0 0 0\": is it an MTL file?",
        ),
        ("no material", OBJ.to_owned(), "# none\n".into(), "is not in s.mtl (it has: no material)"),
        ("empty", String::new(), MTL.to_owned(), "holds no triangle"),
        (
            "nomtl",
            OBJ.replace("s.mtl", "t.mtl"),
            MTL.to_owned(),
            "s.obj:1: cannot read the material file",
        ),
        ("kd", OBJ.to_owned(), MTL.replace("Kd 0.5", "Kd -0.5"), "\"grey\": Kd is"),
        ("kdword", OBJ.to_owned(), MTL.replace("Kd 0.5", "Kd half"), "s.mtl:2"),
        (
            "kdshort",
            OBJ.to_owned(),
            MTL.replace("0.25 0.125", "0.25"),
            "s.mtl:2: material \"grey\": Kd has 2 numbers",
        ),
        (
            "nouse",
            OBJ.replace("usemtl grey\n", ""),
            MTL.to_owned(),
            "s.obj:12: face has no material; expected a usemtl statement before it",
        ),
        (
            "map",
            OBJ.to_owned(),
            MTL.replace("illum 7\nnewmtl lamp", "map_Kd x.png\nnewmtl lamp"),
            "s.mtl:3: material \"grey\": map_Kd: cannot read the texture",
        ),
        (
            "option",
            OBJ.to_owned(),
            MTL.replace("illum 7\nnewmtl lamp", "map_Kd -bm 2 x.png\nnewmtl lamp"),
            "s.mtl:3: material \"grey\": map_Kd: the option -bm is not supported",
        ),
    ] {
        let message = TestFolder::new(name, &obj, &mtl).error();
        assert!(message.contains(expected), "{name}: {message:?} lacks {expected:?}");
    }
    let folder = TestFolder::new("nomesh", OBJ, MTL);
    fs::remove_file(folder.0.join("s.obj")).unwrap();
    assert!(folder.error().contains("s.obj"));
}

#[test]
fn shading_normals_are_interpolated_and_missing_ones_are_flat() {
    let tilted = OBJ.replace("vn 0 0 1", "vn 0 0 1\nvn 3 0 0").replace("2/2/1", "2/2/2");
    let scene = TestFolder::new("tilted", &tilted, MTL).load().unwrap();
    let hit = scene.intersect(&Ray::new(vec3(0.75, 0.25, 1.0), -Vec3::Z)).unwrap();
    // On the edge's middle of triangle 1 2 3: weights 1/4, 1/2, 1/4 of Z, X, Z.
    let expected = vec3(0.5, 0.0, 0.5).normalize();
    assert!((hit.frame_ns.n - expected).length() < 1e-6, "{}", hit.frame_ns.n);
    assert_eq!(hit.ng, Vec3::Z);
    let lamp = scene.intersect(&Ray::new(vec3(0.1, 0.1, 1.0), Vec3::Z)).unwrap();
    assert_eq!(lamp.frame_ns.n, Vec3::Z);
}

/// The OBJ file of `OBJ`'s square and lamp in other words; all of them give the same scene.
#[test]
fn every_form_of_a_mesh_that_exporters_write_is_read() {
    let plain = TestFolder::new("plain", OBJ, MTL).load().unwrap();
    let seen = |scene: &Scene| {
        let shapes = scene.shapes().iter();
        let shape = |s: &Shape| {
            (s.material, s.positions.clone(), s.uvs.clone(), s.normals.clone(), s.triangles.clone())
        };
        (shapes.map(shape).collect::<Vec<_>>(), scene.light())
    };
    let latin1 = |text: &str| text.chars().map(|c| c as u8).collect::<Vec<_>>();
    let utf16 = |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<_>>();
    let forms: Vec<(&str, Vec<u8>, Vec<u8>)> = [
        ("bom", format!("\u{feff}{OBJ}"), format!("\u{feff}{MTL}")),
        ("indent", OBJ.replace('\n', "\n \t "), MTL.replace('\n', "\n\t")),
        ("tabs", OBJ.replace(' ', "\t"), MTL.replace(' ', "\t")),
        ("comments", OBJ.replace('\n', " # c\n"), MTL.replace('\n', " # c\n")),
        (
            "close comments",
            OBJ.replace("v 1 1 0", "v 1 1 0#c"),
            MTL.replace("illum 7", "illum 7#c"),
        ),
        ("cr", OBJ.replace('\n', "\r"), MTL.replace('\n', "\r")),
        ("crlf", OBJ.replace('\n', "\r\n"), MTL.replace('\n', "\r\n")),
        (
            "continued",
            OBJ.replace("v 1 1 0", "v 1 \\\n1 \\\n 0"),
            MTL.replace("Kd 0.5", "Kd \\\n0.5"),
        ),
        ("blank lines", OBJ.replace('\n', "\n\n  \n"), MTL.replace('\n', "\n\n")),
        ("some colours", OBJ.replace("v 1 1 0", "v 1 1 0 0.5 0.5 0.5"), MTL.to_owned()),
        ("half a colour", OBJ.replace("v 1 1 0", "v 1 1 0 0.5 0.5"), MTL.to_owned()),
        ("weight", OBJ.replace("v 1 1 0", "v 1 1 0 2"), MTL.to_owned()),
        (
            "negative",
            OBJ.replace("f 1/1/1 2/2/1 3/3/1 4/4/1", "f -4/-4/-1 -3/-3/-1 -2/-2/-1 -1/-1/-1"),
            MTL.to_owned(),
        ),
        (
            "spaces",
            OBJ.replace("usemtl grey", "usemtl  light grey "),
            MTL.replace("newmtl grey", "newmtl light grey"),
        ),
        (
            "number sign",
            OBJ.replace("usemtl grey", "usemtl Grey #1"),
            MTL.replace("newmtl grey", "newmtl Grey #1"),
        ),
        ("quoted", OBJ.replace("mtllib s.mtl", "mtllib \"s.mtl\""), MTL.to_owned()),
        ("umlauts", OBJ.replace("grey", "gr\u{fc}n"), MTL.replace("grey", "gr\u{fc}n")),
        ("twice", OBJ.replace("o lamp", "mtllib ./s.mtl\no lamp"), MTL.to_owned()),
        ("mtllib last", OBJ.replace("mtllib s.mtl\n", "") + "mtllib s.mtl", MTL.to_owned()),
        ("unused", OBJ.to_owned() + "v nan 0 0\nvn nan 0 0\nvt nan 0\n", MTL.to_owned()),
        ("lower case", OBJ.to_owned(), MTL.replace("Kd", "kd").replace("Ke", "KE")),
        (
            "joined",
            OBJ.replace("v 1 1 0", "\u{feff}v 1 1 0"),
            MTL.replace("newmtl lamp", "\u{feff}newmtl lamp"),
        ),
        ("nameless", OBJ.replace("usemtl grey", "usemtl\nusemtl grey"), format!("{MTL}newmtl\n")),
        ("sign", OBJ.replace("usemtl grey", "usemtl #1"), MTL.replace("grey", "#1")),
    ]
    .into_iter()
    .map(|(name, obj, mtl)| (name, obj.into_bytes(), mtl.into_bytes()))
    .chain([
        (
            "latin1",
            latin1(&OBJ.replace("grey", "gr\u{fc}n")),
            MTL.replace("grey", "gr\u{fc}n").into_bytes(),
        ),
        ("utf16", utf16(&format!("\u{feff}{OBJ}")), utf16(&format!("\u{feff}{MTL}"))),
    ])
    .collect();
    for (name, obj, mtl) in forms {
        let folder = TestFolder::new("forms", OBJ, MTL);
        fs::write(folder.0.join("s.obj"), obj).unwrap();
        fs::write(folder.0.join("s.mtl"), mtl).unwrap();
        let scene = folder.load().unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(seen(&scene), seen(&plain), "{name}");
    }
}

/// Bytes of the scene's text with some in the place of `NAME`.
fn with_name(text: &str, name: &[u8]) -> Vec<u8> {
    let parts: Vec<&[u8]> = text.split("NAME").map(str::as_bytes).collect();
    parts.join(name)
}

#[cfg(unix)]
#[test]
fn names_of_two_bytes_a_character_hold_no_backslash() {
    use std::os::unix::ffi::OsStrExt as _;
    let picture = image::RgbImage::from_pixel(1, 1, image::Rgb([255, 0, 0]));
    for name in [
        b"\x95\x5c".as_slice(), // Shift-JIS
        b"\xb3\x5c\xa5\x5c",    // Big5
        b"\x81\x5c x",          // GBK
        b"a\x83\x85\x83\x5c",   // a byte that is white space in Latin-1
        b"a\\b",                // a file of Unix in plain ASCII
        "\u{fc}\\b".as_bytes(),
    ] {
        let obj = with_name(&OBJ.replace("grey", "NAME").replace("s.mtl", "NAME.mtl"), name);
        let mtl = with_name(&MTL.replace("grey", "NAME\nmap_Kd NAME.png"), name);
        let folder = TestFolder::new("bytes", OBJ, MTL);
        let file = |end: &[u8]| folder.0.join(std::ffi::OsStr::from_bytes(&[name, end].concat()));
        fs::write(folder.0.join("s.obj"), obj).unwrap();
        fs::write(file(b".mtl"), mtl).unwrap();
        picture.save_with_format(file(b".png"), image::ImageFormat::Png).unwrap();
        fs::rename(folder.0.join("s.obj"), file(b".obj")).unwrap();
        fs::write(folder.0.join("s.toml"), with_name("[input]\nobjfile = 'NAME.obj'\n", name))
            .unwrap();
        let scene = folder.load().unwrap_or_else(|error| panic!("{name:x?}: {error}"));
        assert_eq!(scene.material_of(0).diffuse.average(), Vec3::X, "{name:x?}");
        assert_eq!(scene.shapes().len(), 2, "{name:x?}");
        // The name that a message shows has its backslash.
        fs::write(file(b".obj"), with_name("mtllib NAME.mtl\nv 0 0 0\nusemtl x\nf 1 1 1\n", name))
            .unwrap();
        assert!(!folder.error().contains('\u{f75c}'), "{}", folder.error());
    }
}

#[test]
fn accents_may_be_characters_of_their_own() {
    let (whole, apart) = ("B\u{f6}den", "Bo\u{308}den");
    for (used, there) in [(whole, apart), (apart, whole)] {
        let obj = OBJ.replace("grey", used).replace("s.mtl", &format!("{used}.mtl"));
        let folder = TestFolder::new("accents", &obj, MTL);
        fs::write(folder.0.join(format!("{there}.mtl")), MTL.replace("grey", there)).unwrap();
        let scene = folder.load().unwrap();
        assert_eq!(scene.material_of(0).diffuse.average(), vec3(0.5, 0.25, 0.125));
    }
    // Names that differ only so are two.
    let mtl = format!("{}newmtl {apart}\nKd 1 1 1\n", MTL.replace("grey", whole));
    let scene = TestFolder::new("both", &OBJ.replace("grey", apart), &mtl).load().unwrap();
    assert_eq!(scene.material_of(0).diffuse.average(), Vec3::ONE);
}

#[test]
fn a_mesh_is_found_as_other_files_are() {
    let load = |there: &str, written: &[u8]| {
        let folder = TestFolder::new("mesh-name", OBJ, MTL);
        fs::create_dir_all(folder.0.join(there).parent().unwrap()).unwrap();
        fs::rename(folder.0.join("s.obj"), folder.0.join(there)).unwrap();
        fs::rename(folder.0.join("s.mtl"), folder.0.join(there).with_file_name("s.mtl")).unwrap();
        let toml = [b"[input]\nobjfile = '", written, b"'\n"].concat();
        fs::write(folder.0.join("s.toml"), toml).unwrap();
        folder.load().map(|scene| scene.remarks().join("\n"))
    };
    let (whole, apart) = ("B\u{f6}den", "Bo\u{308}den");
    for (there, written) in [
        (format!("{whole}.obj"), format!("{apart}.obj")),
        (format!("{apart}.obj"), format!("{whole}.obj")),
        (format!("{apart}/{whole}.obj"), format!("{whole}\\{apart}.obj")),
        ("a #1.obj".into(), "a #1.obj".into()),
    ] {
        assert_eq!(load(&there, written.as_bytes()).unwrap(), "", "{there}");
    }
    let error = load("s.obj", b"a #1.obj").unwrap_err().to_string();
    assert!(error.contains("s.toml:2: cannot read the mesh ") && error.contains("a #1.obj: No"));
}

#[test]
fn nameless_materials_that_nothing_uses_are_remarked_on() {
    let obj = OBJ.replace("usemtl grey", "usemtl\nusemtl grey");
    let scene = TestFolder::new("nameless", &obj, &format!("newmtl\n{MTL}")).load().unwrap();
    let said = scene.remarks().join("\n");
    assert!(said.contains("s.obj:12: usemtl names no material; no face uses it"), "{said}");
    assert!(said.contains("s.mtl:1: newmtl names no material; no face uses this"), "{said}");
}

#[test]
fn a_name_that_leads_out_of_the_folder_is_looked_for_beside() {
    for name in ["../gone/s.mtl", "..\\..\\a b\\s.mtl", "../x/../y/sub/s.mtl"] {
        let folder = TestFolder::new("out", &OBJ.replace("s.mtl", name), MTL);
        let scene = folder.load().unwrap_or_else(|error| panic!("{name}: {error}"));
        let said = scene.remarks().join("\n");
        assert!(said.contains("leads to no file; taken is"), "{said}");
    }
    // What is there is taken from there.
    let folder = TestFolder::new("round", OBJ, MTL);
    let own = folder.0.file_name().unwrap().to_str().unwrap().to_owned();
    fs::write(folder.0.join("s.obj"), OBJ.replace("s.mtl", &format!("../{own}/s.mtl"))).unwrap();
    assert_eq!(folder.load().unwrap().remarks(), [""; 0]);
    let error = TestFolder::new("nowhere", &OBJ.replace("s.mtl", "../t.mtl"), MTL).error();
    assert!(error.contains("../t.mtl: No such file"), "{error}");
}

#[test]
fn a_mesh_may_name_several_material_files() {
    let (gray, lamp) = MTL.split_once("newmtl lamp").unwrap();
    let lamp = format!("newmtl lamp{lamp}newmtl grey\nKd 1 1 1\n");
    for (name, statement) in [
        ("words", "a.mtl b.mtl"),
        ("spaces", "a b.MTL lamp s.mtl # both"),
        ("quotes", "\"a b\" \"lamp s.mtl\""),
        ("one", "my mat.mtl"),
        ("lines", "a.mtl\nmtllib b.mtl"),
        ("slashes", "sub\\a.mtl b.mtl"),
    ] {
        let folder = TestFolder::new("several", &OBJ.replace("s.mtl", statement), "");
        fs::create_dir(folder.0.join("sub")).unwrap();
        for (file, text) in [
            ("a.mtl", gray),
            ("b.mtl", &lamp),
            ("a b.MTL", gray),
            ("a b", gray),
            ("lamp s.mtl", &lamp),
            ("sub/a.mtl", gray),
            ("my mat.mtl", MTL),
        ] {
            fs::write(folder.0.join(file), text).unwrap();
        }
        let scene = folder.load().unwrap_or_else(|error| panic!("{name}: {error}"));
        // Of two materials of one name the first file's counts.
        let Texture::Constant(color) = scene.material_of(0).diffuse else { panic!("{name}") };
        assert_eq!(color, vec3(0.5, 0.25, 0.125), "{name}");
        assert_eq!(scene.first_light_intensity(), vec3(10.0, 20.0, 30.0), "{name}");
    }
    let folder = TestFolder::new("missing", &OBJ.replace("s.mtl", "s.mtl t.mtl"), MTL);
    let error = folder.error();
    assert!(
        error.contains("s.obj:1: cannot read the material file") && error.contains("t.mtl"),
        "{error}"
    );
}

#[test]
fn what_has_no_area_is_left_out_and_remarked_on() {
    let plain = TestFolder::new("area", OBJ, MTL).load().unwrap();
    let more = OBJ.replace("o lamp", "l 1 2\nl 1 2 3 4\np 1\nf 1 2\no lamp");
    let scene = TestFolder::new("no-area", &more, MTL).load().unwrap();
    let triangles =
        |scene: &Scene| scene.shapes().iter().map(|s| s.triangles.len()).collect::<Vec<_>>();
    assert_eq!(triangles(&scene), triangles(&plain));
    let said = scene.remarks().join("\n");
    for expected in [
        "s.obj:18: 2 lines (l) have no area",
        "s.obj:20: 1 point (p) has no area",
        "s.obj:21: 1 face of fewer than 3 corners has no area",
    ] {
        assert!(said.contains(expected), "{said}");
    }
    let far = TestFolder::new("far", &OBJ.replace("v 1 1 0", "v 1 -1e30 0 2"), MTL).load().unwrap();
    let said = far.remarks().join("\n");
    assert!(said.contains("s.obj: a vertex lies at 1e30; beyond 1e6 from the origin"), "{said}");
    assert!(said.contains("s.obj:4: 1 weight (v x y z w) statement is ignored"), "{said}");
    let lines = OBJ.replace("f 1/1/1 2/2/1 3/3/1 4/4/1", "l 1 2 3 4").replace("f ", "l ");
    assert!(TestFolder::new("lines", &lines, MTL).error().contains("holds no triangle"));
}

#[test]
fn a_broken_material_that_no_face_uses_is_remarked_on() {
    let plain = TestFolder::new("plain-spare", OBJ, MTL).load().unwrap();
    let count = MTL.lines().count();
    for (statement, expected) in [
        ("map_Kd gone.png", "map_Kd: cannot read the texture"),
        ("map_Ks s.mtl", "map_Ks: cannot decode the texture"),
        ("map_Kd -bm 2 x.png", "map_Kd: the option -bm is not supported"),
        ("Kd -1 1 1", "Kd is"),
        ("Ns many", "Ns is"),
        ("illum x", "illum is"),
    ] {
        // A second material of one name is never used.
        for name in ["spare", "grey"] {
            let mtl = format!("{MTL}newmtl {name}\n{statement}\nillum 7\n");
            let scene = TestFolder::new("spare", OBJ, &mtl).load().unwrap();
            let said = scene.remarks().join("\n");
            let place = format!("s.mtl:{}: material \"{name}\": {expected}", count + 2);
            assert!(said.contains(&place), "{said}");
            assert!(said.ends_with("; no face uses this material"), "{said}");
            assert_eq!(scene.first_light_intensity(), plain.first_light_intensity());
            let used = OBJ.replacen("usemtl grey", "usemtl spare", 1);
            if name == "spare" {
                let error = TestFolder::new("used", &used, &mtl).error();
                assert!(error.contains(&place) && !error.contains("no face"), "{error}");
            }
        }
    }
}

#[test]
fn statements_that_are_not_supported_are_remarked_on() {
    let freeform = "vp 0.1\ncstype bezier\ndeg 1 1\nSURF 0 1 0 1 1 2 4 3\nparm u 0 1\nend\ncall a.obj\nface 1 2 3\n\
                    curv 0 1 1 2\nsurf 0 1 0 1 1 2 4 3\ns off\nmg 0\n";
    let scene = TestFolder::new("freeform", &format!("{OBJ}{freeform}"), MTL).load().unwrap();
    let said = scene.remarks().join("\n");
    let expected = [
        "s.obj:25: 2 surf statements are ignored",
        "s.obj:28: 1 call statement is ignored",
        "s.obj:29: 1 face statement is ignored",
        "s.obj:30: 1 curv statement is ignored",
    ];
    assert_eq!(scene.remarks().len(), expected.len(), "{said}");
    for expected in expected {
        assert!(said.contains(expected), "{said}");
    }
    // Few remarks on what is perhaps no mesh at all.
    let words: String = (0..100).map(|i| format!("word{i}\u{1b}[2J\n")).collect();
    let scene = TestFolder::new("words", &format!("{OBJ}{words}"), MTL).load().unwrap();
    assert_eq!(scene.remarks().len(), 13);
    let said = scene.remarks().join("\n");
    assert!(said.ends_with("s.obj:34: 88 more kinds of statements are ignored"), "{said}");
    assert!(said.contains("1 word0?[2j statement is ignored"), "{said}");
}

#[test]
fn what_a_material_says_in_vain_is_remarked_on() {
    let folder = TestFolder::new("vain", OBJ, MTL);
    let picture = image::RgbImage::from_pixel(1, 1, image::Rgb([255, 0, 0]));
    picture.save(folder.0.join("t.png")).unwrap();
    let said = |mtl: &str| {
        std::fs::write(folder.0.join("s.mtl"), mtl).unwrap();
        folder.load().unwrap().remarks().join("\n")
    };
    assert_eq!(said(MTL), "");
    let lines = MTL.lines().count();
    for (statements, expected) in [
        ("Kd 0.5 1 1\nmap_Kd t.png", "1: material \"m\": Kd is ignored: map_Kd takes its place"),
        ("map_Ks t.png\nKs 0 0 0", "2: material \"m\": Ks is ignored: map_Ks takes its place"),
        ("Kd 1 1 1\nmap_Kd t.png\nKs .5 .5 .5", ""),
        ("foo 1\nPr 0.5\nfoo 2", "1: 2 foo statements are ignored"),
        ("foo 1\nPr 0.5\nfoo 2", "2: 1 Pr statement is ignored"),
        ("Ka 1 1 1\nNi 1.5\nTf 1 1 1\nsharpness 60\nd 1\nTr 0", ""),
        ("illum 99", "1: illum 99 is no model of MTL (0 to 10): Phong is taken"),
        ("illum 10", ""),
        ("map_Kd t.png\nmap_Kd ./t.png", "2: material \"m\": map_Kd replaces that of line "),
        ("map_Kd gone.png\nmap_Kd t.png", "2: material \"m\": map_Kd replaces that of line "),
        ("Ns 5\nNs 6", "2: material \"m\": Ns replaces that of line "),
        ("Ke 0 0 0\nke 1 1 1", "2: material \"m\": ke replaces that of line "),
        ("Ns 5\nNs  5 # again", ""),
        (
            "Kd 255 255 255",
            "1: material \"m\": Kd is [255, 255, 255]: a surface cannot reflect more",
        ),
        ("Ks 0 1.5 0", "1: material \"m\": Ks is [0, 1.5, 0]: a surface cannot reflect more"),
        ("Kd 1 1 1\nKs 1 1 1", ""),
        ("newmtl m", "1: material \"m\" is there already: the first counts"),
        ("newmtl m # again", "1: material \"m\" is there already: the first counts"),
        ("newmtl n #1\nnewmtl n #2", ""),
        ("newmtl n #1\nnewmtl n #1", "2: material \"n\" is there already: the first counts"),
    ] {
        // The first line of these statements is behind `newmtl m`.
        let found = said(&format!("{MTL}newmtl m\n{statements}\n"));
        let expected = expected.split_once(": ").map(|(line, words)| {
            format!("s.mtl:{}: {words}", lines + 1 + line.parse::<usize>().unwrap())
        });
        match expected {
            None => assert_eq!(found, "", "{statements}"),
            Some(expected) => assert!(found.contains(&expected), "{statements}: {found}"),
        }
    }
    assert!(said(&format!("Kd 1 1 1\n{MTL}")).contains("s.mtl:1: 1 Kd statement is ignored"));
}

#[test]
fn a_face_without_uv_or_normal_concerns_itself_alone() {
    let tilted = OBJ.replace("vn 0 0 1", "vn 0 0.6 0.8");
    let more = tilted.replace("o lamp", "f 1//1 2//1 3//1\nf 1/1 3/3 4/4\nf 2 3 4\no lamp");
    let scene = TestFolder::new("mixed", &more, MTL).load().unwrap();
    let shape = &scene.shapes()[0];
    let corner = |triangle: usize, corner: usize| {
        let vertex = shape.triangles[triangle][corner] as usize;
        (shape.uvs[vertex], shape.normals[vertex])
    };
    let (normal, flat) = (vec3(0.0, 0.6, 0.8), Vec3::Z);
    let uv = |x: f32, y: f32| glam::vec2(x, y);
    assert_eq!(corner(0, 1), (uv(1.0, 0.0), normal));
    assert_eq!(corner(1, 2), (uv(0.0, 1.0), normal));
    assert_eq!(corner(2, 1), (uv(0.0, 0.0), normal));
    assert_eq!(corner(3, 1), (uv(1.0, 1.0), flat));
    assert_eq!(corner(4, 2), (uv(0.0, 0.0), flat));
}

#[test]
fn concave_polygons_have_their_own_area() {
    let arrow = OBJ
        .replace("v 1 0 0", "v 0.5 0.9 0")
        .replace("v 1 1 0", "v 1 0 0")
        .replace("v 0 1 0", "v 0.5 1 0");
    let scene = TestFolder::new("arrow", &arrow, MTL).load().unwrap();
    let shape = &scene.shapes()[0];
    let area: f32 = (0..shape.triangles.len())
        .map(|i| shape.corners(i))
        .map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length())
        .sum();
    assert!((area - 0.05).abs() < 1e-6, "{area}");
    assert!(scene.intersect(&Ray::new(vec3(0.5, 0.5, 1.0), -Vec3::Z)).is_none());
}

#[test]
fn a_scene_without_a_light_loads_and_only_asking_for_it_fails() {
    let scene =
        TestFolder::new("dark", OBJ, &MTL.replace("Ke 10 20 30", "Ke 0 0 0")).load().unwrap();
    assert_eq!(scene.light(), None);
    assert!(scene.intersect(&Ray::new(vec3(0.5, 0.5, 2.0), -Vec3::Z)).is_some());
    let said =
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| scene.first_light_position()));
    let said = *said.unwrap_err().downcast::<String>().unwrap();
    assert!(said.starts_with("the scene has no light: no shape of "), "{said}");
}

/// A thin blocker close above a floor, anywhere and seen from anywhere: no point below it is lit, and none
/// elsewhere shadows itself.
#[test]
fn contact_shadows_stay_far_from_the_origin_and_from_the_camera() {
    let quad = |half: f32, y: f32, at: Vec3| {
        let corner = |x: f32, z: f32| format!("v {} {} {}\n", x + at.x, y + at.y, z + at.z);
        [corner(-half, half), corner(half, half), corner(half, -half), corner(-half, -half)]
            .concat()
    };
    let places = [0.0, 10.0, 300.0, 1e3, 3e3, 1e4].map(|d| vec3(0.0, 0.0, d));
    let places = places.into_iter().chain([vec3(1e3, -1e3, 1e3), vec3(-4e3, 2e3, 0.0)]);
    for (at, away) in places.flat_map(|at| [5.0, 100.0, 1500.0, 3000.0].map(|away| (at, away))) {
        let floor = quad(2.0, 0.0, at);
        let blocker = quad(0.9, 0.25, at);
        let obj = format!("mtllib s.mtl\n{floor}{blocker}usemtl grey\nf 1 2 3 4\nf 5 6 7 8\n");
        let scene = TestFolder::new("moved", &obj, MTL).load().unwrap();
        // Between floor and blocker, at a slant, lies the camera's line of sight.
        let eye = at + away * vec3(0.0, 0.1, 1.0).normalize();
        let light = at + vec3(0.0, 2.0, 0.0);
        let (mut below, mut beside) = (0, 0);
        for index in 0..400u16 {
            let (x, z) = (f32::from(index % 20) - 9.5, f32::from(index / 20) - 9.5);
            let target = at + 0.19 * vec3(x, 0.0, z);
            let direction = (target - eye).normalize();
            let Some(i) = scene.intersect(&Ray::segment(eye, direction, 0.0, f32::INFINITY)) else {
                continue;
            };
            let local = i.p - at;
            // The blocker itself, and a margin for what rounding does to places.
            if local.y > 0.1 || (local.x.abs().max(local.z.abs()) - 1.03).abs() < 0.1 {
                continue;
            }
            let is_below = local.x.abs().max(local.z.abs()) < 1.03;
            let (distance, direction) = ((light - i.p).length(), (light - i.p).normalize());
            for epsilon in [Ray::EPSILON, i.epsilon] {
                let ray = Ray::segment(i.p, direction, epsilon, distance - epsilon);
                assert_eq!(scene.occluded(&ray), is_below, "{at} from {away}: {local}, {epsilon}");
            }
            (below, beside) = (below + u32::from(is_below), beside + u32::from(!is_below));
        }
        assert!(below > 10 && beside > 50, "{at} from {away}: {below} and {beside}");
    }
}

/// How a student writes a shadow ray, and how the reference does.
#[test]
fn no_surface_shadows_itself_in_a_large_scene() {
    for scale in [1.0, 3e3, 1e4, 1e6] {
        let corner = |x: f32, z: f32| format!("v {} 0 {}\n", x * scale, z * scale);
        let obj = format!(
            "mtllib s.mtl\n{}{}{}{}usemtl grey\nf 1 2 3 4\n",
            corner(-2.0, 2.0),
            corner(2.0, 2.0),
            corner(2.0, -2.0),
            corner(-2.0, -2.0)
        );
        let scene = TestFolder::new("large", &obj, MTL).load().unwrap();
        let (eye, light) = (scale * vec3(0.0, 3.0, 4.0), scale * vec3(0.3, 2.0, 0.0));
        for index in 0..10_000u16 {
            let (x, z) = (f32::from(index % 100) - 50.0, f32::from(index / 100) - 50.0);
            // Not along the diagonal that both triangles share.
            let target = scale * 0.0391 * vec3(x, 0.0, z + 0.37);
            let i =
                scene.intersect(&Ray::segment(eye, (target - eye).normalize(), 0.0, f32::INFINITY));
            let i = i.unwrap_or_else(|| panic!("{target} is missed"));
            let (distance, direction) = ((light - i.p).length(), (light - i.p).normalize());
            for epsilon in [Ray::EPSILON, i.epsilon] {
                let ray = Ray::segment(i.p, direction, epsilon, distance - epsilon);
                assert!(!scene.occluded(&ray), "{} shadows itself", i.p);
            }
            // Another value is the student's own choice.
            let own = Ray::segment(i.p, direction, 2e-3, distance);
            assert_eq!(own.begun_off_surface(scene.extent), own);
        }
    }
}
