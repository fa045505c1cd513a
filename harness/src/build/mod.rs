//! Compiling a submission: one direct compiler call, the template's own as cargo makes it, with
//! source and output replaced.
//!
//! [`Recording::obtain`] records that call once for a state of the base code; [`compile`] replays
//! it. The compiler sees a staged folder with the base code's closure and nothing else of
//! `target/`. [`KeptLibraries`] remembers what was built.

mod closure;
mod diagnostics;
mod kept;
mod record;
mod replay;

pub use diagnostics::{Diagnostic, SourcePlace};
pub use kept::KeptLibraries;
pub use record::{Compiling, RecordError, Recording, wrapper_main};
pub use replay::{BuildOutcome, BuildReport, compile, default_limits};

/// The crate whose compiler call is recorded.
pub(crate) const TEMPLATE: &str = "student_template";
