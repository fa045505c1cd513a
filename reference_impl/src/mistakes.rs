//! Known mistakes, made on purpose: `mistake=NAME` in the options of a scene, several separated by
//! commas. They prove the grader and feed the diagnosis; without one the plain renderer runs.
//!
//! The plain renderer stays plain: what can go wrong in a BSDF, the integrator or the render loop
//! is written down once more here, with a switch at every place where students slip. A mistake of
//! a shader is another text in one of its lines. `harness/data/mistakes.json` says of every name
//! what it looks like and which parts it belongs to.

mod bsdfs;
mod integrator;
mod pass;
mod render;
mod stages;

use std::borrow::Cow;

use basecode::gpu::Stage;
use basecode::{Bsdf, Error, Film, Integrator, Material, MaterialModel, RenderJob, Result, Scene};

pub use pass::spoil as spoil_pass;

/// What was asked for: nothing, nearly always.
#[derive(Clone, Debug, Default)]
pub struct Mistakes {
    made: Vec<Mistake>,
    stages: Vec<&'static str>,
}

macro_rules! mistakes {
    ($($variant:ident = $name:literal,)*) => {
        /// One mistake outside the shaders.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs)] // `harness/data/mistakes.json` describes them.
        pub enum Mistake { $($variant,)* }

        impl Mistake {
            /// All of them, with their names.
            const ALL: &'static [(Self, &'static str)] = &[$((Self::$variant, $name),)*];
        }
    };
}

mistakes! {
    DiffuseNoPi = "diffuse-no-pi",
    DiffusePiTwice = "diffuse-pi-twice",
    DiffusePiRounded = "diffuse-pi-rounded",
    DiffuseNoCosine = "diffuse-no-cosine",
    DiffuseAbsCosine = "diffuse-abs-cosine",
    DiffuseNoWoTest = "diffuse-no-wo-test",
    DiffuseNoWiTest = "diffuse-no-wi-test",
    DiffuseScaled = "diffuse-scaled",
    DiffuseTextureIgnored = "diffuse-texture-ignored",
    DiffuseChannelsSwapped = "diffuse-channels-swapped",
    PhongNoPi = "phong-no-pi",
    PhongNoCosine = "phong-no-cosine",
    PhongAbsCosine = "phong-abs-cosine",
    PhongNoWoTest = "phong-no-wo-test",
    PhongNoWiTest = "phong-no-wi-test",
    PhongBlinn = "phong-blinn",
    PhongReflectSign = "phong-reflect-sign",
    PhongReflectForgotten = "phong-reflect-forgotten",
    PhongUnnormalised = "phong-unnormalised",
    PhongNPlusOne = "phong-n-plus-1",
    PhongNOverTwoPi = "phong-n-over-2pi",
    PhongExponentPlusOne = "phong-exponent-plus-1",
    PhongPowBeforeClamp = "phong-pow-before-clamp",
    PhongNoClamp = "phong-no-clamp",
    PhongNoScale = "phong-no-scale",
    PhongScaleDiffuseOnly = "phong-scale-diffuse-only",
    PhongScaleSpecularOnly = "phong-scale-specular-only",
    PhongSpecularWithoutCosine = "phong-specular-without-cosine",
    PhongKdKsSwapped = "phong-kd-ks-swapped",
    PhongTextureIgnored = "phong-texture-ignored",
    PhongChannelsSwapped = "phong-channels-swapped",
    WorldWi = "frame-world-wi",
    GeometricNormal = "frame-geometric-normal",
    WiNotNormalised = "frame-wi-not-normalised",
    WiReversed = "frame-wi-reversed",
    TwoCosines = "light-two-cosines",
    NoFalloff = "light-no-falloff",
    OverR = "light-over-r",
    OverRCubed = "light-over-r-cubed",
    TimesFourPi = "light-times-4pi",
    OverFourPi = "light-over-4pi",
    FirstVertex = "light-first-vertex",
    Centroid = "light-vertex-mean",
    GreyIntensity = "light-grey",
    NoShadows = "shadow-none",
    ShadowInverted = "shadow-inverted",
    ShadowNoMaxT = "shadow-no-max-t",
    ShadowMaxTSquared = "shadow-max-t-r2",
    ShadowEpsilon = "shadow-epsilon",
    ShadowAcne = "shadow-acne",
    ShadowReversed = "shadow-reversed",
    ShadowHalf = "shadow-half",
    ShadowHitReused = "shadow-hit-reused",
    SameSeed = "sampler-same-seed",
    SharedSampler = "sampler-shared",
    PixelCorner = "loop-pixel-corner",
    JitterShifted = "loop-jitter-shifted",
    NotAveraged = "loop-not-averaged",
    FewerSamples = "loop-fewer-samples",
    BlackNotCounted = "loop-black-not-counted",
    FlippedRows = "film-flipped-rows",
    MirroredColumns = "film-mirrored-columns",
    Transposed = "film-transposed",
    Gamma = "film-gamma",
    Clamped = "film-clamped",
    LastPixelMissing = "film-last-pixel-missing",
    DebugMark = "film-debug-mark",
    Dithered = "film-dithered",
    HorizontalFov = "camera-horizontal-fov",
    CameraUnset = "pass-camera-unset",
    HalfPixel = "pass-half-pixel",
    LightPositionUnset = "pass-light-position-unset",
    LightIntensityUnset = "pass-light-intensity-unset",
    RhoDUnset = "pass-rho-d-unset",
    RhoSUnset = "pass-rho-s-unset",
    ExponentUnset = "pass-exponent-unset",
    FirstMaterialForAll = "pass-first-material-for-all",
    AlwaysDiffuse = "pass-always-diffuse",
    LastObjectMissing = "pass-last-object-missing",
    RhoNotScaled = "pass-rho-not-scaled",
    ShadowMapNone = "shadow-map-none",
    ShadowMapAlways = "shadow-map-always",
    ShadowMapHalf = "shadow-map-half",
}

