//! Mistakes in direct illumination: the steps of `crate::integrators::simple`, with switches.

use std::f32::consts::PI;
use std::sync::OnceLock;

use basecode::{
    Bsdf, Frame, INV_PI, Integrator, MaterialModel, Ray, Sampler, Scene, Shape, SurfaceInteraction,
    Vec3,
};

use super::shadow::visibility;
use super::{Mistake as M, Mistakes};

pub struct Mistaken {
    pub mistakes: Mistakes,
    pub shadows: bool,
    /// Made for the first surface, if it makes them itself.
    pub own_bsdfs: OnceLock<Vec<Option<Box<dyn Bsdf>>>>,
}

impl Integrator for Mistaken {
    fn radiance(&self, scene: &Scene, ray: &Ray, _sampler: &Sampler) -> Vec3 {
        let has = |mistake| self.mistakes.has(mistake);
        let Some(mut i) = scene.intersect(ray) else {
            return match () {
                () if has(M::BackgroundGrey) => Vec3::splat(0.1),
                () if has(M::BackgroundWhite) => Vec3::ONE,
                () => Vec3::ZERO,
            };
        };
        let to_light = self.to_light(scene, ray, &i);
        let distance = if has(M::ShadingInF64) {
            to_light.as_dvec3().length() as f32
        } else {
            to_light.length()
        };
        self.turn(&mut i, ray, to_light);
        let cos_i = Frame::cos_theta(i.wi);
        let cos_o = Frame::cos_theta(i.wo);
        let mut visible = 1.0;
        if (self.shadows != has(M::SwitchInverted)) && !has(M::NoShadows) {
            // Whatever the BSDF is told, the shadow ray leads from the surface to the light.
            let way = self.light_position(scene) - i.p;
            let far = way.length();
            visible = visibility(&self.mistakes, scene, ray, &mut i, (way / far, far));
        }
        if visible == 0.0 && has(M::ShadowColor) {
            return Vec3::splat(0.05);
        }
        if visible == 0.0 && has(M::ShadowAlbedo) {
            return scene.material_of(i.shape).diffuse.average();
        }
        if visible == 0.0 || has(M::IntegratorBlack) {
            return Vec3::ZERO;
        }
        if has(M::TestsInIntegrator) && (cos_i <= 0.0 || cos_o <= 0.0) {
            return Vec3::ZERO;
        }
        let distance = match () {
            () if has(M::RayDistance) => i.t,
            () if has(M::DistanceWithoutZ) => to_light.with_z(0.0).length(),
            () if has(M::DistanceFromOrigin) => self.light_position(scene).length(),
            () => distance,
        };
        let incident = self.incident(scene, distance);
        let mut radiance = visible * self.reflected(scene, &i) * incident;
        if has(M::TwoCosines) {
            radiance *= cos_i;
        }
        if has(M::LightCosO) {
            radiance *= cos_o;
        }
        if has(M::CosineInIntegrator) {
            // Where wi is as long as the way to the light, so is its cosine.
            radiance *= (to_light / distance).dot(i.frame_ns.n).max(0.0);
        }
        if has(M::PiInIntegrator) {
            radiance *= INV_PI;
        }
        radiance
    }
}

impl Mistaken {
    fn to_light(&self, scene: &Scene, ray: &Ray, i: &SurfaceInteraction) -> Vec3 {
        let light = self.light_position(scene);
        match () {
            () if self.mistakes.has(M::FromOrigin) => light,
            () if self.mistakes.has(M::LightPlusPoint) => light + i.p,
            () if self.mistakes.has(M::FromCamera) => light - ray.origin,
            () => light - i.p,
        }
    }

    /// Sets the frame and the directions in it.
    fn turn(&self, i: &mut SurfaceInteraction, ray: &Ray, to_light: Vec3) {
        let has = |mistake| self.mistakes.has(mistake);
        let direction = to_light.normalize();
        if has(M::GeometricNormal) {
            i.frame_ns = Frame::from_normal(i.ng);
        }
        if has(M::NormalNegated) {
            i.frame_ns = Frame::from_normal(-i.frame_ns.n);
        }
        if has(M::OtherTangents) {
            let Frame { s, t, n } = i.frame_ns;
            i.frame_ns = Frame { s: 0.6 * s + 0.8 * t, t: 0.6 * t - 0.8 * s, n };
        }
        i.wo = i.frame_ns.to_local(-ray.direction);
        i.wi = i.frame_ns.to_local(direction);
        if has(M::WoWorld) {
            i.wo = -ray.direction;
        }
        let long = has(M::WiNotNormalised) || has(M::WiUnnormalised);
        let wi = if long { to_light } else { direction };
        i.wi = if has(M::WorldWi) { wi } else { i.frame_ns.to_local(wi) };
        if has(M::DirectionsInWorld) {
            (i.wi, i.wo) = (direction, -ray.direction);
        }
        if has(M::WiToWorld) {
            i.wi = i.frame_ns.to_world(wi);
        }
        if has(M::WoLocalTwice) {
            i.wo = i.frame_ns.to_local(i.wo);
        }
        if has(M::WiAxesSwapped) {
            i.wi = Vec3::new(i.wi.y, i.wi.x, i.wi.z);
        }
        if has(M::WiReversed) || has(M::WiFromLight) {
            i.wi = -i.wi;
        }
        if has(M::WiIsWo) {
            i.wi = i.wo;
        }
    }

