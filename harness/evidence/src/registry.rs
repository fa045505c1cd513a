//! Every check and every rule by name. `info.rs` says what each check asks, what its error means and where its bound
//! lies. `sources.rs` names the files that ask and judge it.
//!
//! `umbra explain`, the list in `docs/evidence.md` and the reports read these entries. ARCHITECTURE.md says what a new
//! check needs.

mod info;
mod sources;

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use info::{CheckInfo, IMAGE_RULES};
pub use sources::CheckSources;

/// Names less alike than this (Jaro-Winkler, 1 for the same) are no slip of each other.
const ALIKE: f64 = 0.85;

/// Defines an enum with a name in text for each variant: `ALL`, `name`, `FromStr`, `Display`, serde.
macro_rules! named {
    ($(#[$doc:meta])* $type:ident, $what:literal, $($(#[$entry:meta])* $variant:ident = $name:literal,)+) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
        #[serde(try_from = "String", into = "&'static str")]
        pub enum $type {
            $($(#[$entry])* $variant,)+
        }

        impl $type {
            /// All of them, in the order of the docs.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// The name in text.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)+
                }
            }
        }

        impl FromStr for $type {
            type Err = String;

            fn from_str(text: &str) -> Result<Self, String> {
                let found = Self::ALL.iter().copied().find(|one| one.name() == text);
                found.ok_or_else(|| {
                    let alike = |one: &Self| strsim::jaro_winkler(one.name(), text);
                    let nearest = Self::ALL.iter().max_by(|a, b| alike(a).total_cmp(&alike(b)));
                    let missing = format!("there is no {} \"{text}\"", $what);
                    match nearest.filter(|one| alike(one) >= ALIKE) {
                        Some(nearest) => format!("{missing}; did you mean \"{nearest}\"?"),
                        None => missing,
                    }
                })
            }
        }

        impl TryFrom<String> for $type {
            type Error = String;

            fn try_from(text: String) -> Result<Self, String> {
                text.parse()
            }
        }

        impl From<$type> for &'static str {
            fn from(one: $type) -> Self {
                one.name()
            }
        }

        impl fmt::Display for $type {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(self.name())
            }
        }
    };
}

named! {
    /// A rule that can fail a check: a bound on one measured value.
    RuleId, "rule",
    /// BSDF values at directions over both hemispheres.
    BsdfValue = "bsdf.value",
    /// The same, for the BSDF of a textured surface.
    BsdfTextured = "bsdf.textured",
    /// Radiance along lit rays.
    RaysLit = "rays.lit",
    /// Radiance along rays that must be black.
    RaysBlack = "rays.black",
    /// Radiance against the renderer's own BSDF.
    RaysMaterial = "rays.material",
    /// Lit rays that lose light.
    ShadowLit = "shadow.lit",
    /// Shadowed rays that keep light.
    ShadowDark = "shadow.dark",
    /// One sample per pixel against the integrator's answers.
    LoopAgreement = "loop.agreement",
    /// Pixels of several samples against the integrator's answers.
    LoopPixels = "loop.pixels",
    /// Mean square error on edges.
    LoopEdges = "loop.edges",
    /// Mean signed error on edges.
    LoopEdgeBias = "loop.edge_bias",
    /// No pixel is far from what all rays through it and beside it answer.
    LoopStray = "loop.stray",
    /// Width and height.
    ImageSize = "image.size",
    /// Pixels that are not finite.
    ImageNonFinite = "image.non_finite",
    /// Pixels below zero.
    ImageNegative = "image.negative",
    /// Pixels away from edges.
    ImageInterior = "image.interior",
    /// Adjacent failing pixels.
    ImageBlob = "image.blob",
    /// Pixels on edges.
    ImageEdge = "image.edge",
    /// The mean of a region.
    ImageBias = "image.bias",
    /// The uniform `camera_position`.
    PassCameraPosition = "pass.camera_position",
    /// The uniform `light_position`.
    PassLightPosition = "pass.light_position",
    /// The uniform `light_intensity`.
    PassLightIntensity = "pass.light_intensity",
    /// The uniform `rho_d`.
    PassRhoD = "pass.rho_d",
    /// The uniform `rho_s`.
    PassRhoS = "pass.rho_s",
    /// The uniform `exponent`.
    PassExponent = "pass.exponent",
    /// Surfaces lie where they should on the film.
    PassPlace = "pass.place",
    /// The position that the vertex stage forwards.
    VertexPosition = "vertex.position",
    /// The normal that the vertex stage forwards.
    VertexNormal = "vertex.normal",
    /// Where the vertex stage puts a triangle on the film.
    VertexClip = "vertex.clip",
    /// Lit pixels that the shadow map darkens.
    BonusLit = "bonus.lit",
    /// Shadowed pixels that it leaves lit.
    BonusDark = "bonus.dark",
}

