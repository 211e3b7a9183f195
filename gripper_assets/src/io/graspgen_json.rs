//! GraspGen's JSON: `object.{file, scale}`, `grasps.{transforms, object_in_gripper}`.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::acronym_json::{parse, save};
use super::file::{
    GraspFile, GraspFormat, ObjectReference, Poses, ReadOptions, check_length, matrix_rows,
};
use crate::error::GraspError;
use crate::frame::HandFrame;
use crate::grasp::pose_of_matrix;

#[derive(Serialize, Deserialize)]
struct Content {
    object: Object,
    grasps: Grasps,
}

#[derive(Serialize, Deserialize)]
struct Object {
    #[serde(default)]
    file: Option<String>,
    #[serde(default)]
    scale: Option<f64>,
}

#[derive(Serialize, Deserialize)]
struct Grasps {
    transforms: Vec<[[f64; 4]; 4]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    object_in_gripper: Option<Vec<bool>>,
    /// Not GraspGen's: read and written so that scores survive a round trip.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    score: Option<Vec<Option<f64>>>,
}

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<GraspFile, GraspError> {
    let content: Content = parse(path)?;
    // Poses are of the gripper's base link, with the Panda's axes as in ACRONYM.
    let mut poses = Poses::new(path, options.frame.unwrap_or(HandFrame::Acronym), options);
    for (i, rows) in content.grasps.transforms.iter().enumerate() {
        poses.push(pose_of_matrix(rows), || format!("grasps.transforms[{i}]"))?;
    }
    if let Some(labels) = &content.grasps.object_in_gripper {
        check_length(
            path,
            "grasps.object_in_gripper",
            labels.len(),
            poses.grasps.len(),
        )?;
        for (grasp, label) in poses.grasps.iter_mut().zip(labels) {
            grasp.label = Some(*label);
        }
    }
    if let Some(scores) = &content.grasps.score {
        check_length(path, "grasps.score", scores.len(), poses.grasps.len())?;
        for (grasp, score) in poses.grasps.iter_mut().zip(scores) {
            grasp.score = *score;
        }
    }
    let object = ObjectReference {
        mesh: content.object.file,
        scale: content.object.scale,
        ..ObjectReference::default()
    };
    Ok(poses.finish(GraspFormat::GraspGenJson, None, object))
}

pub(super) fn write(file: &GraspFile) -> Result<(), GraspError> {
    let all = |f: fn(&crate::Grasp) -> bool| file.grasps.iter().all(f);
    let content = Content {
        object: Object {
            file: file.object.mesh.clone(),
            scale: file.object.scale,
        },
        grasps: Grasps {
            transforms: file
                .grasps
                .iter()
                .map(|g| matrix_rows(&g.object_from_hand))
                .collect(),
            object_in_gripper: all(|g| g.label.is_some())
                .then(|| file.grasps.iter().map(|g| g.label == Some(true)).collect()),
            score: (!all(|g| g.score.is_none()))
                .then(|| file.grasps.iter().map(|g| g.score).collect()),
        },
    };
    save(&file.path, &content)
}
