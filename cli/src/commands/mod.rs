//! One file per subcommand.

pub mod bench;
pub mod classify;
pub mod compare;
pub mod completions;
pub mod export_mjcf;
pub mod grippers;
pub mod label;
pub mod merge;
pub mod models;
pub mod objects;
pub mod protocols;
pub mod rank;
pub mod run;
pub mod sample;
#[cfg(feature = "train")]
pub mod train;
#[cfg(feature = "train")]
pub mod train_evaluator;
