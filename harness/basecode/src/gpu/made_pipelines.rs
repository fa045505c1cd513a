//! Pipelines that a device made: one that draws many scenes makes each once.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};

use super::device::Overrides;

/// Number of pipelines that a device keeps; the oldest go.
const KEPT: usize = 32;

/// What a pipeline is made of.
#[derive(PartialEq, Eq)]
pub(super) struct MadeOf {
    /// The WGSL of the vertex stage and, if there is one, the fragment stage.
    texts: (String, Option<String>),
    overrides: Overrides,
}

impl MadeOf {
    /// A pipeline of these texts where the host asks for these changes.
    pub(super) fn new(vertex: &str, fragment: Option<&str>, overrides: Overrides) -> Self {
        let text = |text: &str| overrides.wgsl(text).into_owned();
        let texts = (text(vertex), fragment.map(text));
        // The texts are changed by now; what is left to tell is whether the entry point is the host's.
        let shown = overrides.shown.as_ref().map(|_| String::new());
        Self { texts, overrides: Overrides { shown, edited: None, ..overrides } }
    }
}

/// The pipelines of a device.
#[derive(Default)]
pub(super) struct MadePipelines(Mutex<VecDeque<(MadeOf, wgpu::RenderPipeline)>>);

impl MadePipelines {
    /// The pipeline that was made of the same, if there is one.
    pub(super) fn find(&self, made_of: &MadeOf) -> Option<wgpu::RenderPipeline> {
        let made = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        made.iter().find(|(known, _)| known == made_of).map(|(_, pipeline)| pipeline.clone())
    }

    /// Keeps one.
    pub(super) fn keep(&self, made_of: MadeOf, pipeline: &wgpu::RenderPipeline) {
        let mut made = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if made.len() == KEPT {
            made.pop_front();
        }
        made.push_back((made_of, pipeline.clone()));
    }
}
