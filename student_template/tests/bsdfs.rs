//! Quick tests of 1.1 and 1.2: `cargo test --release -p student_template`.
//!
//! Each fails with "not yet implemented" until its BSDF is written. They ask for a few values only;
//! `umbra check` asks for thousands. Write more tests here as you like: this folder is not submitted.

#[path = "../src/bsdfs/mod.rs"]
mod bsdfs;

use basecode::{Bsdf, Frame, Material, SurfaceInteraction, Vec2, Vec3, vec3};
use bsdfs::{DiffuseBsdf, PhongBsdf};

/// A unit direction in the local frame, whose z axis is the normal: so many degrees from the normal,
/// toward the x axis; on the other side when they are negative, below the surface beyond 90.
fn toward(degrees: f32) -> Vec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    vec3(sin, 0.0, cos)
}

/// What `eval()` returns for the two directions.
fn eval(bsdf: &dyn Bsdf, wo: Vec3, wi: Vec3) -> Vec3 {
    bsdf.eval(&SurfaceInteraction {
        t: 1.0,
        p: Vec3::ZERO,
        uv: Vec2::ZERO,
        ng: Vec3::Z,
        frame_ns: Frame::from_normal(Vec3::Z),
        wo,
        wi,
        shape: 0,
        primitive: 0,
        epsilon: 1e-4,
    })
}

#[track_caller]
fn assert_near(found: Vec3, expected: Vec3) {
    let near = (found - expected).abs().max_element() < 1e-5;
    assert!(near, "expected {expected}, found {found}");
}

fn diffuse() -> DiffuseBsdf {
    DiffuseBsdf::new(&Material::diffuse(vec3(0.2, 0.5, 0.8)))
}

fn phong(exponent: f32) -> PhongBsdf {
    PhongBsdf::new(&Material::phong(vec3(0.3, 0.2, 0.1), vec3(0.2, 0.3, 0.4), exponent))
}

#[test]
fn diffuse_depends_on_the_light_alone() {
    let expected = vec3(0.031831, 0.079577, 0.127324);
    assert_near(eval(&diffuse(), toward(0.0), toward(60.0)), expected);
    assert_near(eval(&diffuse(), toward(-75.0), toward(60.0)), expected);
}

#[test]
fn diffuse_is_black_from_behind() {
    assert_near(eval(&diffuse(), toward(120.0), toward(60.0)), Vec3::ZERO);
    assert_near(eval(&diffuse(), toward(60.0), toward(120.0)), Vec3::ZERO);
}

#[test]
fn phong_peaks_in_the_mirror_direction() {
    let expected = vec3(0.306909, 0.409211, 0.511514);
    assert_near(eval(&phong(10.0), toward(-50.0), toward(50.0)), expected);
}

#[test]
fn phong_falls_off_away_from_the_mirror_direction() {
    // Alpha is 20 degrees.
    let expected = vec3(0.230240, 0.284400, 0.338560);
    assert_near(eval(&phong(10.0), toward(-20.0), toward(40.0)), expected);
}

#[test]
fn phong_is_diffuse_alone_where_alpha_exceeds_a_right_angle() {
    let expected = vec3(0.047746, 0.031831, 0.015915);
    assert_near(eval(&phong(9.8), toward(60.0), toward(60.0)), expected);
}

#[test]
fn phong_conserves_energy() {
    // Kd + Ks is 1.6 in red, so the energy scale darkens all of it.
    let albedo = vec3(0.8, 0.4, 0.2);
    let bsdf = PhongBsdf::new(&Material::phong(albedo, albedo, 10.0));
    assert_near(eval(&bsdf, toward(-60.0), toward(60.0)), vec3(0.551472, 0.275736, 0.137868));
}

#[test]
fn phong_is_black_from_behind() {
    assert_near(eval(&phong(10.0), toward(120.0), toward(60.0)), Vec3::ZERO);
    assert_near(eval(&phong(10.0), toward(60.0), toward(120.0)), Vec3::ZERO);
}
