//! No bytes make the stl reader panic.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = shakedown_objects::io::parse_mesh(bytes, "fuzz.stl".as_ref());
});
