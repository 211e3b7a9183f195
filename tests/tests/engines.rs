//! Two engines, one trial: what both must say, and what shortcuts must not change.

use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use shakedown_gripper_assets::{Grasp, Gripper, ReadOptions, read_grasps};
use shakedown_objects::Object;
use shakedown_objects::mesh::RawMesh;
use shakedown_sim::{Protocol, Scene, run_trial};
use shakedown_tests::measure::{creep_mm_s, delivered_n, slip_onset};
use shakedown_tests::rig::{self, block, gripped};
use shakedown_tests::{acronym_object, files, shared};

#[test]
fn rapier_obeys_the_laws_of_a_grip_too() {
    let cube = block(nalgebra::Vector3::repeat(0.05), 0.1);
    let scene = gripped(&cube, 0.5, 20.0, &["solver.engine=rapier"]);
    let onset = slip_onset(&scene, &nalgebra::Vector3::y());
    assert!((onset - 1.0).abs() < 0.01, "slips at {onset} of 2 mu F");
    let force_n = delivered_n(&scene);
    assert!((force_n - 20.0).abs() < 0.1, "{force_n} N of 20");
    let creep = creep_mm_s(&scene, 0.5);
    assert!(creep < 0.003, "{creep} mm/s");
}

/// Some real grasps of every so many ACRONYM files, with their objects.
fn real_grasps(test: &str, every: usize, each: usize) -> Vec<(Object, Vec<Grasp>)> {
    let Some(root) = shared(test) else {
        return Vec::new();
    };
    let split = root.join("acronym/seen");
    let load = |path: &std::path::PathBuf| {
        let file = read_grasps(path, &ReadOptions::default()).expect("readable");
        let object = acronym_object(&split, &file);
        let step = file.grasps.len() / each;
        let grasps = file.grasps.into_iter().step_by(step).take(each).collect();
        (object, grasps)
    };
    let all = files(&split.join("grasps"), "h5");
    all.iter().step_by(every).map(load).collect()
}

/// Share of the grasps with the same verdict under two settings of the preset `acronym`.
fn same_verdicts(objects: &[(Object, Vec<Grasp>)], a: &[&str], b: &[&str]) -> (usize, usize) {
    let gripper = Gripper::load("franka_panda").expect("built in");
    let protocol = |sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(|s| (*s).to_owned()).collect();
        Protocol::load("acronym", &sets).expect("known constants")
    };
    let (a, b) = (protocol(a), protocol(b));
    let cache: Option<&Path> = None;
    let (mut same, mut all) = (0, 0);
    for (object, grasps) in objects {
        let scene = |p: &Protocol| Scene::new(object, &gripper, p, None, cache).expect("a scene");
        let (a, b) = (scene(&a), scene(&b));
        for grasp in grasps {
            let pose = &grasp.object_from_hand;
            same += usize::from(run_trial(&a, pose).is_held() == run_trial(&b, pose).is_held());
            all += 1;
        }
    }
    (same, all)
}

#[test]
fn kept_contacts_change_no_more_verdicts_than_a_hair_of_speed_does() {
    let objects = real_grasps("kept_contacts", 10, 40);
    let (same, all) = same_verdicts(&objects, &[], &["solver.contact_reuse_m=0"]);
    assert!(same * 100 >= all * 98, "{same} of {all}");
}

#[test]
fn moving_object_and_hand_together_changes_hardly_a_verdict_of_real_grasps() {
    let gripper = Gripper::load("franka_panda").expect("built in");
    let protocol = Protocol::load("acronym", &[]).expect("built in");
    let motion = Isometry3::from_parts(
        Translation3::new(0.4, -1.1, 0.7),
        UnitQuaternion::from_euler_angles(0.9, -0.3, 2.0),
    );
    let (mut same, mut all) = (0, 0);
    for (object, grasps) in real_grasps("rigid_motion", 10, 30) {
        let raw = RawMesh {
            vertices: (object.surface.mesh().vertices().iter())
                .map(|v| (motion * v).into())
                .collect(),
            faces: object.surface.mesh().faces().to_vec(),
        };
        let moved = rig::object(raw, object.mass.mass_kg);
        let scene = |o: &Object| Scene::new(o, &gripper, &protocol, None, None).expect("a scene");
        let (here, there) = (scene(&object), scene(&moved));
        for grasp in grasps {
            let pose = &grasp.object_from_hand;
            let verdict = run_trial(&here, pose).is_held();
            same += usize::from(verdict == run_trial(&there, &(motion * pose)).is_held());
            all += 1;
        }
    }
    eprintln!("{same} of {all} verdicts alike");
    // f32 corners round otherwise about another origin.
    assert!(same * 100 >= all * 96, "{same} of {all}");
}

#[test]
fn both_engines_give_most_real_grasps_the_same_verdict() {
    let objects = real_grasps("both_engines", 20, 12);
    let rapier = ["solver.engine=rapier"];
    let (same, all) = same_verdicts(&objects, &[], &rapier);
    assert!(same * 100 >= all * 80, "{same} of {all}");
}
