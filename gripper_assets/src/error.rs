//! What can be wrong with a grasp file or a hand: the file, the place in it, the mend.

use std::path::{Path, PathBuf};

/// Why grasps or a hand could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GraspError {
    /// The file cannot be opened, read or written.
    #[error("cannot access {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is readable, but its content is not usable.
    #[error("{}: {place}: {what}; {mend}", path.display())]
    Bad {
        /// The file.
        path: PathBuf,
        /// Line, dataset, key or grasp.
        place: String,
        /// What is wrong.
        what: String,
        /// What would mend it.
        mend: String,
    },
    /// No hand of this name.
    #[error("there is no gripper {name:?}; {hint}")]
    UnknownGripper {
        /// What was asked for.
        name: String,
        /// The nearest name, or the list.
        hint: String,
    },
}

impl GraspError {
    /// An error at a place of a file.
    pub fn bad(
        path: &Path,
        place: impl Into<String>,
        what: impl Into<String>,
        mend: impl Into<String>,
    ) -> Self {
        Self::Bad {
            path: path.to_owned(),
            place: place.into(),
            what: what.into(),
            mend: mend.into(),
        }
    }

    /// An error of the system at a file.
    pub fn io(path: &Path, source: std::io::Error) -> Self {
        Self::Io {
            path: path.to_owned(),
            source,
        }
    }
}
