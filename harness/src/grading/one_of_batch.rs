//! One submission never ends the batch: if it triggers a panic in Umbra, that is caught and recorded.

use std::path::Path;

use super::begun::Say;
use super::cache::RecordCache;
use super::pipeline::Grading;
use super::record::{Folders, Record};
use super::tree_checks::Mode;
use crate::evidence::{Check, CheckId, Evidence, Verdict};
use crate::panics::{self, Bug};

/// The check that fails when Umbra itself did: the submission is ungraded.
pub const INTERNAL_ERROR: CheckId = CheckId::SubmissionInternalError;

impl Grading<'_> {
    /// Grades one of a batch, as [`Grading::submission`] does. A panic of Umbra's makes a record that says
    /// so, and is not met again with the same submission by the same program.
    ///
    /// # Errors
    /// The machine's matters and Ctrl-C.
    pub fn one_of_batch(
        &self,
        source: &Path,
        slug: &str,
        out: &Folders,
        say: Say,
    ) -> anyhow::Result<Record> {
        let grade = || self.submission(source, slug, out, Mode::Grade, say);
        contained(self.cache.as_ref(), source, out, grade).unwrap_or_else(|bug| {
            let summary = "an internal error of Umbra stopped the grading of this submission";
            let check = Check::new(INTERNAL_ERROR, "", Verdict::Fail, summary);
            // Its text may hold anything.
            let check = Check { private: bug.to_string(), ..check };
            Ok(Record { evidence: Evidence { checks: vec![check] }, ..self.begin(source, slug) })
        })
    }
}

/// Runs `grade`, unless it is known to meet a bug.
fn contained<T>(
    cache: Option<&RecordCache>,
    source: &Path,
    out: &Folders,
    grade: impl FnOnce() -> T,
) -> Result<T, Bug> {
    if let Some(bug) = cache.and_then(|cache| cache.bug_of(source, out)) {
        return Err(Bug { message: format!("not tried again: {}", bug.message), ..bug });
    }
    let result = panics::contain(grade);
    if let (Err(bug), Some(cache)) = (&result, cache) {
        // Where it cannot be kept, it is met again, and contained again.
        let _ = cache.keep_bug(bug, source, out);
    }
    result
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn a_bug_is_contained_and_the_same_program_does_not_meet_it_again() {
        panics::note();
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        let out = Folders { student: at("student"), instructor: at("instructor") };
        let source = at("submission.zip");
        std::fs::write(&source, "one").unwrap();
        let calls = Cell::new(0);
        let grade = |cache: &RecordCache, good: bool| {
            contained(Some(cache), &source, &out, || {
                calls.set(calls.get() + 1);
                assert!(good, "a pixel of -0.0");
                7
            })
        };
        let cache = RecordCache::with([1; 32]);
        let bug = grade(&cache, false).unwrap_err();
        assert!(bug.message == "a pixel of -0.0" && bug.place.contains("one_of_batch.rs"), "{bug}");
        let again = grade(&cache, true).unwrap_err();
        assert_eq!(again.message, "not tried again: a pixel of -0.0");
        assert_eq!((again.place, calls.get()), (bug.place, 1));
        // Another program tries again, and so does this one with another submission.
        assert_eq!(grade(&RecordCache::with([2; 32]), true), Ok(7));
        std::fs::write(&source, "another").unwrap();
        assert_eq!(grade(&cache, true), Ok(7));
        assert_eq!(calls.get(), 3);
    }
}
