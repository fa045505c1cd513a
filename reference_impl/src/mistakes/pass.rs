//! Mistakes of the render pass: what it forgets to set, to choose or to draw.

use basecode::gpu::{Gpu, MaterialUniforms, Stage, Uniform};
use basecode::{Result, Vec3};

use super::{Mistake as M, Mistakes};
use crate::renderpasses::{DIFFUSE_FS, Object, SIMPLE_VS, SimplePass};

/// Spoils a pass that was made right.
///
/// # Errors
/// When a mistake of a shader no longer fits its text.
pub fn spoil(mistakes: &Mistakes, gpu: &Gpu, pass: &mut SimplePass) -> Result<()> {
    if mistakes.none() {
        return Ok(());
    }
    let has = |mistake| mistakes.has(mistake);
    pass.camera_unset = has(M::CameraUnset);
    if has(M::HalfPixel) {
        pass.viewport_shift = 0.5;
    }
    if has(M::LightPositionUnset) {
        pass.light_position = Vec3::ZERO;
    }
    if has(M::LightIntensityUnset) {
        pass.light_intensity = Vec3::ZERO;
    }
    if has(M::AlwaysDiffuse) {
        let (vs, fs) = (mistakes.text(SIMPLE_VS)?, mistakes.text(DIFFUSE_FS)?);
        let vs = Stage { text: &vs, ..SIMPLE_VS };
        pass.pipelines.phong = gpu.pipeline(vs, Stage { text: &fs, ..DIFFUSE_FS });
    }
    let visible = |object: &Object| !object.material.is_emitter();
    let first = pass.objects.iter().find(|object| visible(object));
    let first = first.map(|object| object.material.clone());
    for object in pass.objects.iter_mut().filter(|object| visible(object)) {
        let material = match &first {
            Some(first) if has(M::FirstMaterialForAll) => first,
            _ => &object.material,
        };
        let scale = if has(M::RhoNotScaled) { 1.0 } else { material.energy_scale() };
        let set = |unset, value: Vec3| if has(unset) { Vec3::ZERO } else { scale * value };
        let exponent = if has(M::ExponentUnset) { 0.0 } else { material.exponent };
        let rho_d = set(M::RhoDUnset, material.diffuse.average());
        let rho_s = set(M::RhoSUnset, material.specular.average());
        object.surface = Uniform::material(gpu, &MaterialUniforms::new(rho_d, rho_s, exponent));
    }
    if has(M::LastObjectMissing)
        && let Some(last) = pass.objects.iter().rposition(visible)
    {
        pass.objects.remove(last);
    }
    Ok(())
}
