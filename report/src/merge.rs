//! Joins the shards of a run into what the whole run would have written.

use std::fs;
use std::path::{Path, PathBuf};

use crate::journal::is_unfinished;
use crate::manifest::Manifest;
use crate::results::ResultsError;
use crate::store::{SIDE_DIRECTORIES, StoreError, io, write_whole};
use crate::trials::COLUMNS;

/// Which part of a run a shard is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Number, from 0.
    pub index: u64,
    /// Shards in all.
    pub of: u64,
}

impl Shard {
    /// Does the shard try the grasp at `position` of the object at `object`?
    pub fn has(self, object: usize, position: usize) -> bool {
        (object as u64 + position as u64) % self.of == self.index
    }
}

impl std::str::FromStr for Shard {
    type Err = String;
    /// `I/N`; or `auto` and `auto/N`, where a Slurm array or a Kubernetes indexed job says which
    /// part this process is.
    fn from_str(text: &str) -> Result<Self, String> {
        let number = |name: &str| std::env::var(name).ok()?.parse::<u64>().ok();
        let (index, of) = text.split_once('/').unwrap_or((text, ""));
        let parsed = if index == "auto" {
            let first = number("SLURM_ARRAY_TASK_MIN").unwrap_or(0);
            let index = number("SLURM_ARRAY_TASK_ID")
                .and_then(|i| i.checked_sub(first))
                .or_else(|| number("JOB_COMPLETION_INDEX"));
            let of = of.parse().ok().or_else(|| number("SLURM_ARRAY_TASK_COUNT"));
            index.zip(of)
        } else {
            index.parse().ok().zip(of.parse().ok())
        };
        let parsed = parsed.map(|(index, of)| Self { index, of });
        match parsed {
            Some(s) if s.index < s.of => Ok(s),
            _ => Err(format!(
                "{text:?} is no shard: give I/N with I from 0 to N - 1, as 0/3; or auto/N inside a \
                 job that sets SLURM_ARRAY_TASK_ID or JOB_COMPLETION_INDEX"
            )),
        }
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

struct Part {
    directory: PathBuf,
    manifest: Manifest,
    shard: Shard,
}

/// Joins `parts` into `out`: `manifest.json`, `trials.csv` and the replays. The summary is the
/// caller's, who knows the outcomes.
///
/// # Errors
/// A directory that is no shard, is unfinished, is of another run, or comes twice; a missing shard;
/// an `out` that is not empty.
pub fn merge(out: &Path, parts: &[PathBuf]) -> Result<Manifest, ResultsError> {
    let mut parts = parts
        .iter()
        .map(|p| open(p))
        .collect::<Result<Vec<_>, _>>()?;
    let whole = check(&mut parts)?;
    let store = |e: StoreError| ResultsError::Unknown(e.to_string());
    fs::create_dir_all(out).map_err(|e| store(io(out)(e)))?;
    if fs::read_dir(out)
        .map_err(|e| store(io(out)(e)))?
        .next()
        .is_some()
    {
        return Err(ResultsError::Unknown(format!(
            "{}: is not empty; choose another OUT",
            out.display()
        )));
    }
    write_whole(&out.join("trials.csv"), &joined(&parts)?).map_err(store)?;
    for side in SIDE_DIRECTORIES {
        let into = out.join(side);
        fs::create_dir_all(&into).map_err(|e| store(io(&into)(e)))?;
        for part in &parts {
            for entry in fs::read_dir(part.directory.join(side))
                .into_iter()
                .flatten()
            {
                let from = entry.map_err(|e| store(io(&into)(e)))?;
                let to = into.join(from.file_name());
                fs::copy(from.path(), &to).map_err(|e| store(io(&to)(e)))?;
            }
        }
    }
    write_whole(&out.join("manifest.json"), whole.to_text().as_bytes()).map_err(store)?;
    Ok(whole)
}

fn open(directory: &Path) -> Result<Part, ResultsError> {
    let path = directory.join("manifest.json");
    let bytes = fs::read(&path).map_err(|source| ResultsError::Io {
        path: path.clone(),
        source,
    })?;
    let manifest: Manifest = serde_json::from_slice(&bytes)
        .map_err(|e| ResultsError::bad(&path, None, e.to_string()))?;
    let shard = manifest.selection["shard"]
        .as_str()
        .and_then(|s| s.parse().ok())
        .ok_or_else(|| {
            let what = "is no shard: its run had no --shard I/N";
            ResultsError::bad(directory, None, what)
        })?;
    if is_unfinished(directory) {
        let what = format!(
            "shard {shard} is unfinished: shakedown resume {}",
            directory.display()
        );
        return Err(ResultsError::bad(directory, None, what));
    }
    Ok(Part {
        directory: directory.to_owned(),
        manifest,
        shard,
    })
}

/// All shards of one run, each once; returns the manifest of the whole.
fn check(parts: &mut [Part]) -> Result<Manifest, ResultsError> {
    parts.sort_by_key(|p| p.shard.index);
    let Some(first) = parts.first() else {
        return Err(ResultsError::Unknown(
            "give the directories of the shards".into(),
        ));
    };
    let whole = first.manifest.clone().unsharded();
    for part in parts.iter() {
        let bad = |what: String| Err(ResultsError::bad(&part.directory, None, what));
        if part.shard.of != first.shard.of {
            return bad(format!(
                "is shard {}, while {} is {}",
                part.shard,
                first.directory.display(),
                first.shard
            ));
        }
        let own = part.manifest.clone().unsharded();
        if own.run_id != whole.run_id {
            return bad(format!(
                "belongs to another run ({}, {} to {})",
                own.run_id,
                first.directory.display(),
                whole.run_id
            ));
        }
    }
    if let Some(pair) = parts.windows(2).find(|w| w[0].shard == w[1].shard) {
        return Err(ResultsError::bad(
            &pair[1].directory,
            None,
            format!(
                "shard {} comes twice, also from {}",
                pair[1].shard,
                pair[0].directory.display()
            ),
        ));
    }
    let of = first.shard.of;
    let missing: Vec<String> = (0..of)
        .filter(|i| !parts.iter().any(|p| p.shard.index == *i))
        .map(|i| format!("{i}/{of}"))
        .collect();
    if !missing.is_empty() {
        return Err(ResultsError::Unknown(format!(
            "shards are missing: {}; run them with --shard",
            missing.join(", ")
        )));
    }
    Ok(whole)
}

/// The rows of all shards in the order of the whole run.
fn joined(parts: &[Part]) -> Result<Vec<u8>, ResultsError> {
    // (object, grasp, raw line)
    let mut rows: Vec<(String, u64, Vec<u8>)> = Vec::new();
    let mut out = COLUMNS.join(",").into_bytes();
    out.push(b'\n');
    for part in parts {
        let path = part.directory.join("trials.csv");
        let bytes = fs::read(&path).map_err(|source| ResultsError::Io {
            path: path.clone(),
            source,
        })?;
        let malformed = |e: csv::Error| ResultsError::bad(&path, None, e.to_string());
        let mut reader = csv::Reader::from_reader(&bytes[..]);
        if reader
            .byte_headers()
            .map_err(malformed)?
            .iter()
            .ne(COLUMNS.map(str::as_bytes))
        {
            let what = "other columns than this version writes";
            return Err(ResultsError::bad(&path, Some("line 1".into()), what));
        }
        let mut record = csv::ByteRecord::new();
        let mut from = reader.position().byte() as usize;
        while reader.read_byte_record(&mut record).map_err(malformed)? {
            let to = reader.position().byte() as usize;
            let line = record.position().map_or(0, csv::Position::line);
            let grasp = std::str::from_utf8(&record[1])
                .ok()
                .and_then(|t| t.parse().ok())
                .ok_or_else(|| {
                    ResultsError::bad(&path, Some(format!("line {line}")), "no grasp number")
                })?;
            let object = String::from_utf8_lossy(&record[0]).into_owned();
            rows.push((object, grasp, bytes[from..to].to_vec()));
            from = to;
        }
    }
    rows.sort_by(|a, b| (&a.0, a.1).cmp(&(&b.0, b.1)));
    for (_, _, line) in rows {
        out.extend(line);
    }
    Ok(out)
}
