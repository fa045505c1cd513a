//! What a wrong picture looks like: the catalogue of known mistakes.

mod catalogue;

pub use catalogue::{Catalogue, CatalogueError, KnownMistake};
