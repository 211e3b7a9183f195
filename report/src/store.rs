//! The run directory: refuses another run's files, takes rows as they come, ends with a summary.

use std::fs;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use shakedown_metrics::Summary;

use crate::manifest::Manifest;
use crate::trials::{TrialRow, write_header, write_row};
use crate::{html, markdown};

/// Why a run directory cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// Nothing can be written there: a full disk, a missing right, a path that is a file.
    #[error("cannot write {}: {source}; free some space or choose another --out", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A baseline cannot be called so.
    #[error("a baseline cannot be called {0:?}: use letters, digits, '.', '_' and '-'")]
    Name(String),
    /// The directory holds something else.
    #[error("{} {what}; choose another --out or remove it", path.display())]
    Occupied {
        /// The directory.
        path: PathBuf,
        /// What it holds.
        what: String,
    },
}

/// An open run directory.
pub struct Store {
    directory: PathBuf,
    manifest: Manifest,
    trials: BufWriter<fs::File>,
}

fn io(path: &Path) -> impl Fn(std::io::Error) -> StoreError + '_ {
    move |source| StoreError::Io {
        path: path.to_owned(),
        source,
    }
}

impl Store {
    /// Opens `directory` for a run: new, empty, or left by the same run (which is then redone).
    ///
    /// # Errors
    /// A directory of another run or with foreign files, or one that cannot be written.
    pub fn create(directory: &Path, manifest: Manifest) -> Result<Self, StoreError> {
        fs::create_dir_all(directory).map_err(io(directory))?;
        let manifest_path = directory.join("manifest.json");
        let occupied = |what: String| StoreError::Occupied {
            path: directory.to_owned(),
            what,
        };
        match fs::read(&manifest_path) {
            Ok(bytes) => {
                let old: Manifest = serde_json::from_slice(&bytes)
                    .map_err(|_| occupied("holds a manifest.json that cannot be read".into()))?;
                if old.run_id != manifest.run_id {
                    return Err(occupied(format!(
                        "belongs to another run ({}, this one is {})",
                        old.run_id, manifest.run_id
                    )));
                }
            }
            Err(_) => {
                let mut entries = fs::read_dir(directory).map_err(io(directory))?;
                if entries.next().is_some() {
                    return Err(occupied("is not empty and holds no manifest.json".into()));
                }
            }
        }
        let mut text = serde_json::to_string_pretty(&manifest).expect("a manifest is plain data");
        text.push('\n');
        write_whole(&manifest_path, text.as_bytes())?;
        let replays = directory.join("replays");
        fs::create_dir_all(&replays).map_err(io(&replays))?;
        let path = directory.join("trials.csv");
        let mut trials = BufWriter::new(fs::File::create(&path).map_err(io(&path))?);
        write_header(&mut trials).map_err(io(&path))?;
        Ok(Self {
            directory: directory.to_owned(),
            manifest,
            trials,
        })
    }

    /// Where the run lies.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// Appends rows of one object and hands them to the system.
    ///
    /// # Errors
    /// A full disk; what was appended before stays.
    pub fn append(&mut self, object: &str, rows: &[TrialRow]) -> Result<(), StoreError> {
        let path = self.directory.join("trials.csv");
        for row in rows {
            write_row(&mut self.trials, object, row).map_err(io(&path))?;
        }
        self.trials.flush().map_err(io(&path))
    }

    /// Writes one file under `replays/`.
    ///
    /// # Errors
    /// As [`Store::append`].
    pub fn add_replay(&self, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        write_whole(&self.directory.join("replays").join(name), bytes)
    }

    /// Writes `summary.json`, `summary.md` and `report.html`.
    ///
    /// # Errors
    /// As [`Store::append`].
    pub fn finish(mut self, summary: &Summary) -> Result<(), StoreError> {
        let trials = self.directory.join("trials.csv");
        self.trials.flush().map_err(io(&trials))?;
        let mut json = serde_json::to_string_pretty(summary).expect("a summary is plain data");
        json.push('\n');
        write_whole(&self.directory.join("summary.json"), json.as_bytes())?;
        let text = markdown::summary(&self.manifest, summary);
        write_whole(&self.directory.join("summary.md"), text.as_bytes())?;
        let page = html::page(&self.manifest, summary);
        write_whole(&self.directory.join("report.html"), page.as_bytes())
    }
}

/// Writes a file under another name first, so that no reader ever sees half of it.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".part");
    let part = path.with_file_name(name);
    let written = fs::write(&part, bytes).and_then(|()| fs::rename(&part, path));
    if written.is_err() {
        let _ = fs::remove_file(&part);
    }
    written.map_err(io(path))
}
