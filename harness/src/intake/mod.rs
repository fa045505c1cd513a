//! Intake: turns a student's submission into a safe private copy with findings.
//!
//! ```text
//! archive or folder --unpack--> Submission (a copy, listed and hashed) --validate--> Validation
//! working folder    --pack----> a2_first_last.zip
//! nearly right one  --fix-----> a conforming zip
//! ```
//!
//! Everything here is library code without processes. [`unpack_bytes`] is the one function that
//! decodes an archive: it writes below an empty destination folder that the caller made, and touches
//! nothing else. Submissions come in by [`crate::decode`], which calls it in a confined child.
//!
//! Conventions: paths of a submission are relative, UTF-8, with `/` between components and neither
//! `.` nor `..`; sizes are bytes; hashes are lower-case hexadecimal SHA-256.

mod check_config;
mod copy;
mod encoding;
mod finding;
mod folder;
mod gz;
mod json_lines;
mod lexer;
mod limits;
mod name;
mod pack;
mod source_paths;
mod source_rules;
mod submission;
mod submitted_config;
mod tar;
mod tar_sparse;
mod tree;
mod tree_config;
mod tree_lost;
mod tree_match;
mod tree_text;
mod unpack;
mod validate;
mod zip;
mod zip_headers;

pub use check_config::check_config;
pub use encoding::text_of;
pub use finding::{Excerpt, Finding, Severity};
pub use json_lines::{first_slip, line_of};
pub use limits::ArchiveLimits;
pub use pack::{Packed, archive_name, fix, mends, pack};
pub use source_rules::{INCLUDE_INSIDE, scan_source, scan_text};
pub use submission::{Format, IntakeError, Refusal, Submission, SubmittedFile};
pub use submitted_config::{Field, ListedRender, SubmittedConfig};
pub(crate) use tree::CONFIG_FILE;
pub use tree::{REPORT_FILES, TreeFile, TreeSpec};
pub use tree_match::{Mark, TreeLine};
pub(crate) use unpack::{copy_unpacked, known, name_of, read_archive};
pub use unpack::{format_of_bytes, unpack, unpack_bytes};
pub use validate::{Validation, validate_refusal, validate_submission};
