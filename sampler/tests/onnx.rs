//! The flow sampler on hand-made graphs: closed-form end poses, and every defect of a model is an
//! error that names file and tensor.

#![cfg(feature = "onnx")]

mod fixture;

use std::path::Path;

use fixture::*;
use nalgebra::Vector3;
use shakedown_gripper_assets::Gripper;
use shakedown_objects::shapes::Family;
use shakedown_objects::{Normalisation, SdfGrid};
use shakedown_sampler::noise::{Attempt, Noise};
use shakedown_sampler::{DrawSettings, FlowModel};

const XI: [f32; 9] = [2.0, -0.7, -1.0, 0.7, 2.0, -0.5, 1.0, 0.5, 2.0];
const TARGET: [f32; 3] = [0.2, -0.1, 0.4];
const DRIFT: [f32; 3] = [0.3, 0.0, -0.6];

fn good(directory: &Path, extra: &str) {
    card(directory, 9, 20, extra);
    save(&small_encoder(9), &directory.join("encoder.onnx"));
    save(
        &spring_velocity(XI, TARGET, DRIFT),
        &directory.join("velocity.onnx"),
    );
}

fn in_steps(steps: Option<usize>) -> DrawSettings {
    DrawSettings {
        steps,
        redraws: None,
    }
}

#[test]
fn sampled_poses_equal_the_recurrence_and_approach_the_closed_form() {
    let dir = tempfile::tempdir().unwrap();
    let gripper = Gripper::load("franka_panda").unwrap();
    let object = Family::Bottle.member(0).object().unwrap();
    let grid = SdfGrid::bake(&object.surface, 9, 0.1);
    let (_, scale) = grid.normalised(Normalisation::MaxAbs);
    // The skew part of XI is the body-frame angular velocity (0.5, -1.0, 0.7).
    let omega = Vector3::new(0.5, -1.0, 0.7);
    let (target, drift) = (
        Vector3::from(TARGET).map(f64::from),
        Vector3::from(DRIFT).map(f64::from),
    );
    let second = ["heun", "adams_bashforth"].map(|i| (format!("integrator = '{i}'\n"), 2));
    for (extra, order) in [(String::new(), 1)].into_iter().chain(second) {
        good(dir.path(), &extra);
        let mut model = FlowModel::load(dir.path(), None).unwrap();
        let mut error = |steps: usize| {
            let grasps = model
                .sample(&object, &gripper, 5, 3, in_steps(Some(steps)))
                .unwrap();
            let mut worst = 0.0f64;
            for g in &grasps {
                let start =
                    Noise::new(3, &object.id, &gripper.name, 1.0).at(g.index, Attempt::default());
                let (r0, t0) = (start.rotation, start.translation);
                let angle = g
                    .object_from_hand
                    .rotation
                    .angle_to(&(r0 * nalgebra::UnitQuaternion::new(omega)));
                assert!(angle < 1e-5, "{angle}");
                let end = (g.object_from_hand.translation.vector - grid.centre_m.coords) / scale;
                if order == 1 {
                    let dt = 1.0 / steps as f64;
                    let recurrence =
                        (0..steps).fold(t0, |t, k| t + (target - t + drift * (k as f64 * dt)) * dt);
                    assert!((end - recurrence).norm() < 1e-5);
                }
                // t' = a - t + s d: t(1) = a - d + s d + (t0 - a + d) e^-1 at s = 1.
                let exact = target + (t0 - target + drift) * (-1.0f64).exp();
                worst = worst.max((end - exact).norm());
            }
            worst
        };
        let (coarse, fine) = (error(10), error(20));
        let ratio = coarse / fine;
        assert!(
            (ratio - f64::from(1 << order)).abs() < 0.4 * f64::from(order),
            "{ratio}"
        );
    }
}

#[test]
fn the_number_of_candidates_and_the_batch_do_not_change_a_candidate() {
    let dir = tempfile::tempdir().unwrap();
    good(dir.path(), "");
    let gripper = Gripper::load("franka_panda").unwrap();
    let object = Family::Can.member(0).object().unwrap();
    let mut model = FlowModel::load(dir.path(), None).unwrap();
    let many = model
        .sample(&object, &gripper, 300, 1, in_steps(None))
        .unwrap();
    let few = model
        .sample(&object, &gripper, 7, 1, in_steps(None))
        .unwrap();
    assert_eq!(many[..7], few[..]);
}

