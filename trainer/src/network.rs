//! The network's numbers: which there are, and where they start.

use rand::RngExt as _;
use shakedown_sampler::seed;

use crate::conv::KERNEL;
use crate::features::{self, HISTOGRAM_CENTRES};
use crate::preset::{Encoder, Preset};

/// Channels of the four convolutions.
pub const CHANNELS: [usize; 4] = [16, 32, 64, 128];

/// Numbers of the network's output: the raw 3 x 3 matrix row by row, then the translation.
pub const OUTPUTS: usize = 12;

/// One named array of weights, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Name, as in checkpoints and graphs.
    pub name: String,
    /// Shape: `[outputs, inputs]` of a matrix, `[n]` of a bias.
    pub shape: Vec<usize>,
    /// Values.
    pub values: Vec<f32>,
}

/// Names and shapes of all parameters in their order.
pub fn layout(preset: &Preset) -> Vec<(String, Vec<usize>)> {
    let mut shapes = Vec::new();
    let mut linear = |name: String, inputs: usize, outputs: usize| {
        shapes.push((format!("{name}.weight"), vec![outputs, inputs]));
        shapes.push((format!("{name}.bias"), vec![outputs]));
    };
    let n = &preset.network;
    match n.encoder {
        Encoder::Conv => {
            let mut channels = 1;
            for (i, c) in CHANNELS.into_iter().enumerate() {
                linear(format!("encoder.conv{i}"), KERNEL.pow(3) * channels, c);
                channels = c;
            }
            let edge = preset.flow.resolution >> CHANNELS.len();
            linear("encoder.out".into(), edge.pow(3) * channels + 1, n.latent);
        }
        Encoder::Histogram => {
            linear("encoder.out".into(), HISTOGRAM_CENTRES.len() + 1, n.latent);
        }
    }
    linear(
        "velocity.layer0".into(),
        features::count(n) + n.latent,
        n.width,
    );
    for i in 1..n.layers {
        linear(format!("velocity.layer{i}"), n.width, n.width);
    }
    linear("velocity.out".into(), n.width, OUTPUTS);
    shapes
}

/// Fresh weights: uniform within `1 / sqrt(inputs)`, the last layer a tenth of it, biases zero.
pub fn initial(preset: &Preset, run_seed: u64) -> Vec<Parameter> {
    layout(preset)
        .into_iter()
        .map(|(name, shape)| drawn(name, shape, run_seed))
        .collect()
}

/// A fresh parameter, by seed and name.
pub(crate) fn drawn(name: String, shape: Vec<usize>, run_seed: u64) -> Parameter {
    let mut rng = seed::stream(run_seed, "weights-v1", &name, "", 0);
    let len = shape.iter().product();
    let values = if shape.len() == 1 {
        vec![0.0; len]
    } else {
        // Uniform within sqrt(6 / inputs) keeps the variance through a rectifier
        // (K. He et al., ICCV 2015).
        let is_last = ["velocity.out.weight", "evaluator.out.weight"].contains(&name.as_str());
        let gain: f32 = if is_last { 0.1 } else { 2.45 };
        let bound = gain / (shape[1] as f32).sqrt();
        (0..len)
            .map(|_| bound * (2.0 * rng.random::<f32>() - 1.0))
            .collect()
    };
    Parameter {
        name,
        shape,
        values,
    }
}
