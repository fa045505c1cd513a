//! Fuzzes [`umbra_fuzz::archive`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| umbra_fuzz::archive(bytes));