/// A flow that stands still draws its noise: with `noise = "surface"` close to the surface, wherever that is.
#[test]
fn a_flow_may_begin_close_to_the_surface() {
    let dir = tempfile::tempdir().unwrap();
    card(dir.path(), 24, 1, "noise = 'surface'\n");
    save(&small_encoder(24), &dir.path().join("encoder.onnx"));
    save(&still_velocity(), &dir.path().join("velocity.onnx"));
    let gripper = Gripper::load("franka_panda").unwrap();
    let object = Family::Mug.member(0).object().unwrap();
    let cell_m = 1.1 * object.surface.mesh().extents().max() / 23.0;
    let mut model = FlowModel::load(dir.path(), None).unwrap();
    let grasps = model.sample(&object, &gripper, 300, 5, in_steps(None));
    let mut sides = [0; 2];
    for grasp in grasps.unwrap() {
        let point = grasp.object_from_hand.translation.vector.into();
        let distance_m = object.surface.signed_distance(&point);
        assert!(distance_m.abs() < 3.0 * cell_m, "{distance_m} {cell_m}");
        sides[usize::from(distance_m < 0.0)] += 1;
    }
    assert!(sides.iter().all(|n| *n > 60), "{sides:?}");
}

/// The flow stands still, so a grasp ends where its noise began, and the evaluator's score is a known
/// function of that: which attempt each number takes can be told from the streams.
#[test]
fn a_grasp_below_the_least_score_is_drawn_anew_and_the_best_attempt_is_kept() {
    let dir = tempfile::tempdir().unwrap();
    let extra = "evaluator = { least_score = 0.7, redraws = 3 }\n";
    card(dir.path(), 9, 1, extra);
    save(&small_encoder(9), &dir.path().join("encoder.onnx"));
    save(&still_velocity(), &dir.path().join("velocity.onnx"));
    save(&turn_evaluator(), &dir.path().join("evaluator.onnx"));
    let gripper = Gripper::load("franka_panda").unwrap();
    let object = Family::Can.member(0).object().unwrap();
    let mut model = FlowModel::load(dir.path(), None).unwrap();
    let drawn = model.sample(&object, &gripper, 300, 5, DrawSettings::default());
    let drawn = drawn.unwrap();
    let score = |attempt: usize, index: u64| {
        let attempt = Attempt {
            place: 0,
            turn: attempt,
        };
        let start = Noise::new(5, &object.id, &gripper.name, 1.0).at(index, attempt);
        let r = start.rotation.to_rotation_matrix()[(0, 0)];
        1.0 / (1.0 + (-4.0 * r).exp())
    };
    let mut ended = [0; 5];
    for grasp in &drawn {
        let scores = [0, 1, 2, 3].map(|attempt| score(attempt, grasp.index));
        let first = scores.iter().position(|s| *s >= 0.7);
        let expected = match first {
            Some(k) => scores[k],
            None => scores.into_iter().fold(0.0, f64::max),
        };
        assert!((grasp.score.unwrap() - expected).abs() < 1e-6, "{grasp:?}");
        ended[first.unwrap_or(4)] += 1;
    }
    // R_xx is uniform within -1..1 and has to be 0.21: two fifths at once, a seventh never.
    assert!(ended.iter().all(|n| *n > 10), "{ended:?}");
    let few = model.sample(&object, &gripper, 7, 5, DrawSettings::default());
    assert_eq!(few.unwrap()[..], drawn[..7]);
    let none = DrawSettings {
        redraws: Some(0),
        ..DrawSettings::default()
    };
    let all = model.sample(&object, &gripper, 300, 5, none).unwrap();
    for grasp in all {
        let expected = score(0, grasp.index);
        assert!((grasp.score.unwrap() - expected).abs() < 1e-6);
    }
}

