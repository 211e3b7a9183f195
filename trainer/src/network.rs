//! From features and latent to a velocity: the network and its numbers.

use candle_core::{Device, Result, Tensor, Var};
use rand::RngExt as _;
use shakedown_sampler::seed;

use crate::conv::{KERNEL, unfold};
use crate::features::{self, HISTOGRAM_CENTRES, LENGTH_UNIT_M};
use crate::preset::{Encoder, Preset};
use crate::silu::silu;

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
        .map(|(name, shape)| {
            let mut rng = seed::stream(run_seed, "weights-v1", &name, "", 0);
            let len = shape.iter().product();
            let values = if shape.len() == 1 {
                vec![0.0; len]
            } else {
                // Uniform within sqrt(6 / inputs) keeps the variance through a rectifier
                // (K. He et al., ICCV 2015).
                let gain: f32 = if name == "velocity.out.weight" {
                    0.1
                } else {
                    2.45
                };
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
        })
        .collect()
}

/// The network as tensors.
pub struct Network {
    preset: Preset,
    /// Weights in the order of [`layout`].
    pub vars: Vec<Var>,
}

impl Network {
    /// Tensors of `parameters`.
    ///
    /// # Errors
    /// Those of the tensor library.
    pub fn new(preset: &Preset, parameters: &[Parameter]) -> Result<Self> {
        let vars = parameters
            .iter()
            .map(|p| {
                let tensor = Tensor::from_slice(&p.values, p.shape.as_slice(), &Device::Cpu)?;
                Var::from_tensor(&tensor)
            })
            .collect::<Result<_>>()?;
        Ok(Self {
            preset: preset.clone(),
            vars,
        })
    }

    /// Latents `[G, L]` of `grids` (`[G, D, D, D, 1]`, or `[G, bins]` for the histogram encoder)
    /// and `scale_m` `[G, 1]`.
    ///
    /// # Errors
    /// Those of the tensor library.
    pub fn encode(&self, grids: &Tensor, scale_m: &Tensor) -> Result<Tensor> {
        let scale = (scale_m / f64::from(LENGTH_UNIT_M))?;
        let groups = scale.dim(0)?;
        let mut x = grids.clone();
        let mut layers = self.vars.chunks(2);
        if self.preset.network.encoder == Encoder::Conv {
            for c in CHANNELS {
                let edge = x.dim(1)? / 2;
                let layer = layers.next().expect("as laid out");
                x = silu(&linear(&unfold(&x)?, layer)?)?.reshape((groups, edge, edge, edge, c))?;
            }
            x = x.flatten_from(1)?;
        }
        let x = Tensor::cat(&[&x, &scale], 1)?;
        silu(&linear(&x, layers.next().expect("as laid out"))?)
    }

    /// Raw velocities `[B, 12]` of `features` `[B, F]`; every `latent` row serves `B / G` rows in
    /// turn.
    ///
    /// # Errors
    /// Those of the tensor library.
    pub fn velocity(&self, features: &Tensor, latent: &Tensor) -> Result<Tensor> {
        let (groups, width) = latent.dims2()?;
        let batch = features.dim(0)?;
        let each = batch / groups;
        let latent = latent
            .reshape((groups, 1, width))?
            .broadcast_as((groups, each, width))?
            .reshape((batch, width))?;
        let skip = self.vars.len() - 2 * (self.preset.network.layers + 1);
        let mut layers = self.vars[skip..].chunks(2);
        let first = layers.next().expect("as laid out");
        let mut x = silu(&linear(&Tensor::cat(&[features, &latent], 1)?, first)?)?;
        for _ in 1..self.preset.network.layers {
            let layer = layers.next().expect("as laid out");
            x = (&x + silu(&linear(&x, layer)?)?)?;
        }
        linear(&x, layers.next().expect("as laid out"))
    }
}

fn linear(x: &Tensor, layer: &[Var]) -> Result<Tensor> {
    x.matmul(&layer[0].t()?)?.broadcast_add(&layer[1])
}

/// Squared errors of rotation (rad^2) and translation, means over the batch, from raw velocities
/// `[B, 12]` and targets `[B, 6]` (body-frame angular velocity, translation velocity).
///
/// The skew projection of RFMGrasp eq. 12 comes first: omega = vee((xi - xi^T) / 2).
///
/// # Errors
/// Those of the tensor library.
pub fn losses(raw: &Tensor, target: &Tensor) -> Result<(Tensor, Tensor)> {
    // Columns of xi: omega_x = (xi21 - xi12) / 2, omega_y = (xi02 - xi20) / 2, ...
    let mut projection = [[0f32; 6]; OUTPUTS];
    for (axis, (plus, minus)) in [(7, 5), (2, 6), (3, 1)].into_iter().enumerate() {
        projection[plus][axis] = 0.5;
        projection[minus][axis] = -0.5;
    }
    for axis in 0..3 {
        projection[9 + axis][3 + axis] = 1.0;
    }
    let projection = Tensor::new(&projection, &Device::Cpu)?;
    let error = (raw.matmul(&projection)? - target)?.sqr()?;
    let batch = error.dim(0)? as f64;
    let part = |from: usize| error.narrow(1, from, 3)?.sum_all()? / batch;
    Ok((part(0)?, part(3)?))
}
