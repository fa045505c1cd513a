//! The sandbox against a hostile program: each layer by itself, all together, as root and not.
//! Every attack is also run where the layer is off and must succeed there, where that is harmless:
//! a test that passes without a sandbox proves nothing.
#![cfg(target_os = "linux")]

mod endings;
mod fixture;
mod layers;
mod limits;
mod useful;
mod whole;
