//! `shakedown classify`: `run` with the geometric stage only.

use crate::args::{Global, RunArgs, Stage};
use crate::failure::{Exit, Failure};

pub fn run(global: &Global, args: &RunArgs) -> Result<Exit, Failure> {
    let geometry_only = RunArgs {
        stages: vec![Stage::Geometry],
        ..args.clone()
    };
    super::run::run(global, &geometry_only)
}
