//! A run as one small file for a git repository: what was run, and a few bits per grasp.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::{Deserialize, Serialize};

use crate::manifest::Manifest;
use crate::results::{GraspResult, Results, ResultsError};
use crate::store::{StoreError, write_whole};

/// Where baselines lie.
pub const DIRECTORY: &str = "baselines";

/// The file of a baseline name.
pub fn path(name: &str) -> PathBuf {
    Path::new(DIRECTORY).join(format!("{name}.json"))
}

/// The baselines there are, for messages.
pub fn listing() -> String {
    let mut names: Vec<String> = fs::read_dir(DIRECTORY)
        .into_iter()
        .flatten()
        .filter_map(|e| Some(e.ok()?.path().file_stem()?.to_string_lossy().into_owned()))
        .collect();
    names.sort();
    if names.is_empty() {
        "none is saved yet: run --save-baseline NAME".to_owned()
    } else {
        names.join(", ")
    }
}

#[derive(Serialize, Deserialize)]
struct File {
    contract: u32,
    manifest: Option<Manifest>,
    geometry: bool,
    physics: bool,
    objects: BTreeMap<String, Packed>,
}

/// Grasps of one object. The arrays are base64; poses are 16-bit digests, little endian.
#[derive(Serialize, Deserialize)]
struct Packed {
    grasps: String,
    poses: String,
    flags: String,
}

/// Numbers as ranges: `0-41,43`.
fn ranges(grasps: &[GraspResult]) -> String {
    let mut parts: Vec<(u64, u64)> = Vec::new();
    for g in grasps {
        match parts.last_mut() {
            Some((_, end)) if *end + 1 == g.grasp => *end = g.grasp,
            _ => parts.push((g.grasp, g.grasp)),
        }
    }
    let text: Vec<String> = parts
        .into_iter()
        .map(|(a, b)| {
            if a == b {
                a.to_string()
            } else {
                format!("{a}-{b}")
            }
        })
        .collect();
    text.join(",")
}

fn unpack(packed: &Packed) -> Result<Vec<GraspResult>, String> {
    let poses = STANDARD
        .decode(&packed.poses)
        .map_err(|e| format!("poses: {e}"))?;
    let flags = STANDARD
        .decode(&packed.flags)
        .map_err(|e| format!("flags: {e}"))?;
    let mut numbers = Vec::with_capacity(flags.len());
    for part in packed.grasps.split(',') {
        let (a, b) = part.split_once('-').unwrap_or((part, part));
        let number = |s: &str| s.parse::<u64>().map_err(|_| format!("grasps: {part:?}"));
        let (a, b) = (number(a)?, number(b)?);
        if b < a || b - a >= flags.len() as u64 {
            return Err(format!(
                "grasps: {part:?} does not fit {} flags",
                flags.len()
            ));
        }
        numbers.extend(a..=b);
    }
    if numbers.len() != flags.len() || poses.len() != 2 * flags.len() {
        return Err(format!(
            "{} grasps, {} poses and {} flags do not fit together",
            numbers.len(),
            poses.len() / 2,
            flags.len()
        ));
    }
    Ok(numbers
        .into_iter()
        .zip(poses.chunks(2))
        .zip(flags)
        .map(|((grasp, pose), flags)| GraspResult {
            grasp,
            pose: u16::from_le_bytes([pose[0], pose[1]]),
            flags,
        })
        .collect())
}

/// Saves results under a name; returns the file.
///
/// # Errors
/// A name that is no file name, a directory that cannot be written.
pub fn save(name: &str, results: &Results) -> Result<PathBuf, StoreError> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    if name.is_empty() || name.starts_with('.') || !name.chars().all(is_plain) {
        return Err(StoreError::Name(name.to_owned()));
    }
    let path = path(name);
    let directory = Path::new(DIRECTORY);
    fs::create_dir_all(directory).map_err(|source| StoreError::Io {
        path: directory.to_owned(),
        source,
    })?;
    let objects = results
        .objects
        .iter()
        .map(|(id, grasps)| {
            let poses: Vec<u8> = grasps.iter().flat_map(|g| g.pose.to_le_bytes()).collect();
            let flags: Vec<u8> = grasps.iter().map(|g| g.flags).collect();
            let packed = Packed {
                grasps: ranges(grasps),
                poses: STANDARD.encode(poses),
                flags: STANDARD.encode(flags),
            };
            (id.clone(), packed)
        })
        .collect();
    let file = File {
        contract: 1,
        manifest: results.manifest.clone(),
        geometry: results.stages[0],
        physics: results.stages[1],
        objects,
    };
    let mut text = serde_json::to_string_pretty(&file).expect("plain data");
    text.push('\n');
    write_whole(&path, text.as_bytes())?;
    Ok(path)
}

/// Reads a baseline file.
///
/// # Errors
/// A file that is none.
pub fn read(name: &str, path: &Path) -> Result<Results, ResultsError> {
    let bytes = fs::read(path).map_err(|source| ResultsError::Io {
        path: path.to_owned(),
        source,
    })?;
    let file: File = serde_json::from_slice(&bytes)
        .map_err(|e| ResultsError::bad(path, None, format!("not a baseline: {e}")))?;
    let mut objects = BTreeMap::new();
    for (id, packed) in file.objects {
        let grasps = unpack(&packed)
            .map_err(|what| ResultsError::bad(path, Some(format!("object {id:?}")), what))?;
        objects.insert(id, grasps);
    }
    Ok(Results {
        name: name.to_owned(),
        manifest: file.manifest,
        stages: [file.geometry, file.physics],
        objects,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_from_their_ranges() {
        let grasps: Vec<GraspResult> = [0u64, 1, 2, 5, 7, 8]
            .iter()
            .map(|&grasp| GraspResult {
                grasp,
                pose: grasp as u16 * 300,
                flags: grasp as u8,
            })
            .collect();
        assert_eq!(ranges(&grasps), "0-2,5,7-8");
        let packed = Packed {
            grasps: ranges(&grasps),
            poses: STANDARD.encode(
                grasps
                    .iter()
                    .flat_map(|g| g.pose.to_le_bytes())
                    .collect::<Vec<u8>>(),
            ),
            flags: STANDARD.encode(grasps.iter().map(|g| g.flags).collect::<Vec<u8>>()),
        };
        assert_eq!(unpack(&packed).unwrap(), grasps);
        let huge = Packed {
            grasps: "0-99999999999".into(),
            ..packed
        };
        assert!(unpack(&huge).unwrap_err().contains("does not fit"));
    }
}
