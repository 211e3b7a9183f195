//! ACRONYM's JSON: `object`, `object_scale`, `transforms`, `quality_flex_object_in_gripper`.

use std::io::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::file::{
    GraspFile, GraspFormat, ObjectReference, Poses, ReadOptions, check_length, create, matrix_rows,
};
use crate::error::GraspError;
use crate::frame::HandFrame;
use crate::grasp::pose_of_matrix;

#[derive(Serialize, Deserialize)]
struct Content {
    #[serde(default)]
    object: Option<String>,
    #[serde(default)]
    object_scale: Option<f64>,
    transforms: Vec<[[f64; 4]; 4]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    quality_flex_object_in_gripper: Option<Vec<i64>>,
    /// Not ACRONYM's: read and written so that scores survive a round trip.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    score: Option<Vec<Option<f64>>>,
}

/// Parses a whole JSON file; the error names line and column.
pub(super) fn parse<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T, GraspError> {
    let bytes = std::fs::read(path).map_err(|e| GraspError::io(path, e))?;
    serde_json::from_slice(&bytes).map_err(|e| {
        GraspError::bad(
            path,
            format!("line {}, column {}", e.line(), e.column()),
            e.to_string(),
            "see docs/formats.md for the keys",
        )
    })
}

/// Writes a value as JSON.
pub(super) fn save<T: Serialize>(path: &Path, value: &T) -> Result<(), GraspError> {
    let mut out = create(path)?;
    serde_json::to_writer(&mut out, value)
        .map_err(std::io::Error::from)
        .and_then(|()| out.write_all(b"\n"))
        .and_then(|()| out.flush())
        .map_err(|e| GraspError::io(path, e))
}

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<GraspFile, GraspError> {
    let content: Content = parse(path)?;
    let mut poses = Poses::new(path, options.frame.unwrap_or(HandFrame::Acronym), options);
    for (i, rows) in content.transforms.iter().enumerate() {
        poses.push(pose_of_matrix(rows), || format!("transforms[{i}]"))?;
    }
    if let Some(labels) = &content.quality_flex_object_in_gripper {
        check_length(
            path,
            "quality_flex_object_in_gripper",
            labels.len(),
            poses.grasps.len(),
        )?;
        for (grasp, label) in poses.grasps.iter_mut().zip(labels) {
            grasp.label = Some(*label != 0);
        }
    }
    if let Some(scores) = &content.score {
        check_length(path, "score", scores.len(), poses.grasps.len())?;
        for (grasp, score) in poses.grasps.iter_mut().zip(scores) {
            grasp.score = *score;
        }
    }
    let object = ObjectReference {
        mesh: content.object,
        scale: content.object_scale,
        ..ObjectReference::default()
    };
    Ok(poses.finish(GraspFormat::AcronymJson, None, object))
}

pub(super) fn write(file: &GraspFile) -> Result<(), GraspError> {
    let all = |f: fn(&crate::Grasp) -> bool| file.grasps.iter().all(f);
    let content = Content {
        object: file.object.mesh.clone(),
        object_scale: file.object.scale,
        transforms: file
            .grasps
            .iter()
            .map(|g| matrix_rows(&g.object_from_hand))
            .collect(),
        quality_flex_object_in_gripper: all(|g| g.label.is_some()).then(|| {
            file.grasps
                .iter()
                .map(|g| i64::from(g.label == Some(true)))
                .collect()
        }),
        score: (!all(|g| g.score.is_none())).then(|| file.grasps.iter().map(|g| g.score).collect()),
    };
    save(&file.path, &content)
}
