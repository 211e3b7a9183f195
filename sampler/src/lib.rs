//! Where grasps come from: a flow model on SE(3) read from ONNX files, and an antipodal sampler as
//! the candidates of ACRONYM were made.
//!
//! Every draw has a name of its own: the run's seed, the object, the hand and the number of the
//! grasp ([`seed`], [`noise`]), so candidate 17 is the same whether 18 or 1 000 are drawn.

pub mod antipodal;
pub mod card;
pub mod files;
pub mod flow;
pub mod noise;
pub mod seed;
pub mod shell;

#[cfg(feature = "onnx")]
mod graph;
#[cfg(feature = "onnx")]
pub mod network;
#[cfg(feature = "onnx")]
mod redraw;
#[cfg(feature = "onnx")]
pub mod runtime;
#[cfg(feature = "onnx")]
mod vet;

pub use antipodal::{AntipodalSettings, sample_antipodal};
pub use card::{Centring, EvaluatorCard, Integrator, ModelCard, ModelError, NoiseKind};
pub use files::{ModelFiles, built_in_names};
pub use flow::{FlowSample, VelocityField, integrate};
#[cfg(feature = "onnx")]
pub use network::{DrawSettings, FlowModel, FlowPath};
