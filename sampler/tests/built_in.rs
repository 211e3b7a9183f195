//! The models that come with this repository can be used as they are.

#![cfg(feature = "onnx")]

use shakedown_gripper_assets::Gripper;
use shakedown_objects::shapes::Family;
use shakedown_sampler::{DrawSettings, FlowModel, ModelFiles, built_in_names};

#[test]
fn each_draws_grasps_whose_tcp_lies_at_the_object() {
    let gripper = Gripper::load("franka_panda").unwrap();
    let object = Family::Mug.member(2).object().unwrap();
    let (low, high) = object.surface.mesh().bounds();
    for name in built_in_names() {
        let files = ModelFiles::find(name).unwrap();
        let evaluator = files.evaluator.as_deref().unwrap().len();
        let size = files.card.len() + files.encoder.len() + files.velocity.len() + evaluator;
        assert!(size <= 8_000_000, "{name}: {size} bytes");
        let card = files.parsed_card().unwrap();
        assert_eq!(card.name, name);
        assert!(!card.licence.is_empty() && card.command.contains("shakedown train"));
        let mut model = FlowModel::open(&files, None).unwrap();
        let grasps = model
            .sample(&object, &gripper, 64, 0, DrawSettings::default())
            .unwrap();
        let near = grasps
            .iter()
            .filter(|g| {
                let tcp = g.object_from_hand * nalgebra::Point3::new(0.0, 0.0, gripper.tcp_z_m);
                (0..3).all(|k| tcp[k] > low[k] - 0.02 && tcp[k] < high[k] + 0.02)
            })
            .count();
        assert!(near >= 58, "{name}: {near} of 64");
    }
    let error = ModelFiles::find("nobody").unwrap_err().to_string();
    assert!(
        error.contains("rfm-embedded") && error.contains("rfm-acronym"),
        "{error}"
    );
}

#[test]
fn each_is_accepted_and_draws_the_same_when_it_comes_as_files_from_outside() {
    let object = Family::Mug.member(2).object().unwrap();
    let gripper = Gripper::load("franka_panda").unwrap();
    for name in built_in_names() {
        let files = ModelFiles::find(name).unwrap();
        let directory = tempfile::tempdir().unwrap();
        let write = |file: &str, bytes: &[u8]| {
            std::fs::write(directory.path().join(file), bytes).unwrap();
        };
        write("model.toml", files.card.as_bytes());
        write("encoder.onnx", &files.encoder);
        write("velocity.onnx", &files.velocity);
        if let Some(evaluator) = &files.evaluator {
            write("evaluator.onnx", evaluator);
        }
        let draw = |mut model: FlowModel| {
            model
                .sample(&object, &gripper, 3, 0, DrawSettings::default())
                .unwrap()
        };
        let outside = FlowModel::load(directory.path(), None).unwrap();
        let inside = FlowModel::open(&files, None).unwrap();
        assert_eq!(draw(outside), draw(inside), "{name}");
    }
}
