//! The shader contract against its page, without a device.

use std::collections::BTreeMap;
use std::mem::offset_of;

use wgpu::naga;

use super::*;

/// Struct and member, to offset and size in bytes.
type Members = BTreeMap<(String, String), (u32, u32)>;

fn page() -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/shader_contract.md");
    std::fs::read_to_string(path).unwrap()
}

/// The rows of the page's table of members.
fn table(page: &str) -> Members {
    let mut members = Members::new();
    for line in page.lines() {
        let cells: Vec<&str> = line.split('|').map(|cell| cell.trim().trim_matches('`')).collect();
        let [_, _, _, structure, member, _, offset, size, ..] = cells[..] else { continue };
        if let (Ok(offset), Ok(size)) = (offset.parse(), size.parse()) {
            members.insert((structure.to_owned(), member.to_owned()), (offset, size));
        }
    }
    members
}

/// The members of all structs that a WGSL text binds as uniforms.
fn wgsl_members(text: &str) -> Members {
    let module = naga::front::wgsl::parse_str(text).unwrap();
    let mut layouter = naga::proc::Layouter::default();
    layouter.update(module.to_ctx()).unwrap();
    let mut found = Members::new();
    for (_, variable) in module.global_variables.iter() {
        let ty = &module.types[variable.ty];
        if let naga::TypeInner::Struct { members, .. } = &ty.inner {
            for member in members {
                let name = (ty.name.clone().unwrap(), member.name.clone().unwrap());
                found.insert(name, (member.offset, layouter[member.ty].size));
            }
        }
    }
    found
}

macro_rules! members {
    ($members:ident, $name:literal, $ty:ident: $($member:ident),*) => {
        let zero: $ty = bytemuck::Zeroable::zeroed();
        $($members.insert(
            ($name.to_owned(), stringify!($member).to_owned()),
            (offset_of!($ty, $member) as u32, size_of_val(&zero.$member) as u32),
        );)*
    };
}

fn rust_members() -> Members {
    let mut all = Members::new();
    members!(all, "Frame", FrameUniforms:
        view, projection, camera_position, light_position, light_intensity);
    members!(all, "Object", ObjectUniforms: model, normal_matrix);
    members!(all, "Material", MaterialUniforms: rho_d, rho_s, exponent);
    members!(all, "Shadow", ShadowUniforms: params, light_view_projection);
    all
}

#[test]
fn the_page_its_example_and_the_code_agree_on_every_byte() {
    let page = page();
    let example = page.split("```wgsl").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let expected = table(&page);
    assert_eq!(expected.len(), 12, "the table of the page was not found");
    assert_eq!(wgsl_members(example), expected);
    assert_eq!(rust_members(), expected);
    assert_eq!(size_of::<FrameUniforms>(), 176);
    assert_eq!(size_of::<ObjectUniforms>(), 128);
    assert_eq!(size_of::<MaterialUniforms>(), 48);
    assert_eq!(size_of::<ShadowUniforms>(), 400);
}

#[test]
fn the_page_names_the_constants_of_the_code() {
    let page = page();
    for text in [
        format!("`{COLOR_FORMAT:?}`"),
        format!("`{DEPTH_FORMAT:?}`"),
        format!("{VERTEX_STRIDE} bytes each"),
        format!("near plane {}, far plane {}", Camera::NEAR, Camera::FAR),
        format!("`array<mat4x4f, {SHADOW_LAYERS}>`"),
    ] {
        assert!(page.contains(&text), "the page lacks {text:?}");
    }
    for (group, line) in [
        (FRAME_GROUP, "@group(0) @binding(0) var<storage, read> frame"),
        (OBJECT_GROUP, "@group(1) @binding(0) var<storage, read> object"),
        (MATERIAL_GROUP, "@group(2) @binding(0) var<storage, read> material"),
        (SHADOW_GROUP, "@group(3) @binding(0) var<storage, read> shadow"),
    ] {
        assert!(line.starts_with(&format!("@group({group})")) && page.contains(line), "{line}");
    }
}

#[test]
fn normals_go_through_the_inverse_transpose() {
    let model = glam::Mat4::from_translation(glam::vec3(1.0, 2.0, 3.0))
        * glam::Mat4::from_scale(glam::vec3(2.0, 1.0, 0.5));
    let object = ObjectUniforms::new(model);
    // The plane x + y = 0 has the normal (1, 1, 0); scaled by (2, 1), it has (1/2, 1, 0).
    let normal = object.normal_matrix * glam::vec4(1.0, 1.0, 0.0, 0.0);
    assert!((normal - glam::vec4(0.5, 1.0, 0.0, 0.0)).length() < 1e-6, "{normal}");
}
