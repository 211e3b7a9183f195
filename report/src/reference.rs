//! The good grasps that came with an object: what a sampler's grasps are compared with.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};
use shakedown_metrics::distribution::{Distribution, SIZE_MAX, of_object};

use crate::replay::file_stem;
use crate::results::ResultsError;

/// Good grasps of one object, as kept under `references/`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reference {
    /// The object.
    pub object: String,
    /// Height of the tcp in the hand frame, metres: poses are compared there.
    pub tcp_z_m: f64,
    /// x, y, z (m), qx, qy, qz, qw of `object_from_hand`: little-endian f64, base64.
    pub poses: String,
}

impl Reference {
    /// Keeps as many poses as a comparison can use, evenly spread over the list.
    pub fn new(object: &str, tcp_z_m: f64, poses: &[Isometry3<f64>]) -> Self {
        let step = poses.len().div_ceil(2 * SIZE_MAX).max(1);
        let bytes: Vec<u8> = poses
            .iter()
            .step_by(step)
            .flat_map(|p| {
                let (t, q) = (p.translation.vector, p.rotation.coords);
                [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
            })
            .flat_map(f64::to_le_bytes)
            .collect();
        Self {
            object: object.to_owned(),
            tcp_z_m,
            poses: STANDARD.encode(bytes),
        }
    }

    /// The file's name under `references/`.
    pub fn file_name(&self) -> String {
        format!("{}.json", file_stem(&self.object))
    }

    /// `object_from_tcp` of each pose.
    fn at_tcp(&self) -> Vec<Isometry3<f64>> {
        let bytes = STANDARD.decode(&self.poses).unwrap_or_default();
        let numbers: Vec<f64> = bytes
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes")))
            .collect();
        numbers
            .chunks_exact(7)
            .map(|n| pose(n.try_into().expect("seven numbers"), self.tcp_z_m))
            .collect()
    }
}

fn pose(n: [f64; 7], tcp_z_m: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(n[6], n[3], n[4], n[5]));
    Isometry3::from_parts(Translation3::new(n[0], n[1], n[2]), turn)
        * Translation3::new(0.0, 0.0, tcp_z_m)
}

/// Distances of the grasps in `trials.csv` from the references of a run, by object.
///
/// # Errors
/// Files that cannot be read.
pub fn distributions(run: &Path) -> Result<BTreeMap<String, Distribution>, ResultsError> {
    let mut references: BTreeMap<String, Reference> = BTreeMap::new();
    for entry in fs::read_dir(run.join("references")).into_iter().flatten() {
        let Ok(path) = entry.map(|e| e.path()) else {
            continue;
        };
        let bytes = fs::read(&path).map_err(|source| ResultsError::Io {
            path: path.clone(),
            source,
        })?;
        let reference: Reference = serde_json::from_slice(&bytes)
            .map_err(|e| ResultsError::bad(&path, None, e.to_string()))?;
        references.insert(reference.object.clone(), reference);
    }
    if references.is_empty() {
        return Ok(BTreeMap::new());
    }
    let path = run.join("trials.csv");
    let malformed = |e: csv::Error| ResultsError::bad(&path, None, e.to_string());
    let mut reader = csv::Reader::from_path(&path).map_err(malformed)?;
    // Columns object and x_m .. qw of the contract.
    let mut drawn: BTreeMap<String, Vec<Isometry3<f64>>> = BTreeMap::new();
    for record in reader.records() {
        let record = record.map_err(malformed)?;
        if let Some(reference) = references.get(&record[0]) {
            let numbers = std::array::from_fn(|i| record[4 + i].parse().unwrap_or(0.0));
            let poses = drawn.entry(record[0].to_owned()).or_default();
            poses.push(pose(numbers, reference.tcp_z_m));
        }
    }
    Ok(references
        .into_iter()
        .filter_map(|(id, reference)| {
            Some((id.clone(), of_object(drawn.get(&id)?, &reference.at_tcp())?))
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_come_back_at_the_tcp() {
        let turn = UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3);
        let p = Isometry3::from_parts(Translation3::new(0.1, 0.2, 0.3), turn);
        let reference = Reference::new("mug", 0.1, &[p]);
        let back = reference.at_tcp();
        let expected = p * Translation3::new(0.0, 0.0, 0.1);
        assert!((back[0].to_homogeneous() - expected.to_homogeneous()).norm() < 1e-12);
        assert_eq!(
            Reference::new("mug", 0.1, &vec![p; 2000]).at_tcp().len(),
            667
        );
    }
}
