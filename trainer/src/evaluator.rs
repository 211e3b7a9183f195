//! Will this grasp hold? A network that judges where a flow ended, trained on ends that were tried.
//!
//! The flow says where grasps are, and errs at some; an evaluator trained on the flow's own grasps finds
//! those (A. Mousavian et al., "6-DOF GraspNet", ICCV 2019; trained on the generator's samples as in
//! A. Murali et al., "GraspGen", 2025). It sees of a pose what the flow sees of it: distances at points
//! fixed to the hand. The sampler draws anew what it does not believe in.

use nalgebra::Isometry3;
use rand::RngExt as _;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use shakedown_objects::{NormalisedSdf, Probe};
use shakedown_sampler::seed;

use crate::adam::Weights;
use crate::error::TrainError;
use crate::features;
use crate::layer::{Layer, back_to_first, linear_back, onward};
use crate::network::{Parameter, drawn};
use crate::preset::TrainingPreset;

/// Grasps of one object that were tried.
#[derive(Debug, Clone)]
pub struct TriedObject {
    /// The grid the network sees.
    pub sdf: NormalisedSdf,
    /// Poses of the model's frame in the normalised frame of the grid, and whether each is good.
    pub ends: Vec<(Isometry3<f32>, bool)>,
}

/// Network and optimisation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvaluatorPreset {
    /// Width of the hidden layers.
    pub width: usize,
    /// Number of hidden layers; all but the first add to their input.
    pub layers: usize,
    /// Grasps in a batch.
    pub batch: usize,
    /// The optimisation; what concerns objects and velocities is not used.
    pub training: TrainingPreset,
}

impl EvaluatorPreset {
    /// The built-in one.
    pub fn built_in() -> Self {
        let text = include_str!("../presets/evaluator.toml");
        toml::from_str(text).expect("a preset of ours")
    }
}

/// Fresh weights.
pub fn initial(preset: &EvaluatorPreset, run_seed: u64) -> Vec<Parameter> {
    let mut shapes = Vec::new();
    let mut add = |name: String, inputs: usize, outputs: usize| {
        shapes.push((format!("{name}.weight"), vec![outputs, inputs]));
        shapes.push((format!("{name}.bias"), vec![outputs]));
    };
    add(
        "evaluator.layer0".into(),
        features::seen_count(),
        preset.width,
    );
    for i in 1..preset.layers {
        add(format!("evaluator.layer{i}"), preset.width, preset.width);
    }
    add("evaluator.out".into(), preset.width, 1);
    shapes
        .into_iter()
        .map(|(name, shape)| drawn(name, shape, run_seed))
        .collect()
}

/// The network at work.
#[derive(Debug, Default)]
pub struct Evaluator {
    hidden: Vec<Layer>,
    logits: Vec<f32>,
    back: Vec<f32>,
    inner: Vec<f32>,
    by: Vec<Vec<f32>>,
}

impl Evaluator {
    /// Logits of rows of features.
    pub fn forward(&mut self, parameters: &[Parameter], features: &[f32]) -> &[f32] {
        let layers = parameters.len() / 2 - 1;
        self.hidden.resize_with(layers, Layer::default);
        let mut pairs = parameters.chunks(2).map(|p| [&p[0], &p[1]]);
        let mut next = || pairs.next().expect("a pair a layer");
        let first = self.hidden.first_mut().expect("at least one layer");
        first.forward(features, next());
        onward(&mut self.hidden, next, &mut self.logits);
        &self.logits
    }

