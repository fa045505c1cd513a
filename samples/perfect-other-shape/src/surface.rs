//! What a surface does with light: one type for both models, in world space and double precision.

use std::f64::consts::PI;

use basecode::{Bsdf, Material, MaterialModel, SurfaceInteraction, Texture, Vec3};

pub struct Surface {
    kd: Texture,
    /// None for diffuse materials.
    gloss: Option<Gloss>,
}

struct Gloss {
    ks: Texture,
    n: f64,
    /// Of both terms.
    scale: f64,
}

impl Surface {
    pub fn new(material: &Material) -> Self {
        let gloss = (material.model == MaterialModel::Phong).then(|| Gloss {
            ks: material.specular.clone(),
            n: material.exponent.into(),
            scale: material.energy_scale().into(),
        });
        Surface { kd: material.diffuse.clone(), gloss }
    }
}

impl Bsdf for Surface {
    fn eval(&self, i: &SurfaceInteraction) -> Vec3 {
        let normal = i.frame_ns.n.as_dvec3();
        let viewer = i.frame_ns.to_world(i.wo).as_dvec3();
        let light = i.frame_ns.to_world(i.wi).as_dvec3();
        let cos_light = normal.dot(light);
        if normal.dot(viewer).min(cos_light) <= 0.0 {
            return Vec3::ZERO;
        }
        let kd = self.kd.eval(i).as_dvec3();
        let value = match &self.gloss {
            None => kd / PI,
            Some(gloss) => {
                let mirrored = 2.0 * cos_light * normal - light;
                let lobe = mirrored.dot(viewer).max(0.0).powf(gloss.n);
                let ks = gloss.ks.eval(i).as_dvec3();
                gloss.scale / PI * (kd + ks * (0.5 * gloss.n + 1.0) * lobe)
            }
        };
        (value * cos_light).as_vec3()
    }
}
