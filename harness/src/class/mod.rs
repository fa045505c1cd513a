//! A class, as a learning platform gives it: which submissions there are, whose each is, which attempt counts, and
//! what a late one costs.
//!
//! ```text
//! paths --collect--> Source with Label --grading--> Claim and Grade --settle--> Standing, Class
//! ```
//!
//! Nothing here guesses: cases that names, class list and decisions leave open are listed for the instructor.

mod attempts;
pub mod claim;
pub mod collect;
mod download;
pub mod export;
pub mod feedback;
pub mod jplag;
pub mod late;
pub mod layout;
pub mod matches;
pub mod matching;
pub mod mending;
pub mod names;
pub mod overrides;
pub mod owners;
pub mod pins;
pub mod roster;
pub mod settle;
pub mod slots;
pub mod stamps;
pub mod standing;

pub use attempts::set_aside;
pub use claim::Claim;
pub use collect::{CollectOptions, Collected, Empty, Source, collect, recognized, skipped};
pub use late::{LatePolicy, Lateness};
pub use layout::{Label, Platform};
pub use matches::{MATCHES, Matches};
pub use owners::Owners;
pub use pins::{Decisions, Pins, Stated};
pub use roster::{ListedStudent, Roster};
pub use settle::settle;
pub use standing::{Attempt, Class, Deciding, INCOMPARABLE, Missing, Standing, Undecided};
