//! What did a run find? Read back from a run directory, a `trials.csv`, or a baseline.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use shakedown_metrics::compare::{Tried, Tries};

use crate::baseline;
use crate::manifest::Manifest;

/// Why results cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ResultsError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It holds something else.
    #[error("{}{}: {what}", path.display(), place.as_ref().map(|p| format!(", {p}")).unwrap_or_default())]
    Bad {
        /// The file.
        path: PathBuf,
        /// Line or key.
        place: Option<String>,
        /// What is wrong and how to mend it.
        what: String,
    },
    /// There is no such run.
    #[error("{0}")]
    Unknown(String),
}

impl ResultsError {
    pub(crate) fn bad(path: &Path, place: Option<String>, what: impl Into<String>) -> Self {
        Self::Bad {
            path: path.to_owned(),
            place,
            what: what.into(),
        }
    }
}

/// What counts as a success in a comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Metric {
    /// The trial held.
    Held,
    /// Geometry: neither collision nor out of reach.
    Optimal,
    /// Optimal, and closes, centred and aligned.
    OptimalStrict,
    /// Geometry: not in collision.
    CollisionFree,
    /// Geometry: not out of reach.
    Graspable,
}

impl Metric {
    /// All, in the order of their bits.
    pub const ALL: [Self; 5] = [
        Self::Held,
        Self::Optimal,
        Self::OptimalStrict,
        Self::CollisionFree,
        Self::Graspable,
    ];

    /// Name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Optimal => "optimal",
            Self::OptimalStrict => "optimal_strict",
            Self::CollisionFree => "collision_free",
            Self::Graspable => "graspable",
        }
    }

    fn bit(self) -> u8 {
        1 << self as u8
    }
}

/// The results of one grasp; a few bytes, as a run may have millions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GraspResult {
    /// Number within the object.
    pub grasp: u64,
    /// 16 bits of the digest of its pose.
    pub pose: u16,
    pub(crate) flags: u8,
}

/// The results of a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Results {
    /// Where they were read, as the user named it.
    pub name: String,
    /// What was run; `None` for a bare `trials.csv`.
    pub manifest: Option<Manifest>,
    /// Was geometry judged, and were trials run?
    pub stages: [bool; 2],
    /// Results by object, sorted by grasp.
    pub objects: BTreeMap<String, Vec<GraspResult>>,
}

impl Results {
    /// Opens a run directory, a `trials.csv`, a baseline file, or a baseline by name.
    ///
    /// # Errors
    /// Nothing of that name, a missing column, a cell that is no number.
    pub fn open(name: &str) -> Result<Self, ResultsError> {
        let path = Path::new(name);
        if path.is_dir() {
            let manifest_path = path.join("manifest.json");
            let manifest = if manifest_path.is_file() {
                Some(read_manifest(&manifest_path)?)
            } else {
                None
            };
            return Self::read_csv(name, &path.join("trials.csv"), manifest);
        }
        if path.is_file() {
            if path.extension().is_some_and(|e| e == "json") {
                return baseline::read(name, path);
            }
            let beside = path.with_file_name("manifest.json");
            let manifest = if beside.is_file() {
                Some(read_manifest(&beside)?)
            } else {
                None
            };
            return Self::read_csv(name, path, manifest);
        }
        let stored = baseline::path(name);
        if stored.is_file() {
            return baseline::read(name, &stored);
        }
        Err(ResultsError::Unknown(format!(
            "there is no run {name:?}: give a run directory, a trials.csv, or a baseline ({})",
            baseline::listing()
        )))
    }

