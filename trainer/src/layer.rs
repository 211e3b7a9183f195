//! One layer, forth and back.

use crate::activation::add_silu;
use crate::network::Parameter;
use crate::product::{Matrix, MatrixMut};

/// What the way forth through a layer leaves for the way back; the memory is used again.
#[derive(Debug, Default)]
pub struct Layer {
    /// Derivative of the activation, `[B, O]`; before the activation, what it acts on.
    pub slope: Vec<f32>,
    /// What comes out, `[B, O]`.
    pub out: Vec<f32>,
}

impl Layer {
    /// `silu(x W^T + b)`.
    pub fn forward(&mut self, x: &[f32], [weight, bias]: [&Parameter; 2]) {
        linear(x, [weight, bias], &mut self.slope);
        self.activate(None);
    }

    /// The activation, past which a shortcut may lead.
    pub fn activate(&mut self, shortcut: Option<&[f32]>) {
        self.out.clear();
        self.out.extend_from_slice(shortcut.unwrap_or_default());
        self.out.resize(self.slope.len(), 0.0);
        add_silu(&mut self.slope, &mut self.out);
    }

    /// Gradient by the argument of the activation from that by what comes out.
    pub fn before_activation(&self, gradient: &[f32], out: &mut Vec<f32>) {
        out.clear();
        out.extend(gradient.iter().zip(&self.slope).map(|(g, s)| g * s));
    }
}

/// `out = x W^T + b`, rows `[B, O]`; the weight is `[O, I]`.
pub fn linear(x: &[f32], [weight, bias]: [&Parameter; 2], out: &mut Vec<f32>) {
    let inputs = weight.shape[1];
    out.clear();
    for _ in 0..x.len() / inputs {
        out.extend_from_slice(&bias.values);
    }
    let weight = Matrix::new(&weight.values, inputs).transposed();
    MatrixMut::new(out, bias.values.len()).add_product(Matrix::new(x, inputs), weight);
}

/// Gradients by weight and bias (`by`, in this order) of a linear layer, from that by its output
/// `[B, O]`.
pub fn linear_back(x: &[f32], gradient: &[f32], by: &mut [Vec<f32>]) {
    let outputs = by[1].len();
    let inputs = by[0].len() / outputs;
    let gradient_matrix = Matrix::new(gradient, outputs);
    MatrixMut::new(&mut by[0], inputs)
        .set_product(gradient_matrix.transposed(), Matrix::new(x, inputs));
    by[1].fill(0.0);
    add_rows(gradient, &mut by[1]);
}

/// Gradient by the input of a linear layer, from that by its output.
pub fn through(gradient: &[f32], weight: &Parameter, out: &mut Vec<f32>) {
    let [outputs, inputs] = weight.shape[..] else {
        unreachable!("weights are matrices")
    };
    out.resize(gradient.len() / outputs * inputs, 0.0);
    MatrixMut::new(out, inputs).set_product(
        Matrix::new(gradient, outputs),
        Matrix::new(&weight.values, inputs),
    );
}

/// What follows the first of the hidden layers: the others, each of which adds to what comes in, and a linear
/// one into `out`. `next` gives weight and bias of one after the other.
pub fn onward<'p>(
    hidden: &mut [Layer],
    mut next: impl FnMut() -> [&'p Parameter; 2],
    out: &mut Vec<f32>,
) {
    let (first, rest) = hidden.split_first_mut().expect("at least one layer");
    let mut before = &first.out;
    for layer in rest {
        linear(before, next(), &mut layer.slope);
        layer.activate(Some(before));
        before = &layer.out;
    }
    linear(before, next(), out);
}

/// The way back through [`onward`]: `back` holds the gradient by its output and becomes that by what comes
/// out of the first hidden layer. `layers` gives parameters and their gradients from the last layer on.
pub fn back_to_first<'p>(
    hidden: &[Layer],
    layers: &mut impl Iterator<Item = (&'p [Parameter], &'p mut [Vec<f32>])>,
    back: &mut Vec<f32>,
    inner: &mut Vec<f32>,
) {
    let mut next = || layers.next().expect("as laid out");
    let (p, by) = next();
    let last = hidden.last().expect("at least one layer");
    linear_back(&last.out, back, by);
    std::mem::swap(back, inner);
    through(inner, &p[0], back);
    for (layer, before) in hidden[1..].iter().zip(hidden).rev() {
        let (p, by) = next();
        let width = p[0].shape[1];
        layer.before_activation(back, inner);
        linear_back(&before.out, inner, by);
        // Past the layer by its shortcut, and through it.
        MatrixMut::new(back, width)
            .add_product(Matrix::new(inner, width), Matrix::new(&p[0].values, width));
    }
}

/// Adds every row to `sum`.
pub fn add_rows(rows: &[f32], sum: &mut [f32]) {
    for row in rows.chunks(sum.len()) {
        for (s, x) in sum.iter_mut().zip(row) {
            *s += x;
        }
    }
}
