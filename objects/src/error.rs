//! What can be wrong with an object: always the file, the place in it and the mend.

use std::fmt;
use std::path::{Path, PathBuf};

/// A place inside a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Place {
    /// The file as a whole.
    Whole,
    /// A line of a text file, counted from 1.
    Line(usize),
    /// A byte offset of a binary file.
    Byte(u64),
    /// A vertex, counted from 0.
    Vertex(usize),
    /// A face, counted from 0.
    Face(usize),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole => Ok(()),
            Self::Line(n) => write!(f, ":{n}"),
            Self::Byte(n) => write!(f, ": byte {n}"),
            Self::Vertex(n) => write!(f, ": vertex {n}"),
            Self::Face(n) => write!(f, ": face {n}"),
        }
    }
}

/// Why an object could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ObjectError {
    /// The file cannot be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is readable, but what it holds is not a usable object.
    #[error("{}{place}: {what}; {mend}", path.display())]
    Bad {
        /// The file.
        path: PathBuf,
        /// Where in it.
        place: Place,
        /// What is wrong.
        what: String,
        /// What would mend it.
        mend: String,
    },
}

impl ObjectError {
    /// An error at a place of a file.
    pub fn bad(
        path: &Path,
        place: Place,
        what: impl Into<String>,
        mend: impl Into<String>,
    ) -> Self {
        Self::Bad {
            path: path.to_owned(),
            place,
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
