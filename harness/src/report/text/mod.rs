//! Console output: a table of many submissions; for one, its parts and the next step.

mod class;
mod closing;
mod defend;
mod detail;
mod explain;
mod page;
mod table;

pub use closing::{Closing, checked_only, closing};
pub use defend::defend;
pub use detail::detail;
pub use explain::{explain, explain_all};
pub use page::Look;
pub use table::{in_a_line, table};