    /// What the surface makes of the light.
    fn reflected(&self, scene: &Scene, i: &SurfaceInteraction) -> Vec3 {
        let has = |mistake| self.mistakes.has(mistake);
        if has(M::NoBsdf) {
            return Vec3::ONE;
        }
        if has(M::OwnBsdfs) {
            return match scene.material_of(i.shape).model {
                MaterialModel::Mirror => Vec3::ZERO,
                _ => self.own_bsdf(scene, i).map_or(Vec3::ZERO, |bsdf| bsdf.eval(i)),
            };
        }
        let mut asked = *i;
        if has(M::FirstMaterial) {
            asked.shape = 0;
        }
        if has(M::NextMaterial) {
            asked.shape = (i.shape + 1) % scene.shapes().len();
        }
        if has(M::MaterialOfIndex) {
            let of_index = scene.shapes().iter().position(|shape| shape.material == i.shape);
            asked.shape = of_index.unwrap_or(i.shape);
        }
        scene.bsdf(&asked).eval(i)
    }

    /// A BSDF of its own making.
    fn own_bsdf(&self, scene: &Scene, i: &SurfaceInteraction) -> Option<&dyn Bsdf> {
        let make =
            || scene.materials().iter().map(|material| self.mistakes.bsdf(material)).collect();
        self.own_bsdfs.get_or_init(make)[scene.shapes()[i.shape].material].as_deref()
    }

    fn light_position(&self, scene: &Scene) -> Vec3 {
        let mut shapes = scene.shapes().iter().enumerate();
        let emits = |(index, _): &(usize, &Shape)| scene.material_of(*index).is_emitter();
        match shapes.find(emits) {
            Some((_, light)) if self.mistakes.has(M::FirstVertex) => light.positions[0],
            Some((_, light)) if self.mistakes.has(M::Centroid) => {
                // Corners that several triangles share count once.
                let mut corners: Vec<Vec3> = Vec::new();
                for corner in light.triangles.iter().flatten() {
                    let corner = light.positions[*corner as usize];
                    if !corners.contains(&corner) {
                        corners.push(corner);
                    }
                }
                corners.iter().sum::<Vec3>() / corners.len() as f32
            }
            _ if self.mistakes.has(M::LightTooHigh) => scene.first_light_position() + 0.1 * Vec3::Y,
            _ => scene.first_light_position(),
        }
    }

    /// The light that arrives from a distance.
    fn incident(&self, scene: &Scene, distance: f32) -> Vec3 {
        let has = |mistake| self.mistakes.has(mistake);
        let squared = distance * distance;
        let falloff = match () {
            () if has(M::NoFalloff) => 1.0,
            () if has(M::OverR) => distance,
            () if has(M::OverRootOfR) => distance.sqrt(),
            () if has(M::OverRCubed) => distance * squared,
            () if has(M::OverRFourth) => squared * squared,
            () if has(M::Softened) => 1.0 + squared,
            () if has(M::GameAttenuation) => 1.0 + 0.09 * distance + 0.032 * squared,
            () => squared,
        };
        let incident = self.light_intensity(scene) / falloff;
        if has(M::IncidentClamped) { incident.min(Vec3::ONE) } else { incident }
    }

    fn light_intensity(&self, scene: &Scene) -> Vec3 {
        let has = |mistake| self.mistakes.has(mistake);
        let intensity = scene.first_light_intensity();
        match () {
            () if has(M::TimesFourPi) => 4.0 * PI * intensity,
            () if has(M::OverFourPi) => intensity / (4.0 * PI),
            () if has(M::TimesPi) => PI * intensity,
            () if has(M::GreyIntensity) => Vec3::splat(intensity.x),
            () if has(M::RedOnly) => Vec3::X * intensity.x,
            () if has(M::IntensitySwapped) => super::bsdfs::blue_first(intensity),
            () => intensity,
        }
    }
}