    fn read_csv(name: &str, path: &Path, manifest: Option<Manifest>) -> Result<Self, ResultsError> {
        let file = fs::File::open(path).map_err(|source| ResultsError::Io {
            path: path.to_owned(),
            source,
        })?;
        let mut reader = csv::ReaderBuilder::new()
            .buffer_capacity(1 << 20)
            .from_reader(file);
        let malformed = |e: csv::Error| ResultsError::bad(path, None, e.to_string());
        let headers = reader.byte_headers().map_err(malformed)?.clone();
        let column = |name: &str| headers.iter().position(|h| h == name.as_bytes());
        let needed = |name: &str| {
            column(name).ok_or_else(|| {
                let what = format!("there is no column `{name}`; is this the trials.csv of a run?");
                ResultsError::bad(path, Some("line 1".into()), what)
            })
        };
        let columns = Columns {
            object: needed("object")?,
            grasp: needed("grasp")?,
            pose: ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"].map(column),
            held: column("held"),
            class: column("class"),
            flags: ["collides", "reachable", "closes", "centred", "aligned"].map(column),
        };
        let mut results = Self {
            name: name.to_owned(),
            manifest,
            ..Self::default()
        };
        let mut record = csv::ByteRecord::new();
        while reader.read_byte_record(&mut record).map_err(malformed)? {
            columns.take(&record, &mut results).map_err(|what| {
                let line = record.position().map_or(0, csv::Position::line);
                ResultsError::bad(path, Some(format!("line {line}")), what)
            })?;
        }
        for grasps in results.objects.values_mut() {
            grasps.sort_by_key(|g| g.grasp);
            if let Some(pair) = grasps.windows(2).find(|w| w[0].grasp == w[1].grasp) {
                let what = format!("grasp {} of an object stands there twice", pair[0].grasp);
                return Err(ResultsError::bad(path, None, what));
            }
        }
        if results.objects.is_empty() {
            return Err(ResultsError::bad(path, None, "there is no row in it"));
        }
        Ok(results)
    }

    /// The run's grasps with their success by `metric`; `None` if that was not measured.
    pub fn tries(&self, metric: Metric) -> Option<Tries> {
        if !self.stages[usize::from(metric == Metric::Held)] {
            return None;
        }
        let one = |g: &GraspResult| Tried {
            grasp: g.grasp,
            pose: g.pose,
            success: g.flags & metric.bit() != 0,
        };
        Some(
            self.objects
                .iter()
                .map(|(id, grasps)| (id.clone(), grasps.iter().map(one).collect()))
                .collect(),
        )
    }
}

fn read_manifest(path: &Path) -> Result<Manifest, ResultsError> {
    let bytes = fs::read(path).map_err(|source| ResultsError::Io {
        path: path.to_owned(),
        source,
    })?;
    serde_json::from_slice(&bytes).map_err(|e| ResultsError::bad(path, None, e.to_string()))
}

struct Columns {
    object: usize,
    grasp: usize,
    pose: [Option<usize>; 7],
    held: Option<usize>,
    class: Option<usize>,
    flags: [Option<usize>; 5],
}

impl Columns {
    fn take(&self, record: &csv::ByteRecord, results: &mut Results) -> Result<(), String> {
        let text = |i: usize| std::str::from_utf8(&record[i]).map_err(|e| e.to_string());
        let object = text(self.object)?;
        let grasp = text(self.grasp)?;
        let grasp = grasp
            .parse()
            .map_err(|_| format!("grasp {grasp:?} is not a whole number"))?;
        let flag = |column: Option<usize>, name: &str| match column.map(|c| &record[c]) {
            None | Some(b"") => Ok(None),
            Some(b"1") => Ok(Some(true)),
            Some(b"0") => Ok(Some(false)),
            Some(other) => Err(format!(
                "{name} is {:?}, neither 0 nor 1",
                String::from_utf8_lossy(other)
            )),
        };
        let mut flags = 0;
        let mut set = |metric: Metric, on: bool| {
            if on {
                flags |= metric.bit();
            }
        };
        if let Some(held) = flag(self.held, "held")? {
            results.stages[1] = true;
            set(Metric::Held, held);
        }
        let optimal = match self.class.map(|c| &record[c]) {
            None | Some(b"") => None,
            Some(class) => Some(class == b"optimal"),
        };
        if let Some(optimal) = optimal {
            results.stages[0] = true;
            let names = ["collides", "reachable", "closes", "centred", "aligned"];
            let mut on = [false; 5];
            for ((on, column), name) in on.iter_mut().zip(self.flags).zip(names) {
                *on = flag(column, name)?.unwrap_or(false);
            }
            let [collides, reachable, closes, centred, aligned] = on;
            set(Metric::Optimal, optimal);
            set(
                Metric::OptimalStrict,
                optimal && closes && centred && aligned,
            );
            set(Metric::CollisionFree, !collides);
            set(Metric::Graspable, reachable);
        }
        let mut hasher = blake3::Hasher::new();
        for i in self.pose.iter().flatten() {
            hasher.update(&record[*i]);
            hasher.update(b",");
        }
        let digest = hasher.finalize();
        let row = GraspResult {
            grasp,
            pose: u16::from_le_bytes([digest.as_bytes()[0], digest.as_bytes()[1]]),
            flags,
        };
        match results.objects.get_mut(object) {
            Some(rows) => rows.push(row),
            None => {
                results.objects.insert(object.to_owned(), vec![row]);
            }
        }
        Ok(())
    }
}
