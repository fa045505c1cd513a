//! Realtime drawing.

mod device;
mod normal;
mod shadow;
mod simple;

pub use normal::NormalPass;
pub use simple::SimplePass;
