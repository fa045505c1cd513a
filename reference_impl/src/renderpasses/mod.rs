//! Realtime drawing.

mod normal;
mod shadow;
mod simple;

pub use normal::NormalPass;
#[cfg(test)]
pub(crate) use simple::PHONG_FS;
pub use simple::SimplePass;
pub(crate) use simple::{DIFFUSE_FS, Object, SIMPLE_VS};
