//! The loop: batch, gradient, step; with a log, checkpoints and validation.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use crate::adam::{Weights, learning_rate};
use crate::batch::Batches;
use crate::checkpoint;
use crate::data::TrainingObject;
use crate::error::TrainError;
use crate::export::{Provenance, export};
use crate::gradient::Network;
use crate::history::{self, Entry};
use crate::network;
use crate::preset::Preset;

/// Steps between two rows of the log.
const REPORT_STEPS: u64 = 50;

/// A training.
#[derive(Debug, Clone)]
pub struct Training<'a> {
    /// What decides the weights.
    pub preset: &'a Preset,
    /// What is learned from; each object has grasps.
    pub objects: &'a [TrainingObject],
    /// Seed of weights and batches.
    pub run_seed: u64,
    /// Where checkpoint, log and model go.
    pub out: &'a Path,
    /// What the card says.
    pub provenance: &'a Provenance,
    /// Go on from the checkpoint in `out`.
    pub resume: bool,
    /// Start from the averaged weights of the checkpoint in this directory, which has the same
    /// network.
    pub start_from: Option<&'a Path>,
    /// Stop after that long; the checkpoint can be resumed.
    pub time_limit: Option<Duration>,
    /// Steps between two checkpoints.
    pub checkpoint_steps: u64,
    /// Steps between two validations; 0: only at the end.
    pub validation_steps: u64,
}

/// Where a training stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Steps taken.
    pub step: u64,
    /// Steps in all.
    pub steps: u64,
    /// Latest row of the log.
    pub entry: Option<Entry>,
}

/// Whoever watches.
pub trait Observer {
    /// Called after every step.
    fn progress(&mut self, progress: &Progress);

    /// Measures the model written to `directory`; the result goes into its card.
    ///
    /// # Errors
    /// A text for the user.
    fn validate(&mut self, directory: &Path, step: u64) -> Result<BTreeMap<String, f64>, String>;
}

/// Trains, and leaves `model.toml`, `encoder.onnx`, `velocity.onnx`, `training.csv`, `loss.svg`
/// and the checkpoint in `training.out`. True if all steps were taken.
///
/// The same preset, data and seed give the same weights on the same machine, whatever the number
/// of threads, and whether or not it was stopped and resumed.
///
/// # Errors
/// Data without grasps, a checkpoint of another preset, a full disk, a loss that is not finite;
/// the last good checkpoint stays.
pub fn train(training: &Training<'_>, observer: &mut dyn Observer) -> Result<bool, TrainError> {
    let Training { preset, out, .. } = *training;
    if training.objects.is_empty() || training.objects.iter().any(|o| o.poses.is_empty()) {
        return Err(TrainError::Data(
            "there is nothing to learn from: no object with a successful grasp".into(),
        ));
    }
    fs::create_dir_all(out).map_err(|e| TrainError::io("write", out, e))?;
    let mut weights = if training.resume && checkpoint::exists(out) {
        checkpoint::load(out, preset)?
    } else if checkpoint::exists(out) {
        return Err(TrainError::bad(
            out,
            "holds a checkpoint already: --resume goes on from it, another --out starts afresh",
        ));
    } else if let Some(teacher) = training.start_from {
        Weights::new(checkpoint::averaged(teacher, preset)?)
    } else {
        Weights::new(network::initial(preset, training.run_seed))
    };
    let mut entries = history::read(out, weights.step);
    let batches = Batches::new(preset, training.objects, training.run_seed);
    let started = Instant::now();
    let steps = preset.training.steps;
    let mut sums = [0f64; 2];
    let mut since = 0u32;
    let mut network = Network::new(preset);
    let mut next = batches.batch(weights.step);
    while weights.step < steps {
        let step = weights.step;
        let batch = next;
        let ((losses, gradients), following) = rayon::join(
            || network.gradients(&weights.parameters, &batch),
            || batches.batch(step + 1),
        );
        next = following;
        let loss = losses.rotation + losses.translation;
        if !loss.is_finite() {
            return Err(TrainError::Diverged { step, loss });
        }
        weights.update(gradients, &preset.training);
        sums[0] += f64::from(losses.rotation);
        sums[1] += f64::from(losses.translation);
        since += 1;
        if weights.step.is_multiple_of(REPORT_STEPS) || weights.step == steps {
            entries.push(Entry {
                step: weights.step,
                loss_rotation: (sums[0] / f64::from(since)) as f32,
                loss_translation: (sums[1] / f64::from(since)) as f32,
                learning_rate: learning_rate(step, &preset.training),
            });
            (sums, since) = ([0.0; 2], 0);
        }
        let entry = entries.last().copied();
        observer.progress(&Progress {
            step: weights.step,
            steps,
            entry,
        });
        let late = training.time_limit.is_some_and(|l| started.elapsed() >= l);
        let on_row = weights.step.is_multiple_of(REPORT_STEPS);
        let due = |every: u64| every > 0 && weights.step.is_multiple_of(every);
        // Stops and saves only between rows of the log, so that a resumed log has the same rows.
        let stop = late && on_row;
        if due(training.checkpoint_steps.next_multiple_of(REPORT_STEPS)) || stop {
            checkpoint::save(out, preset, &weights)?;
            history::write(out, &entries)?;
        }
        if due(training.validation_steps) && weights.step < steps && !stop {
            export(out, preset, &weights.averaged(), training.provenance)?;
            observer
                .validate(out, weights.step)
                .map_err(TrainError::Validation)?;
        }
        if stop {
            break;
        }
    }
    checkpoint::save(out, preset, &weights)?;
    history::write(out, &entries)?;
    export(out, preset, &weights.averaged(), training.provenance)?;
    let metrics = observer
        .validate(out, weights.step)
        .map_err(TrainError::Validation)?;
    let provenance = Provenance {
        metrics,
        ..training.provenance.clone()
    };
    export(out, preset, &weights.averaged(), &provenance)?;
    Ok(weights.step >= steps)
}
