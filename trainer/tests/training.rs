//! Claims about training: what is exported is what was trained, a kill changes no bit, and what
//! cannot be learned is said.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::Duration;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use shakedown_gripper_assets::Gripper;
use shakedown_objects::shapes::Family;
use shakedown_objects::{Normalisation, Object, Probe};
use shakedown_sampler::{
    AntipodalSettings, DrawSettings, EvaluatorCard, FlowModel, ModelFiles, sample_antipodal,
};
use shakedown_trainer::batch::{Batch, Batches};
use shakedown_trainer::evaluator::{self, Evaluator, EvaluatorPreset};
use shakedown_trainer::export::{Provenance, add_evaluator, export};
use shakedown_trainer::gradient::Network;
use shakedown_trainer::history::Entry;
use shakedown_trainer::moments::Moments;
use shakedown_trainer::network::initial;
use shakedown_trainer::{
    Observer, Pair, Preset, Progress, TrainError, Training, TrainingObject, features, train,
};

struct Quiet;

impl Observer for Quiet {
    fn progress(&mut self, _: &Progress) {}
    fn validate(&mut self, directory: &Path, _: u64) -> Result<BTreeMap<String, f64>, String> {
        FlowModel::load(directory, None).map_err(|e| e.to_string())?;
        Ok(BTreeMap::from([("loads".to_owned(), 1.0)]))
    }
}

fn small(name: &str) -> Preset {
    let mut preset = Preset::load(name).unwrap();
    preset.network.width = 24;
    preset.network.layers = 3;
    preset.network.latent = 8;
    preset.flow.resolution = 16;
    preset.training.objects_per_batch = 2;
    preset.training.grasps_per_object = 8;
    preset.training.steps = 100;
    preset.flow.couplings = preset.flow.couplings.min(48);
    preset
}

fn object(family: Family) -> Object {
    family.member(0).object().unwrap()
}

fn data(preset: &Preset) -> Vec<TrainingObject> {
    let gripper = Gripper::load("franka_panda").unwrap();
    [Family::Box, Family::Ring]
        .into_iter()
        .map(|family| {
            let object = object(family);
            let grasps = sample_antipodal(&object, &gripper, 20, 0, &AntipodalSettings::default());
            let mut object = TrainingObject::new(
                &object.id,
                &object.surface,
                &grasps,
                gripper.tcp_z_m,
                preset,
            )
            .unwrap();
            object.couple(preset, 3);
            object
        })
        .collect()
}

fn training<'a>(
    preset: &'a Preset,
    objects: &'a [TrainingObject],
    out: &'a Path,
    provenance: &'a Provenance,
) -> Training<'a> {
    Training {
        preset,
        objects,
        run_seed: 3,
        out,
        provenance,
        resume: false,
        start_from: None,
        time_limit: None,
        checkpoint_steps: 50,
        validation_steps: 0,
    }
}

fn provenance() -> Provenance {
    Provenance {
        name: "test".into(),
        licence: "MIT OR Apache-2.0".into(),
        training_data: "two shapes".into(),
        command: "cargo test".into(),
        gripper: "franka_panda".into(),
        ..Provenance::default()
    }
}

