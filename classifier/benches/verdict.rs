//! Full geometric verdicts per second. Peers on ACRONYM's sample mug: python-fcl's collision check
//! alone 20 900 poses/s. `SHAKEDOWN_GRASPS` (an ACRONYM h5) and `SHAKEDOWN_MESH` with
//! `SHAKEDOWN_SCALE` choose that mug; otherwise the embedded one with its antipodal grasps turned
//! into a fan of poses.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use shakedown_classifier::{HandModel, Thresholds, classify};
use shakedown_gripper_assets::{Gripper, ReadOptions, read_grasps};
use shakedown_objects::shapes::Family;
use shakedown_objects::{Object, ObjectSpec};

fn subject(hand_depth_m: f64) -> (Object, Vec<Isometry3<f64>>) {
    let var = |name: &str| std::env::var(name).ok();
    if let (Some(grasps), Some(mesh)) = (var("SHAKEDOWN_GRASPS"), var("SHAKEDOWN_MESH")) {
        let file = read_grasps(grasps.as_ref(), &ReadOptions::default()).expect("grasps");
        let object = Object::load(&ObjectSpec {
            mesh: mesh.into(),
            scale: file.object.scale,
            ..ObjectSpec::default()
        })
        .expect("a usable mesh");
        return (
            object,
            file.grasps.iter().map(|g| g.object_from_hand).collect(),
        );
    }
    let object = Family::Mug.member(0).object().expect("built in");
    let com = object.mass.com_m.coords;
    let poses = (0..2000)
        .map(|i| {
            let angle = f64::from(i) * 2.399_963;
            let tilt = f64::from(i) / 2000.0 * std::f64::consts::PI;
            let rotation = UnitQuaternion::from_euler_angles(0.0, tilt, angle);
            let back = rotation * Vector3::new(0.0, 0.0, -hand_depth_m);
            Isometry3::from_parts(Translation3::from(com + back), rotation)
        })
        .collect();
    (object, poses)
}

fn verdict(c: &mut Criterion) {
    let gripper = Gripper::load("franka_panda").expect("built in");
    let hand = HandModel::new(&gripper, gripper.opening_max_m).expect("built in");
    let thresholds = Thresholds::default();
    let (object, poses) = subject(gripper.tcp_z_m);
    // A fixed spread of 15 mm and 0.3 rad: about half of the poses collide then.
    let spread: Vec<Isometry3<f64>> = poses
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let wave = |k: f64| (i as f64 * k).sin();
            let shift = Vector3::new(wave(1.7), wave(2.9), wave(3.3)) * 0.021;
            let turn = Vector3::new(wave(0.7), wave(1.1), wave(1.9)) * 0.3;
            p * Isometry3::from_parts(Translation3::from(shift), UnitQuaternion::new(turn))
        })
        .collect();
    let mut group = c.benchmark_group("verdict");
    group.throughput(Throughput::Elements(poses.len() as u64));
    group.sample_size(10);
    for (name, poses) in [("as_given", &poses), ("perturbed", &spread)] {
        group.bench_function(name, |b| {
            b.iter(|| {
                poses
                    .iter()
                    .filter(|p| classify(&hand, &object.surface, p, &thresholds).collides)
                    .count()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, verdict);
criterion_main!(benches);
