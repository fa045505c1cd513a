use std::fs;
use std::path::PathBuf;

use glam::{Vec3, vec3};

use super::*;

/// A scene folder under the system's temporary one, removed in the end.
struct Folder(PathBuf);

impl Folder {
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

impl Drop for Folder {
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
    let scene = Folder::new("good", OBJ, MTL).load().unwrap();
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
    let scene = Folder::new("ends", OBJ, MTL).load().unwrap();
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
        ("nan", OBJ.replace("v 1 1 0", "v 1 nan 0"), MTL.to_owned(), "s.obj:4"),
        ("face", OBJ.replace("f 5 6 7", "f 5 6 99"), MTL.to_owned(), "out of bounds"),
        ("word", OBJ.replace("v 1 1 0", "v 1 one 0"), MTL.to_owned(), "s.obj:4"),
        ("empty", String::new(), MTL.to_owned(), "holds no triangle"),
        ("nomtl", OBJ.replace("s.mtl", "t.mtl"), MTL.to_owned(), "t.mtl"),
        ("kd", OBJ.to_owned(), MTL.replace("Kd 0.5", "Kd -0.5"), "\"grey\": Kd is"),
        ("kdword", OBJ.to_owned(), MTL.replace("Kd 0.5", "Kd half"), "s.mtl:2"),
        (
            "kdshort",
            OBJ.to_owned(),
            MTL.replace("0.25 0.125", "0.25"),
            "s.mtl:2: cannot read the materials: Kd has 2 numbers",
        ),
        ("dark", OBJ.to_owned(), MTL.replace("Ke 10 20 30", "Ke 0 0 0"), "no light"),
        ("nouse", OBJ.replace("usemtl grey\n", ""), MTL.to_owned(), "has no material"),
        (
            "map",
            OBJ.to_owned(),
            MTL.replace("illum 7\nnewmtl lamp", "map_Kd x.png\nnewmtl lamp"),
            "x.png",
        ),
    ] {
        let message = Folder::new(name, &obj, &mtl).error();
        assert!(message.contains(expected), "{name}: {message:?} lacks {expected:?}");
    }
    let folder = Folder::new("nomesh", OBJ, MTL);
    fs::remove_file(folder.0.join("s.obj")).unwrap();
    assert!(folder.error().contains("s.obj"));
}

#[test]
fn shading_normals_are_interpolated_and_missing_ones_are_flat() {
    let tilted = OBJ.replace("vn 0 0 1", "vn 0 0 1\nvn 3 0 0").replace("2/2/1", "2/2/2");
    let scene = Folder::new("tilted", &tilted, MTL).load().unwrap();
    let hit = scene.intersect(&Ray::new(vec3(0.75, 0.25, 1.0), -Vec3::Z)).unwrap();
    // On the edge's middle of triangle 1 2 3: weights 1/4, 1/2, 1/4 of Z, X, Z.
    let expected = vec3(0.5, 0.0, 0.5).normalize();
    assert!((hit.frame_ns.n - expected).length() < 1e-6, "{}", hit.frame_ns.n);
    assert_eq!(hit.ng, Vec3::Z);
    let lamp = scene.intersect(&Ray::new(vec3(0.1, 0.1, 1.0), Vec3::Z)).unwrap();
    assert_eq!(lamp.frame_ns.n, Vec3::Z);
}
