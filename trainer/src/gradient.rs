//! From a batch to velocities, and from their errors back to a gradient of every weight.
//!
//! By hand, layer by layer: through a tensor library with automatic derivatives the same step took
//! two thirds longer, most of it in passes over memory between the products.

use crate::batch::Batch;
use crate::conv::Neighbourhoods;
use crate::features::{self, LENGTH_UNIT_M};
use crate::layer::{Layer, add_rows, back_to_first, linear_back, onward, through};
use crate::network::{CHANNELS, OUTPUTS, Parameter};
use crate::preset::{Encoder, Preset};
use crate::product::{Matrix, MatrixMut};

/// Squared errors, means over a batch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Losses {
    /// Of the angular velocity, rad^2.
    pub rotation: f32,
    /// Of the translation velocity, in the units of the targets.
    pub translation: f32,
}

/// The network at work; its memory is used again from batch to batch.
#[derive(Debug)]
pub struct Network<'a> {
    preset: &'a Preset,
    /// Each with the rows that it acts on.
    convolutions: Vec<(Neighbourhoods, Vec<f32>, Layer)>,
    /// What becomes the latent, `[G, ..]`.
    encoded: Vec<f32>,
    latent: Layer,
    hidden: Vec<Layer>,
    raw: Vec<f32>,
    /// The latent's part in the first layer, `[G, width]`; on the way back its gradient.
    per_object: Vec<f32>,
    /// Gradients on their way: by what comes out of a layer, and by what its activation acts on.
    back: Vec<f32>,
    inner: Vec<f32>,
    unfolded: Vec<f32>,
    /// By each parameter.
    by: Vec<Vec<f32>>,
}

impl<'a> Network<'a> {
    /// The network of a preset.
    pub fn new(preset: &'a Preset) -> Self {
        let mut convolutions = Vec::new();
        if preset.network.encoder == Encoder::Conv {
            let (mut edge, mut channels) = (preset.flow.resolution, 1);
            for c in CHANNELS {
                let around = Neighbourhoods::new(edge, channels);
                (edge, channels) = (around.edge_out(), c);
                convolutions.push((around, Vec::new(), Layer::default()));
            }
        }
        Self {
            preset,
            convolutions,
            encoded: Vec::new(),
            latent: Layer::default(),
            hidden: (0..preset.network.layers)
                .map(|_| Layer::default())
                .collect(),
            raw: Vec::new(),
            per_object: Vec::new(),
            back: Vec::new(),
            inner: Vec::new(),
            unfolded: Vec::new(),
            by: Vec::new(),
        }
    }

    /// Raw velocities `[B, 12]` of a batch: the 3 x 3 matrix row by row, then the translation.
    pub fn forward(&mut self, parameters: &[Parameter], batch: &Batch) -> &[f32] {
        let mut layers = parameters.chunks(2).map(|p| [&p[0], &p[1]]);
        let mut next = || layers.next().expect("as laid out");
        let mut x = batch.grids.as_slice();
        for (around, rows, layer) in &mut self.convolutions {
            around.unfold(x, rows);
            layer.forward(rows, next());
            x = &layer.out;
        }
        self.encoded.clear();
        let groups = batch.scale_m.len();
        for (code, scale_m) in x.chunks(x.len() / groups).zip(&batch.scale_m) {
            self.encoded.extend_from_slice(code);
            self.encoded.push(scale_m / LENGTH_UNIT_M);
        }
        self.latent.forward(&self.encoded, next());
        let first = self.hidden.first_mut().expect("at least one layer");
        let [weight, bias] = next();
        let codes = Matrix::new(&self.latent.out, self.preset.network.latent);
        let features = features::count(&self.preset.network);
        let weight = Matrix::new(&weight.values, weight.shape[1]);
        let outputs = bias.values.len();
        // What the latent gives is the same for all rows of an object.
        self.per_object.clear();
        for _ in 0..groups {
            self.per_object.extend_from_slice(&bias.values);
        }
        let of_code = weight.columns(features, self.preset.network.latent);
        MatrixMut::new(&mut self.per_object, outputs).add_product(codes, of_code.transposed());
        let each = batch.features.len() / features / groups;
        first.slope.clear();
        for row in self.per_object.chunks(outputs) {
            for _ in 0..each {
                first.slope.extend_from_slice(row);
            }
        }
        let seen = Matrix::new(&batch.features, features);
        let of_seen = weight.columns(0, features).transposed();
        MatrixMut::new(&mut first.slope, outputs).add_product(seen, of_seen);
        first.activate(None);
        onward(&mut self.hidden, next, &mut self.raw);
        &self.raw
    }

