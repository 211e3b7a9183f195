//! Adam (D. P. Kingma and J. Ba, ICLR 2015) with everything a checkpoint must keep in the open.

use crate::network::Parameter;
use crate::preset::TrainingPreset;

const BETA_1: f32 = 0.9;
const BETA_2: f32 = 0.999;
const EPSILON: f32 = 1e-8;

/// Weights, their running mean, and the moments of their gradients.
#[derive(Debug, Clone, PartialEq)]
pub struct Weights {
    /// Steps taken.
    pub step: u64,
    /// The weights.
    pub parameters: Vec<Parameter>,
    /// Running mean of the weights: what is exported.
    pub mean: Vec<Vec<f32>>,
    /// First moments.
    pub first: Vec<Vec<f32>>,
    /// Second moments.
    pub second: Vec<Vec<f32>>,
}

impl Weights {
    /// Fresh weights, nothing known of their gradients.
    pub fn new(parameters: Vec<Parameter>) -> Self {
        let zeros = || {
            parameters
                .iter()
                .map(|p| vec![0.0; p.values.len()])
                .collect()
        };
        Self {
            step: 0,
            mean: parameters.iter().map(|p| p.values.clone()).collect(),
            first: zeros(),
            second: zeros(),
            parameters,
        }
    }

    /// The running mean as parameters.
    pub fn averaged(&self) -> Vec<Parameter> {
        self.parameters
            .iter()
            .zip(&self.mean)
            .map(|(p, mean)| Parameter {
                values: mean.clone(),
                ..p.clone()
            })
            .collect()
    }

    /// One step along `gradients` (same order as the parameters).
    pub fn update(&mut self, gradients: &[Vec<f32>], settings: &TrainingPreset) {
        let norm = gradients
            .iter()
            .map(|g| sum_of_squares(g))
            .sum::<f64>()
            .sqrt() as f32;
        let shorten = (settings.clip_norm / norm.max(1e-12)).min(1.0);
        let rate = learning_rate(self.step, settings);
        self.step += 1;
        let t = self.step.min(1_000_000) as i32;
        // The bias corrections of both moments.
        let rate = rate / (1.0 - BETA_1.powi(t));
        let c2 = 1.0 / (1.0 - BETA_2.powi(t));
        // The mean follows quickly while there is little to average.
        let keep = settings.ema.min((1.0 + t as f32) / (10.0 + t as f32));
        for (k, p) in self.parameters.iter_mut().enumerate() {
            let state = self.first[k].iter_mut().zip(&mut self.second[k]);
            let weights = p.values.iter_mut().zip(&mut self.mean[k]);
            for (((w, mean), (m, v)), g) in weights.zip(state).zip(&gradients[k]) {
                let g = g * shorten;
                *m += (1.0 - BETA_1) * (g - *m);
                *v += (1.0 - BETA_2) * (g * g - *v);
                *w -= rate * *m / ((*v * c2).sqrt() + EPSILON);
                *mean += (1.0 - keep) * (*w - *mean);
            }
        }
    }
}

/// In sixteen sums side by side, which a processor adds at once.
fn sum_of_squares(x: &[f32]) -> f64 {
    let mut sums = [0f64; 16];
    let (sixteens, left) = x.as_chunks::<16>();
    for x in sixteens {
        for (sum, x) in sums.iter_mut().zip(x) {
            *sum += f64::from(*x).powi(2);
        }
    }
    let left = left.iter().map(|x| f64::from(*x).powi(2));
    sums.iter().sum::<f64>() + left.sum::<f64>()
}

/// Linear start, then a cosine down to zero at the last step.
pub fn learning_rate(step: u64, settings: &TrainingPreset) -> f32 {
    if step < settings.warmup_steps {
        return settings.learning_rate * (step + 1) as f32 / settings.warmup_steps as f32;
    }
    let way = settings.steps.saturating_sub(settings.warmup_steps).max(1);
    let share = (step - settings.warmup_steps) as f32 / way as f32;
    settings.learning_rate * 0.5 * (1.0 + (std::f32::consts::PI * share.min(1.0)).cos())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;

    #[test]
    fn it_finds_the_bottom_of_a_bowl_and_its_first_step_is_the_rate() {
        let mut settings = Preset::load("best").unwrap().training;
        settings.learning_rate = 0.05;
        settings.warmup_steps = 0;
        settings.steps = 400;
        let p = Parameter {
            name: "x".into(),
            shape: vec![2],
            values: vec![1.0, -2.0],
        };
        let mut weights = Weights::new(vec![p]);
        for i in 0..400 {
            let x = &weights.parameters[0].values;
            let g = vec![vec![x[0] - 0.5, 10.0 * (x[1] + 1.0)]];
            weights.update(&g, &settings);
            if i == 0 {
                assert!((weights.parameters[0].values[0] - 0.95).abs() < 1e-4);
            }
        }
        let x = &weights.parameters[0].values;
        assert!(
            (x[0] - 0.5).abs() < 1e-2 && (x[1] + 1.0).abs() < 1e-2,
            "{x:?}"
        );
        assert!(learning_rate(400, &settings) < 1e-6);
    }
}
