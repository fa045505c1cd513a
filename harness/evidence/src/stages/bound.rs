//! The values that a render pass binds.

use basecode::{Camera, MaterialModel, Scene, Vec3};

use crate::RuleId;

/// A uniform that a render pass must set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoundValue {
    /// `frame.camera_position`.
    CameraPosition,
    /// `frame.light_position`.
    LightPosition,
    /// `frame.light_intensity`.
    LightIntensity,
    /// `material.rho_d`.
    RhoD,
    /// `material.rho_s`: Phong materials, and that none reaches a mirror.
    RhoS,
    /// `material.exponent`, Phong materials only.
    Exponent,
}

impl BoundValue {
    /// All of them, in the order of the contract.
    pub const ALL: [Self; 6] = [
        Self::CameraPosition,
        Self::LightPosition,
        Self::LightIntensity,
        Self::RhoD,
        Self::RhoS,
        Self::Exponent,
    ];

    /// The uniform's name in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::CameraPosition => "frame.camera_position",
            Self::LightPosition => "frame.light_position",
            Self::LightIntensity => "frame.light_intensity",
            Self::RhoD => "material.rho_d",
            Self::RhoS => "material.rho_s",
            Self::Exponent => "material.exponent",
        }
    }

    /// The rule that it is judged by.
    pub fn rule(self) -> RuleId {
        match self {
            Self::CameraPosition => RuleId::PassCameraPosition,
            Self::LightPosition => RuleId::PassLightPosition,
            Self::LightIntensity => RuleId::PassLightIntensity,
            Self::RhoD => RuleId::PassRhoD,
            Self::RhoS => RuleId::PassRhoS,
            Self::Exponent => RuleId::PassExponent,
        }
    }

    /// A fragment stage that writes the value; as `phong.fs` with `model` 1, as `diffuse.fs` with 0.
    /// The blue channel of scalars tells which of the two drew.
    pub fn stage(self, phong: bool) -> String {
        let value = match self {
            Self::Exponent => format!("vec3f(material.exponent.x, 0.0, {}.0)", u8::from(phong)),
            // As a shader that has no specular term: what is no Phong material shows none.
            Self::RhoS if !phong => "vec3f(0.0)".to_owned(),
            _ => format!("{}.xyz", self.name()),
        };
        let contract = include_str!("../shaders/contract.wgsl");
        format!(
            "{contract}\n@fragment\nfn fs_main(@location(0) p: vec3f, @location(1) n: vec3f) -> @location(0) vec4f {{\n    \
             return vec4f({value}, 1.0);\n}}\n"
        )
    }

    /// What a right pass binds for a shape; nothing where the contract leaves it open.
    pub fn expected(self, scene: &Scene, camera: &Camera, shape: usize) -> Option<Vec3> {
        let phong = scene.material_of(shape).model == MaterialModel::Phong;
        match self {
            Self::CameraPosition => Some(camera.eye()),
            Self::LightPosition => Some(scene.first_light_position()),
            Self::LightIntensity => Some(scene.first_light_intensity()),
            Self::RhoD | Self::RhoS | Self::Exponent => self.bound(scene, shape, phong),
        }
    }

    /// What shows of the material of a shape that is drawn by the Phong pipeline, or by the diffuse one.
    pub(super) fn bound(self, scene: &Scene, shape: usize, phong_draws: bool) -> Option<Vec3> {
        let material = scene.material_of(shape);
        let scale = material.energy_scale();
        match self {
            Self::RhoD => Some(scale * material.diffuse.average()),
            // A mirror has no specular term, whoever draws it.
            Self::RhoS if material.model == MaterialModel::Mirror => Some(Vec3::ZERO),
            Self::RhoS if phong_draws => Some(scale * material.specular.average()),
            // Blue tells the pipeline apart: a diffuse material must be drawn by `diffuse.fs`.
            Self::Exponent if phong_draws => Some(Vec3::new(material.exponent, 0.0, 1.0)),
            _ => None,
        }
    }
}
