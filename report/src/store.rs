//! The run directory: refuses another run's files, takes rows as they come, ends with a summary.

use std::fs::{self, File};
use std::io::{Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use shakedown_metrics::Summary;

use crate::journal::{self, Done, Journal, Start};
use crate::manifest::Manifest;
use crate::reference::Reference;
use crate::results::ResultsError;
use crate::trials::{TrialRow, write_header, write_row};
use crate::view::ViewMesh;
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
    /// Another process writes this run.
    #[error("another process is writing this run ({}); wait for it or choose another --out", .0.display())]
    Busy(PathBuf),
    /// There is no unfinished run.
    #[error("{}: there is no unfinished run to resume; a finished one needs nothing, a new one starts with `run`", .0.display())]
    NothingToResume(PathBuf),
    /// The rows cannot be read back.
    #[error(transparent)]
    Rows(#[from] Box<ResultsError>),
    /// A file of the run was changed by someone else.
    #[error("{}: damaged ({what}); start the run again in another --out", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
}

/// What lies beside the rows: recorded trials, the objects as the 3-D view shows them, and good
/// grasps that came with them.
pub(crate) const SIDE_DIRECTORIES: [&str; 3] = ["replays", "views", "references"];

/// An open run directory.
pub struct Store {
    directory: PathBuf,
    manifest: Manifest,
    trials: File,
    journal: Journal,
    buffer: Vec<u8>,
}

pub(crate) fn io(path: &Path) -> impl Fn(std::io::Error) -> StoreError + '_ {
    move |source| StoreError::Io {
        path: path.to_owned(),
        source,
    }
}

fn header() -> Vec<u8> {
    let mut bytes = Vec::new();
    write_header(&mut bytes).expect("memory takes it");
    bytes
}

fn make_directories(directory: &Path) -> Result<(), StoreError> {
    for name in SIDE_DIRECTORIES {
        let path = directory.join(name);
        fs::create_dir_all(&path).map_err(io(&path))?;
    }
    Ok(())
}

/// Makes sure that `directory` is new, empty, or of the run with this id.
fn claim(directory: &Path, manifest: &Manifest) -> Result<(), StoreError> {
    fs::create_dir_all(directory).map_err(io(directory))?;
    let occupied = |what: String| StoreError::Occupied {
        path: directory.to_owned(),
        what,
    };
    match fs::read(directory.join("manifest.json")) {
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
            // A kill right at the start may have left the journal and nothing else.
            let own = [journal::DIRECTORY, "manifest.json.part"];
            let foreign = |e: &fs::DirEntry| own.iter().all(|name| e.file_name() != *name);
            let entries = fs::read_dir(directory).map_err(io(directory))?;
            if entries.filter_map(Result::ok).any(|e| foreign(&e)) {
                return Err(occupied("is not empty and holds no manifest.json".into()));
            }
        }
    }
    Ok(())
}

impl Store {
    /// Opens `directory` for a run: new, empty, or left by the same run (which is then redone).
    ///
    /// # Errors
    /// A directory of another run or with foreign files, one that another process writes, or one
    /// that cannot be written.
    pub fn create(directory: &Path, manifest: Manifest, start: &Start) -> Result<Self, StoreError> {
        claim(directory, &manifest)?;
        let header = header();
        let journal = Journal::create(directory, start, header.len() as u64)?;
        write_whole(
            &directory.join("manifest.json"),
            manifest.to_text().as_bytes(),
        )?;
        make_directories(directory)?;
        let path = directory.join("trials.csv");
        let mut trials = File::create(&path).map_err(io(&path))?;
        trials.write_all(&header).map_err(io(&path))?;
        Ok(Self {
            directory: directory.to_owned(),
            manifest,
            trials,
            journal,
            buffer: Vec::new(),
        })
    }

