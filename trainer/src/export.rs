//! The network as the two graphs of the model contract, with its card.
//!
//! What the trainer computes in Rust on the way in ([`crate::features`]) and on the way out (the
//! turn from the hand's frame) is part of the graph, so the sampler needs to know nothing of it.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use shakedown_sampler::{ModelCard, ModelFiles};

use crate::checkpoint::replace;
use crate::conv::KERNEL;
use crate::error::TrainError;
use crate::export_moments::{moments_along, moments_of};
use crate::features::{
    self, DISTANCE_WIDTHS_M, HISTOGRAM_CENTRES, HISTOGRAM_STEEPNESS, LENGTH_UNIT_M,
    TIME_FREQUENCIES,
};
use crate::moments;
use crate::network::{CHANNELS, OUTPUTS, Parameter};
use crate::onnx::{Attribute, Dimension, Graph};
use crate::preset::{Encoder, NetworkPreset, Preset};

/// What the card says that the preset does not know.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Provenance {
    /// Name of the model.
    pub name: String,
    /// One line.
    pub description: String,
    /// Licence of the weights.
    pub licence: String,
    /// What it was trained on.
    pub training_data: String,
    /// The command that made it.
    pub command: String,
    /// Name of the hand.
    pub gripper: String,
    /// What it was measured to reach.
    pub metrics: BTreeMap<String, f64>,
}

/// Writes `model.toml`, `encoder.onnx` and `velocity.onnx` into `directory`.
///
/// # Errors
/// A disk that cannot be written; files there before stay whole.
pub fn export(
    directory: &Path,
    preset: &Preset,
    parameters: &[Parameter],
    provenance: &Provenance,
) -> Result<(), TrainError> {
    fs::create_dir_all(directory).map_err(|e| TrainError::io("write", directory, e))?;
    let write = |name: &str, bytes: &[u8]| replace(&directory.join(name), |p| fs::write(p, bytes));
    write("encoder.onnx", &encoder(preset, parameters))?;
    write("velocity.onnx", &velocity(preset, parameters))?;
    let text = toml::to_string(&card(preset, provenance)).expect("plain data");
    write("model.toml", text.as_bytes())
}

/// Writes a model anew into `directory`, with an evaluator.
///
/// # Errors
/// A disk that cannot be written; files there before stay whole.
pub fn add_evaluator(
    directory: &Path,
    model: &ModelFiles,
    card: &ModelCard,
    parameters: &[Parameter],
) -> Result<(), TrainError> {
    fs::create_dir_all(directory).map_err(|e| TrainError::io("write", directory, e))?;
    let write = |name: &str, bytes: &[u8]| replace(&directory.join(name), |p| fs::write(p, bytes));
    write("encoder.onnx", &model.encoder)?;
    write("velocity.onnx", &model.velocity)?;
    write("evaluator.onnx", &evaluator(parameters))?;
    let text = toml::to_string(card).expect("plain data");
    write("model.toml", text.as_bytes())
}

fn card(preset: &Preset, provenance: &Provenance) -> ModelCard {
    let flow = &preset.flow;
    ModelCard {
        name: provenance.name.clone(),
        description: provenance.description.clone(),
        licence: provenance.licence.clone(),
        training_data: provenance.training_data.clone(),
        command: provenance.command.clone(),
        gripper: provenance.gripper.clone(),
        frame: flow.frame.clone(),
        resolution: flow.resolution,
        padding: flow.padding,
        centring: flow.centring,
        normalisation: flow.normalisation,
        noise_translation_std: flow.noise_translation_std,
        noise: flow.noise,
        steps: flow.steps,
        integrator: flow.integrator,
        control_points_m: if preset.network.hand_frame {
            features::control_points_m()
        } else {
            Vec::new()
        },
        evaluator: None,
        metrics: provenance.metrics.clone(),
    }
}

const ANY: Dimension = None;

fn n(size: usize) -> Dimension {
    Some(size as i64)
}

/// Fetches parameters by name.
struct Weights<'a>(&'a [Parameter]);

impl Weights<'_> {
    fn get(&self, name: &str) -> &Parameter {
        let found = self.0.iter().find(|p| p.name == name);
        found.unwrap_or_else(|| panic!("{name} is part of the layout"))
    }

    fn linear(&self, graph: &mut Graph, name: &str, x: &str) -> String {
        let weight = self.get(&format!("{name}.weight"));
        self.product(graph, name, x, &weight.values)
    }

    fn product(&self, graph: &mut Graph, name: &str, x: &str, values: &[f32]) -> String {
        let weight = self.get(&format!("{name}.weight"));
        let bias = self.get(&format!("{name}.bias"));
        let w = graph.floats(&weight.shape, values);
        let b = graph.floats(&bias.shape, &bias.values);
        graph.node_with("Gemm", &[x, &w, &b], &[("transB", Attribute::Int(1))])
    }
}

fn silu(graph: &mut Graph, x: &str) -> String {
    let s = graph.node("Sigmoid", &[x]);
    graph.node("Mul", &[x, &s])
}

