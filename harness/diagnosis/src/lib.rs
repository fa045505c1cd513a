//! Diagnosis of wrong answers: the catalogue of known mistakes, their answers, and the one nearest to a submission's
//! answers.

mod catalogue;
mod diagnose;
pub mod fit;
mod loops;
mod nearest;
mod stored;
mod thumbnail;
mod view;

pub use catalogue::{Catalogue, CatalogueError, KnownMistake, MistakeClass, RightVariant};
pub use diagnose::{Diagnosis, Input};
pub use stored::{Material, Stored, StoredError, StoredView};
pub use thumbnail::{LENGTH, Thumbnail};
pub use view::{LoopSeen, Observations, View, ViewKind};
