//! Realtime drawing.

mod normal;
mod simple;

pub use normal::NormalPass;
pub use simple::SimplePass;
