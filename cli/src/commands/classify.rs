//! `shakedown classify`: only geometry.

use crate::args::{Global, RunArgs, Stage};
use crate::failure::{Exit, Failure};

pub fn run(global: &Global, args: &RunArgs) -> Result<Exit, Failure> {
    super::run::run(global, &only_geometry(args))
}

/// The same run without trials.
pub fn only_geometry(args: &RunArgs) -> RunArgs {
    let mut args = args.clone();
    args.stages = vec![Stage::Geometry];
    args
}
