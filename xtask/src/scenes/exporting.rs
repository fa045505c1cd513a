//! Scenes as TOML, OBJ, MTL and PNG files.

use super::mesh::Mesh;
use super::scene::{Material, Scene};
use anyhow::Result;
use glam::DVec3;
use std::fmt::Write;

/// A file to be written; `path` is relative to `scenes/a2`, with forward slashes.
pub struct ExportedFile {
    pub path: String,
    pub bytes: Vec<u8>,
}

/// Decimals of positions, normals and texture coordinates: half a unit in the last place is 5e-6.
const DECIMALS: usize = 5;
/// Decimals of an emitter's positions: its quad is 2e-6 wide.
const EMITTER_DECIMALS: usize = 7;

/// The files of one scene.
///
/// # Errors
/// When a texture cannot be encoded.
pub fn scene_files(scene: &Scene) -> Result<Vec<ExportedFile>> {
    let mut files = Vec::new();
    let mut push = |path: String, bytes: Vec<u8>| {
        files.push(ExportedFile { path: format!("{}/{path}", scene.folder), bytes })
    };
    for (variant, realtime, bonus) in
        [("offline", false, false), ("realtime", true, false), ("realtime_bonus", true, true)]
    {
        if !bonus || scene.bonus {
            push(
                format!("tinyrender/{}_{variant}.toml", scene.name),
                toml(scene, realtime, bonus).into_bytes(),
            );
        }
    }
    push(format!("mesh/{}.obj", scene.mesh_name), obj(scene).into_bytes());
    push(format!("mesh/{}.mtl", scene.mesh_name), mtl(scene).into_bytes());
    for texture in &scene.textures {
        push(format!("mesh/{}", texture.file), texture.png()?);
    }
    Ok(files)
}

/// `value` rounded to `decimals` places, without trailing zeros and without a negative zero.
pub fn decimal(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text =
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_string() } else { text.to_string() }
}

/// A TOML float: always with a decimal point, because arrays of the original format hold one type only.
fn float(value: f64) -> String {
    let text = decimal(value, DECIMALS);
    if text.contains('.') { text } else { format!("{text}.0") }
}

fn toml(scene: &Scene, realtime: bool, bonus: bool) -> String {
    let vector = |v: DVec3| format!("[{}, {}, {}]", float(v.x), float(v.y), float(v.z));
    let camera = &scene.camera;
    let [width, height] = scene.film;
    let mut text = format!(
        "[input]\nobjfile = \"../mesh/{}.obj\"\n\n\
         [camera]\neye = {}\nat = {}\nup = [0.0, 1.0, 0.0]\nfov = {}\n\n\
         [film]\nwidth = {width}\nheight = {height}\n\n\
         [renderer]\nrealtime = {realtime}\n",
        scene.mesh_name,
        vector(camera.eye),
        vector(camera.at),
        float(camera.fov_deg),
    );
    text += &if realtime {
        "type = \"direct\"\n".to_string()
    } else {
        format!("type = \"simple\"\nspp = {}\n", scene.spp)
    };
    if bonus {
        text += "bonus = true\n";
    }
    text
}

fn mtl(scene: &Scene) -> String {
    let rgb = |c: &[f64; 3]| c.map(|x| decimal(x, DECIMALS)).join(" ");
    let mut text = String::from("# made by xtask scenes\n");
    let mut shapes: Vec<_> = scene.shapes.iter().collect();
    if scene.listed_backward {
        shapes.reverse();
    }
    for shape in shapes {
        text += &format!("\nnewmtl {}\n", shape.name);
        let maps = match &shape.material {
            Material::Diffuse { kd, map_kd } => {
                text += &format!("illum 7\nKd {}\n", rgb(kd));
                [("map_Kd", map_kd), ("map_Ks", &None)]
            }
            Material::Phong { kd, ks, ns, map_kd, map_ks } => {
                text += &format!(
                    "illum 2\nKd {}\nKs {}\nNs {}\n",
                    rgb(kd),
                    rgb(ks),
                    decimal(*ns, DECIMALS)
                );
                [("map_Kd", map_kd), ("map_Ks", map_ks)]
            }
            Material::Mirror { kd, ks } => {
                text += &format!("illum 5\nKd {}\nKs {}\n", rgb(kd), rgb(ks));
                [("map_Kd", &None), ("map_Ks", &None)]
            }
            Material::Emitter { ke } => {
                text += &format!("illum 7\nKd 0 0 0\nKe {}\n", rgb(ke));
                [("map_Kd", &None), ("map_Ks", &None)]
            }
        };
        for (key, file) in maps {
            if let Some(file) = file {
                text += &format!("{key} {file}\n");
            }
        }
    }
    text
}

fn obj(scene: &Scene) -> String {
    let mut text = format!("# made by xtask scenes\nmtllib {}.mtl\n", scene.mesh_name);
    let mut first = 1;
    for shape in &scene.shapes {
        let decimals = match shape.material {
            Material::Emitter { .. } => EMITTER_DECIMALS,
            _ => DECIMALS,
        };
        text += &format!("o {0}\ng {0}\nusemtl {0}\n", shape.name);
        write_mesh(&mut text, &shape.mesh, first, decimals);
        first += shape.mesh.vertices.len();
    }
    text
}

/// Vertices and faces; `first` is the OBJ index of the mesh's first vertex, the same in all three lists.
fn write_mesh(text: &mut String, mesh: &Mesh, first: usize, decimals: usize) {
    let mut line = |key: &str, values: &[f64], decimals: usize| {
        text.push_str(key);
        for value in values {
            // Writing to a string cannot fail.
            let _ = write!(text, " {}", decimal(*value, decimals));
        }
        text.push('\n');
    };
    mesh.vertices.iter().for_each(|v| line("v", &v.position.to_array(), decimals));
    mesh.vertices.iter().for_each(|v| line("vt", &v.uv.to_array(), DECIMALS));
    mesh.vertices.iter().for_each(|v| line("vn", &v.normal.to_array(), DECIMALS));
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| i as usize + first);
        text.push_str(&format!("f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}\n"));
    }
}
