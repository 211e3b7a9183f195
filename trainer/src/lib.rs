//! Where the flow model comes from: Riemannian flow matching on SE(3), trained in Rust and
//! exported to the two ONNX graphs of the contract.
//!
//! data ([`data`]) -> noise with its grasps ([`coupling`], [`pairing`]) -> batches of path and target ([`batch`], [`features`], [`moments`]) ->
//! network ([`network`]) and gradient ([`gradient`], of [`layer`], [`conv`], [`activation`] and
//! [`product`]) -> optimiser ([`adam`]) -> loop ([`train`]) with
//! checkpoints and a log -> graphs ([`export`], [`onnx`]).
//!
//! A second network ([`evaluator`]) judges the grasps that a trained flow draws.
//!
//! The method is that of RFMGrasp; where it is silent or contradicts itself, the presets say what
//! was chosen.

pub mod activation;
pub mod adam;
pub mod batch;
pub mod checkpoint;
pub mod conv;
pub mod coupling;
pub mod data;
pub mod error;
pub mod evaluator;
pub mod export;
mod export_moments;
pub mod features;
pub mod gradient;
pub mod history;
pub mod layer;
pub mod moments;
pub mod network;
pub mod onnx;
pub mod pairing;
pub mod preset;
pub mod product;
pub mod train;

pub use data::{Pair, TaughtPath, TrainingObject};
pub use error::TrainError;
pub use preset::Preset;
pub use train::{Observer, Progress, Training, train};
