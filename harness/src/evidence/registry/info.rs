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

/// The rules of a comparison of images.
const IMAGE: &[RuleId] = &[
    RuleId::ImageSize,
    RuleId::ImageNonFinite,
    RuleId::ImageNegative,
    RuleId::ImageInterior,
    RuleId::ImageBlob,
    RuleId::ImageEdge,
    RuleId::ImageBias,
];
/// Those, and the rules of visibility.
const BONUS: &[RuleId] = &[
    RuleId::ImageSize,
    RuleId::ImageNonFinite,
    RuleId::ImageNegative,
    RuleId::ImageInterior,
    RuleId::ImageBlob,
    RuleId::ImageEdge,
    RuleId::ImageBias,
    RuleId::BonusLit,
    RuleId::BonusDark,
];

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
                    for the BSDF that a textured scene hands out.",
                "The sum of differences over the sum of expected values, of the worst material.",
                "Each value |a - b| <= (1e-4 + 1e-6 n) |b| + 1e-6 of the material's peak: room for f32 \
                    arithmetic in any order, and for what a power makes of its base's error. No direction may \
                    differ. Directions with |cos| < 1e-4 are not asked.",
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
                "Asks for unshadowed radiance along lit rays under four witness BSDFs: a constant, one of wi, \
                    one of wo, one of the angle between them. Asks whether rays are black that meet nothing, or \
                    a surface seen or lit from behind.",
                "The sum of differences over the sum of expected values, of the worst witness. Rays that are \
                    not black are a slip.",
                "A ray differs from 3e-3 relative on (f32 positions and frames in any order). 0.2 % of the \
                    rays may differ, for seams that no mask knows.",
                &[RuleId::RaysLit, RuleId::RaysBlack],
            ),
            Self::RadianceMaterial => info(
                "Compares unshadowed radiance with what the renderer's own BSDF answers where the ray ends, \
                    right or wrong, times I / r^2: is the BSDF of the right surface asked? Judged where the \
                    light is right, on surfaces of one color.",
                "A slip.",
                "2 % of the value + 0.1 % of the mean, under any convention. 0.2 % of the rays may differ.",
                &[RuleId::RaysMaterial],
            ),
            Self::LoopAgreement => info(
                "Compares the render at 1 sample per pixel with what the integrator answers along the pixels' \
                    center rays: loop, film and camera.",
                "The sum of differences over the sum of radiance.",
                "A pixel away from edges differs from 3e-3 relative + 1e-5 of the largest value on. 0.2 % may \
                    differ.",
                &[RuleId::LoopAgreement],
            ),
            Self::LoopSamples => info(
                "Renders at 16 samples per pixel, 64 pixels wide, without shadows. Is that the average of what the integrator \
                    answers along 16 stratified rays of each pixel, whatever it shades? So sum, count and spread \
                    on both axes. Random, stratified, Sobol, lattice and grid samples pass.",
                "The sum of differences over the sum of radiance. A fault on edges or stray pixels alone is a slip.",
                "Pixels: 4 standard errors, by the largest variance of the 3x3 around; 1 % + 4 pixels may \
                    exceed them. Edges, by direction: the mean square error, over the largest variance around, \
                    is at most 1.1 times that of independent samples. A right renderer has 0.4, samples that are \
                    all the same have 4. The mean error on edges may be 8 standard deviations. No pixel may be \
                    5 % off where the rays around it vary by 3 % at most.",
                &[RuleId::LoopPixels, RuleId::LoopEdges, RuleId::LoopEdgeBias, RuleId::LoopStray],
            ),
            Self::ShadowRays => info(
                "Asks for radiance with shadows over radiance without, along lit and along shadowed rays. The \
                    witness BSDF is the same everywhere, below the surface too. Asks whether the switch changes \
                    the shading of lit rays.",
                "The fraction of wrong lit rays + the fraction of wrong shadowed rays, at most 1.",
                "Visibility within 0.02 of 1 or of 0, shading within 3e-3. 0.2 % of either kind may be wrong.",
                &[RuleId::ShadowLit, RuleId::ShadowDark],
            ),
            Self::ImageOffline => info(
                "The scene's film at its samples per pixel, with the student's seed; for a large film a \
                 small one first. Passed on every \
                    scene, it earns 1.1 to 1.4 in full.",
                "The sum of differences over the sum of expected values, away from edges.",
                "See *Images*.",
                IMAGE,
            ),
            Self::PassUniforms => info(
                "Draws the student's pass under stages of ours, which show camera position, light position \
                    and intensity, rho_d, rho_s, exponent and world position.",
                "The fraction of wrong pixels, all uniforms together. One wrong value is a slip, two are a \
                    concept. Another shape's material, an energy scale too many or too few, exchanged albedos \
                    and exchanged pipelines are a slip each, and so are surfaces beside their place.",
                "1e-4 of the largest component, because it travels as f32. 0.5 % of the pixels may differ \
                    (coverage along seams). Surfaces may lie 0.04 pixels beside their place (median).",
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
                "Draws the student's vertex stage under a pass of ours: the world position and normal that it \
                    forwards, and where on the film they land. More frames, under other matrices, tell which \
                    matrix is missing, in the wrong order or on the wrong side, and whether w is 1.",
                "Position, normal and place on the film are priced apart and add up, each a slip or a \
                    concept. A position on a surface is right, wherever it shows.",
                "Position within 2e-3 of its distance, normal within 1e-2, for all but 0.5 % of the pixels. \
                    Pixels may land 0.04 pixels beside their place (median), because hardware snaps vertices to \
                    1/256.",
                &[RuleId::VertexPosition, RuleId::VertexNormal, RuleId::VertexClip],
            ),
            Self::StageDiffuse => info(
                "Draws the student's diffuse fragment stage under our pass and vertex stage, on diffuse \
                    materials.",
                "As realtime images.",
                "As realtime images: see *Images*.",
                IMAGE,
            ),
            Self::StagePhong => info(
                "Draws the student's Phong fragment stage under our pass and vertex stage, on Phong \
                    materials.",
                "As realtime images.",
                "As realtime images: see *Images*.",
                IMAGE,
            ),
            Self::ImageRealtime => info(
                "The frame that the student's pass and stages draw, without shadows. Passed on every scene, \
                    it earns 2.1 to 2.4 in full. Fails where no shader of the submission can have drawn it. A \
                    normal that is not renormalized is as good.",
                "The sum of differences over the sum of expected values, away from edges.",
                "See *Images*.",
                IMAGE,
            ),
            Self::ImageRealtimeCoverage => info(
                "Do surfaces lie where they should, whatever their colors, and does light fall on them at \
                    all? Asked where a part's own evidence does not apply.",
                "The fraction of wrong pixels.",
                "0.5 % may differ. Within a surface, on most scenes, brightness (cube root) must \
                    correlate with what is expected by 0.2. Silhouettes do not. Black surfaces are seen with \
                    every fragment in one color, and count if a known mistake explains some scene.",
                &[],
            ),
            Self::ImageRealtimeDiffuse => info(
                "The frame on diffuse materials alone. Asked where the fragment stage cannot be exchanged.",
                "As realtime images.",
                "As realtime images.",
                IMAGE,
            ),
            Self::ImageRealtimePhong => info(
                "The frame on Phong materials alone. Asked where the fragment stage cannot be exchanged.",
                "As realtime images.",
                "As realtime images.",
                IMAGE,
            ),
            Self::BonusImage => info(
                "The frame with shadows, where `config.json` names a bonus scene; the best scene counts. A \
                    frame that is wrong is judged by visibility alone, from the student's own frames with and \
                    without shadows. One too dark to judge is left to the other scene.",
                "As images. By visibility: the fraction of wrong lit pixels + that of wrong shadowed ones.",
                "As realtime images. By visibility: 2 % of the pixel without shadows; 2.5e-4 of the pixels + \
                    4 may be wrong.",
                BONUS,
            ),
            Self::BonusProbe => info(
                "The same on the probe `both_shadows`, whichever scene the student chose: shadows on diffuse \
                    *and* Phong surfaces, within a narrower frustum than the assignment's own. Fails where the \
                    shadow map is not drawn and read.",
                "As `bonus.image`.",
                "As `bonus.image`.",
                BONUS,
            ),
            Self::BonusDefault => info(
                "Appears only where a frame that should be without shadows has them and is right otherwise: a slip.",
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
                "Is `config.json` as the handout asks? Names the first slip in it, with its line. Costs \
                    nothing.",
                "",
                "",
                &[],
            ),
            Self::SubmissionNumber => {
                info("Does the student number stand under another name in the batch?", "", "", &[])
            }
            Self::SubmissionLikeness => info(
                "Appears only where a file of the source is another submission's too, but for comments, blanks and \
                 what the template says: names both to the instructor. So it does with what JPlag found much alike.",
                "",
                "",
                &[],
            ),
            Self::SubmissionBuild => info(
                "Does the source build, with files of the template for broken ones if need be?",
                "",
                "",
                &[],
            ),
            Self::SubmissionReplaced => info(
                "Appears only where files were replaced by the template's: names them.",
                "",
                "",
                &[],
            ),
            Self::SubmissionJudged => info(
                "Appears only where the machine failed: all is a range of points.",
                "",
                "",
                &[],
            ),
            Self::SubmissionUploads => info(
                "Appears only where the CPU may upload all frames: says so to the instructor.",
                "",
                "",
                &[],
            ),
            Self::SubmissionNoVertices => info(
                "Appears only where no pipeline that draws a picture takes vertices, and fragments cover the \
                    background as well: says so to the instructor.",
                "",
                "",
                &[],
            ),
            Self::SubmissionBudget => info(
                "Appears only where the submission used up its time on a path (`limits.budget`).",
                "",
                "",
                &[],
            ),
            Self::SubmissionOutput => info(
                "Appears only where a worker printed more than `limits.run.output_kib`. Costs nothing.",
                "",
                "",
                &[],
            ),
            Self::SubmissionInternalError => info(
                "Appears only where Umbra itself failed: all is a range of points, and `grade` ends with code \
                    70.",
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
                info("Do rows of the film have samples of their own? Costs nothing.", "", "", &[])
            }
            Self::SamplerSeed => {
                info("Does another seed give another image? Costs nothing.", "", "", &[])
            }
            Self::BsdfDiffusePhysical => info(
                "Is the diffuse BSDF reciprocal, and does it keep energy? Costs nothing.",
                "The largest relative difference between f(wo, wi) and f(wi, wo), and the largest directional \
                    albedo by quadrature (`harness/src/evidence/physical.rs`).",
                "",
                &[],
            ),
            Self::BsdfPhongPhysical => info(
                "Is the Phong BSDF reciprocal, and does it keep energy? Costs nothing.",
                "As `bsdf.diffuse.physical`.",
                "",
                &[],
            ),
            Self::SubmittedOffline => info(
                "Is the submitted offline image right, all of it? For images without code.",
                "As images.",
                "As offline images.",
                IMAGE,
            ),
            Self::SubmittedOfflineLit => info(
                "Are its lit pixels right? For images without code.",
                "As images.",
                "As offline images.",
                IMAGE,
            ),
            Self::SubmittedOfflineShadowed => info(
                "Are its shadowed pixels right? For images without code.",
                "As images.",
                "As offline images.",
                IMAGE,
            ),
            Self::SubmittedOfflineDiffuse => info(
                "Are its pixels on diffuse materials right? For images without code.",
                "As images.",
                "As offline images.",
                IMAGE,
            ),
            Self::SubmittedOfflinePhong => info(
                "Are its pixels on Phong materials right? For images without code.",
                "As images.",
                "As offline images.",
                IMAGE,
            ),
            Self::SubmittedRealtimeAll => info(
                "Is the submitted realtime image right, all of it? For images without code.",
                "As images.",
                "In 8-bit sRGB levels: see *Images*.",
                IMAGE,
            ),
            Self::SubmittedRealtimeDiffuse => info(
                "Are its pixels on diffuse materials right? For images without code.",
                "As images.",
                "In 8-bit sRGB levels: see *Images*.",
                IMAGE,
            ),
            Self::SubmittedRealtimePhong => info(
                "Are its pixels on Phong materials right? For images without code.",
                "As images.",
                "In 8-bit sRGB levels: see *Images*.",
                IMAGE,
            ),
            Self::SubmittedOrigin => info(
                "Is the submitted image what the code draws? Costs nothing. An image that fails is *stale*.",
                "",
                "Offline, at most 0.1 % + 4 of the pixels, and no 2x2 block, are further apart than 4 \
                    deviations. A deviation is R / 2 sqrt(2 / spp) with R the range of the 3x3 pixels around, \
                    since a wrong renderer's variance is not the reference's. Realtime, 0.25 % of the pixels may \
                    differ by two 8-bit levels, 5 % on edges.",
                &[],
            ),
            Self::SubmittedScene => info(
                "Does the submitted image show its scene at all? Costs nothing. What fails is *unrelated* \
                    (another scene, noise, black), and the instructor is told. Asked of images that are neither \
                    right nor the code's.",
                "",
                "Brightness (cube root) correlates with a right image's by 0.25, or the steepness of \
                    brightness by 0.1, as it is or mirrored.",
                &[],
            ),
            Self::SubmittedNoise => info(
                "Has a submitted offline image the noise of the scene's samples per pixel? See *Noise*. \
                    Counts for images without code only.",
                "",
                "It looks like at most 1.5 times more or fewer samples than the scene asks for, or five \
                    standard errors if that is more.",
                &[],
            ),
            Self::SubmittedCopied => info(
                "Is a submitted offline image a published one? Counts for images without code only, and the \
                    instructor is told. Published are mean, pixel centers and the image without shadows.",
                "",
                "At most 1 % of the noisy pixels are more than one 8-bit level from a published image: \
                    neither half precision, nor 8 bits, nor a few touched pixels hide a copy.",
                &[],
            ),
            Self::SubmittedSeed => info(
                "Without code, is the noise of a submitted offline image what the student's number predicts? \
                    A match raises what images alone may earn. Another noise is no fault, because seeding by row \
                    is only advice.",
                "",
                "Drawn with that seed in the base code's order, and less the stored mean, the noisy pixels \
                    correlate by 0.5. Other seeds stay below 0.3.",
                &[],
            ),
            Self::SubmittedShared => info(
                "Does another person of the batch submit the same offline image? Counts for images without \
                    code only, and the instructor is told. A student number is one person.",
                "",
                "Equal SHA-256 over 8-bit levels after half precision, of images that have noise of their own \
                    (looking like 3 samples per pixel or more).",
                &[],
            ),
        }
    }
}