    /// The losses of a batch, and the gradient of their weighted sum by every parameter.
    pub fn gradients(&mut self, parameters: &[Parameter], batch: &Batch) -> (Losses, &[Vec<f32>]) {
        self.forward(parameters, batch);
        if self.by.is_empty() {
            self.by = parameters
                .iter()
                .map(|p| vec![0.0; p.values.len()])
                .collect();
        }
        let weight = self.preset.training.translation_weight;
        let losses = losses(&self.raw, &batch.targets, weight, &mut self.back);
        self.backward(parameters, batch);
        (losses, &self.by)
    }

    /// Fills `by`, from the gradient by the raw velocities in `back`.
    fn backward(&mut self, parameters: &[Parameter], batch: &Batch) {
        let network = &self.preset.network;
        let mut layers = parameters.chunks(2).zip(self.by.chunks_mut(2)).rev();
        let width = network.width;
        let (back, inner) = (&mut self.back, &mut self.inner);
        back_to_first(&self.hidden, &mut layers, back, inner);

        let mut next = || layers.next().expect("as laid out");
        let (p, by) = next();
        let (features, codes) = (features::count(network), network.latent);
        let inputs = features + codes;
        self.hidden[0].before_activation(&self.back, &mut self.inner);
        MatrixMut::new(&mut by[0], inputs)
            .columns(0, features)
            .set_product(
                Matrix::new(&self.inner, width).transposed(),
                Matrix::new(&batch.features, features),
            );
        let groups = batch.scale_m.len();
        self.per_object.fill(0.0);
        let rows = self.inner.chunks(self.inner.len() / groups);
        for (rows, sum) in rows.zip(self.per_object.chunks_mut(width)) {
            add_rows(rows, sum);
        }
        let per_object = Matrix::new(&self.per_object, width);
        by[1].fill(0.0);
        add_rows(&self.per_object, &mut by[1]);
        MatrixMut::new(&mut by[0], inputs)
            .columns(features, codes)
            .set_product(
                per_object.transposed(),
                Matrix::new(&self.latent.out, codes),
            );
        self.back.clear();
        self.back.resize(groups * codes, 0.0);
        let of_code = Matrix::new(&p[0].values, inputs).columns(features, codes);
        MatrixMut::new(&mut self.back, codes).set_product(per_object, of_code);

        let (p, by) = next();
        self.latent.before_activation(&self.back, &mut self.inner);
        linear_back(&self.encoded, &self.inner, by);
        if self.convolutions.is_empty() {
            return;
        }
        through(&self.inner, &p[0], &mut self.back);
        // All of the code but the scale comes from the convolutions.
        std::mem::swap(&mut self.back, &mut self.inner);
        self.back.clear();
        for code in self.inner.chunks(p[0].shape[1]) {
            self.back.extend_from_slice(&code[..code.len() - 1]);
        }
        for (i, (around, rows, layer)) in self.convolutions.iter().enumerate().rev() {
            let (p, by) = next();
            layer.before_activation(&self.back, &mut self.inner);
            linear_back(rows, &self.inner, by);
            if i > 0 {
                through(&self.inner, &p[0], &mut self.unfolded);
                around.fold(&self.unfolded, &mut self.back);
            }
        }
    }
}

