//! Where the code of each check stands: `umbra explain` and ARCHITECTURE.md show it.

use super::CheckId;

/// The code of a check, as paths in `harness/src`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CheckSources {
    /// The file that asks the submission.
    pub asked: &'static str,
    /// The file that judges what it answers; the same one if nothing else asks it.
    pub judged: &'static str,
}

impl CheckId {
    /// The files that ask it and judge it.
    pub const fn sources(self) -> CheckSources {
        let (asked, judged) = match self {
            Self::BsdfDiffuse | Self::BsdfPhong => ("grading/conventions.rs", "evidence/bsdf.rs"),
            Self::BsdfDiffusePhysical | Self::BsdfPhongPhysical => {
                ("grading/conventions.rs", "evidence/physical.rs")
            }
            Self::RadianceLit => ("grading/conventions.rs", "evidence/rays/unshadowed.rs"),
            Self::RadianceMaterial => ("grading/conventions.rs", "evidence/rays/material.rs"),
            Self::ShadowRays => ("grading/offline.rs", "evidence/rays/shadows.rs"),
            Self::LoopAgreement | Self::LoopSamples => ("grading/offline.rs", "evidence/loops.rs"),
            Self::ImageOffline => ("grading/offline.rs", "evidence/images.rs"),
            Self::PassUniforms => ("grading/isolate.rs", "evidence/stages.rs"),
            Self::StageVertex => ("grading/isolate.rs", "evidence/vertex.rs"),
            Self::StageDiffuse | Self::StagePhong => ("grading/isolate.rs", "evidence/images.rs"),
            Self::ImageRealtime | Self::ImageRealtimeDiffuse | Self::ImageRealtimePhong => {
                ("grading/realtime.rs", "evidence/images.rs")
            }
            Self::BonusImage | Self::BonusProbe => {
                ("grading/realtime.rs", "evidence/shadow_map.rs")
            }
            Self::SubmittedOffline
            | Self::SubmittedOfflineLit
            | Self::SubmittedOfflineShadowed
            | Self::SubmittedOfflineDiffuse
            | Self::SubmittedOfflinePhong
            | Self::SubmittedRealtimeAll
            | Self::SubmittedRealtimeDiffuse
            | Self::SubmittedRealtimePhong
            | Self::SubmittedOrigin => ("grading/submitted.rs", "evidence/images.rs"),
            Self::SubmittedScene
            | Self::SubmittedNoise
            | Self::SubmittedCopied
            | Self::SubmittedSeed => ("grading/submitted.rs", "evidence/submitted.rs"),
            Self::ImageRealtimeCoverage => of_one("grading/coverage.rs"),
            Self::BonusDefault => of_one("grading/realtime.rs"),
            Self::SamplerThreads | Self::SamplerRows | Self::SamplerSeed => {
                of_one("grading/sampler.rs")
            }
            Self::SubmissionTree | Self::SubmissionConfig => of_one("grading/tree_checks.rs"),
            Self::SubmissionNumber | Self::SubmissionLikeness | Self::SubmittedShared => {
                of_one("grading/shared.rs")
            }
            Self::SubmissionBuild => of_one("grading/begun.rs"),
            Self::SubmissionReplaced => of_one("grading/template_fallback.rs"),
            Self::SubmissionJudged => of_one("grading/pipeline.rs"),
            Self::SubmissionUploads | Self::SubmissionNoVertices => of_one("grading/uploads.rs"),
            Self::SubmissionBudget | Self::SubmissionOutput => of_one("grading/session.rs"),
            Self::SubmissionInternalError => of_one("grading/one_of_batch.rs"),
        };
        CheckSources { asked, judged }
    }
}

const fn of_one(file: &'static str) -> (&'static str, &'static str) {
    (file, file)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// The code of a file without its tests.
    fn code(file: &str) -> String {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src").join(file);
        let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{file}: {error}"));
        text.split("#[cfg(test)]\nmod tests {").next().unwrap().to_owned()
    }

    #[test]
    fn one_file_names_each_check_and_the_one_that_asks_calls_the_one_that_judges() {
        for &check in CheckId::ALL {
            let CheckSources { asked, judged } = check.sources();
            let names = |file: &str| {
                let words = code(file);
                let name = format!("{check:?}");
                let mut words = words.split(|c: char| !c.is_alphanumeric());
                words.any(|word| word == name)
            };
            // `submission.build` is a constant of the rubric's.
            assert!(
                names(asked) || names(judged) || code(asked).contains("rubric::BUILD"),
                "{check}: neither {asked} nor {judged} names it"
            );
            // evidence/rays/shadows.rs is `rays` or `shadows` to who calls it.
            let modules = judged.trim_end_matches(".rs").split('/').skip(1);
            let called =
                || modules.map(|module| format!("{module}::")).any(|m| code(asked).contains(&m));
            assert!(asked == judged || called(), "{check}: {asked} does not call {judged}");
        }
    }
}
