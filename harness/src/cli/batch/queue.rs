//! Takes the submissions of a batch through all stages, several at a time.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::Context as _;

use super::Batch;
use crate::cli::class::{self, Source};
use crate::cli::context::{Context, INTERRUPTED};
use crate::cli::told_once;
use crate::grading::{Begun, Folders, Grading, Record, RecordCache, StoredRecord, Workshop};
use crate::report;
use crate::rubric;

/// What became of a submission.
enum Ended {
    Record(Box<StoredRecord>),
    /// It is not there any more, as the text says.
    Gone(String),
    Interrupted,
}

impl Batch<'_> {
    /// Receives and builds what a student checks.
    pub(super) fn begin(
        &self,
        context: &Context,
        workshop: &Workshop,
        source: &Source,
    ) -> anyhow::Result<Begun> {
        let say = |stage: &str| context.say(stage);
        let begin = || {
            let mut begun = workshop.receive(&source.path, &source.slug, self.mode, &say)?;
            workshop.build(&mut begun, &say)?;
            self.keeps_plugin.map_or(Ok(()), |file| begun.keep_plugin(file))?;
            anyhow::Ok(begun)
        };
        begin().with_context(|| source.path.display().to_string())
    }

    /// Judges what was begun so.
    pub(super) fn go_on(
        &self,
        context: &Context,
        grading: &Grading,
        source: &Source,
        begun: Begun,
    ) -> anyhow::Result<StoredRecord> {
        let Source { path, name, slug, .. } = source;
        let record = grading.judge(begun, &self.folders(slug), &|stage| context.say(stage));
        let record = record.with_context(|| path.display().to_string())?;
        Ok(StoredRecord::held(Record { name: name.clone(), ..record }))
    }

    /// Takes submissions through all stages, in their order; none is begun after Ctrl-C. One that the machine
    /// failed on has a record that says so: the others' are no worse for it. One that is not there any more has none,
    /// and a line among those that come second.
    pub(super) fn grade_all(
        &self,
        context: &Context,
        grading: &Grading,
        sources: &[&Source],
        jobs: usize,
    ) -> (Vec<StoredRecord>, Vec<String>) {
        let next = AtomicUsize::new(0);
        let results = Mutex::new(Vec::new());
        let gone = Mutex::new(Vec::new());
        context.progress.count(sources.len());
        let work = || {
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                let Some(source) = sources.get(index) else { return };
                match self.grade_one(context, grading, source) {
                    Ended::Record(record) => {
                        let Ok(mut results) = results.lock() else { return };
                        results.push((index, *record));
                    }
                    Ended::Gone(why) => {
                        gone.lock().map(|mut gone| gone.push(why)).unwrap_or_default();
                    }
                    Ended::Interrupted => return,
                }
            }
        };
        std::thread::scope(|scope| {
            for _ in 0..jobs {
                scope.spawn(work);
            }
        });
        let mut results = results.into_inner().unwrap_or_default();
        results.sort_by_key(|(index, _)| *index);
        let records = results.into_iter().map(|(_, result)| result).collect();
        (records, gone.into_inner().unwrap_or_default())
    }

    fn grade_one(&self, context: &Context, grading: &Grading, source: &Source) -> Ended {
        let Source { path, name, slug, .. } = source;
        let progress = &context.progress;
        let out = self.folders(slug);
        let begun = Instant::now();
        let older = source.moved.as_ref().and_then(|_| RecordCache::text(&out.instructor));
        let result = class::note_source(&out, source).and_then(|()| {
            let say = |stage: &str| progress.at(&format!("{slug}: {stage}"));
            grading.one_of_batch(path, slug, &out, &say)
        });
        if INTERRUPTED.load(Ordering::Relaxed) && result.is_err() {
            return Ended::Interrupted;
        }
        if result.is_err() && path.symlink_metadata().is_err() {
            // An earlier grade stays.
            let why = format!("{name}: {} is not there any more", path.display());
            progress.note(&why);
            return Ended::Gone(why);
        }
        let result = result.unwrap_or_else(|error| {
            progress.note(&format!("{}: {}", path.display(), told_once(&error)));
            grading.unjudged(path, slug)
        });
        let record = Record { name: name.clone(), ..result };
        if let (Some(older), Some(from)) = (older, &source.moved) {
            match RecordCache::keep_replaced(&out.instructor, &older, &record) {
                Ok(false) => {}
                Ok(true) => progress.note(&format!(
                    "{} of {} is graded again: it replaces the one that was {from}",
                    record.name,
                    class::who(&record.student)
                )),
                Err(error) => progress.note(&told_once(&error)),
            }
        }
        let mut is_kept = false;
        if let Some(cache) = &grading.cache {
            match cache.list(&record, &out) {
                Ok(()) => is_kept = true,
                Err(error) => progress.note(&told_once(&error)),
            }
            let grade = rubric::grade(&context.assignment.rules, &record.evidence);
            let cost = if cache.was_found(slug) {
                "unchanged".to_owned()
            } else {
                format!("{:.1} s", begun.elapsed().as_secs_f64())
            };
            progress.step(&format!("{}, {cost}", report::in_a_line(&record, &grade)));
        }
        Ended::Record(Box::new(match is_kept {
            true => StoredRecord::kept(record, true, &out.instructor),
            false => StoredRecord::held(record),
        }))
    }

    /// The folders of a submission in the report.
    fn folders(&self, slug: &str) -> Folders {
        Folders {
            student: self.output.join(slug),
            instructor: self.output.join(report::INSTRUCTOR).join(slug),
        }
    }
}
