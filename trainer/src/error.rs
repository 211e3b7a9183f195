//! What can go wrong in a training.

use std::path::{Path, PathBuf};

/// Why a training cannot start or go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrainError {
    /// A file cannot be read or written.
    #[error("cannot {what} {}: {source}", path.display())]
    Io {
        /// `read` or `write`.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file holds something else than it should.
    #[error("{}: {what}", path.display())]
    Bad {
        /// The file.
        path: PathBuf,
        /// What is wrong and what to do.
        what: String,
    },
    /// The data cannot train anything.
    #[error("{0}")]
    Data(String),
    /// The loss is no longer a number.
    #[error(
        "the loss is {loss} at step {step}; the last checkpoint is kept, resume it with a lower \
         learning_rate"
    )]
    Diverged {
        /// The step.
        step: u64,
        /// The loss.
        loss: f32,
    },
    /// The model that was written is not usable.
    #[error(transparent)]
    Model(#[from] shakedown_sampler::ModelError),
    /// The observer's validation failed.
    #[error("validation: {0}")]
    Validation(String),
}

impl TrainError {
    pub(crate) fn io(what: &'static str, path: &Path, source: std::io::Error) -> Self {
        let path = path.to_owned();
        Self::Io { what, path, source }
    }

    pub(crate) fn bad(path: &Path, what: impl Into<String>) -> Self {
        Self::Bad {
            path: path.to_owned(),
            what: what.into(),
        }
    }
}