    /// Opens the unfinished run in `directory` again; says which rows are on disk.
    ///
    /// # Errors
    /// Another run's directory, another process that writes it, a damaged header.
    pub fn resume(directory: &Path, manifest: Manifest) -> Result<(Self, Vec<Done>), StoreError> {
        claim(directory, &manifest)?;
        let path = directory.join("trials.csv");
        let mut trials = File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(io(&path))?;
        let header = header();
        let (journal, done) = Journal::resume(directory, &mut trials, header.len() as u64)?;
        // A kill before the first row may have left half a header.
        trials.seek(SeekFrom::Start(0)).map_err(io(&path))?;
        trials.write_all(&header).map_err(io(&path))?;
        trials.seek(SeekFrom::End(0)).map_err(io(&path))?;
        write_whole(
            &directory.join("manifest.json"),
            manifest.to_text().as_bytes(),
        )?;
        make_directories(directory)?;
        let store = Self {
            directory: directory.to_owned(),
            manifest,
            trials,
            journal,
            buffer: Vec::new(),
        };
        Ok((store, done))
    }

    /// Where the run lies.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// Appends rows of one object; when this returns they survive a kill.
    ///
    /// # Errors
    /// A full disk; what was appended before stays.
    pub fn append(&mut self, object: &str, rows: &[TrialRow]) -> Result<(), StoreError> {
        if rows.is_empty() {
            return Ok(());
        }
        self.buffer.clear();
        for row in rows {
            write_row(&mut self.buffer, object, row).expect("memory takes it");
        }
        let path = self.directory.join("trials.csv");
        self.trials
            .write_all(&self.buffer)
            .and_then(|()| self.trials.sync_data())
            .map_err(io(&path))?;
        self.journal.add(object, rows.len() as u64, &self.buffer)
    }

    /// Writes one file under `replays/`.
    ///
    /// # Errors
    /// As [`Store::append`].
    pub fn add_replay(&self, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        write_whole(&self.directory.join("replays").join(name), bytes)
    }

    /// Keeps how an object looks, for the report.
    ///
    /// # Errors
    /// As [`Store::append`].
    pub fn add_view(&self, view: &ViewMesh) -> Result<(), StoreError> {
        let bytes = serde_json::to_vec(view).expect("plain data");
        write_whole(&self.directory.join("views").join(view.file_name()), &bytes)
    }

    /// Keeps the good grasps that came with an object.
    ///
    /// # Errors
    /// As [`Store::append`].
    pub fn add_reference(&self, reference: &Reference) -> Result<(), StoreError> {
        let bytes = serde_json::to_vec(reference).expect("plain data");
        let path = self
            .directory
            .join("references")
            .join(reference.file_name());
        write_whole(&path, &bytes)
    }

    /// Writes `summary.json`, `summary.md` and `report.html`, and closes the journal.
    ///
    /// # Errors
    /// As [`Store::append`].
    pub fn finish(self, summary: &Summary) -> Result<(), StoreError> {
        write_summary(&self.directory, &self.manifest, summary)?;
        self.journal.close()
    }
}

/// Writes `summary.json`, `summary.md` and `report.html` of a run.
///
/// # Errors
/// A directory that cannot be written.
pub fn write_summary(
    directory: &Path,
    manifest: &Manifest,
    summary: &Summary,
) -> Result<(), StoreError> {
    let mut json = serde_json::to_string_pretty(summary).expect("a summary is plain data");
    json.push('\n');
    write_whole(&directory.join("summary.json"), json.as_bytes())?;
    let text = markdown::summary(manifest, summary);
    write_whole(&directory.join("summary.md"), text.as_bytes())?;
    #[cfg(feature = "parquet")]
    crate::columnar::write(directory).map_err(io(&directory.join(crate::columnar::FILE)))?;
    let collected = html::collect::collect(directory, manifest).map_err(Box::new)?;
    let page = html::page::page(manifest, summary, &collected);
    write_whole(&directory.join("report.html"), page.as_bytes())
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
