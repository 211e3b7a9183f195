//! isaac_grasp YAML: a map of named grasps with position, orientation (w first) and confidence.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::file::{GraspFile, GraspFormat, ObjectReference, Poses, ReadOptions, create};
use crate::error::GraspError;
use crate::frame::HandFrame;
use crate::grasp::pose_of_quaternion;

/// Joint that carries the opening of the Panda hand, half of it.
const FINGER_JOINT: &str = "panda_finger_joint1";

#[derive(Serialize, Deserialize)]
struct Content {
    format: String,
    #[serde(default = "version")]
    format_version: yaml_serde::Value,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    object_file: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    object_scale: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    gripper_file: Option<String>,
    grasps: BTreeMap<String, Entry>,
}

fn version() -> yaml_serde::Value {
    yaml_serde::Value::String("1.0".into())
}

#[derive(Serialize, Deserialize)]
struct Entry {
    #[serde(default)]
    confidence: Option<f64>,
    position: [f64; 3],
    orientation: Orientation,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    cspace_position: BTreeMap<String, f64>,
}

#[derive(Serialize, Deserialize)]
struct Orientation {
    w: f64,
    xyz: [f64; 3],
}

/// Orders `grasp_2` before `grasp_10`: by the trailing number, then by name.
fn natural(name: &str) -> (u64, &str) {
    let digits = name.len() - name.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    let number = name[name.len() - digits..].parse().unwrap_or(u64::MAX);
    (number, name)
}

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<GraspFile, GraspError> {
    let text = std::fs::read_to_string(path).map_err(|e| GraspError::io(path, e))?;
    let content: Content = yaml_serde::from_str(&text).map_err(|e| {
        let place = e
            .location()
            .map_or_else(|| "file".to_owned(), |l| format!("line {}", l.line()));
        GraspError::bad(
            path,
            place,
            e.to_string(),
            "see docs/formats.md for the keys",
        )
    })?;
    if content.format != "isaac_grasp" {
        return Err(GraspError::bad(
            path,
            "format",
            format!("{:?}", content.format),
            "only isaac_grasp is known",
        ));
    }
    let mut entries: Vec<(&String, &Entry)> = content.grasps.iter().collect();
    entries.sort_by_key(|(name, _)| natural(name));
    let mut poses = Poses::new(path, options.frame.unwrap_or(HandFrame::Acronym), options);
    for (name, entry) in entries {
        let [x, y, z] = entry.orientation.xyz;
        let pose = pose_of_quaternion(entry.position, [x, y, z, entry.orientation.w]);
        let grasp = poses.push(pose, || format!("grasps.{name}"))?;
        grasp.score = entry.confidence;
        grasp.width_m = entry.cspace_position.get(FINGER_JOINT).map(|q| 2.0 * q);
    }
    let object = ObjectReference {
        mesh: content.object_file,
        scale: content.object_scale,
        ..ObjectReference::default()
    };
    Ok(poses.finish(GraspFormat::IsaacYaml, None, object))
}

pub(super) fn write(file: &GraspFile) -> Result<(), GraspError> {
    let entry = |g: &crate::Grasp| {
        let q = g.object_from_hand.rotation.coords;
        Entry {
            confidence: g.score,
            position: g.object_from_hand.translation.vector.into(),
            orientation: Orientation {
                w: q.w,
                xyz: [q.x, q.y, q.z],
            },
            cspace_position: g
                .width_m
                .map(|w| (FINGER_JOINT.to_owned(), w / 2.0))
                .into_iter()
                .collect(),
        }
    };
    let content = Content {
        format: "isaac_grasp".into(),
        format_version: version(),
        object_file: file.object.mesh.clone(),
        object_scale: file.object.scale,
        gripper_file: file.gripper.clone(),
        grasps: file
            .grasps
            .iter()
            .enumerate()
            .map(|(i, g)| (format!("grasp_{i:07}"), entry(g)))
            .collect(),
    };
    let text = yaml_serde::to_string(&content)
        .map_err(|e| GraspError::bad(&file.path, "file", e.to_string(), "this is a defect"))?;
    let mut out = create(&file.path)?;
    out.write_all(
        b"# poses: object_from_hand, ACRONYM hand frame (z approach, x closing), metres\n",
    )
    .and_then(|()| out.write_all(text.as_bytes()))
    .and_then(|()| out.flush())
    .map_err(|e| GraspError::io(&file.path, e))
}
