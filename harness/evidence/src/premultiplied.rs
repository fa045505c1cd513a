//! Conventions of the realtime path: what a render pass may multiply into its uniforms, so that the
//! fragment stages leave it out.
//!
//! A pass that hands out intensity over pi to stages that do not divide by it is right. So pass and stages are also
//! judged with each such convention undone, if the pass and a fragment stage both keep it: one alone has made a
//! mistake. The rubric takes the result that earns most.

use std::f64::consts::{PI, TAU};

use basecode::{Image, Scene, Vec3};

use super::pixels::seen_by_shader;
use super::shading::Shading;
use super::stages::BoundValue;
use crate::expected::SurfaceBuffer;

/// A factor of a uniform: its name, and its value for a Phong exponent n.
#[derive(Clone, Copy, Debug)]
struct Factor {
    name: &'static str,
    of: fn(f64) -> f64,
}

const LIGHT: [Factor; 3] = [
    Factor { name: "", of: |_| 1.0 },
    Factor { name: "1/pi", of: |_| 1.0 / PI },
    Factor { name: "pi", of: |_| PI },
];
const DIFFUSE: [Factor; 2] =
    [Factor { name: "", of: |_| 1.0 }, Factor { name: "1/pi", of: |_| 1.0 / PI }];
const SPECULAR: [Factor; 5] = [
    Factor { name: "", of: |_| 1.0 },
    Factor { name: "1/pi", of: |_| 1.0 / PI },
    Factor { name: "1/(2 pi)", of: |_| 1.0 / TAU },
    Factor { name: "n + 2", of: |n| n + 2.0 },
    Factor { name: "(n + 2)/(2 pi)", of: |n| (n + 2.0) / TAU },
];

/// What a pass multiplies into light intensity, diffuse and specular albedo, and stages leave out.
#[derive(Clone, Copy, Debug)]
pub struct Premultiplied {
    light: Factor,
    diffuse: Factor,
    specular: Factor,
}

impl Premultiplied {
    /// All conventions but the contract's.
    pub fn all() -> Vec<Self> {
        let mut all = Vec::new();
        for light in LIGHT {
            for diffuse in DIFFUSE {
                for specular in SPECULAR {
                    all.push(Self { light, diffuse, specular });
                }
            }
        }
        all.remove(0);
        all
    }

    /// What it is, for reports.
    pub fn name(&self) -> String {
        let factors =
            [("light_intensity", self.light), ("rho_d", self.diffuse), ("rho_s", self.specular)];
        let factors = factors.iter().filter(|(_, factor)| !factor.name.is_empty());
        let factors: Vec<_> =
            factors.map(|(value, factor)| format!("{value} by {}", factor.name)).collect();
        format!("the pass multiplies {}, the stages leave it out", factors.join(" and "))
    }

    /// A frame that shows a bound value, as it would look without the convention.
    pub fn undone_bound(
        &self,
        scene: &Scene,
        surface: &SurfaceBuffer,
        bound: BoundValue,
        frame: &Image,
    ) -> Image {
        let factor = match bound {
            BoundValue::LightIntensity => self.light.of,
            BoundValue::RhoD => self.diffuse.of,
            BoundValue::RhoS => self.specular.of,
            _ => return frame.clone(),
        };
        let pixels = frame.pixels.iter().zip(&surface.pixels).map(|(pixel, (_, point))| {
            let exponent = point.as_ref().map(|point| scene.material_of(point.shape).exponent);
            *pixel / factor(f64::from(exponent.unwrap_or_default())) as f32
        });
        Image { pixels: pixels.collect(), ..*frame }
    }

    /// What a stage draws under a pass that keeps the contract, as it would be if the stage left
    /// nothing out.
    pub fn undone_stage(&self, scene: &Scene, surface: &SurfaceBuffer, image: &Image) -> Image {
        let Ok(camera) = scene.camera(surface.width, surface.height) else { return image.clone() };
        let pixels = image.pixels.iter().zip(&surface.pixels).map(|(pixel, (_, point))| {
            let Some(point) = point else { return *pixel };
            let shaded = seen_by_shader(scene, &camera, point);
            let (right, left) = (Shading::default(), self.left_to_stages());
            let n = f64::from(shaded.material.exponent);
            // The lobe's normalization depends on n; the factor is taken at this n.
            let left = Shading { factor: [left[0], left[1] / (self.specular.of)(n)], ..right };
            let (right, left) = (right.radiance(&shaded), left.radiance(&shaded));
            let ratio = |c: usize| if left[c] > 0.0 { right[c] / left[c] } else { 1.0 };
            *pixel * Vec3::from([0, 1, 2].map(|c| ratio(c) as f32))
        });
        Image { pixels: pixels.collect(), ..*image }
    }

    /// The factors of the two terms of a stage, but for the specular one's own.
    fn left_to_stages(&self) -> [f64; 2] {
        let light = (self.light.of)(0.0);
        [1.0 / (light * (self.diffuse.of)(0.0)), 1.0 / light]
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn names_tell_conventions_apart() {
        let all = Premultiplied::all();
        let names: BTreeSet<String> = all.iter().map(Premultiplied::name).collect();
        assert_eq!((all.len(), names.len()), (29, 29));
        let both = "the pass multiplies light_intensity by 1/pi and rho_s by n + 2, the stages leave it out";
        assert!(names.contains(both), "{names:?}");
    }
}
