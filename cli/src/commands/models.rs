//! `shakedown models`: the flow models that are built in.

use crate::args::{Format, Global};
use crate::failure::{Exit, Failure};

pub fn run(global: &Global) -> Result<Exit, Failure> {
    if global.format == Format::Json {
        println!("[]");
    } else {
        println!(
            "No model is built in yet. Give any model of the contract as a directory:\n  \
             shakedown run --model DIR    (model.toml, encoder.onnx, velocity.onnx; docs/formats.md)\n\
             Without one, candidates come from the antipodal sampler."
        );
    }
    Ok(Exit::Success)
}
