//! No bytes make the csv reader panic.
#![no_main]

use shakedown_gripper_assets::{HandFrame, ReadOptions, read_grasps};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    std::fs::write(file.path(), bytes).expect("a temporary file");
    let options = ReadOptions {
        format: Some("csv".parse().expect("a known format")),
        frame: Some(HandFrame::Acronym),
        ..ReadOptions::default()
    };
    let _ = read_grasps(file.path(), &options);
});