pub(crate) fn scaled(graph: &mut Graph, x: &str, factor: f32) -> String {
    let c = graph.floats(&[1], &[factor]);
    graph.node("Mul", &[x, &c])
}

/// `encoder.onnx`.
fn encoder(preset: &Preset, parameters: &[Parameter]) -> Vec<u8> {
    let weights = Weights(parameters);
    let mut g = Graph::default();
    let d = n(preset.flow.resolution);
    let sdf = g.input("sdf", &[ANY, n(1), d, d, d]);
    let scale = g.input("scale", &[ANY, n(1)]);
    let scale = scaled(&mut g, &scale, 1.0 / LENGTH_UNIT_M);
    let latent = match preset.network.encoder {
        Encoder::Conv => {
            let x = convolutions(&mut g, &weights, &sdf);
            let x = concat(&mut g, &[&x, &scale]);
            // The trainer keeps channels last, the graph first.
            let weight = weights.get("encoder.out.weight");
            let edge = preset.flow.resolution >> CHANNELS.len();
            let (cells, channels) = (edge.pow(3), CHANNELS[CHANNELS.len() - 1]);
            let columns = cells * channels + 1;
            let values: Vec<f32> = (0..weight.values.len())
                .map(|i| {
                    let (row, column) = (i / columns, i % columns);
                    let from = if column + 1 == columns {
                        column
                    } else {
                        column % cells * channels + column / cells
                    };
                    weight.values[row * columns + from]
                })
                .collect();
            weights.product(&mut g, "encoder.out", &x, &values)
        }
        Encoder::Histogram => {
            let bins = HISTOGRAM_CENTRES.len();
            let cells = preset.flow.resolution.pow(3) as i64;
            let shape = g.integers(&[-1, 1, cells]);
            let flat = g.node("Reshape", &[&sdf, &shape]);
            let centres = g.floats(&[1, bins, 1], &HISTOGRAM_CENTRES);
            let below = g.node("Sub", &[&centres, &flat]);
            let below = scaled(&mut g, &below, HISTOGRAM_STEEPNESS);
            let soft = g.node("Sigmoid", &[&below]);
            let axes = [
                ("axes", Attribute::Ints(vec![2])),
                ("keepdims", Attribute::Int(0)),
            ];
            let x = g.node_with("ReduceMean", &[&soft], &axes);
            let x = concat(&mut g, &[&x, &scale]);
            weights.linear(&mut g, "encoder.out", &x)
        }
    };
    let mut latent = silu(&mut g, &latent);
    if preset.network.moments {
        let moments = moments_of(&mut g, &sdf, preset.flow.resolution);
        latent = concat(&mut g, &[&latent, &moments]);
    }
    g.output("latent", &latent, &[ANY, n(latent_count(&preset.network))]);
    g.finish("encoder")
}

/// Length of the latent of the contract: what the encoder learned, then the moments.
fn latent_count(network: &NetworkPreset) -> usize {
    network.latent + if network.moments { moments::COUNT } else { 0 }
}

fn convolutions(g: &mut Graph, weights: &Weights<'_>, sdf: &str) -> String {
    let mut x = sdf.to_owned();
    let mut channels = 1;
    for (i, c) in CHANNELS.into_iter().enumerate() {
        let weight = weights.get(&format!("encoder.conv{i}.weight"));
        let bias = weights.get(&format!("encoder.conv{i}.bias"));
        let cells = KERNEL.pow(3);
        let values: Vec<f32> = (0..weight.values.len())
            .map(|j| {
                let (row, rest) = (j / (cells * channels), j % (cells * channels));
                let (channel, cell) = (rest / cells, rest % cells);
                weight.values[(row * cells + cell) * channels + channel]
            })
            .collect();
        let w = g.floats(&[c, channels, KERNEL, KERNEL, KERNEL], &values);
        let b = g.floats(&[c], &bias.values);
        let attributes = [
            ("kernel_shape", Attribute::Ints(vec![3; 3])),
            ("strides", Attribute::Ints(vec![2; 3])),
            // One layer of zeros before; after the last node the window never reaches.
            ("pads", Attribute::Ints(vec![1, 1, 1, 0, 0, 0])),
        ];
        let y = g.node_with("Conv", &[&x, &w, &b], &attributes);
        x = silu(g, &y);
        channels = c;
    }
    g.node_with("Flatten", &[&x], &[("axis", Attribute::Int(1))])
}

pub(crate) fn concat(g: &mut Graph, parts: &[&str]) -> String {
    g.node_with("Concat", parts, &[("axis", Attribute::Int(1))])
}

