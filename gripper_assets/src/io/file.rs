//! What every grasp file comes down to, and which reader it needs.

use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use nalgebra::{Isometry3, Matrix3, Point3};

use super::{acronym_h5, acronym_json, csv, graspgen_json, isaac_yaml, npz};
use crate::error::GraspError;
use crate::frame::HandFrame;
use crate::grasp::Grasp;

/// The grasp formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum GraspFormat {
    /// ACRONYM HDF5 (read only).
    AcronymH5,
    /// ACRONYM JSON.
    AcronymJson,
    /// GraspGen JSON.
    GraspGenJson,
    /// isaac_grasp YAML.
    IsaacYaml,
    /// NumPy archive.
    Npz,
    /// Comma-separated poses.
    Csv,
}

impl GraspFormat {
    /// All formats with the names of `--grasp-format`.
    pub const NAMES: [(&'static str, Self); 6] = [
        ("acronym-h5", Self::AcronymH5),
        ("acronym-json", Self::AcronymJson),
        ("graspgen-json", Self::GraspGenJson),
        ("isaac-yaml", Self::IsaacYaml),
        ("npz", Self::Npz),
        ("csv", Self::Csv),
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        Self::NAMES
            .iter()
            .find(|(_, f)| *f == self)
            .map_or("", |(n, _)| n)
    }

    /// The format of a file: by its first bytes, then by the keys inside.
    fn detect(path: &Path) -> Result<Self, GraspError> {
        let mut head = vec![0u8; 4096];
        let mut file = fs::File::open(path).map_err(|e| GraspError::io(path, e))?;
        let mut n = 0;
        while n < head.len() {
            match file
                .read(&mut head[n..])
                .map_err(|e| GraspError::io(path, e))?
            {
                0 => break,
                k => n += k,
            }
        }
        head.truncate(n);
        if head.starts_with(b"\x89HDF\r\n\x1a\n") {
            return Ok(Self::AcronymH5);
        }
        if head.starts_with(b"PK") {
            return Ok(Self::Npz);
        }
        let text = String::from_utf8_lossy(&head);
        let start = text.trim_start_matches('\u{feff}').trim_start();
        if start.is_empty() {
            return Err(GraspError::bad(
                path,
                "file",
                "it is empty",
                "write the grasps again",
            ));
        }
        if start.starts_with('{') {
            let whole = fs::read_to_string(path).map_err(|e| GraspError::io(path, e))?;
            let is_acronym = whole.contains("\"object_scale\"")
                || whole.contains("\"quality_flex_object_in_gripper\"")
                || !whole.contains("\"grasps\"");
            return Ok(if is_acronym {
                Self::AcronymJson
            } else {
                Self::GraspGenJson
            });
        }
        if text.contains("isaac_grasp") {
            return Ok(Self::IsaacYaml);
        }
        let first = start.lines().find(|l| !l.starts_with('#')).unwrap_or("");
        if first.split(',').any(|c| c.trim() == "x_m") {
            return Ok(Self::Csv);
        }
        Err(GraspError::bad(
            path,
            "first bytes",
            "not a grasp format that is known here",
            "use ACRONYM h5/json, GraspGen json, isaac_grasp yaml, npz or csv, or say --grasp-format",
        ))
    }
}

impl FromStr for GraspFormat {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        Self::NAMES
            .iter()
            .find(|(n, _)| *n == s)
            .map(|(_, f)| *f)
            .ok_or_else(|| {
                let names: Vec<_> = Self::NAMES.iter().map(|(n, _)| *n).collect();
                format!("no grasp format {s:?}: {}", names.join(", "))
            })
    }
}

/// What a grasp file says of its object; SI units, scaled mesh frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ObjectReference {
    /// Mesh path as written in the file.
    pub mesh: Option<String>,
    /// Metres per mesh unit.
    pub scale: Option<f64>,
    /// Mass, kg.
    pub mass_kg: Option<f64>,
    /// Density, kg/m3.
    pub density_kg_m3: Option<f64>,
    /// Friction coefficient.
    pub friction: Option<f64>,
    /// Volume, m3.
    pub volume_m3: Option<f64>,
    /// Centre of mass, metres.
    pub com_m: Option<Point3<f64>>,
    /// Inertia about the centre of mass, kg m2, usual sign of off-diagonal elements.
    pub inertia_kg_m2: Option<Matrix3<f64>>,
}

/// Grasps of one object.
#[derive(Debug, Clone, PartialEq)]
pub struct GraspFile {
    /// Where they were read.
    pub path: PathBuf,
    /// In which format.
    pub format: GraspFormat,
    /// Name of the hand, if the file tells.
    pub gripper: Option<String>,
    /// Their object.
    pub object: ObjectReference,
    /// The grasps in file order.
    pub grasps: Vec<Grasp>,
    /// Rotations that had drifted and were made orthonormal again.
    pub reorthonormalised: usize,
}

/// How to read a file that leaves things open.
#[derive(Debug, Clone, Copy)]
pub struct ReadOptions {
    /// Format; recognised by content if `None`.
    pub format: Option<GraspFormat>,
    /// Frame of the poses; `None`: what the format or the file says.
    pub frame: Option<HandFrame>,
    /// Height of the tcp, metres, for poses in that frame.
    pub tcp_z_m: f64,
}

impl Default for ReadOptions {
    /// The Franka hand's tcp; nothing forced.
    fn default() -> Self {
        Self {
            format: None,
            frame: None,
            tcp_z_m: 0.1034,
        }
    }
}

/// Largest grasp file that is read, bytes: some ten million grasps.
pub const GRASP_BYTES_MAX: u64 = 1 << 30;

