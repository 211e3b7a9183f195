//! No bytes make the ply reader panic.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = shakedown_objects::io::parse_mesh(bytes, "fuzz.ply".as_ref());
});
