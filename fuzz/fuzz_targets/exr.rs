//! Fuzzes [`umbra_fuzz::exr`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| umbra_fuzz::exr(bytes));
