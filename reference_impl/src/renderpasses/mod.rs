//! Realtime drawing.

mod normal;
mod shadow;
mod simple;

pub use normal::NormalPass;
pub use simple::SimplePass;
pub(crate) use simple::{DIFFUSE_FS, Object, PHONG_FS, SIMPLE_VS};
