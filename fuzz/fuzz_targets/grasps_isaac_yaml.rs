//! No bytes make the isaac-yaml reader panic.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| shakedown_fuzz::grasps(bytes, "isaac-yaml"));
