//! Fuzzes [`umbra_fuzz::mtl`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| umbra_fuzz::mtl(bytes));