/// One Euler step of the exported graphs goes where the network in Rust says, within 1e-5. The
/// runtime is tract, or an ONNX Runtime where `ORT_DYLIB_PATH` names one.
#[test]
fn the_exported_graphs_are_the_network() {
    let gripper = Gripper::load("franka_panda").unwrap();
    let dir = tempfile::tempdir().unwrap();
    for name in ["paper", "best"] {
        let preset = small(name);
        let mut parameters = initial(&preset, 1);
        // Biases too, so that a wrong one would show.
        for p in &mut parameters {
            for (i, v) in p.values.iter_mut().enumerate() {
                *v += 0.01 * ((i * 7919) % 13) as f32 - 0.06;
            }
        }
        let out = dir.path().join(name);
        export(&out, &preset, &parameters, &provenance()).unwrap();
        let mut model = FlowModel::load(&out, None).unwrap();
        // In the axes in which the model sees it.
        let object = object(Family::Mug);
        let object = object.turned(&object.snug_axes());
        let paths = model.paths(&object, &gripper, 6, 4, Some(1)).unwrap();
        let own = TrainingObject::new("mug", &object.surface, &[], gripper.tcp_z_m, &preset);
        let own = own.unwrap();
        let width = features::count(&preset.network);
        let points = Probe::new(&features::control_points_m());
        let mut batch = Batch {
            grids: match name {
                "paper" => own.sdf.values.clone(),
                _ => own.histogram.clone(),
            },
            scale_m: vec![own.sdf.scale_m as f32],
            features: vec![0.0; width * paths.len()],
            targets: Vec::new(),
        };
        for (path, out) in paths.iter().zip(batch.features.chunks_mut(width)) {
            let pose = Isometry3::from_parts(
                Translation3::from(path.states[0].translation.cast::<f32>()),
                path.states[0].rotation.cast(),
            );
            let seen = (&own.sdf, &own.moments);
            features::write(&preset.network, &points, seen, &pose, 0.0, out);
        }
        let mut network = Network::new(&preset);
        let raw = network.forward(&parameters, &batch);
        for (path, raw) in paths.iter().zip(raw.chunks(12)) {
            let xi = |r: usize, c: usize| f64::from(raw[3 * r + c]);
            let omega = Vector3::new(
                (xi(2, 1) - xi(1, 2)) / 2.0,
                (xi(0, 2) - xi(2, 0)) / 2.0,
                (xi(1, 0) - xi(0, 1)) / 2.0,
            );
            let mut v = Vector3::new(raw[9].into(), raw[10].into(), raw[11].into());
            if preset.network.hand_frame {
                v = path.states[0].rotation * v * (0.1 / own.sdf.scale_m);
            }
            let end = path.states[0].rotation * UnitQuaternion::new(omega);
            assert!(end.angle_to(&path.states[1].rotation) < 2e-5, "{name}");
            let way = path.states[1].translation - path.states[0].translation;
            assert!(
                (way - v).norm() < 1e-5 * (1.0 + v.norm()),
                "{name}: {way} {v}"
            );
        }
    }
}

/// The score of an exported evaluator is the sigmoid of the network's logit.
#[test]
fn the_exported_evaluator_is_the_network() {
    let gripper = Gripper::load("franka_panda").unwrap();
    let dir = tempfile::tempdir().unwrap();
    let flow = small("best");
    let out = dir.path().join("flow");
    export(&out, &flow, &initial(&flow, 1), &provenance()).unwrap();
    let files = ModelFiles::read(&out).unwrap();
    let mut card = files.parsed_card().unwrap();
    card.evaluator = Some(EvaluatorCard {
        least_score: 0.5,
        redraws: 0,
    });
    let mut preset = EvaluatorPreset::built_in();
    preset.width = 24;
    let mut parameters = evaluator::initial(&preset, 2);
    for p in &mut parameters {
        for (i, v) in p.values.iter_mut().enumerate() {
            *v += 0.01 * ((i * 7919) % 13) as f32 - 0.06;
        }
    }
    let judged = dir.path().join("judged");
    add_evaluator(&judged, &files, &card, &parameters).unwrap();
    let mut model = FlowModel::load(&judged, None).unwrap();
    let object = object(Family::Mug);
    let object = object.turned(&object.snug_axes());
    let settings = DrawSettings::default();
    let grasps = model.sample(&object, &gripper, 6, 4, settings).unwrap();
    let own = TrainingObject::new("mug", &object.surface, &grasps, gripper.tcp_z_m, &flow);
    let own = own.unwrap();
    let probe = Probe::new(&features::control_points_m());
    let mut seen = Vec::new();
    evaluator::look(&probe, &own.sdf, own.poses.iter().copied(), &mut seen);
    let mut network = Evaluator::default();
    let logits = network.forward(&parameters, &seen);
    for (grasp, logit) in grasps.iter().zip(logits) {
        let score = f64::from(1.0 / (1.0 + (-logit).exp()));
        assert!(
            (grasp.score.unwrap() - score).abs() < 1e-5,
            "{grasp:?} {score}"
        );
    }
}

