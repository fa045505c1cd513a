//! What the console shows: a table for many hand-ins, every detail for one.

mod detail;
mod page;
mod table;

pub use detail::detail;
pub use table::table;
