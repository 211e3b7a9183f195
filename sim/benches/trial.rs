//! Trials per second, one thread, by what the fingers touch.

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Isometry3;
use shakedown_gripper_assets::Gripper;
use shakedown_objects::shapes::Family;
use shakedown_sim::{Protocol, Scene, run_trial};

fn trial(c: &mut Criterion) {
    let gripper = Gripper::load("franka_panda").expect("built in");
    let object = Family::Can.member(0).object().expect("built in");
    let com = object.mass.com_m.coords;
    // From the side, at half height: a grasp that holds, so every stage is run.
    let turn = nalgebra::UnitQuaternion::from_euler_angles(0.0, std::f64::consts::FRAC_PI_2, 0.0)
        * nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
    let back = turn * nalgebra::Vector3::new(0.0, 0.0, -gripper.tcp_z_m);
    let pose = Isometry3::from_parts((com + back).into(), turn);
    let mut group = c.benchmark_group("trial");
    group.sample_size(10);
    for contact in ["pieces", "surface"] {
        let set = vec![format!("solver.object_contact={contact}")];
        let protocol = Protocol::load("acronym", &set).expect("built in");
        let scene = Scene::new(&object, &gripper, &protocol, None, None).expect("a scene");
        assert!(
            run_trial(&scene, &pose).is_held(),
            "the bench measures a grasp that holds"
        );
        group.bench_function(contact, |b| b.iter(|| run_trial(&scene, &pose)));
    }
    group.finish();
}

criterion_group!(benches, trial);
criterion_main!(benches);
