//! What the targets share: bytes become the file that a reader expects.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use shakedown_gripper_assets::{HandFrame, ReadOptions, read_grasps};
use tempfile::TempDir;

/// Runs `f` with a directory that lives as long as the process.
pub fn in_directory<T>(f: impl FnOnce(&Path) -> T) -> T {
    thread_local!(static DIRECTORY: RefCell<Option<TempDir>> = const { RefCell::new(None) });
    let path: PathBuf = DIRECTORY.with_borrow_mut(|d| {
        let directory = d.get_or_insert_with(|| tempfile::tempdir().expect("a directory"));
        directory.path().to_owned()
    });
    f(&path)
}

/// Runs `f` with a file that holds `bytes`.
pub fn as_file<T>(bytes: &[u8], name: &str, f: impl FnOnce(&Path) -> T) -> T {
    in_directory(|directory| {
        let path = directory.join(name);
        std::fs::write(&path, bytes).expect("a temporary file");
        f(&path)
    })
}

/// No bytes make the reader of a grasp format panic.
pub fn grasps(bytes: &[u8], format: &str) {
    as_file(bytes, "grasps", |path| {
        let options = ReadOptions {
            format: Some(format.parse().expect("a known format")),
            frame: Some(HandFrame::Acronym),
            ..ReadOptions::default()
        };
        let _ = read_grasps(path, &options);
    });
}

/// No bytes make the reader of a mesh format panic. `parse_mesh` catches panics, which is known to
/// happen inside the gltf crate; any other is found here.
pub fn mesh(bytes: &[u8], name: &str) {
    let result = shakedown_objects::io::parse_mesh(bytes, name.as_ref());
    let caught = result.is_err_and(|e| e.to_string().contains("the file is damaged"));
    let is_gltf = bytes.starts_with(b"glTF") || name.ends_with("glb");
    assert!(is_gltf || !caught, "a panic was caught");
}

/// Splits bytes at the first zero: two files from one input.
pub fn two(bytes: &[u8]) -> (&[u8], &[u8]) {
    match bytes.iter().position(|b| *b == 0) {
        Some(i) => (&bytes[..i], &bytes[i + 1..]),
        None => (bytes, &[]),
    }
}