#[test]
fn every_defect_of_a_model_names_file_and_tensor() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    let encoder = || small_encoder(9);
    let velocity = || spring_velocity(XI, TARGET, DRIFT);
    let check = |change: &dyn Fn(), file: &str, needle: &str| {
        good(path, "");
        change();
        let e = match FlowModel::load(path, None) {
            Ok(_) => panic!("{needle}: accepted"),
            Err(e) => e.to_string(),
        };
        assert!(e.contains(file) && e.contains(needle), "{needle}: {e}");
    };
    let write = |m: &tract_onnx::pb::ModelProto, name: &str| save(m, &path.join(name));
    check(
        &|| std::fs::remove_file(path.join("encoder.onnx")).unwrap(),
        "encoder.onnx",
        "missing",
    );
    check(
        &|| std::fs::write(path.join("velocity.onnx"), b"no onnx").unwrap(),
        "velocity.onnx",
        "ONNX",
    );
    check(
        &|| write(&small_encoder(12), "encoder.onnx"),
        "encoder.onnx",
        "`sdf`",
    );
    check(&|| card(path, 9, 0, ""), "model.toml", "steps");
    let judged = |least: f64, redraws: usize| {
        let extra = format!("evaluator = {{ least_score = {least}, redraws = {redraws} }}\n");
        card(path, 9, 5, &extra);
    };
    check(&|| judged(1.5, 2), "model.toml", "least_score");
    check(&|| judged(0.5, 5000), "model.toml", "redraws");
    check(&|| judged(0.5, 2), "evaluator.onnx", "missing");
    let judged_by = |change: &dyn Fn(&mut tract_onnx::pb::GraphProto)| {
        judged(0.5, 2);
        let mut m = turn_evaluator();
        change(m.graph.as_mut().unwrap());
        write(&m, "evaluator.onnx");
    };
    check(
        &|| judged_by(&|g| g.input.push(value("time", FLOAT, &[-1, 1]))),
        "evaluator.onnx",
        "`time`",
    );
    check(
        &|| {
            judged_by(&|g| {
                g.output[0].name = "belief".into();
                g.node.last_mut().unwrap().output[0] = "belief".into();
            });
        },
        "evaluator.onnx",
        "`score`",
    );
    std::fs::remove_file(path.join("evaluator.onnx")).unwrap();
    check(&|| card(path, 9, 5, "colour = 1\n"), "model.toml", "colour");
    check(
        &|| card(path, 9, 5, "frame = 'acronym'\n"),
        "model.toml",
        "line",
    );
    check(
        &|| {
            let mut m = encoder();
            m.graph.as_mut().unwrap().output[0].name = "code".into();
            m.graph.as_mut().unwrap().node[2].output[0] = "code".into();
            write(&m, "encoder.onnx");
        },
        "encoder.onnx",
        "`latent`",
    );
    check(
        &|| {
            let mut m = velocity();
            m.graph.as_mut().unwrap().input[3] = value("time", FLOAT, &[1, 1]);
            write(&m, "velocity.onnx");
        },
        "velocity.onnx",
        "`time`",
    );
    check(
        &|| {
            let mut m = velocity();
            m.graph
                .as_mut()
                .unwrap()
                .input
                .push(value("colour", FLOAT, &[-1, 1]));
            write(&m, "velocity.onnx");
        },
        "velocity.onnx",
        "`colour`",
    );
    check(
        &|| {
            let mut m = velocity();
            let points = value("sdf_at_points", FLOAT, &[-1, -1]);
            m.graph.as_mut().unwrap().input.push(points);
            write(&m, "velocity.onnx");
        },
        "velocity.onnx",
        "`sdf_at_points`",
    );
}

#[test]
fn a_network_that_returns_nan_is_an_error_not_a_grasp() {
    let dir = tempfile::tempdir().unwrap();
    good(dir.path(), "");
    let nan = spring_velocity(XI, [f32::NAN, 0.0, 0.0], DRIFT);
    save(&nan, &dir.path().join("velocity.onnx"));
    let gripper = Gripper::load("franka_panda").unwrap();
    let object = Family::Can.member(0).object().unwrap();
    let mut model = FlowModel::load(dir.path(), None).unwrap();
    let e = model
        .sample(&object, &gripper, 2, 0, in_steps(None))
        .unwrap_err()
        .to_string();
    assert!(
        e.contains("velocity.onnx") && e.contains("`translation_velocity`"),
        "{e}"
    );
}
