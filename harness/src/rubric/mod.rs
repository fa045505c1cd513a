//! From evidence to points: a pure function of the assignment's rules and a submission's evidence.
//!
//! The rules, in order:
//! 1. A gate that is closed caps the total.
//! 2. A *path* (offline or realtime) whose proof passes on every scene earns all its parts in full.
//! 3. Otherwise each part is worth what its own evidence says, the worst scene counting.
//! 4. If a part's evidence does not apply, its fallback decides.
//! 5. A check that fails costs its scene's weight times what the curve takes for its error; a part
//!    loses the largest of them, never a sum or a mean.
//! 6. When the proof fails and no part's own evidence says why, the path's `residual_part` pays.
//! 7. A part that the machine could not test is a range from 0 to all points, with its reason.
//! 8. Without code, a part earns nothing until the instructor confirms what its images show
//!    ([`PartGrade::unconfirmed`]).
//! 9. Public and held-back scenes are graded apart by these rules; the lower counts, part by part.
//! 10. Of the conventions that a path was judged under, the one that is worth most counts.

mod curve;
mod grade;
mod rules;

pub use curve::Curve;
pub use grade::{BUILD, Grade, IMAGES_EARN, ONCE_CONFIRMED, PartGrade, ceiling, grade, settle};
pub use rules::{Gate, Part, PathRule, Rules, Trust};