impl Mistakes {
    /// Adds a mistake by its name.
    ///
    /// # Errors
    /// When there is none of this name.
    pub fn add(&mut self, name: &str) -> Result<()> {
        let code = Mistake::ALL.iter().find(|(_, known)| *known == name);
        let mut stages = stages::ALL.iter().chain(stages::HARMLESS);
        let stage = stages.find(|mistake| mistake.name == name);
        self.made.extend(code.map(|(mistake, _)| *mistake));
        self.stages.extend(stage.map(|mistake| mistake.name));
        if code.is_none() && stage.is_none() {
            return Err(Error::Argument(format!("unknown mistake \"{name}\"")));
        }
        Ok(())
    }

    /// Whether a mistake is to be made.
    pub fn has(&self, mistake: Mistake) -> bool {
        self.made.contains(&mistake)
    }

    /// Whether nothing is wrong outside the shaders.
    fn none(&self) -> bool {
        self.made.is_empty()
    }

    /// The text of a shader stage, with its mistakes.
    ///
    /// # Errors
    /// When a line that a mistake replaces is no longer there.
    pub fn text(&self, stage: Stage<'static>) -> Result<Cow<'static, str>> {
        stages::apply(stage.name, stage.text, &self.stages).map_err(Error::Argument)
    }

    /// The BSDF to take in the right one's place, if any.
    pub fn bsdf(&self, material: &Material) -> Option<Box<dyn Bsdf>> {
        if self.none() {
            return None;
        }
        Some(match material.model {
            MaterialModel::Diffuse => Box::new(bsdfs::Diffuse::new(self, material)),
            _ => Box::new(bsdfs::Phong::new(self, material)),
        })
    }

    /// The integrator to take in the right one's place, if any.
    pub fn integrator(&self, shadows: bool) -> Option<Box<dyn Integrator>> {
        let mistaken = || integrator::Mistaken { mistakes: self.clone(), shadows };
        (!self.none()).then(|| Box::new(mistaken()) as Box<dyn Integrator>)
    }

    /// Renders in the right loop's place; nothing when there is no need.
    pub fn render(
        &self,
        scene: &Scene,
        integrator: &dyn Integrator,
        job: &RenderJob,
        film: &mut Film,
    ) -> Option<Result<()>> {
        (!self.none()).then(|| render::render(self, scene, integrator, job, film))
    }
}

#[cfg(test)]
mod tests;
