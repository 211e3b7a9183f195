//! Which noise becomes which grasp, once and for all?
//!
//! Drawn at random, a point of noise leads to every grasp of its object alike, and all that can be learned
//! at first is the way to their middle. Paired by least total cost (A. Tong et al., TMLR 2024), ways are short and
//! hardly cross; groups much larger than what a batch has of one object come close to the least of all.

use nalgebra::{Isometry3, Translation3};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;
use shakedown_sampler::shell::Shell;
use shakedown_sampler::{NoiseKind, seed};

use crate::data::TrainingObject;
use crate::features::LENGTH_UNIT_M;
use crate::pairing;
use crate::preset::{FlowPreset, Preset};

/// Noise and grasps that are paired together. The time for all grows with the square of it.
const GROUP: usize = 256;

/// Weight of a squared decimetre beside a squared radian. So high that noise goes to a grasp close to it and
/// turns there; 100 does as well (docs/training.md).
const TRANSLATION_WEIGHT: f32 = 20.0;

impl TrainingObject {
    /// Pairs as much noise of the object with its grasps as the preset asks for.
    pub fn couple(&mut self, preset: &Preset, run_seed: u64) {
        let flow = &preset.flow;
        if flow.couplings == 0 || self.poses.is_empty() {
            return;
        }
        let unit = self.sdf.scale_m as f32 / LENGTH_UNIT_M;
        let mut rng = seed::stream(run_seed, "coupling-v1", &self.id, "", 0);
        let shell = (flow.noise == NoiseKind::Surface).then(|| Shell::new(&self.sdf));
        while self.couplings.len() < flow.couplings {
            let count = GROUP.min(flow.couplings - self.couplings.len());
            let grasps: Vec<_> = (0..count)
                .map(|_| self.poses[rng.random_range(0..self.poses.len())])
                .collect();
            let noise: Vec<_> = (0..count)
                .map(|_| noise(flow, shell.as_ref(), &mut rng))
                .collect();
            let order = pairing::optimal(&noise, &grasps, unit, TRANSLATION_WEIGHT);
            let pairs = noise.into_iter().zip(order);
            self.couplings
                .extend(pairs.map(|(from, j)| [from, grasps[j]]));
        }
    }
}

/// A pose to begin at, normalised frame.
pub fn noise(flow: &FlowPreset, shell: Option<&Shell>, rng: &mut ChaCha8Rng) -> Isometry3<f32> {
    let translation = match shell {
        Some(shell) => shell.at([(); 3].map(|()| rng.random())),
        None => seed::normal_vector(rng) * flow.noise_translation_std,
    };
    let rotation = seed::uniform_rotation(rng);
    Isometry3::from_parts(Translation3::from(translation.cast()), rotation.cast())
}
