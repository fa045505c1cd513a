//! The cache key of a batch: everything that its records depend on.

use std::path::Path;

use anyhow::Context;
use sha2::{Digest, Sha256};

use super::cache::RecordCache;
use super::pipeline::Grading;
use crate::files::{feed, files_below};
use crate::store::scene_digest;

impl Grading<'_> {
    /// Keeps the records that this makes; `force` finds none again.
    ///
    /// # Errors
    /// When something that they depend on cannot be read.
    pub fn record_cache(&self, force: bool) -> anyhow::Result<RecordCache> {
        let mut hash = Sha256::new();
        let assignment = self.assignment;
        hash.update(serde_json::to_vec(&(
            (&assignment.scenes, &assignment.tree, &assignment.tolerances, &assignment.limits),
            self.held_back.as_ref(),
        ))?);
        let mut files = self.supervisor.programs().to_vec();
        files.extend(self.reference.clone());
        // Stored images, what known mistakes answer, and what a submission began from.
        let folder = assignment.root.join("expected");
        let below = files_below(&folder);
        files.extend(below.with_context(|| format!("cannot read {}", folder.display()))?);
        for file in files {
            let mut own = Sha256::new();
            feed(&mut own, &file).with_context(|| format!("cannot read {}", file.display()))?;
            // Not where the repository lies: a copy of it judges alike.
            let below = file.strip_prefix(&folder).ok();
            let name = below.map(Path::as_os_str).or(file.file_name()).unwrap_or_default();
            hash.update(name.as_encoded_bytes());
            hash.update(own.finalize());
        }
        hash.update(scene_digest(&assignment.root.join(&assignment.sampler_scene))?);
        for case in &self.cases {
            for scene in [&case.offline, &case.realtime].into_iter().chain(&case.bonus) {
                hash.update(scene_digest(scene)?);
            }
        }
        Ok(RecordCache::new(hash.finalize().into(), force))
    }
}