named! {
    /// A check: one question that a submission is asked, once or on each scene.
    CheckId, "check",
    /// 1.1.
    BsdfDiffuse = "bsdf.diffuse",
    /// 1.2.
    BsdfPhong = "bsdf.phong",
    /// 1.3: light along rays.
    RadianceLit = "radiance.lit",
    /// 1.3: the BSDF at the hit point.
    RadianceMaterial = "radiance.material",
    /// 1.3: the render loop at one sample.
    LoopAgreement = "loop.agreement",
    /// 1.3: the render loop at several samples.
    LoopSamples = "loop.samples",
    /// 1.4.
    ShadowRays = "shadow.rays",
    /// The offline path end to end.
    ImageOffline = "image.offline",
    /// 2.1.
    PassUniforms = "pass.uniforms",
    /// 2.2.
    StageVertex = "stage.vertex",
    /// 2.3.
    StageDiffuse = "stage.diffuse",
    /// 2.4.
    StagePhong = "stage.phong",
    /// The realtime path end to end.
    ImageRealtime = "image.realtime",
    /// The fallback of 2.1 and 2.2.
    ImageRealtimeCoverage = "image.realtime.coverage",
    /// The fallback of 2.3.
    ImageRealtimeDiffuse = "image.realtime.diffuse",
    /// The fallback of 2.4.
    ImageRealtimePhong = "image.realtime.phong",
    /// 2.5, on the scene that the student chose.
    BonusImage = "bonus.image",
    /// 2.5, on a scene that everybody is asked.
    BonusProbe = "bonus.probe",
    /// 2.5: shadows where none were asked for.
    BonusDefault = "bonus.default",
    /// The archive's tree.
    SubmissionTree = "submission.tree",
    /// The archive's `config.json`.
    SubmissionConfig = "submission.config",
    /// One student number, two names.
    SubmissionNumber = "submission.number",
    /// Source that is another submission's, too.
    SubmissionSimilarity = "submission.likeness",
    /// The build.
    SubmissionBuild = "submission.build",
    /// Files replaced by the template's.
    SubmissionReplaced = "submission.replaced",
    /// An environment failure.
    SubmissionJudged = "submission.judged",
    /// Pixels uploaded by the CPU.
    SubmissionUploads = "submission.uploads",
    /// Frames without vertices.
    SubmissionNoVertices = "submission.no_vertices",
    /// The budget of time.
    SubmissionBudget = "submission.budget",
    /// Too much output.
    SubmissionOutput = "submission.output",
    /// A bug of Umbra's.
    SubmissionInternalError = "submission.internal_error",
    /// Sampler: threads.
    SamplerThreads = "sampler.threads",
    /// Sampler: rows.
    SamplerRows = "sampler.rows",
    /// Sampler: seed.
    SamplerSeed = "sampler.seed",
    /// Physics of 1.1.
    BsdfDiffusePhysical = "bsdf.diffuse.physical",
    /// Physics of 1.2.
    BsdfPhongPhysical = "bsdf.phong.physical",
    /// A submitted offline image as a whole.
    SubmittedOffline = "submitted.offline",
    /// Its lit pixels.
    SubmittedOfflineLit = "submitted.offline.lit",
    /// Its shadowed pixels.
    SubmittedOfflineShadowed = "submitted.offline.shadowed",
    /// Its diffuse pixels.
    SubmittedOfflineDiffuse = "submitted.offline.diffuse",
    /// Its Phong pixels.
    SubmittedOfflinePhong = "submitted.offline.phong",
    /// A submitted realtime image as a whole.
    SubmittedRealtimeAll = "submitted.realtime.all",
    /// Its diffuse pixels.
    SubmittedRealtimeDiffuse = "submitted.realtime.diffuse",
    /// Its Phong pixels.
    SubmittedRealtimePhong = "submitted.realtime.phong",
    /// Whether the code draws it.
    SubmittedOrigin = "submitted.origin",
    /// Whether it shows its scene.
    SubmittedScene = "submitted.scene",
    /// Its noise.
    SubmittedNoise = "submitted.noise",
    /// Whether it is a published image.
    SubmittedCopied = "submitted.copied",
    /// Whether its noise follows from the student's seed.
    SubmittedSeed = "submitted.seed",
    /// Whether another submission holds it.
    SubmittedShared = "submitted.shared",
}