/// `velocity.onnx`.
fn velocity(preset: &Preset, parameters: &[Parameter]) -> Vec<u8> {
    let weights = Weights(parameters);
    let network = &preset.network;
    let mut g = Graph::default();
    let latent = g.input("latent", &[ANY, n(latent_count(network))]);
    let rotation = g.input("rotation", &[ANY, n(3), n(3)]);
    let translation = g.input("translation", &[ANY, n(3)]);
    let time = g.input("time", &[ANY, n(1)]);
    let mut parts = Vec::new();
    let mut scale_in_units = String::new();
    if network.hand_frame {
        (parts, scale_in_units) = from_the_hand(&mut g, &rotation, &translation);
    } else {
        parts.push(reshaped(&mut g, &rotation, &[-1, 9]));
        parts.push(translation);
    }
    parts.push(time.clone());
    let multiples: Vec<f32> = TIME_FREQUENCIES
        .iter()
        .map(|f| std::f32::consts::PI * f)
        .collect();
    let multiples = g.floats(&[1, multiples.len()], &multiples);
    let phase = g.node("Mul", &[&time, &multiples]);
    parts.push(g.node("Sin", &[&phase]));
    parts.push(g.node("Cos", &[&phase]));
    if network.moments {
        let learned = network.latent as i64;
        let moments = columns(&mut g, &latent, learned, learned + moments::COUNT as i64);
        parts.push(moments_along(&mut g, &moments, &rotation, &scale_in_units));
        parts.push(columns(&mut g, &latent, 0, learned));
    } else {
        parts.push(latent);
    }
    let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
    let x = concat(&mut g, &parts);
    let x = hidden(&mut g, &weights, "velocity", network.layers, &x);
    let raw = weights.linear(&mut g, "velocity.out", &x);
    let xi = columns(&mut g, &raw, 0, 9);
    let xi = reshaped(&mut g, &xi, &[-1, 3, 3]);
    let mut v = columns(&mut g, &raw, 9, OUTPUTS as i64);
    if network.hand_frame {
        let row = reshaped(&mut g, &v, &[-1, 1, 3]);
        let turned = summed_product(&mut g, &rotation, &row, 2);
        v = g.node("Div", &[&turned, &scale_in_units]);
    }
    g.output("rotation_velocity", &xi, &[ANY, n(3), n(3)]);
    g.output("translation_velocity", &v, &[ANY, n(3)]);
    g.finish("velocity")
}

/// What a network sees of a pose from the hand, and the scale in units of the network.
fn from_the_hand(g: &mut Graph, rotation: &str, translation: &str) -> (Vec<String>, String) {
    let mut parts = Vec::new();
    let scale = g.input("scale", &[ANY, n(1)]);
    let points = features::control_points_m().len();
    let sdf = g.input("sdf_at_points", &[ANY, n(points)]);
    for w in DISTANCE_WIDTHS_M {
        let widths = scaled(g, &scale, 1.0 / w);
        let x = g.node("Mul", &[&sdf, &widths]);
        parts.push(g.node("Tanh", &[&x]));
    }
    let scale_in_units = scaled(g, &scale, 1.0 / LENGTH_UNIT_M);
    // R^T t: column sums of R times t.
    let column = reshaped(g, translation, &[-1, 3, 1]);
    let centre = summed_product(g, rotation, &column, 1);
    parts.push(g.node("Mul", &[&centre, &scale_in_units]));
    parts.push(g.node("Log", &[&scale_in_units]));
    (parts, scale_in_units)
}

/// `evaluator.onnx`: the probability that a grasp holds.
fn evaluator(parameters: &[Parameter]) -> Vec<u8> {
    let weights = Weights(parameters);
    let mut g = Graph::default();
    let rotation = g.input("rotation", &[ANY, n(3), n(3)]);
    let translation = g.input("translation", &[ANY, n(3)]);
    let (parts, _) = from_the_hand(&mut g, &rotation, &translation);
    let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
    let x = concat(&mut g, &parts);
    let x = hidden(&mut g, &weights, "evaluator", parameters.len() / 2 - 1, &x);
    let logit = weights.linear(&mut g, "evaluator.out", &x);
    let score = g.node("Sigmoid", &[&logit]);
    g.output("score", &score, &[ANY, n(1)]);
    g.finish("evaluator")
}

/// Hidden layers; all but the first add to their input.
fn hidden(g: &mut Graph, weights: &Weights<'_>, name: &str, layers: usize, x: &str) -> String {
    let x = weights.linear(g, &format!("{name}.layer0"), x);
    let mut x = silu(g, &x);
    for i in 1..layers {
        let y = weights.linear(g, &format!("{name}.layer{i}"), &x);
        let y = silu(g, &y);
        x = g.node("Add", &[&x, &y]);
    }
    x
}

pub(crate) fn reshaped(g: &mut Graph, x: &str, shape: &[i64]) -> String {
    let shape = g.integers(shape);
    g.node("Reshape", &[x, &shape])
}

fn summed_product(g: &mut Graph, a: &str, b: &str, axis: i64) -> String {
    let product = g.node("Mul", &[a, b]);
    let axes = g.integers(&[axis]);
    let no = [("keepdims", Attribute::Int(0))];
    g.node_with("ReduceSum", &[&product, &axes], &no)
}

fn columns(g: &mut Graph, x: &str, from: i64, to: i64) -> String {
    let (from, to) = (g.integers(&[from]), g.integers(&[to]));
    let axis = g.integers(&[1]);
    g.node("Slice", &[x, &from, &to, &axis])
}
