//! No bytes make the off reader panic.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| shakedown_fuzz::mesh(bytes, "fuzz.off"));
