//! Realtime drawing.

mod normal;
mod shadow;
mod simple;

pub use normal::NormalPass;
pub use simple::SimplePass;
#[cfg(test)]
pub(crate) use simple::PHONG_FS;
pub(crate) use simple::{DIFFUSE_FS, Object, SIMPLE_VS};
