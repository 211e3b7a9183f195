//! No bytes make the acronym-h5 reader panic.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| shakedown_fuzz::grasps(bytes, "acronym-h5"));
