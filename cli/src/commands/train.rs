//! `shakedown train`: a flow model from labelled grasps.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use indicatif::ProgressBar;
use rayon::prelude::*;
use shakedown_classifier::{Class, HandModel, Thresholds, classify};
use shakedown_gripper_assets::Gripper;
use shakedown_objects::Object;
use shakedown_sampler::{DrawSettings, FlowModel};
use shakedown_sim::{Protocol, Scene, run_trial};
use shakedown_trainer::export::Provenance;
use shakedown_trainer::{Observer, Preset, Progress, Training, train};

use crate::args::Global;
use crate::args_judging::TrainArgs;
use crate::commands::train_evaluator;
use crate::failure::{Exit, Failure};
use crate::progress;
use crate::training_data::TrainingData;

/// Steps between two checkpoints, and between two validations by the classifier.
const CHECKPOINT_STEPS: u64 = 500;
const VALIDATION_STEPS: u64 = 5000;

/// Every so many validations also try the grasps in physics.
const PHYSICS_EVERY: u64 = 2;

/// Candidates per object of a validation.
const CANDIDATES: u64 = 40;

pub fn run(global: &Global, args: &TrainArgs) -> Result<Exit, Failure> {
    let mut preset = Preset::load(&args.preset)?;
    if let Some(steps) = args.steps {
        preset.training.steps = steps.max(1);
    }
    if let Some(rate) = args.learning_rate {
        preset.training.learning_rate = rate;
    }
    preset.check()?;
    let gripper = Gripper::load(&args.gripper)?;
    let protocol = args.protocol.load()?;
    if let Some(model) = &args.evaluator_for {
        return train_evaluator::run(global, args, model, &gripper, &protocol);
    }
    let data = TrainingData::load(global, args, &preset, &gripper, &protocol)?;
    progress::note(global, &data.description);
    let directory_name = args
        .out
        .file_name()
        .map(|n| n.to_string_lossy().into_owned());
    let own = args.data.iter().any(|d| d == "embedded");
    let licence = match &args.licence {
        Some(text) => text.clone(),
        None if own => "MIT OR Apache-2.0".to_owned(),
        None => "that of the training data".to_owned(),
    };
    let provenance = Provenance {
        name: args.name.clone().or(directory_name).unwrap_or_default(),
        description: format!(
            "Riemannian flow matching on SE(3), preset {}, {} steps{}, seed {}",
            preset.name,
            preset.training.steps,
            if args.rectify.is_some() {
                " on the rectified paths of an earlier training"
            } else {
                ""
            },
            global.seed
        ),
        licence,
        training_data: data.description.clone(),
        command: command_line(),
        gripper: gripper.name.clone(),
        metrics: BTreeMap::new(),
    };
    let mut watch = Watch {
        global,
        args,
        hand: HandModel::new(&gripper, gripper.opening_max_m)?,
        gripper: &gripper,
        protocol: &protocol,
        objects: &data.validation,
        bar: progress::bar(global, preset.training.steps),
        validations: 0,
    };
    watch.bar.set_message("train");
    let training = Training {
        preset: &preset,
        objects: &data.objects,
        run_seed: global.seed,
        out: &args.out,
        provenance: &provenance,
        resume: args.resume,
        start_from: args.rectify.as_deref(),
        time_limit: args
            .minutes
            .map(|m| Duration::from_secs_f64(60.0 * m.max(0.0))),
        checkpoint_steps: CHECKPOINT_STEPS,
        validation_steps: VALIDATION_STEPS,
    };
    let complete = train(&training, &mut watch)?;
    watch.bar.finish_and_clear();
    println!("model: {}", args.out.display());
    if complete {
        Ok(Exit::Success)
    } else {
        eprintln!("note: the time is up before the last step; --resume goes on");
        Ok(Exit::Incomplete)
    }
}

/// The command as typed, without the path of the binary.
pub fn command_line() -> String {
    let words: Vec<String> = std::env::args().skip(1).collect();
    format!("shakedown {}", words.join(" "))
}

struct Watch<'a> {
    global: &'a Global,
    args: &'a TrainArgs,
    hand: HandModel,
    gripper: &'a Gripper,
    protocol: &'a Protocol,
    objects: &'a [Object],
    bar: ProgressBar,
    validations: u64,
}

impl Observer for Watch<'_> {
    fn progress(&mut self, progress: &Progress) {
        self.bar.set_length(progress.steps);
        self.bar.set_position(progress.step);
        if let Some(e) = progress.entry {
            self.bar.set_message(format!(
                "R {:.3} t {:.3}",
                e.loss_rotation, e.loss_translation
            ));
        }
    }

    fn validate(&mut self, directory: &Path, step: u64) -> Result<BTreeMap<String, f64>, String> {
        self.validations += 1;
        let is_last = step == self.bar.length().unwrap_or(step);
        let physics = is_last || self.validations.is_multiple_of(PHYSICS_EVERY);
        let metrics = self.measure(directory, physics)?;
        let text: Vec<String> = metrics.iter().map(|(k, v)| format!("{k} {v:.3}")).collect();
        if !self.global.quiet {
            let line = format!("step {step}: {}", text.join(", "));
            self.bar.suspend(|| eprintln!("{line}"));
        }
        Ok(metrics)
    }
}

impl Watch<'_> {
    fn measure(&self, directory: &Path, physics: bool) -> Result<BTreeMap<String, f64>, String> {
        let mut model =
            FlowModel::load(directory, self.args.ort.as_deref()).map_err(|e| e.to_string())?;
        let thresholds = Thresholds::default();
        let cache = shakedown_objects::pieces::default_cache_directory();
        let mut n = 0usize;
        let mut counts = [0usize; 4];
        for object in self.objects {
            let grasps = model
                .sample(
                    object,
                    self.gripper,
                    CANDIDATES,
                    self.global.seed,
                    DrawSettings::default(),
                )
                .map_err(|e| e.to_string())?;
            n += grasps.len();
            for g in &grasps {
                let pose = &g.object_from_hand;
                let verdict = classify(&self.hand, &object.surface, pose, &thresholds);
                counts[0] += usize::from(verdict.reachable);
                counts[1] += usize::from(!verdict.collides);
                counts[2] += usize::from(verdict.class() == Class::Optimal);
            }
            if physics {
                let scene = Scene::new(object, self.gripper, self.protocol, None, cache.as_deref())
                    .map_err(|e| e.to_string())?;
                counts[3] += grasps
                    .par_iter()
                    .filter(|g| run_trial(&scene, &g.object_from_hand).is_held())
                    .count();
            }
        }
        let kind = if self.args.hold_out > 0 {
            "held_out_objects"
        } else {
            "training_objects"
        };
        let names = ["graspable", "collision_free", "optimal", "held"];
        Ok(names
            .into_iter()
            .zip(counts)
            .filter(|(name, _)| physics || *name != "held")
            .map(|(name, c)| (format!("{kind}_{name}"), c as f64 / n.max(1) as f64))
            .collect())
    }
}