/// Losses of raw velocities `[B, 12]` against targets `[B, 6]` (body-frame angular velocity, translation
/// velocity), and the gradient of `rotation + weight translation` by the raw velocities.
///
/// The skew projection of RFMGrasp eq. 12 comes first: omega = vee((xi - xi^T) / 2).
fn losses(raw: &[f32], targets: &[f32], weight: f32, gradient: &mut Vec<f32>) -> Losses {
    const PLUS_MINUS: [[usize; 2]; 3] = [[7, 5], [2, 6], [3, 1]];
    gradient.clear();
    gradient.resize(raw.len(), 0.0);
    let share = OUTPUTS as f32 / raw.len() as f32;
    let mut sums = [0f64; 2];
    let rows = raw.chunks(OUTPUTS).zip(targets.chunks(6));
    for ((raw, target), gradient) in rows.zip(gradient.chunks_mut(OUTPUTS)) {
        for (k, [plus, minus]) in PLUS_MINUS.into_iter().enumerate() {
            let error = 0.5 * (raw[plus] - raw[minus]) - target[k];
            sums[0] += f64::from(error).powi(2);
            gradient[plus] = share * error;
            gradient[minus] = -share * error;
            let error = raw[9 + k] - target[3 + k];
            sums[1] += f64::from(error).powi(2);
            gradient[9 + k] = 2.0 * share * weight * error;
        }
    }
    let [rotation, translation] = sums.map(|s| (s * f64::from(share)) as f32);
    Losses {
        rotation,
        translation,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::initial;

    fn small(name: &str) -> Preset {
        let mut preset = Preset::load(name).unwrap();
        preset.network.width = 12;
        preset.network.layers = 3;
        preset.network.latent = 6;
        preset.flow.resolution = 16;
        preset
    }

    fn numbers(len: usize, step: f32) -> Vec<f32> {
        (0..len).map(|i| (i as f32 * step).sin()).collect()
    }

    /// The derivative along a direction is what the losses do over a small step that way.
    #[test]
    fn the_gradient_is_the_slope_of_the_losses_in_every_layer_of_both_presets() {
        for name in ["paper", "best"] {
            let preset = small(name);
            let (groups, each) = (2, 5);
            let grid = match preset.network.encoder {
                Encoder::Conv => preset.flow.resolution.pow(3),
                Encoder::Histogram => features::HISTOGRAM_CENTRES.len(),
            };
            let batch = Batch {
                grids: numbers(groups * grid, 0.37),
                scale_m: vec![0.08, 0.15],
                features: numbers(groups * each * features::count(&preset.network), 0.73),
                targets: numbers(groups * each * 6, 1.7),
            };
            let parameters = initial(&preset, 3);
            let mut network = Network::new(&preset);
            let total = |network: &mut Network<'_>, p: &[Parameter]| {
                let l = network.gradients(p, &batch).0;
                f64::from(l.rotation)
                    + f64::from(preset.training.translation_weight) * f64::from(l.translation)
            };
            let by = network.gradients(&parameters, &batch).1.to_vec();
            for (k, p) in parameters.iter().enumerate() {
                let norm = by[k]
                    .iter()
                    .map(|g| f64::from(*g).powi(2))
                    .sum::<f64>()
                    .sqrt();
                assert!(norm > 1e-4, "{name} {}: nothing arrives", p.name);
                let h = 2e-3 / norm;
                let moved = |sign: f64| {
                    let mut moved = parameters.clone();
                    for (w, g) in moved[k].values.iter_mut().zip(&by[k]) {
                        *w += (sign * h * f64::from(*g) / norm) as f32;
                    }
                    moved
                };
                let rise = total(&mut network, &moved(1.0)) - total(&mut network, &moved(-1.0));
                let slope = rise / (2.0 * h);
                assert!(
                    (slope / norm - 1.0).abs() < 0.02,
                    "{name} {}: {slope} {norm}",
                    p.name
                );
            }
        }
    }
}