#[test]
fn a_stopped_training_resumes_to_the_same_bytes_on_any_number_of_threads() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    for name in ["paper", "best"] {
        let preset = small(name);
        let objects = data(&preset);
        let facts = provenance();
        let pool = |n: usize| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(n)
                .build()
                .unwrap()
        };
        let whole = d.join(format!("{name}-whole"));
        let done =
            pool(1).install(|| train(&training(&preset, &objects, &whole, &facts), &mut Quiet));
        assert!(done.unwrap());
        let cut = d.join(format!("{name}-cut"));
        let mut first = training(&preset, &objects, &cut, &facts);
        first.time_limit = Some(Duration::ZERO);
        let done = pool(2).install(|| train(&first, &mut Quiet));
        assert!(!done.unwrap(), "it stops before the last step");
        let mut second = training(&preset, &objects, &cut, &facts);
        second.resume = true;
        assert!(train(&second, &mut Quiet).unwrap());
        for file in [
            "checkpoint.safetensors",
            "encoder.onnx",
            "velocity.onnx",
            "model.toml",
            "training.csv",
            "loss.svg",
        ] {
            let read = |run: &Path| fs::read(run.join(file)).unwrap();
            assert!(read(&whole) == read(&cut), "{name}: {file}");
        }
    }
}

/// Coupled noise begins close to the surface and goes to grasps of the object, on ways much shorter than those of a
/// random pairing; a first stage learns from nothing else.
#[test]
fn noise_is_coupled_with_grasps_close_to_it() {
    let mut preset = small("best");
    preset.flow.couplings = 300;
    for o in &mut data(&preset) {
        assert_eq!(o.couplings.len(), 300);
        let cell = 2.0 * o.sdf.half_edge / (o.sdf.resolution - 1) as f32;
        let way = |from: &Isometry3<f32>, to: &Isometry3<f32>| {
            (from.translation.vector - to.translation.vector).norm()
        };
        let (mut coupled, mut random) = (0.0, 0.0);
        for (i, [from, to]) in o.couplings.iter().enumerate() {
            assert!(o.poses.contains(to));
            let distance = o.sdf.at(from.translation.vector.data.0[0]);
            assert!(distance.abs() < 3.0 * cell, "{distance} of cells of {cell}");
            coupled += way(from, to);
            random += way(from, &o.poses[i % o.poses.len()]);
        }
        assert!(coupled < 0.7 * random, "{}: {coupled} {random}", o.id);
        // A coupling with itself, alone: no trajectory moves.
        let [from, _] = o.couplings[0];
        o.couplings = vec![[from; 2]];
        let still = Batches::new(&preset, std::slice::from_ref(o), 0).batch(0);
        assert!(still.targets.iter().all(|x| x.abs() < 1e-4));
    }
}

/// An object that shall be shown a quarter as often as another is.
#[test]
fn objects_are_shown_by_their_shares() {
    let preset = small("best");
    let mut objects = data(&preset);
    objects[1].share = 0.25;
    let seldom = objects[1].sdf.scale_m as f32;
    assert_ne!(objects[0].sdf.scale_m as f32, seldom);
    let batches = Batches::new(&preset, &objects, 0);
    let shown: Vec<f32> = (0..300).flat_map(|i| batches.batch(i).scale_m).collect();
    let share = shown.iter().filter(|s| **s == seldom).count() as f64 / shown.len() as f64;
    assert!((share - 0.2).abs() < 0.05, "{share}");
}

#[test]
fn a_preset_that_contradicts_itself_is_refused() {
    let mut preset = small("best");
    preset.flow.optimal_transport = true;
    let error = preset.check().unwrap_err().to_string();
    assert!(error.contains("give one"), "{error}");
    preset.flow.optimal_transport = false;
    preset.flow.couplings = 0;
    let error = preset.check().unwrap_err().to_string();
    assert!(error.contains("flow.couplings"), "{error}");
}

fn from_noise(from: Isometry3<f32>, to: Isometry3<f32>) -> Pair {
    Pair {
        time: 0.0,
        from,
        to,
        is_mended: false,
    }
}

