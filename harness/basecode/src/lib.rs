pub mod exr_io;
pub mod image;
