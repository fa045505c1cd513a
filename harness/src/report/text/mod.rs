//! What the console shows: a table for many submissions, the parts of one with what is next to do.

mod class;
mod closing;
mod defend;
mod detail;
mod explain;
mod page;
mod table;

pub use closing::{Closing, closing};
pub use defend::defend;
pub use detail::detail;
pub use explain::{explain, explain_all};
pub use page::Look;
pub use table::{in_a_line, table};
