//! Pose lists as CSV: `x_m,y_m,z_m,qx,qy,qz,qw[,score][,label][,width_m][,frame]`.

use std::path::Path;

use super::file::{
    GraspFile, GraspFormat, ObjectReference, Poses, ReadOptions, create, stated_frame,
};
use crate::error::GraspError;
use crate::grasp::pose_of_quaternion;

const POSE: [&str; 7] = ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"];

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<GraspFile, GraspError> {
    let mut reader = ::csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(::csv::Trim::All)
        .from_path(path)
        .map_err(|e| csv_error(path, &e))?;
    let headers = reader.headers().map_err(|e| csv_error(path, &e))?.clone();
    let column = |name: &str| headers.iter().position(|h| h == name);
    let mut pose_columns = [0; 7];
    for (slot, name) in pose_columns.iter_mut().zip(POSE) {
        *slot = column(name).ok_or_else(|| {
            GraspError::bad(
                path,
                "line 1",
                format!("there is no column `{name}`"),
                format!("the header must name {}", POSE.join(",")),
            )
        })?;
    }
    let [score, label, width, frame] = ["score", "label", "width_m", "frame"].map(column);
    let mut poses: Option<Poses<'_>> = None;
    let mut file_frame: Option<String> = None;
    let mut record = ::csv::StringRecord::new();
    while reader
        .read_record(&mut record)
        .map_err(|e| csv_error(path, &e))?
    {
        let line = record.position().map_or(0, ::csv::Position::line);
        let number = |column: usize| -> Result<f64, GraspError> {
            let text = record.get(column).unwrap_or("");
            text.parse().map_err(|_| {
                GraspError::bad(
                    path,
                    format!("line {line}, column `{}`", &headers[column]),
                    format!("{text:?} is no number"),
                    "correct the cell",
                )
            })
        };
        let optional = |column: Option<usize>| -> Result<Option<f64>, GraspError> {
            match column {
                Some(c) if !record.get(c).unwrap_or("").is_empty() => number(c).map(Some),
                _ => Ok(None),
            }
        };
        let here = frame.and_then(|c| record.get(c)).filter(|f| !f.is_empty());
        if poses.is_none() {
            file_frame = here.map(str::to_owned);
            poses = Some(Poses::new(
                path,
                stated_frame(path, options, here)?,
                options,
            ));
        } else if here != file_frame.as_deref() {
            return Err(GraspError::bad(
                path,
                format!("line {line}"),
                format!("frame {here:?} after {file_frame:?}"),
                "all rows must speak of one frame",
            ));
        }
        let [x, y, z, qx, qy, qz, qw] = {
            let mut values = [0.0; 7];
            for (value, column) in values.iter_mut().zip(pose_columns) {
                *value = number(column)?;
            }
            values
        };
        let label = match label.and_then(|c| record.get(c)).unwrap_or("") {
            "" => None,
            "1" | "true" | "True" => Some(true),
            "0" | "false" | "False" => Some(false),
            other => {
                return Err(GraspError::bad(
                    path,
                    format!("line {line}, column `label`"),
                    format!("{other:?} is no label"),
                    "write 0 or 1, or leave it empty",
                ));
            }
        };
        let (score, width) = (optional(score)?, optional(width)?);
        let poses = poses.as_mut().expect("made above");
        let grasp = poses.push(pose_of_quaternion([x, y, z], [qx, qy, qz, qw]), || {
            format!("line {line}")
        })?;
        (grasp.score, grasp.width_m, grasp.label) = (score, width, label);
    }
    let poses = match poses {
        Some(p) => p,
        None => Poses::new(path, stated_frame(path, options, Some("acronym"))?, options),
    };
    Ok(poses.finish(GraspFormat::Csv, None, ObjectReference::default()))
}

fn csv_error(path: &Path, error: &::csv::Error) -> GraspError {
    let place = error
        .position()
        .map_or_else(|| "file".to_owned(), |p| format!("line {}", p.line()));
    GraspError::bad(
        path,
        place,
        error.to_string(),
        "write plain comma-separated text",
    )
}

pub(super) fn write(file: &GraspFile) -> Result<(), GraspError> {
    let some = |f: fn(&crate::Grasp) -> bool| file.grasps.iter().any(f);
    let has = [
        some(|g| g.score.is_some()),
        some(|g| g.label.is_some()),
        some(|g| g.width_m.is_some()),
    ];
    let io = |e: ::csv::Error| GraspError::io(&file.path, e.into());
    let mut out = ::csv::Writer::from_writer(create(&file.path)?);
    let names = ["score", "label", "width_m"];
    let extra = names
        .into_iter()
        .zip(has)
        .filter(|(_, h)| *h)
        .map(|(n, _)| n);
    out.write_record(POSE.into_iter().chain(extra).chain(["frame"]))
        .map_err(io)?;
    for g in &file.grasps {
        let t = g.object_from_hand.translation.vector;
        let q = g.object_from_hand.rotation.coords;
        let mut row: Vec<String> = [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
            .iter()
            .map(ToString::to_string)
            .collect();
        let text = |x: Option<f64>| x.map(|v| v.to_string()).unwrap_or_default();
        let label = g.label.map(|l| u8::from(l).to_string()).unwrap_or_default();
        let cells = [text(g.score), label, text(g.width_m)];
        row.extend(
            cells
                .into_iter()
                .zip(has)
                .filter(|(_, h)| *h)
                .map(|(c, _)| c),
        );
        row.push("acronym".into());
        out.write_record(&row).map_err(io)?;
    }
    out.flush().map_err(|e| GraspError::io(&file.path, e))
}
