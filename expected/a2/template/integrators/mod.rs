//! Light transport.

mod normal;
mod simple;

pub use normal::NormalIntegrator;
pub use simple::SimpleIntegrator;
