//! What is on disk for good? A run writes down every portion of rows it has finished, with a
//! checksum, so that it can be killed at any instant and go on.
//!
//! The journal lies in `.journal/` inside the run directory and goes when the run is complete: a
//! run that was resumed leaves the same files as one that was not.

use std::fs::{self, File};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::store::{StoreError, io, write_whole};

/// Name inside the run directory.
pub const DIRECTORY: &str = ".journal";

/// How the run was started: what `resume` repeats.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// Words of the command line.
    pub arguments: Vec<String>,
    /// Where it was given.
    pub working_directory: PathBuf,
}

/// One finished portion of rows.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Entry {
    object: String,
    rows: u64,
    /// Where the portion ends in `trials.csv`.
    end: u64,
    /// blake3 of its bytes.
    hash: String,
}

/// The open journal of a run; holds the lock as long as it lives.
pub struct Journal {
    directory: PathBuf,
    log: File,
    end: u64,
    _lock: File,
}

/// Rows of an object that are on disk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Done {
    /// The object.
    pub object: String,
    /// Its finished rows.
    pub rows: u64,
}

fn locked(directory: &Path) -> Result<File, StoreError> {
    fs::create_dir_all(directory).map_err(io(directory))?;
    let path = directory.join("lock");
    let file = File::create(&path).map_err(io(&path))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(fs::TryLockError::WouldBlock) => Err(StoreError::Busy(directory.to_owned())),
        Err(fs::TryLockError::Error(e)) => Err(io(&path)(e)),
    }
}

/// Is there an unfinished run in `run`?
pub fn is_unfinished(run: &Path) -> bool {
    run.join(DIRECTORY).join("start.json").is_file()
}

/// How the unfinished run in `run` was started.
///
/// # Errors
/// No unfinished run, or a damaged file.
pub fn start_of(run: &Path) -> Result<Start, StoreError> {
    let path = run.join(DIRECTORY).join("start.json");
    let bytes = fs::read(&path).map_err(|_| StoreError::NothingToResume(run.to_owned()))?;
    serde_json::from_slice(&bytes).map_err(|e| StoreError::Damaged {
        path,
        what: e.to_string(),
    })
}

impl Journal {
    /// Starts afresh: rows begin at byte `header` of `trials.csv`.
    ///
    /// # Errors
    /// Another process that writes this run; a disk that cannot be written.
    pub fn create(run: &Path, start: &Start, header: u64) -> Result<Self, StoreError> {
        let directory = run.join(DIRECTORY);
        let lock = locked(&directory)?;
        let path = directory.join("rows.jsonl");
        let log = File::create(&path).map_err(io(&path))?;
        let text = serde_json::to_string_pretty(start).expect("plain data");
        write_whole(&directory.join("start.json"), text.as_bytes())?;
        Ok(Self {
            directory,
            log,
            end: header,
            _lock: lock,
        })
    }

    /// Goes on: keeps the portions whose checksums fit, cuts off the rest of `trials.csv`, and says
    /// what is done.
    ///
    /// # Errors
    /// As [`Journal::create`].
    pub fn resume(
        run: &Path,
        trials: &mut File,
        header: u64,
    ) -> Result<(Self, Vec<Done>), StoreError> {
        let directory = run.join(DIRECTORY);
        let lock = locked(&directory)?;
        let path = directory.join("rows.jsonl");
        let text = fs::read_to_string(&path).unwrap_or_default();
        let csv = run.join("trials.csv");
        let mut kept: Vec<Entry> = Vec::new();
        let mut end = header;
        for line in text.lines() {
            let Ok(entry) = serde_json::from_str::<Entry>(line) else {
                break;
            };
            if entry.end < end || !is_intact(trials, end, &entry) {
                break;
            }
            end = entry.end;
            kept.push(entry);
        }
        trials.set_len(end).map_err(io(&csv))?;
        trials.seek(SeekFrom::Start(end)).map_err(io(&csv))?;
        // The log is written anew, without the damaged tail.
        let mut log = String::new();
        let mut done: Vec<Done> = Vec::new();
        for entry in kept {
            log.push_str(&serde_json::to_string(&entry).expect("plain data"));
            log.push('\n');
            match done.last_mut() {
                Some(d) if d.object == entry.object => d.rows += entry.rows,
                _ => done.push(Done {
                    object: entry.object,
                    rows: entry.rows,
                }),
            }
        }
        write_whole(&path, log.as_bytes())?;
        let log = File::options()
            .append(true)
            .open(&path)
            .map_err(io(&path))?;
        let journal = Self {
            directory,
            log,
            end,
            _lock: lock,
        };
        Ok((journal, done))
    }

    /// Notes that `bytes` with `rows` rows of `object` are on disk.
    ///
    /// # Errors
    /// A full disk; the portion then counts as not done.
    pub fn add(&mut self, object: &str, rows: u64, bytes: &[u8]) -> Result<(), StoreError> {
        self.end += bytes.len() as u64;
        let entry = Entry {
            object: object.to_owned(),
            rows,
            end: self.end,
            hash: blake3::hash(bytes).to_hex().to_string(),
        };
        let mut line = serde_json::to_string(&entry).expect("plain data");
        line.push('\n');
        let path = self.directory.join("rows.jsonl");
        self.log
            .write_all(line.as_bytes())
            .and_then(|()| self.log.sync_data())
            .map_err(io(&path))
    }

    /// The run is complete: nothing of the journal stays.
    ///
    /// # Errors
    /// A directory that cannot be changed.
    pub fn close(self) -> Result<(), StoreError> {
        // First what makes the run count as unfinished.
        let start = self.directory.join("start.json");
        fs::remove_file(&start).map_err(io(&start))?;
        fs::remove_dir_all(&self.directory).map_err(io(&self.directory))
    }
}

fn is_intact(trials: &mut File, from: u64, entry: &Entry) -> bool {
    let mut bytes = Vec::new();
    let length = entry.end - from;
    trials
        .seek(SeekFrom::Start(from))
        .and_then(|_| trials.take(length).read_to_end(&mut bytes))
        .is_ok()
        && bytes.len() as u64 == length
        && blake3::hash(&bytes).to_hex().as_str() == entry.hash
}