    /// Mean cross-entropy of a batch (nats), and its gradient by every parameter.
    pub fn gradients(
        &mut self,
        parameters: &[Parameter],
        features: &[f32],
        is_good: &[bool],
    ) -> (f32, &[Vec<f32>]) {
        self.forward(parameters, features);
        self.by.resize_with(parameters.len(), Vec::new);
        for (by, p) in self.by.iter_mut().zip(parameters) {
            by.resize(p.values.len(), 0.0);
        }
        let share = 1.0 / is_good.len() as f32;
        let mut loss = 0f64;
        self.back.clear();
        for (x, good) in self.logits.iter().zip(is_good) {
            // log(1 + exp(-s x)) without overflow, s = 1 for good ones.
            let against = if *good { -*x } else { *x };
            let excess = against.max(0.0) + (-against.abs()).exp().ln_1p();
            loss += f64::from(excess);
            let probability = 1.0 / (1.0 + (-x).exp());
            self.back
                .push(share * (probability - f32::from(u8::from(*good))));
        }
        let mut layers = parameters.chunks(2).zip(self.by.chunks_mut(2)).rev();
        let (back, inner) = (&mut self.back, &mut self.inner);
        back_to_first(&self.hidden, &mut layers, back, inner);
        let (_, by) = layers.next().expect("the first layer's");
        self.hidden[0].before_activation(&self.back, &mut self.inner);
        linear_back(features, &self.inner, by);
        ((loss * f64::from(share)) as f32, &self.by)
    }
}

/// Writes what the network sees of poses of one object, row by row.
pub fn look(
    probe: &Probe,
    sdf: &NormalisedSdf,
    poses: impl Iterator<Item = Isometry3<f32>>,
    out: &mut Vec<f32>,
) {
    let mut row = vec![0.0; features::seen_count()];
    for pose in poses {
        features::from_the_hand(probe, sdf, &pose, &mut row);
        out.extend_from_slice(&row);
    }
}

/// One step's examples: `batch` grasps of objects drawn at random, by seed and step alone.
fn examples(
    preset: &EvaluatorPreset,
    probe: &Probe,
    objects: &[TriedObject],
    run_seed: u64,
    step: u64,
) -> (Vec<f32>, Vec<bool>) {
    const OF_ONE: usize = 8;
    let parts: Vec<(Vec<f32>, Vec<bool>)> = (0..preset.batch.div_ceil(OF_ONE))
        .into_par_iter()
        .map(|slot| {
            let name = format!("slot{slot}");
            let mut rng = seed::stream(run_seed, "evaluator-v1", &name, "", step);
            let object = &objects[rng.random_range(0..objects.len())];
            let picks: Vec<_> = (0..OF_ONE)
                .map(|_| object.ends[rng.random_range(0..object.ends.len())])
                .collect();
            let mut features = Vec::new();
            let poses = picks.iter().map(|p| p.0);
            look(probe, &object.sdf, poses, &mut features);
            (features, picks.into_iter().map(|p| p.1).collect())
        })
        .collect();
    let mut batch = (Vec::new(), Vec::new());
    for (features, is_good) in parts {
        batch.0.extend(features);
        batch.1.extend(is_good);
    }
    batch
}