/// Pairs from a time on: after it the trajectories lead from those poses to those grasps, before it
/// they are drawn as in a first stage.
#[test]
fn what_is_taught_from_a_time_on_leads_to_the_grasps_of_the_pairs() {
    let preset = small("best");
    let mut objects = data(&preset);
    let drawn = Batches::new(&preset, &objects, 0).batch(0);
    for o in &mut objects {
        let from = Isometry3::translation(0.2, 0.1, 0.3);
        o.pairs = vec![Pair {
            time: 0.5,
            ..from_noise(from, from)
        }];
        assert_eq!(o.pairs_from(), 0.5);
    }
    let batch = Batches::new(&preset, &objects, 0).batch(0);
    let k = preset.training.grasps_per_object;
    let rows: Vec<&[f32]> = batch.targets.chunks(6).collect();
    for object in rows.chunks(k) {
        // A pair that is where it shall be asks for no motion.
        assert!(
            object[k / 2..]
                .iter()
                .flat_map(|r| r.iter())
                .all(|x| x.abs() < 1e-4)
        );
        assert!(
            object[..k / 2]
                .iter()
                .all(|r| r.iter().any(|x| x.abs() > 1e-2))
        );
    }
    assert_eq!(drawn.targets.len(), batch.targets.len());
}

/// Two poses of a pair that mends and of one that does not, told apart by where they begin.
#[test]
fn what_the_teacher_got_wrong_is_shown_more_often() {
    let mut preset = small("best");
    preset.training.grasps_per_object = 64;
    let mut objects = data(&preset);
    let pair = |x: f32, is_mended: bool| {
        let pose = Isometry3::translation(x, 0.1, 0.3);
        Pair {
            is_mended,
            ..from_noise(pose, pose)
        }
    };
    // The first object: 2 of 50 mended; the second: 25 of 50.
    for (object, mended) in objects.iter_mut().zip([2, 25]) {
        object.pairs = (0..50)
            .map(|i| pair(if i < mended { 0.2 } else { -0.2 }, i < mended))
            .collect();
    }
    assert!((objects[0].difficulty() - (3.0f32 * 49.0).sqrt() / 52.0).abs() < 1e-6);
    let (mended, straight) = objects[0].mended_and_straight();
    assert_eq!((mended.len(), straight.len()), (2, 48));
    let batches = Batches::new(&preset, &objects, 0);
    let width = features::count(&preset.network);
    let centre = 2 * features::control_points_m().len();
    let scale_m = objects[0].sdf.scale_m as f32;
    let mut seen = [[0usize; 2]; 2];
    for step in 0..40 {
        let batch = batches.batch(step);
        let groups = batch.features.chunks(64 * width);
        for (rows, scale) in groups.zip(&batch.scale_m) {
            let object = usize::from(*scale != scale_m);
            for row in rows.chunks(width) {
                seen[object][usize::from(row[centre] > 0.0)] += 1;
            }
        }
    }
    let share = |s: [usize; 2]| s[1] as f32 / (s[0] + s[1]) as f32;
    assert!(
        (share(seen[0]) - objects[0].difficulty()).abs() < 0.05,
        "{seen:?}"
    );
    assert!(
        (share(seen[1]) - objects[1].difficulty()).abs() < 0.05,
        "{seen:?}"
    );
    let first = (seen[0][0] + seen[0][1]) as f32 / (40 * 2 * 64) as f32;
    let expected = objects[0].difficulty() / (objects[0].difficulty() + objects[1].difficulty());
    assert!((first - expected).abs() < 0.15, "{first} {expected}");
}

#[test]
fn the_loss_falls() {
    let mut preset = small("best");
    preset.training.steps = 400;
    preset.training.learning_rate = 5e-3;
    let mut objects = data(&preset);
    // A pairing that is fixed has no chance in it: all of the loss can go.
    for o in &mut objects {
        let noise = |i: usize| Isometry3::translation(0.3 * i as f32 - 0.4, 0.2, 0.5);
        o.pairs = (0..3).map(|i| from_noise(noise(i), o.poses[i])).collect();
    }
    let dir = tempfile::tempdir().unwrap();
    let facts = provenance();
    train(&training(&preset, &objects, dir.path(), &facts), &mut Quiet).unwrap();
    let entries = shakedown_trainer::history::read(dir.path(), u64::MAX);
    let sum = |e: &Entry| e.loss_rotation + e.loss_translation;
    assert_eq!(entries.len(), 8);
    assert!(sum(&entries[7]) < 0.5 * sum(&entries[0]), "{entries:?}");
}

