//! Mistakes of the render pass: what it forgets to set, to choose or to draw.

use basecode::gpu::{FrameUniforms, Gpu, MaterialUniforms, Stage, Uniform};
use basecode::{Material, MaterialModel, Result, Scene, Texture, Vec2, Vec3, Vec4};

use super::{Mistake as M, Mistakes};
use crate::renderpasses::{DIFFUSE_FS, Object, PHONG_FS, SIMPLE_VS, SimplePass};

/// Spoils a pass that was made right.
///
/// # Errors
/// When a mistake of a shader no longer fits its text.
pub fn spoil(mistakes: &Mistakes, gpu: &Gpu, scene: &Scene, pass: &mut SimplePass) -> Result<()> {
    if mistakes.none() {
        return Ok(());
    }
    let has = |mistake| mistakes.has(mistake);
    if has(M::HalfPixel) {
        pass.viewport_shift = 0.5;
    }
    if has(M::CameraOld) {
        pass.last_frame = Some(FrameUniforms::new(&scene.camera(1, 1)?));
    }
    spoil_light(mistakes, pass);
    let pipeline = |fs: Stage<'static>| {
        let (vs, text) = (mistakes.text(SIMPLE_VS)?, mistakes.text(fs)?);
        Ok::<_, basecode::Error>(
            gpu.pipeline(Stage { text: &vs, ..SIMPLE_VS }, Stage { text: &text, ..fs }),
        )
    };
    if has(M::AlwaysDiffuse) || has(M::PipelinesSwapped) {
        pass.pipelines.phong = pipeline(DIFFUSE_FS)?;
    }
    if has(M::PipelinesSwapped) {
        pass.pipelines.diffuse = pipeline(PHONG_FS)?;
    }
    spoil_objects(mistakes, gpu, scene, pass);
    Ok(())
}

fn spoil_light(mistakes: &Mistakes, pass: &mut SimplePass) {
    let has = |mistake| mistakes.has(mistake);
    if has(M::LightPositionUnset) {
        pass.light_position = Vec3::ZERO;
    }
    if has(M::LightIntensityUnset) {
        pass.light_intensity = Vec3::ZERO;
    }
    if has(M::PassRedOnly) {
        pass.light_intensity = Vec3::X * pass.light_intensity.x;
    }
    if has(M::PassOverFourPi) {
        pass.light_intensity /= 4.0 * std::f32::consts::PI;
    }
}

/// What the frame's uniforms hold in the end.
pub fn spoil_frame(mistakes: &Mistakes, frame: &mut FrameUniforms) {
    if mistakes.has(M::PassLightAtCamera) {
        frame.light_position = frame.camera_position;
    }
    if mistakes.has(M::CameraUnset) {
        frame.camera_position = Vec4::ZERO;
    }
}

fn spoil_objects(mistakes: &Mistakes, gpu: &Gpu, scene: &Scene, pass: &mut SimplePass) {
    let has = |mistake| mistakes.has(mistake);
    let visible = |object: &Object| !object.material.is_emitter();
    let materials: Vec<Material> = pass
        .objects
        .iter()
        .filter(|object| visible(object))
        .map(|object| object.material.clone())
        .collect();
    let own = pass.objects.iter_mut().filter(|object| visible(object));
    for (index, object) in own.enumerate() {
        let material = match () {
            () if has(M::FirstMaterialForAll) => &materials[0],
            () if has(M::PassMaterialOfIndex) => &scene.materials()[index],
            () if has(M::PreviousMaterial) => &materials[index.saturating_sub(1)],
            () => &materials[index],
        };
        object.surface = Uniform::material(gpu, &uniforms(mistakes, material));
        if has(M::MirrorPhong) && object.material.model == MaterialModel::Mirror {
            object.material.model = MaterialModel::Phong;
        }
    }
    if has(M::FirstObjectMissing)
        && let Some(first) = pass.objects.iter().position(visible)
    {
        pass.objects.remove(first);
    }
    if has(M::LastObjectMissing)
        && let Some(last) = pass.objects.iter().rposition(visible)
    {
        pass.objects.remove(last);
    }
    if has(M::HalfOfTriangles) {
        for object in &mut pass.objects {
            object.mesh.index_count = object.mesh.index_count / 6 * 3;
        }
    }
    if has(M::PassBlack) {
        pass.objects.clear();
    }
    if has(M::ObjectsReversed) {
        pass.objects.reverse();
    }
}

fn uniforms(mistakes: &Mistakes, material: &Material) -> MaterialUniforms {
    let has = |mistake| mistakes.has(mistake);
    let scale = match material.energy_scale() {
        _ if has(M::RhoNotScaled) => 1.0,
        scale if has(M::PassScaleTwice) => scale * scale,
        scale => scale,
    };
    let color = |texture: &Texture| {
        if has(M::PassFirstTexel) { texture.lookup(Vec2::ZERO) } else { texture.average() }
    };
    let set = |unset, value: Vec3| if has(unset) { Vec3::ZERO } else { scale * value };
    let mut rho_d = set(M::RhoDUnset, color(&material.diffuse));
    let mut rho_s = set(M::RhoSUnset, color(&material.specular));
    if has(M::RhoSwapped) {
        (rho_d, rho_s) = (rho_s, rho_d);
    }
    if has(M::RhoGrey) {
        (rho_d, rho_s) = (Vec3::splat(rho_d.x), Vec3::splat(rho_s.x));
    }
    let exponent = match material.exponent {
        _ if has(M::ExponentUnset) => 0.0,
        n if has(M::PassExponentTruncated) => n.trunc(),
        n => n,
    };
    MaterialUniforms::new(rho_d, rho_s, exponent)
}
