//! How often a renderer is asked again because the machine may be at fault, and when enough is
//! enough.

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::outcome::{Matter, Outcome};

/// So many requests of one path may be asked again: each may cost its time limit.
const MAX_RETRIES: usize = 2;
/// After so many requests of one path ran out of time, the rest is not asked any more: a renderer
/// that hangs would otherwise cost its limit for every question.
const MAX_TIMEOUTS: usize = 2;

/// Patience with one path of one hand-in, over all its jobs.
///
/// A timeout counts when the same request runs out of time once more, alone on the machine. One
/// that is confirmed so speaks for all of the path: others count as they are. One that nobody can
/// confirm any more counts for nothing, and what it asked stays ungraded.
#[derive(Debug, Default)]
pub struct Patience(Mutex<State>);

#[derive(Debug, Default)]
struct State {
    retries: usize,
    hangs: bool,
    timeouts: usize,
}

impl Patience {
    /// None at all: every timeout counts at once.
    pub fn none() -> Self {
        Self(Mutex::new(State { hangs: true, ..State::default() }))
    }

    /// Begins anew, for another path.
    pub fn renew(&self) {
        *self.state() = State::default();
    }

    /// Takes one retry, if any is left.
    pub fn another_try(&self) -> bool {
        let mut state = self.state();
        let left = state.retries < MAX_RETRIES;
        state.retries += usize::from(left);
        left
    }

    /// Whether a timeout must be confirmed, and may: takes one retry then.
    pub(super) fn asks_again(&self) -> bool {
        !self.state().hangs && self.another_try()
    }

    /// What a timeout comes to; `confirmed` when the request had the machine for itself.
    pub(super) fn timed_out(&self, confirmed: bool) -> Outcome {
        let mut state = self.state();
        state.timeouts += 1;
        state.hangs |= confirmed;
        if state.hangs { Outcome::TimedOut } else { unconfirmed() }
    }

    /// The outcome of all that is not asked any more, when patience is at its end.
    pub fn is_over(&self) -> Option<Outcome> {
        let state = self.state();
        let matter = if state.hangs { Matter::Submission } else { Matter::Machine };
        let reason = "not asked: the renderer ran out of time before".to_owned();
        (state.timeouts >= MAX_TIMEOUTS).then_some(Outcome::NotRun { reason, matter })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn unconfirmed() -> Outcome {
    let reason = "ran out of time beside other work, and was asked often enough".to_owned();
    Outcome::NotRun { reason, matter: Matter::Machine }
}

/// Whether an outcome may be a fault of the machine by the word of someone who could lie: it is
/// believed when a renderer of ours fails on the same case.
pub fn blames_the_machine(outcome: &Outcome) -> bool {
    match outcome {
        Outcome::NoAdapter(_) => true,
        Outcome::NotRun { matter: Matter::Submission, .. } => false,
        // Time is the parent's word.
        Outcome::NotRun { .. } => *outcome != unconfirmed(),
        Outcome::Failed(said) | Outcome::Panicked(said) => {
            let said = said.to_lowercase();
            (said.contains("device") && said.contains("lost"))
                || said.contains("no space left on device")
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_confirmed_timeout_speaks_for_all() {
        let patience = Patience::default();
        assert!(patience.asks_again());
        assert_eq!(patience.timed_out(true), Outcome::TimedOut);
        assert_eq!(patience.is_over(), None);
        assert!(!patience.asks_again(), "hanging renderers do not stall a batch");
        assert_eq!(patience.timed_out(false), Outcome::TimedOut);
        assert_eq!(patience.is_over().and_then(|o| o.matter()), Some(Matter::Submission));
        patience.renew();
        assert_eq!(patience.is_over(), None);
        assert!(patience.asks_again());
    }

    #[test]
    fn what_nobody_confirms_costs_nothing() {
        let patience = Patience::default();
        for _ in 0..MAX_RETRIES {
            // Asked again, it answered.
            assert!(patience.asks_again());
        }
        assert!(!patience.asks_again());
        assert_eq!(patience.timed_out(false).matter(), Some(Matter::Machine));
        assert_eq!(patience.timed_out(false).matter(), Some(Matter::Machine));
        assert_eq!(patience.is_over().and_then(|o| o.matter()), Some(Matter::Machine));
        assert!(!blames_the_machine(&patience.timed_out(false)));
    }

    #[test]
    fn without_patience_every_timeout_counts() {
        let patience = Patience::none();
        assert!(!patience.asks_again());
        assert_eq!(patience.timed_out(false), Outcome::TimedOut);
    }

    #[test]
    fn blame_is_recognised() {
        let machine = |matter| Outcome::NotRun { reason: "x".into(), matter };
        for (outcome, blames) in [
            (Outcome::NoAdapter(String::new()), true),
            (machine(Matter::Machine), true),
            (machine(Matter::Ours), true),
            (machine(Matter::Submission), false),
            (Outcome::Failed("Parent device is lost".into()), true),
            (Outcome::Panicked("No space left on device (os error 28)".into()), true),
            (Outcome::Failed("lost in thought".into()), false),
            (Outcome::ExitedEarly(75), false),
            (Outcome::TimedOut, false),
        ] {
            assert_eq!(blames_the_machine(&outcome), blames, "{outcome:?}");
        }
    }
}
