//! From evidence to points: a pure function of the assignment's rules and a hand-in's evidence.
//!
//! The rules, in order:
//! 1. A gate that is closed caps the total.
//! 2. A *path* (offline or realtime) whose proof passes on every scene earns all its parts in full.
//! 3. Otherwise each part is worth what its own evidence says, the worst scene counting.
//! 4. Evidence that does not apply gives way to the part's fallback.
//! 5. When the proof fails and no part's own evidence says why, the path's `blame` part pays.
//! 6. What cannot be judged is a range from 0 to all points, with its reason.
//! 7. Without code, a part earns nothing until the instructor confirms what its images show
//!    ([`PartGrade::unconfirmed`]).
//! 8. Public and held-back scenes are graded apart by these rules; the lower counts, part by part.

mod curve;
mod deletion;
mod grade;
mod rules;

pub use curve::Curve;
pub use deletion::EvidenceRule;
pub use grade::{BUILD, Grade, PartGrade, grade};
pub use rules::{Gate, Part, PathRule, Rules, Trust};
