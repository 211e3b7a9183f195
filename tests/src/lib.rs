//! What the tests of the whole share: where the real data lies, and how to say that it does not.

pub mod laws;
pub mod measure;
pub mod rig;

use std::path::{Path, PathBuf};

/// The folder of real data beside the checkout (`SHAKEDOWN_SHARED`, else `../shared`), or `None`
/// after saying plainly that `test` was skipped.
pub fn shared(test: &str) -> Option<PathBuf> {
    let root = std::env::var_os("SHAKEDOWN_SHARED").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared"),
        PathBuf::from,
    );
    if root.join("acronym/seen/grasps").is_dir() {
        return Some(root);
    }
    eprintln!("SKIPPED {test}: no real data at {}", root.display());
    None
}

/// ACRONYM's sample mug, relative to the split folder.
pub const SAMPLE_MUG: &str = "grasps/Mug_10f6e09036350e92b3f21f1137c3c347_0.0002682457830986903.h5";

/// All files of a folder with an extension, sorted.
pub fn files(directory: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = std::fs::read_dir(directory)
        .into_iter()
        .flatten()
        .filter_map(|e| e.ok().map(|e| e.path()))
        .filter(|p| p.extension().is_some_and(|e| e == extension))
        .collect();
    found.sort();
    found
}

/// The object of an ACRONYM file.
pub fn acronym_object(
    split: &Path,
    file: &shakedown_gripper_assets::GraspFile,
) -> shakedown_objects::Object {
    let spec = shakedown_objects::ObjectSpec {
        mesh: split.join(file.object.mesh.as_ref().expect("a mesh")),
        scale: file.object.scale,
        mass_kg: file.object.mass_kg,
        ..shakedown_objects::ObjectSpec::default()
    };
    shakedown_objects::Object::load(&spec).expect("a good mesh")
}