/// Reads a grasp file of any known format.
///
/// # Errors
/// An unreadable file, a missing or misshapen field, a rotation that is none, no grasps, or a
/// pose list without a frame; always with the place in the file.
pub fn read_grasps(path: &Path, options: &ReadOptions) -> Result<GraspFile, GraspError> {
    let size = fs::metadata(path).map_err(|e| GraspError::io(path, e))?;
    if !size.is_file() || size.len() > GRASP_BYTES_MAX {
        return Err(GraspError::bad(
            path,
            "the file",
            format!("no plain file of at most {} MiB", GRASP_BYTES_MAX >> 20),
            "split it into several files",
        ));
    }
    let format = match options.format {
        Some(f) => f,
        None => GraspFormat::detect(path)?,
    };
    let file = match format {
        GraspFormat::AcronymH5 => acronym_h5::read(path, options)?,
        GraspFormat::AcronymJson => acronym_json::read(path, options)?,
        GraspFormat::GraspGenJson => graspgen_json::read(path, options)?,
        GraspFormat::IsaacYaml => isaac_yaml::read(path, options)?,
        GraspFormat::Npz => npz::read(path, options)?,
        GraspFormat::Csv => csv::read(path, options)?,
    };
    if file.grasps.is_empty() {
        return Err(GraspError::bad(
            path,
            "grasps",
            "there are none",
            "give a file with at least one grasp",
        ));
    }
    Ok(file)
}

/// Writes grasps, poses in the ACRONYM frame, in the format of `file.format` to `file.path`.
///
/// # Errors
/// A path that cannot be written, or the format that is read only.
pub fn write_grasps(file: &GraspFile) -> Result<(), GraspError> {
    match file.format {
        GraspFormat::AcronymJson => acronym_json::write(file),
        GraspFormat::GraspGenJson => graspgen_json::write(file),
        GraspFormat::IsaacYaml => isaac_yaml::write(file),
        GraspFormat::Npz => npz::write(file),
        GraspFormat::Csv => csv::write(file),
        GraspFormat::AcronymH5 => Err(GraspError::bad(
            &file.path,
            "format",
            "ACRONYM h5 is read only here",
            "write json, yaml, npz or csv",
        )),
    }
}

/// Collects poses while a reader runs: turns frames, counts drift, names the grasp in errors.
pub(super) struct Poses<'a> {
    path: &'a Path,
    frame: HandFrame,
    tcp_z_m: f64,
    pub(super) grasps: Vec<Grasp>,
    pub(super) reorthonormalised: usize,
}

impl<'a> Poses<'a> {
    pub(super) fn new(path: &'a Path, frame: HandFrame, options: &ReadOptions) -> Self {
        Self {
            path,
            frame,
            tcp_z_m: options.tcp_z_m,
            grasps: Vec::new(),
            reorthonormalised: 0,
        }
    }

    /// Adds a pose in the frame of the file; `place` names it in an error.
    pub(super) fn push(
        &mut self,
        pose: Result<(Isometry3<f64>, bool), String>,
        place: impl FnOnce() -> String,
    ) -> Result<&mut Grasp, GraspError> {
        let (pose, drifted) = pose.map_err(|what| {
            GraspError::bad(self.path, place(), what, "give a rigid motion in metres")
        })?;
        self.reorthonormalised += usize::from(drifted);
        let index = self.grasps.len() as u64;
        let pose = match self.frame {
            HandFrame::Acronym => pose,
            frame => frame.to_hand(&pose, self.tcp_z_m),
        };
        self.grasps.push(Grasp::new(index, pose));
        Ok(self.grasps.last_mut().expect("just pushed"))
    }

    pub(super) fn finish(
        self,
        format: GraspFormat,
        gripper: Option<String>,
        object: ObjectReference,
    ) -> GraspFile {
        GraspFile {
            path: self.path.to_owned(),
            format,
            gripper,
            object,
            grasps: self.grasps,
            reorthonormalised: self.reorthonormalised,
        }
    }
}

/// The frame of a pose list: what is asked for, else what the file says, else an error.
pub(super) fn stated_frame(
    path: &Path,
    options: &ReadOptions,
    in_file: Option<&str>,
) -> Result<HandFrame, GraspError> {
    if let Some(frame) = options.frame {
        return Ok(frame);
    }
    let Some(name) = in_file else {
        return Err(GraspError::bad(
            path,
            "frame",
            "the file does not say which frame its poses are of",
            "give --frame acronym|panda_hand|tcp",
        ));
    };
    name.parse()
        .map_err(|e: String| GraspError::bad(path, "frame", e, "correct the field or give --frame"))
}

/// The 4 x 4 rows of a pose.
pub(super) fn matrix_rows(pose: &Isometry3<f64>) -> [[f64; 4]; 4] {
    let m = pose.to_homogeneous();
    std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)]))
}

/// Checks that an optional column has one entry per grasp.
pub(super) fn check_length(
    path: &Path,
    key: &str,
    found: usize,
    grasps: usize,
) -> Result<(), GraspError> {
    if found == grasps {
        return Ok(());
    }
    Err(GraspError::bad(
        path,
        key,
        format!("{found} entries for {grasps} grasps"),
        "give one entry per grasp or leave the field out",
    ))
}

/// Creates the file and its directory for writing.
pub(super) fn create(path: &Path) -> Result<std::io::BufWriter<fs::File>, GraspError> {
    if let Some(parent) = path.parent().filter(|p| !p.as_os_str().is_empty()) {
        fs::create_dir_all(parent).map_err(|e| GraspError::io(parent, e))?;
    }
    fs::File::create(path)
        .map(std::io::BufWriter::new)
        .map_err(|e| GraspError::io(path, e))
}
