//! One ONNX graph of a model: opened, checked against the contract, and run.

use std::path::{Path, PathBuf};

use ort::session::builder::GraphOptimizationLevel;
use ort::session::{Session, SessionOutputs};
use ort::value::{Tensor, TensorElementType, ValueType};

use crate::card::ModelError;
use crate::runtime::{Runtime, runtime};

/// A graph with the path that names it in errors.
pub(crate) struct Graph {
    path: PathBuf,
    session: Session,
    pub runtime: Runtime,
}

/// An input on its way into a graph.
pub(crate) type Input = (&'static str, Tensor<f32>);

impl Graph {
    pub fn open(path: &Path, bytes: &[u8], ort: Option<&Path>) -> Result<Self, ModelError> {
        let (runtime, environment) = runtime(ort).map_err(|e| ModelError::bad(path, e))?;
        let session = Session::builder(environment)
            .map_err(|e| failed(path, &e))?
            .with_optimization_level(GraphOptimizationLevel::All)
            .map_err(|e| failed(path, &e))?
            .with_intra_threads(1)
            .map_err(|e| failed(path, &e))?
            .commit_from_memory(bytes)
            .map_err(|e| ModelError::bad(path, format!("not a usable ONNX graph: {e}")))?;
        Ok(Self {
            path: path.to_owned(),
            session,
            runtime: runtime.clone(),
        })
    }

    pub fn bad(&self, what: impl Into<String>) -> ModelError {
        ModelError::bad(&self.path, what)
    }

    pub fn has_input(&self, name: &str) -> bool {
        self.session.inputs().iter().any(|i| i.name() == name)
    }

    /// Checks that it wants what it is fed with, and gives what is asked of it.
    pub fn names(
        &self,
        needed: &[&str],
        optional: &[&str],
        outputs: &[&str],
    ) -> Result<(), ModelError> {
        let inputs: Vec<&str> = self.session.inputs().iter().map(|i| i.name()).collect();
        for name in needed {
            if !inputs.contains(name) {
                return Err(self.bad(format!("there is no input `{name}`; it has {inputs:?}")));
            }
        }
        for name in &inputs {
            if !needed.contains(name) && !optional.contains(name) {
                return Err(self.bad(format!("nobody knows what to feed to input `{name}`")));
            }
        }
        let found: Vec<&str> = self.session.outputs().iter().map(|o| o.name()).collect();
        for name in outputs {
            if !found.contains(name) {
                return Err(self.bad(format!("there is no output `{name}`; it has {found:?}")));
            }
        }
        Ok(())
    }

    /// Checks type and shape of an input; -1 is a dimension that may be anything.
    pub fn input(&self, name: &str, expected: &[i64]) -> Result<(), ModelError> {
        let outlet = self.session.inputs().iter().find(|i| i.name() == name);
        let Some(ValueType::Tensor { ty, shape, .. }) = outlet.map(|o| o.dtype()) else {
            return Err(self.bad(format!("input `{name}` is no tensor")));
        };
        if *ty != TensorElementType::Float32 {
            return Err(self.bad(format!("input `{name}` is {ty:?}, not float32")));
        }
        let found: Vec<i64> = shape.iter().copied().collect();
        let fits = found.len() == expected.len()
            && found
                .iter()
                .zip(expected)
                .all(|(f, e)| *f == -1 || *e == -1 || f == e);
        if !fits {
            return Err(self.bad(format!(
                "input `{name}` has shape {found:?}, expected {expected:?} (-1: any)"
            )));
        }
        if found.first().is_some_and(|b| *b != -1) {
            return Err(self.bad(format!("input `{name}` has a fixed batch of {}", found[0])));
        }
        Ok(())
    }

    /// Width of a [B, L] output, if the graph declares it.
    pub fn output_width(&self, name: &str) -> Result<Option<usize>, ModelError> {
        let outlet = self.session.outputs().iter().find(|o| o.name() == name);
        let Some(ValueType::Tensor { shape, .. }) = outlet.map(|o| o.dtype()) else {
            return Err(self.bad(format!("output `{name}` is no tensor")));
        };
        Ok(shape.last().and_then(|&l| usize::try_from(l).ok()))
    }

    /// An input of this graph.
    pub fn tensor(
        &self,
        name: &'static str,
        shape: Vec<i64>,
        data: Vec<f32>,
    ) -> Result<Input, ModelError> {
        let tensor = Tensor::from_array((shape, data)).map_err(|e| failed(&self.path, &e))?;
        Ok((name, tensor))
    }

    /// Runs it; the outputs asked for, all numbers finite.
    pub fn run<const N: usize>(
        &mut self,
        inputs: Vec<Input>,
        outputs: [&str; N],
        object: Option<&str>,
    ) -> Result<[Vec<f32>; N], ModelError> {
        let path = &self.path;
        let found = self.session.run(inputs).map_err(|e| failed(path, &e))?;
        let mut values: [Vec<f32>; N] = std::array::from_fn(|_| Vec::new());
        for (name, values) in outputs.into_iter().zip(&mut values) {
            *values = extract(path, &found, name)?;
            if !values.iter().all(|v| v.is_finite()) {
                let of = object.map_or(String::new(), |o| format!(" for object {o}"));
                let what = format!("output `{name}` is not finite{of}");
                return Err(ModelError::bad(path, what));
            }
        }
        Ok(values)
    }
}

fn failed(path: &Path, error: &impl std::fmt::Display) -> ModelError {
    ModelError::bad(path, format!("the network fails: {error}"))
}

fn extract(path: &Path, outputs: &SessionOutputs<'_>, name: &str) -> Result<Vec<f32>, ModelError> {
    let value = outputs
        .get(name)
        .ok_or_else(|| ModelError::bad(path, format!("there is no output `{name}`")))?;
    value
        .try_extract_tensor::<f32>()
        .map(|(_, data)| data.to_vec())
        .map_err(|e| ModelError::bad(path, format!("output `{name}`: {e}")))
}
