//! What a wrong picture looks like: the catalogue of known mistakes, what they answer, and which one
//! a submission's answers are nearest to.

mod catalogue;
mod diagnose;
pub mod fit;
mod loops;
mod nearest;
mod stored;
mod thumbnail;
mod view;

pub use catalogue::{Catalogue, CatalogueError, Class, KnownMistake, RightVariant};
pub use diagnose::{Diagnosis, Input};
pub use stored::{Material, Stored, StoredError, StoredView};
pub use thumbnail::{LENGTH, Thumbnail};
pub use view::{Kind, LoopSeen, Observations, View};
