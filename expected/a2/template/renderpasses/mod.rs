//! Realtime drawing.

mod normal;
mod shadow;
mod simple;

pub use normal::NormalPass;
pub use simple::SimplePass;
