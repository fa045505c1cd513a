//! Where the code of each check stands: `umbra explain` and ARCHITECTURE.md show it.

use super::CheckId;

/// The code of a check, as paths in `harness`.
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
            Self::BsdfDiffuse | Self::BsdfPhong => {
                ("src/grading/conventions.rs", "evidence/src/bsdf.rs")
            }
            Self::BsdfDiffusePhysical | Self::BsdfPhongPhysical => {
                ("src/grading/conventions.rs", "evidence/src/physical.rs")
            }
            Self::RadianceLit => ("src/grading/conventions.rs", "evidence/src/rays/unshadowed.rs"),
            Self::RadianceMaterial => {
                ("src/grading/conventions.rs", "evidence/src/rays/material.rs")
            }
            Self::ShadowRays => ("src/grading/offline.rs", "evidence/src/rays/shadows.rs"),
            Self::LoopAgreement | Self::LoopSamples => {
                ("src/grading/offline.rs", "evidence/src/loops.rs")
            }
            Self::ImageOffline => ("src/grading/offline.rs", "evidence/src/images.rs"),
            Self::PassUniforms => ("src/grading/isolate.rs", "evidence/src/stages.rs"),
            Self::StageVertex => ("src/grading/isolate.rs", "evidence/src/vertex.rs"),
            Self::StageDiffuse | Self::StagePhong => {
                ("src/grading/isolate.rs", "evidence/src/images.rs")
            }
            Self::ImageRealtime | Self::ImageRealtimeDiffuse | Self::ImageRealtimePhong => {
                ("src/grading/realtime.rs", "evidence/src/images.rs")
            }
            Self::BonusImage | Self::BonusProbe => {
                ("src/grading/realtime.rs", "evidence/src/shadow_map.rs")
            }
            Self::SubmittedOffline
            | Self::SubmittedOfflineLit
            | Self::SubmittedOfflineShadowed
            | Self::SubmittedOfflineDiffuse
            | Self::SubmittedOfflinePhong
            | Self::SubmittedRealtimeAll
            | Self::SubmittedRealtimeDiffuse
            | Self::SubmittedRealtimePhong
            | Self::SubmittedOrigin => ("src/grading/submitted.rs", "evidence/src/images.rs"),
            Self::SubmittedScene
            | Self::SubmittedNoise
            | Self::SubmittedCopied
            | Self::SubmittedSeed => ("src/grading/submitted.rs", "evidence/src/submitted.rs"),
            Self::ImageRealtimeCoverage => of_one("src/grading/coverage.rs"),
            Self::BonusDefault => of_one("src/grading/realtime.rs"),
            Self::SamplerThreads | Self::SamplerRows | Self::SamplerSeed => {
                of_one("src/grading/sampler.rs")
            }
            Self::SubmissionTree | Self::SubmissionConfig => of_one("src/grading/tree_checks.rs"),
            Self::SubmissionNumber | Self::SubmissionSimilarity | Self::SubmittedShared => {
                of_one("src/grading/shared.rs")
            }
            Self::SubmissionBuild => of_one("src/grading/begun.rs"),
            Self::SubmissionReplaced => of_one("src/grading/template_fallback.rs"),
            Self::SubmissionJudged => of_one("src/grading/pipeline.rs"),
            Self::SubmissionUploads | Self::SubmissionNoVertices => {
                of_one("src/grading/uploads.rs")
            }
            Self::SubmissionBudget | Self::SubmissionOutput => of_one("src/grading/session.rs"),
            Self::SubmissionInternalError => of_one("src/grading/one_of_batch.rs"),
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
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file);
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
            // evidence/src/rays/shadows.rs is `rays` or `shadows` to who calls it.
            let modules = judged.trim_end_matches(".rs").split('/').skip(2);
            let called =
                || modules.map(|module| format!("{module}::")).any(|m| code(asked).contains(&m));
            assert!(asked == judged || called(), "{check}: {asked} does not call {judged}");
        }
    }
}
