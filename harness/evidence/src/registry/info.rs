//! What each check asks, what its error means and where its bound lies: the text of `docs/evidence.md`.

use schemars::JsonSchema;
use serde::Serialize;

use super::{CheckId, RuleId};

/// What is known about a check before any submission is judged.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct CheckInfo {
    /// What it asks.
    pub question: &'static str,
    /// What its error measures, in [0, 1]; empty where it is 0 or 1.
    pub error: &'static str,
    /// Up to where an answer is right, and why; empty where the answer is yes or no.
    pub bound: &'static str,
    /// The rules that can fail it; empty where the check itself is the rule.
    pub rules: &'static [RuleId],
}

/// The rules of a comparison of images, and more if some are named.
macro_rules! image_rules {
    ($($more:ident),*) => {
        &[
            RuleId::ImageSize,
            RuleId::ImageNonFinite,
            RuleId::ImageNegative,
            RuleId::ImageInterior,
            RuleId::ImageBlob,
            RuleId::ImageEdge,
            RuleId::ImageBias,
            $(RuleId::$more,)*
        ]
    };
}

/// The rules of a comparison of images.
pub const IMAGE_RULES: &[RuleId] = image_rules!();
/// Those, and the rules of visibility.
const BONUS: &[RuleId] = image_rules!(BonusLit, BonusDark);