/// Turning object, noise and grasps together turns nothing that the network sees or learns.
#[test]
fn in_the_hands_frame_a_turn_of_the_scene_changes_no_target() {
    let preset = small("best");
    let mut objects = data(&preset);
    let still = Batches::new(&preset, &objects, 0).batch(0);
    // Half a turn about z maps the grid's nodes onto nodes, so even the distances agree.
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f32::consts::PI);
    for o in &mut objects {
        let n = o.sdf.resolution;
        let old = o.sdf.values.clone();
        for x in 0..n {
            for y in 0..n {
                for z in 0..n {
                    o.sdf.values[(x * n + y) * n + z] = old[((n - 1 - x) * n + n - 1 - y) * n + z];
                }
            }
        }
        o.moments = Moments::new(&o.sdf.values, n);
        o.pairs = vec![from_noise(
            Isometry3::translation(0.2, 0.1, 0.3),
            o.poses[0],
        )];
    }
    let pairs: Vec<_> = objects.iter().map(|o| o.pairs.clone()).collect();
    for o in &mut objects {
        for pair in &mut o.pairs {
            for pose in [&mut pair.from, &mut pair.to] {
                *pose = Isometry3::from_parts(Translation3::identity(), turn) * *pose;
            }
        }
    }
    let turned = Batches::new(&preset, &objects, 0).batch(0);
    let mut unturned = data(&preset);
    for (o, p) in unturned.iter_mut().zip(pairs) {
        o.pairs = p;
    }
    let straight = Batches::new(&preset, &unturned, 0).batch(0);
    assert_ne!(still.targets, straight.targets);
    let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-3);
    assert!(near(&turned.targets, &straight.targets));
    assert!(near(&turned.features, &straight.features));
}

#[test]
fn what_cannot_be_learned_is_said_and_the_last_checkpoint_stays() {
    let preset = small("best");
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let facts = provenance();
    let mut empty = data(&preset);
    empty[0].poses.clear();
    let error = train(
        &training(&preset, &empty, &d.join("empty"), &facts),
        &mut Quiet,
    );
    assert!(
        error
            .unwrap_err()
            .to_string()
            .contains("no object with a successful grasp")
    );

    let objects = data(&preset);
    let out = d.join("good");
    train(&training(&preset, &objects, &out, &facts), &mut Quiet).unwrap();
    let again = train(&training(&preset, &objects, &out, &facts), &mut Quiet).unwrap_err();
    assert!(again.to_string().contains("--resume"), "{again}");
    let mut other = preset.clone();
    other.training.learning_rate = 0.5;
    let mut resumed = training(&other, &objects, &out, &facts);
    resumed.resume = true;
    let error = train(&resumed, &mut Quiet).unwrap_err();
    assert!(error.to_string().contains("another preset"), "{error}");

    let mut unseen = preset.clone();
    unseen.flow.normalisation = Normalisation::MaxAbs;
    let error = unseen.check().unwrap_err();
    assert!(error.to_string().contains("half_edge"), "{error}");

    let mut wild = small("best");
    wild.training.learning_rate = 1e30;
    wild.training.warmup_steps = 60;
    let out = d.join("wild");
    let mut short = training(&wild, &objects, &out, &facts);
    short.checkpoint_steps = 1;
    let error = train(&short, &mut Quiet).unwrap_err();
    assert!(matches!(error, TrainError::Diverged { .. }), "{error}");

    fs::write(d.join("good/checkpoint.safetensors"), b"half a file").unwrap();
    let good = d.join("good");
    let mut damaged = training(&preset, &objects, &good, &facts);
    damaged.resume = true;
    let error = train(&damaged, &mut Quiet).unwrap_err();
    assert!(error.to_string().contains("damaged checkpoint"), "{error}");
}
