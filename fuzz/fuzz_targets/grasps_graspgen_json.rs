//! No bytes make the graspgen-json reader panic.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| shakedown_fuzz::grasps(bytes, "graspgen-json"));