impl CheckId {
    /// What is known about it.
    pub const fn info(self) -> CheckInfo {
        const fn info(
            question: &'static str,
            error: &'static str,
            bound: &'static str,
            rules: &'static [RuleId],
        ) -> CheckInfo {
            CheckInfo { question, error, bound, rules }
        }
        match self {
            Self::BsdfDiffuse => info(
                "Asks the diffuse BSDF by value, at directions over both hemispheres, for four albedos and \
                    for the BSDF of a textured surface.",
                "The sum of differences over the sum of expected values, of the worst material.",
                "Each value |a - b| <= (1e-4 + 1e-6 n) |b| + 1e-6 of the material's peak: room for f32 \
                    arithmetic in any order, and for what a power makes of its base's error. No direction \
                    may differ. Directions with |cos| < 1e-4 are not asked.",
                &[RuleId::BsdfValue, RuleId::BsdfTextured],
            ),
            Self::BsdfPhong => info(
                "Asks the Phong BSDF by value, with exponents 1, 2, 9.8, 30, 50, 101.5 and 500, for Kd + Ks \
                    below and above 1, and at directions around the lobe too.",
                "The sum of differences over the sum of expected values, of the worst material.",
                "As `bsdf.diffuse`.",
                &[RuleId::BsdfValue, RuleId::BsdfTextured],
            ),
            Self::RadianceLit => info(
                "Asks for unshadowed radiance along lit rays under four witness BSDFs: a constant, a \
                    function of wi, of wo, and of the angle between them. Rays that meet nothing, or a \
                    surface seen or lit from behind, must be black.",
                "The sum of differences over the sum of expected values, of the worst witness. Rays that are \
                    not black are a slip.",
                "A ray fails if it is off by more than 3e-3 relative (f32 positions and frames in any \
                    order). 0.2 % of the rays may fail, for seams that no mask knows.",
                &[RuleId::RaysLit, RuleId::RaysBlack],
            ),
            Self::RadianceMaterial => info(
                "Compares unshadowed radiance with the renderer's own BSDF where the ray ends, right or \
                    wrong, times I / r^2. This tests that the BSDF of the right surface is used. Judged \
                    where the light is right, on surfaces of one color.",
                "A slip.",
                "2 % of the value + 0.1 % of the mean, under any convention. 0.2 % of the rays may differ.",
                &[RuleId::RaysMaterial],
            ),
            Self::LoopAgreement => info(
                "Compares the render at 1 sample per pixel with the integrator's radiance along the pixels' \
                    center rays. This tests loop, film and camera.",
                "The sum of differences over the sum of radiance.",
                "A pixel away from edges fails if it is off by more than 3e-3 relative + 1e-5 of the largest \
                    value. 0.2 % may fail.",
                &[RuleId::LoopAgreement],
            ),
            Self::LoopSamples => info(
                "Renders at 16 samples per pixel, 63 pixels wide, without shadows. The result must be the \
                    average of the integrator's radiance along 16 stratified rays of each pixel, whether \
                    that radiance is right or wrong. This tests sum, count and spread on both axes. Random, \
                    stratified, Sobol, lattice and grid samples pass.",
                "The sum of differences over the sum of radiance. A fault on edges or stray pixels alone is \
                    a slip.",
                "Pixels: 4 standard errors, by the largest variance of the 3x3 around; 1 % + 4 pixels may \
                    exceed them. Edges, by direction: the mean square error, over the largest variance \
                    around, is at most 1.1 times that of independent samples. A right renderer has 0.4, \
                    samples that are all the same have 4. What a pixel's center column or row alone would leave \
                    on edges may be there to 0.4, and to 6 standard deviations. The mean error on edges may be 8 standard \
                    deviations. No pixel may be 5 % off where the rays around it vary by 3 % at most.",
                &[RuleId::LoopPixels, RuleId::LoopEdges, RuleId::LoopEdgeBias, RuleId::LoopStray],
            ),
            Self::ShadowRays => info(
                "Asks for radiance with shadows over radiance without, along lit and along shadowed rays. \
                    The witness BSDF is the same everywhere, below the surface too. The switch must not \
                    change the shading of lit rays.",
                "The fraction of wrong lit rays + the fraction of wrong shadowed rays, at most 1.",
                "Visibility within 0.02 of 1 or of 0, shading within 3e-3. 0.2 % of either kind may be \
                    wrong.",
                &[RuleId::ShadowLit, RuleId::ShadowDark],
            ),
            Self::ImageOffline => info(
                "Renders the scene's film at its samples per pixel, with the student's seed. A large film is \
                    rendered small first, and on one scene in full with a quarter of the samples. If it passes on \
                    every scene, 1.1 to 1.4 are earned in full.",
                "The sum of differences over the sum of expected values, away from edges.",
                "See section Images of docs/evidence.md.",
                IMAGE_RULES,
            ),
            Self::PassUniforms => info(
                "Draws the student's pass with Umbra's stages, which show camera position, light position \
                    and intensity, rho_d, rho_s, exponent and world position.",
                "The fraction of wrong pixels, all uniforms together. One wrong value is a slip, two are a \
                    concept. Another shape's material, an energy scale too many or too few, exchanged \
                    albedos and exchanged pipelines are a slip each, and so are misplaced surfaces.",
                "1e-4 of the largest component, because it travels as f32. 0.5 % of the pixels may differ \
                    (coverage along seams). Surfaces may be off by 0.04 pixels (median).",
                &[
                    RuleId::PassCameraPosition,
                    RuleId::PassLightPosition,
                    RuleId::PassLightIntensity,
                    RuleId::PassRhoD,
                    RuleId::PassRhoS,
                    RuleId::PassExponent,
                    RuleId::PassPlace,
                ],
            ),
            Self::StageVertex => info(
                "Draws the student's vertex stage in Umbra's pass: the world position and normal that it \
                    forwards, and where on the film they land. More frames, under other matrices, tell which \
                    matrix is missing, in the wrong order or on the wrong side, and whether w is 1.",
                "Position, normal and place on the film are priced apart and add up, each a slip or a \
                    concept.",
                "Position within 2e-3 of its distance, normal within 1e-2, for all but 0.5 % of the pixels. \
                    Pixels may be off by 0.04 pixels (median), because hardware snaps vertices to 1/256.",
                &[RuleId::VertexPosition, RuleId::VertexNormal, RuleId::VertexClip],
            ),
            Self::StageDiffuse => info(
                "Draws the student's diffuse fragment stage in Umbra's pass with Umbra's vertex stage, on \
                    diffuse materials.",
                "As `image.realtime`.",
                "As `image.realtime`.",
                IMAGE_RULES,
            ),
            Self::StagePhong => info(
                "Draws the student's Phong fragment stage in Umbra's pass with Umbra's vertex stage, on \
                    Phong materials.",
                "As `image.realtime`.",
                "As `image.realtime`.",
                IMAGE_RULES,
            ),
            Self::ImageRealtime => info(
                "The frame that the student's pass and stages draw, without shadows. If it passes on every \
                    scene, 2.1 to 2.4 are earned in full. It fails if no shader of the submission can have \
                    drawn it. A normal that is not renormalized passes too.",
                "The sum of differences over the sum of expected values, away from edges.",
                "See section Images of docs/evidence.md.",
                IMAGE_RULES,
            ),
            Self::ImageRealtimeCoverage => info(
                "Do surfaces lie where they should, whatever their colors, and does light fall on them at \
                    all? Counts if a part's own evidence does not apply.",
                "The fraction of wrong pixels.",
                "0.5 % may differ. Within a surface, on most scenes, brightness (cube root) must correlate \
                    with the expected image by 0.2, which silhouettes do not. Black surfaces are drawn again \
                    with every fragment in one color. They count if a known mistake explains some scene.",
                &[],
            ),
            Self::ImageRealtimeDiffuse => info(
                "The frame on diffuse materials alone. Counts if the fragment stage cannot be exchanged.",
                "As `image.realtime`.",
                "As `image.realtime`.",
                IMAGE_RULES,
            ),
            Self::ImageRealtimePhong => info(
                "The frame on Phong materials alone. Counts if the fragment stage cannot be exchanged.",
                "As `image.realtime`.",
                "As `image.realtime`.",
                IMAGE_RULES,
            ),
            Self::BonusImage => info(
                "The frame with shadows, on the bonus scenes that `config.json` names; the best scene \
                    counts. A wrong frame is judged by visibility alone, from the student's own frames with \
                    and without shadows. If it is too dark to judge, the other scene decides.",
                "As `image.realtime`. By visibility: the fraction of wrong lit pixels + that of wrong \
                    shadowed ones.",
                "As `image.realtime`. By visibility: 2 % of the pixel without shadows; 2.5e-4 of the pixels \
                    + 4 may be wrong.",
                BONUS,
            ),
            Self::BonusProbe => info(
                "The same on the probe `both_shadows`, whichever scene the student chose: shadows on diffuse \
                    *and* Phong surfaces, within a narrower frustum than the assignment's own. It fails if \
                    the shadow map is not drawn and read.",
                "As `bonus.image`.",
                "As `bonus.image`.",
                BONUS,
            ),
            Self::BonusDefault => info(
                "Appears only if a frame that should be without shadows has them and is right otherwise: a \
                    slip.",
                "",
                "",
                &[],
            ),
            Self::SubmissionTree => info(
                "Does the archive follow the handout's tree? A hint says what `umbra validate --fix` would \
                    move.",
                "",
                "",
                &[],
            ),
            Self::SubmissionConfig => info(
                "Is `config.json` as the handout demands? Names the first slip in it, with its line. Costs \
                    nothing.",
                "",
                "",
                &[],
            ),
            Self::SubmissionNumber => {
                info("Does the student number stand under another name in the batch?", "", "", &[])
            }
            Self::SubmissionSimilarity => info(
                "Appears only if two submissions share a source file, apart from comments, blanks and the \
                    template's lines. Names both to the instructor. The same holds for what JPlag found very \
                    similar.",
                "",
                "",
                &[],
            ),
            Self::SubmissionBuild => info(
                "Does the source build? Broken files may be replaced by the template's.",
                "",
                "",
                &[],
            ),
            Self::SubmissionReplaced => info(
                "Appears only if files were replaced by the template's. Names them.",
                "",
                "",
                &[],
            ),
            Self::SubmissionJudged => info(
                "Appears only if the machine failed. Every part is then a range of points.",
                "",
                "",
                &[],
            ),
            Self::SubmissionUploads => info(
                "Appears only if the CPU may have uploaded all frames. Only the instructor sees it.",
                "",
                "",
                &[],
            ),
            Self::SubmissionNoVertices => info(
                "Appears only if no pipeline that draws a picture takes vertices, and fragments cover the \
                    background as well. Only the instructor sees it.",
                "",
                "",
                &[],
            ),
            Self::SubmissionBudget => info(
                "Appears only if the submission used up its time on a path (`limits.budget`).",
                "",
                "",
                &[],
            ),
            Self::SubmissionOutput => info(
                "Appears only if a worker printed more than `limits.run.output_kib`. Costs nothing.",
                "",
                "",
                &[],
            ),
            Self::SubmissionInternalError => info(
                "Appears only after a bug in Umbra. Every part is then a range of points, and `grade` ends \
                    with code 70.",
                "",
                "",
                &[],
            ),
            Self::SamplerThreads => info(
                "Is the image the same, bit for bit, with one thread and with several? Costs nothing.",
                "",
                "",
                &[],
            ),
            Self::SamplerRows => {
                info("Does each row of the film have its own samples? Costs nothing.", "", "", &[])
            }
            Self::SamplerSeed => {
                info("Does another seed give another image? Costs nothing.", "", "", &[])
            }
            Self::BsdfDiffusePhysical => info(
                "Is the diffuse BSDF reciprocal, and does it conserve energy? Costs nothing.",
                "The largest relative difference between f(wo, wi) and f(wi, wo), and the largest \
                    directional albedo by quadrature (`harness/evidence/src/physical.rs`).",
                "",
                &[],
            ),
            Self::BsdfPhongPhysical => info(
                "Is the Phong BSDF reciprocal, and does it conserve energy? Costs nothing.",
                "As `bsdf.diffuse.physical`.",
                "",
                &[],
            ),
            Self::SubmittedOffline => info(
                "Is the submitted offline image right, all of it? For images without code.",
                "As `image.offline`.",
                "As `image.offline`.",
                IMAGE_RULES,
            ),
            Self::SubmittedOfflineLit => info(
                "Are its lit pixels right? For images without code.",
                "As `image.offline`.",
                "As `image.offline`.",
                IMAGE_RULES,
            ),
            Self::SubmittedOfflineShadowed => info(
                "Are its shadowed pixels right? For images without code.",
                "As `image.offline`.",
                "As `image.offline`.",
                IMAGE_RULES,
            ),
            Self::SubmittedOfflineDiffuse => info(
                "Are its pixels on diffuse materials right? For images without code.",
                "As `image.offline`.",
                "As `image.offline`.",
                IMAGE_RULES,
            ),
            Self::SubmittedOfflinePhong => info(
                "Are its pixels on Phong materials right? For images without code.",
                "As `image.offline`.",
                "As `image.offline`.",
                IMAGE_RULES,
            ),
            Self::SubmittedRealtimeAll => info(
                "Is the submitted realtime image right, all of it? For images without code.",
                "As `image.realtime`.",
                "In 8-bit sRGB levels: section Images of docs/evidence.md.",
                IMAGE_RULES,
            ),
            Self::SubmittedRealtimeDiffuse => info(
                "Are its pixels on diffuse materials right? For images without code.",
                "As `image.realtime`.",
                "In 8-bit sRGB levels: section Images of docs/evidence.md.",
                IMAGE_RULES,
            ),
            Self::SubmittedRealtimePhong => info(
                "Are its pixels on Phong materials right? For images without code.",
                "As `image.realtime`.",
                "In 8-bit sRGB levels: section Images of docs/evidence.md.",
                IMAGE_RULES,
            ),
            Self::SubmittedOrigin => info(
                "Is the submitted image what the code draws? Costs nothing. An image that fails is *stale*.",
                "",
                "Offline, at most 0.1 % + 4 of the pixels, and no 2x2 block, are further apart than 4 \
                    deviations. A deviation is R / 2 sqrt(2 / spp) with R the range of the 3x3 pixels \
                    around, since a wrong renderer's variance is not the reference's. Realtime, 0.25 % of \
                    the pixels may differ by two 8-bit levels, 5 % on edges.",
                &[],
            ),
            Self::SubmittedScene => info(
                "Does the submitted image show its scene at all? Costs nothing. An image that fails is \
                    *unrelated* (another scene, noise, black), and the instructor is told. Asked of images \
                    that are neither right nor the code's.",
                "",
                "Brightness (cube root) correlates with a right image's by 0.25, or its gradient by 0.1, as \
                    it is or mirrored.",
                &[],
            ),
            Self::SubmittedNoise => info(
                "Does a submitted offline image have the noise of the scene's samples per pixel? Counts for \
                    images without code only. Noise is explained in docs/evidence.md.",
                "",
                "It looks like at most 1.5 times more or fewer samples than the scene asks for, or five \
                    standard errors if that is more.",
                &[],
            ),
            Self::SubmittedCopied => info(
                "Is a submitted offline image a published one? Counts for images without code only, and the \
                    instructor is told. The published images are mean, pixel centers and the one without \
                    shadows.",
                "",
                "At most 1 % of the noisy pixels are more than one 8-bit level from a published image: \
                    neither half precision, nor 8 bits, nor a few touched pixels hide a copy.",
                &[],
            ),
            Self::SubmittedSeed => info(
                "Without code, is the noise of a submitted offline image the one that the student number \
                    predicts? A match raises what images alone may earn. Other noise is no fault, because \
                    seeding by row is only advice.",
                "",
                "The noisy pixels, minus the stored mean, correlate by 0.5 with an image drawn with that \
                    seed in the base code's order. Other seeds stay below 0.3.",
                &[],
            ),
            Self::SubmittedShared => info(
                "Does another person of the batch submit the same offline image? Counts for images without \
                    code only, and the instructor is told. A student number is one person.",
                "",
                "Equal SHA-256 over 8-bit levels after half precision, of images that have noise of their \
                    own (looking like 3 samples per pixel or more).",
                &[],
            ),
        }
    }
}