/// Trains an evaluator; returns its averaged weights. `progress` hears the step and the mean loss of
/// the last steps, and may look at the weights.
///
/// # Errors
/// Nothing to learn from; a loss that is not finite.
pub fn train_evaluator(
    preset: &EvaluatorPreset,
    objects: &[TriedObject],
    run_seed: u64,
    mut progress: impl FnMut(u64, f32, &Weights),
) -> Result<Vec<Parameter>, TrainError> {
    let has = |good: bool| objects.iter().any(|o| o.ends.iter().any(|e| e.1 == good));
    if objects.iter().any(|o| o.ends.is_empty()) || !has(true) || !has(false) {
        return Err(TrainError::Data(
            "there is nothing to learn from: an evaluator needs grasps that held and grasps that did not"
                .into(),
        ));
    }
    let probe = Probe::new(&features::control_points_m());
    let mut weights = Weights::new(initial(preset, run_seed));
    let mut network = Evaluator::default();
    let batch = |step| examples(preset, &probe, objects, run_seed, step);
    let mut next = batch(0);
    while weights.step < preset.training.steps {
        let step = weights.step;
        let (features, is_good) = next;
        let ((loss, gradients), following) = rayon::join(
            || network.gradients(&weights.parameters, &features, &is_good),
            || batch(step + 1),
        );
        next = following;
        if !loss.is_finite() {
            return Err(TrainError::Diverged { step, loss });
        }
        weights.update(gradients, &preset.training);
        progress(weights.step, loss, &weights);
    }
    Ok(weights.averaged())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;
    use nalgebra::Translation3;
    use shakedown_objects::SdfGrid;
    use shakedown_objects::shapes::Family;

    fn small() -> (Preset, EvaluatorPreset) {
        let mut flow = Preset::load("best").unwrap();
        flow.flow.resolution = 16;
        let mut preset = EvaluatorPreset::built_in();
        (preset.width, preset.layers, preset.batch) = (16, 3, 64);
        (flow, preset)
    }

    /// Poses along a line through a mug; good are those on one side.
    fn tried(flow: &Preset) -> TriedObject {
        let object = Family::Mug.member(0).object().unwrap();
        let grid = SdfGrid::bake(&object.surface, 16, 0.3);
        let ends = (0..80).map(|i| {
            let x = 0.02 * i as f32 - 0.79;
            (Translation3::new(x, 0.1, 0.2).into(), x > 0.0)
        });
        TriedObject {
            sdf: NormalisedSdf::new(&grid, flow.flow.normalisation),
            ends: ends.collect(),
        }
    }

    #[test]
    fn the_gradient_is_the_slope_of_the_loss_in_every_layer() {
        let (flow, preset) = small();
        let object = tried(&flow);
        let probe = Probe::new(&features::control_points_m());
        let mut seen = Vec::new();
        let poses = object.ends.iter().map(|e| e.0);
        look(&probe, &object.sdf, poses, &mut seen);
        let is_good: Vec<bool> = object.ends.iter().map(|e| e.1).collect();
        let parameters = initial(&preset, 3);
        let mut network = Evaluator::default();
        let by = network.gradients(&parameters, &seen, &is_good).1.to_vec();
        let mut loss = |p: &[Parameter]| f64::from(network.gradients(p, &seen, &is_good).0);
        for (k, p) in parameters.iter().enumerate() {
            let norm = by[k]
                .iter()
                .map(|g| f64::from(*g).powi(2))
                .sum::<f64>()
                .sqrt();
            assert!(norm > 1e-5, "{}: nothing arrives", p.name);
            let h = 1e-3 / norm;
            let mut moved = |sign: f64| {
                let mut moved = parameters.clone();
                for (w, g) in moved[k].values.iter_mut().zip(&by[k]) {
                    *w += (sign * h * f64::from(*g) / norm) as f32;
                }
                loss(&moved)
            };
            let slope = (moved(1.0) - moved(-1.0)) / (2.0 * h);
            assert!(
                (slope / norm - 1.0).abs() < 0.02,
                "{}: {slope} {norm}",
                p.name
            );
        }
    }

    #[test]
    fn it_learns_which_side_of_a_mug_is_good_and_needs_examples_of_both_kinds() {
        let (flow, mut preset) = small();
        preset.training.steps = 300;
        let object = tried(&flow);
        let objects = [object.clone()];
        let mut losses = Vec::new();
        let weights = train_evaluator(&preset, &objects, 1, |_, loss, _| losses.push(loss));
        let weights = weights.unwrap();
        assert!(losses[0] > 0.5 && losses[299] < 0.2, "{losses:?}");
        let probe = Probe::new(&features::control_points_m());
        let mut seen = Vec::new();
        let poses = object.ends.iter().map(|e| e.0);
        look(&probe, &object.sdf, poses, &mut seen);
        let mut network = Evaluator::default();
        let logits = network.forward(&weights, &seen);
        let right = logits
            .iter()
            .zip(&object.ends)
            .filter(|(x, e)| (**x > 0.0) == e.1);
        assert!(right.count() >= 74);
        let again = train_evaluator(&preset, &objects, 1, |_, _, _| {});
        assert_eq!(again.unwrap(), weights);
        let mut all_good = object;
        all_good.ends.retain(|e| e.1);
        let error = train_evaluator(&preset, &[all_good], 1, |_, _, _| {});
        assert!(error.unwrap_err().to_string().contains("did not"));
    }
}
