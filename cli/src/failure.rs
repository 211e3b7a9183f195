//! How a command ends: documented exit codes, one clear message.

use std::fmt;
use std::process::ExitCode;

/// Exit codes of the contract.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Done.
    Success = 0,
    /// A defect of this program.
    Internal = 1,
    /// Wrong words on the command line.
    Usage = 2,
    /// Bad input; the message names file, place and mend.
    BadInput = 3,
    /// No grasp was selected.
    NothingToDo = 4,
    /// Some objects could not be read under `--keep-going`; the rest is on disk.
    Incomplete = 5,
    /// `compare` found the new run worse.
    Regression = 100,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// Why a command ended early.
#[derive(Debug)]
pub struct Failure {
    /// With which code.
    pub exit: Exit,
    message: String,
}

impl Failure {
    /// Bad input.
    pub fn input(message: impl fmt::Display) -> Self {
        Self {
            exit: Exit::BadInput,
            message: message.to_string(),
        }
    }

    /// Wrong use of the command line.
    pub fn usage(message: impl fmt::Display) -> Self {
        Self {
            exit: Exit::Usage,
            message: message.to_string(),
        }
    }

    /// No grasp selected.
    pub fn nothing(message: impl fmt::Display) -> Self {
        Self {
            exit: Exit::NothingToDo,
            message: message.to_string(),
        }
    }

    /// A defect of this program.
    pub fn internal(message: impl fmt::Display) -> Self {
        Self {
            exit: Exit::Internal,
            message: message.to_string(),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

macro_rules! bad_input {
    ($($t:ty),+) => {$(
        impl From<$t> for Failure {
            fn from(e: $t) -> Self {
                Self::input(e)
            }
        }
    )+};
}

bad_input!(
    shakedown_objects::ObjectError,
    shakedown_gripper_assets::GraspError,
    shakedown_sampler::ModelError,
    shakedown_classifier::hand::HandError,
    shakedown_sim::ProtocolError,
    shakedown_sim::SceneError,
    shakedown_report::StoreError,
    shakedown_report::results::ResultsError
);

#[cfg(feature = "train")]
bad_input!(shakedown_trainer::TrainError);
