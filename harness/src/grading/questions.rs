//! Requests to one worker, and their outcomes by handle.

use std::ops::Index;
use std::path::Path;

use super::session::Session;
use crate::worker::{Outcome, Request};

/// Requests that one worker is to answer, in order.
#[derive(Default)]
pub struct Questions(Vec<Request>);

/// The handle of one request: it finds the outcome in the [`Outcomes`] of its [`Questions`].
#[derive(Clone, Copy)]
pub struct Question(usize);

/// One outcome for each of the [`Questions`].
pub struct Outcomes(Vec<Outcome>);

impl Questions {
    /// Adds a request.
    pub fn ask(&mut self, request: Request) -> Question {
        self.0.push(request);
        Question(self.0.len() - 1)
    }

    /// Runs all requests on a plugin.
    pub fn run(self, session: &Session, plugin: &Path) -> Outcomes {
        Outcomes(session.run(Some(plugin), self.0))
    }
}

impl Index<Question> for Outcomes {
    type Output = Outcome;

    /// # Panics
    ///
    /// If the supervisor left a request without an outcome: a bug of ours.
    fn index(&self, question: Question) -> &Outcome {
        &self.0[question.0]
    }
}
