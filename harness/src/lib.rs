//! Umbra grades renderers. Most users run the `umbra` program; this library does the same for programs of your own.
//!
//! [`grade_submission`] takes one submission through all stages and returns its points with their evidence:
//!
//! ```no_run
//! use std::path::Path;
//!
//! use umbra::{GradeOptions, grade_submission};
//!
//! let options = GradeOptions {
//!     root: Path::new("."),
//!     umbra: Path::new("target/release/umbra"),
//!     output: Path::new("report"),
//!     seed: None, // the public scenes alone
//!     reduced_isolation: false,
//! };
//! let graded = grade_submission(Path::new("a2_ada_lampglow.zip"), &options)?;
//! for part in &graded.grade.parts {
//!     println!("{} {} of {}: {}", part.id, part.points, part.out_of, part.reason);
//! }
//! println!("{} of {}", graded.grade.points, graded.grade.out_of);
//! # Ok::<(), anyhow::Error>(())
//! ```
//!
//! Everything else serves Umbra's own programs, changes without notice, and is hidden from this page. ARCHITECTURE.md
//! is the map of the code. Data flows one way: `intake` -> `build` -> `worker` -> `evidence` -> `rubric` -> `report`.

// Its macros are for all modules below.
#[macro_use]
mod output;

#[doc(hidden)]
pub use diagnosis;
#[doc(hidden)]
pub use evidence::{self, expected};
#[doc(hidden)]
pub use imaging;

#[doc(hidden)]
pub mod assignment;
#[doc(hidden)]
pub mod build;
#[doc(hidden)]
pub mod class;
#[doc(hidden)]
pub mod cli;
mod columns;
#[doc(hidden)]
pub mod decode;
#[doc(hidden)]
pub mod files;
#[doc(hidden)]
pub mod grading;
mod harmless;
#[doc(hidden)]
pub mod held_back;
#[doc(hidden)]
pub mod intake;
#[doc(hidden)]
pub mod panics;
mod plain_errors;
#[doc(hidden)]
pub mod plugin;
#[doc(hidden)]
pub mod process;
mod program;
#[doc(hidden)]
pub mod report;
#[doc(hidden)]
pub mod rubric;
#[doc(hidden)]
pub mod sandbox;
#[doc(hidden)]
pub mod store;
#[doc(hidden)]
pub mod viewer;
#[doc(hidden)]
pub mod worker;

pub use evidence::{Check, Evidence, Verdict};
pub use grading::Record;
pub use program::{GradeOptions, grade_submission};
pub use report::SubmissionReport;
pub use rubric::{Grade, PartGrade};
