//! What the page shows beyond the summary, read from the run directory: poses and meshes for the
//! 3-D view, replays, and two small tables over all grasps.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use crate::manifest::Manifest;
use crate::replay::{Replay, file_stem};
use crate::results::ResultsError;
use crate::view::ViewMesh;

/// Grasps the view holds in all; of larger runs the first of each object.
const GRASPS_MAX: usize = 60_000;
/// Bytes of meshes and of replays that go into the page; all replays lie under `replays/`.
const MESH_BYTES_MAX: usize = 12 << 20;
const REPLAY_BYTES_MAX: usize = 4 << 20;

const CLASSES: [&str; 3] = ["optimal", "collision", "out_of_reach"];
const OUTCOMES: [&str; 6] = [
    "held",
    "slipped",
    "dropped",
    "no_contact",
    "initial_collision",
    "diverged",
];
/// Columns that are shown for a chosen grasp.
const NUMBERS: [&str; 11] = [
    "score",
    "p_hold",
    "penetration_m",
    "closing_width_m",
    "slip_linear_m",
    "slip_angular_rad",
    "closing_linear_m",
    "closing_angular_rad",
    "grip_force_n",
    "sim_s",
    "margin_g",
];
const POSE: [&str; 7] = ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"];
const UNKNOWN: u8 = 255;

/// What was collected.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Collected {
    /// The data of the 3-D view.
    pub view: Value,
    /// `held_by_class[class][0: lost, 1: held]`, where both stages ran.
    pub held_by_class: BTreeMap<String, [u64; 2]>,
    /// Ten bins of `p_hold`: cases, sum of `p_hold`, positive labels; outcomes where there are no
    /// labels.
    pub reliability: [(u64, f64, u64); 10],
    /// What the page leaves out, for the reader.
    pub notes: Vec<String>,
}

#[derive(Default)]
struct ObjectRows {
    grasp: Vec<u32>,
    pose: Vec<f32>,
    class: Vec<u8>,
    outcome: Vec<u8>,
    label: Vec<u8>,
    numbers: [Vec<f32>; NUMBERS.len()],
}

/// Reads `trials.csv`, `views/` and `replays/` of a run.
///
/// # Errors
/// A `trials.csv` that cannot be read.
pub fn collect(directory: &Path, manifest: &Manifest) -> Result<Collected, ResultsError> {
    let mut collected = Collected::default();
    let each = GRASPS_MAX / manifest.objects.len().max(1);
    let objects = rows(directory, each, &mut collected)?;
    view(directory, manifest, &objects, &mut collected);
    Ok(collected)
}

/// As [`collect`] for `directory`, with what another run of the same grasps made of each: the
/// view's objects carry `base_outcome`, and `base_replays` stand beside `replays`.
///
/// # Errors
/// A `trials.csv` that cannot be read.
pub fn collect_pair(
    directory: &Path,
    base: &Path,
    manifest: &Manifest,
) -> Result<Collected, ResultsError> {
    let mut collected = Collected::default();
    let each = GRASPS_MAX / manifest.objects.len().max(1);
    let before: BTreeMap<String, BTreeMap<u32, u8>> =
        rows(base, usize::MAX, &mut Collected::default())?
            .into_iter()
            .map(|(id, rows)| (id, rows.grasp.into_iter().zip(rows.outcome).collect()))
            .collect();
    let objects = rows(directory, each, &mut collected)?;
    view(directory, manifest, &objects, &mut collected);
    for ((id, rows), packed) in objects.iter().zip(
        collected.view["objects"]
            .as_array_mut()
            .expect("a list of objects"),
    ) {
        let known = before.get(id);
        let outcome = |g: &u32| known.and_then(|k| k.get(g)).copied().unwrap_or(UNKNOWN);
        let codes: Vec<u8> = rows.grasp.iter().map(outcome).collect();
        packed["base_outcome"] = STANDARD.encode(codes).into();
    }
    let base_replays = replays(base, &mut collected.notes);
    collected.view["base_replays"] = json!(base_replays);
    Ok(collected)
}

fn view(
    directory: &Path,
    manifest: &Manifest,
    objects: &[(String, ObjectRows)],
    collected: &mut Collected,
) {
    let mut mesh_bytes = 0;
    let mut without_mesh = 0;
    let mut list = Vec::new();
    for (id, rows) in objects {
        let path = directory
            .join("views")
            .join(format!("{}.json", file_stem(id)));
        let mesh = fs::read(path)
            .ok()
            .and_then(|bytes| serde_json::from_slice::<ViewMesh>(&bytes).ok())
            .filter(|m| {
                mesh_bytes += m.size();
                let fits = mesh_bytes <= MESH_BYTES_MAX;
                without_mesh += usize::from(!fits);
                fits
            });
        list.push(packed(id, rows, mesh.as_ref()));
    }
    if without_mesh > 0 {
        collected.notes.push(format!(
            "{without_mesh} objects are shown without their mesh, to keep this file small."
        ));
    }
    let replays = replays(directory, &mut collected.notes);
    collected.view = json!({
        "classes": CLASSES,
        "outcomes": OUTCOMES,
        "gripper": manifest.gripper,
        "objects": list,
        "replays": replays,
    });
}

fn rows(
    directory: &Path,
    each: usize,
    collected: &mut Collected,
) -> Result<Vec<(String, ObjectRows)>, ResultsError> {
    let path = directory.join("trials.csv");
    let malformed = |e: csv::Error| ResultsError::bad(&path, None, e.to_string());
    let mut reader = csv::Reader::from_path(&path).map_err(malformed)?;
    let headers = reader.headers().map_err(malformed)?.clone();
    let column = |name: &str| {
        headers
            .iter()
            .position(|h| h == name)
            .ok_or_else(|| ResultsError::bad(&path, None, format!("no column `{name}`")))
    };
    let object = column("object")?;
    let grasp = column("grasp")?;
    let [class, outcome, held, label, p_hold] =
        ["class", "outcome", "held", "label", "p_hold"].map(column);
    let (class, outcome, held, label, p_hold) = (class?, outcome?, held?, label?, p_hold?);
    let pose = POSE
        .iter()
        .map(|n| column(n))
        .collect::<Result<Vec<_>, _>>()?;
    let numbers = NUMBERS
        .iter()
        .map(|n| column(n))
        .collect::<Result<Vec<_>, _>>()?;
    let code = |names: &[&str], text: &str| {
        names
            .iter()
            .position(|n| *n == text)
            .map_or(UNKNOWN, |i| i as u8)
    };
    let mut objects: Vec<(String, ObjectRows)> = Vec::new();
    let mut left_out = 0u64;
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(malformed)? {
        if !record[class].is_empty() && !record[held].is_empty() {
            let counts = collected
                .held_by_class
                .entry(record[class].to_owned())
                .or_default();
            counts[usize::from(&record[held] == "1")] += 1;
        }
        if let Ok(p) = record[p_hold].parse::<f64>() {
            let truth = if record[label].is_empty() {
                held
            } else {
                label
            };
            let bin = &mut collected.reliability[((p * 10.0) as usize).min(9)];
            bin.0 += 1;
            bin.1 += p;
            bin.2 += u64::from(&record[truth] == "1");
        }
        let id = &record[object];
        if objects.last().is_none_or(|(last, _)| last != id) {
            objects.push((id.to_owned(), ObjectRows::default()));
        }
        let rows = &mut objects.last_mut().expect("just pushed").1;
        if rows.grasp.len() >= each {
            left_out += 1;
            continue;
        }
        let number = |i: usize| record[i].parse().unwrap_or(f32::NAN);
        rows.grasp.push(record[grasp].parse().unwrap_or(u32::MAX));
        rows.pose.extend(pose.iter().map(|i| number(*i)));
        rows.class.push(code(&CLASSES, &record[class]));
        rows.outcome.push(code(&OUTCOMES, &record[outcome]));
        rows.label.push(record[label].parse().unwrap_or(UNKNOWN));
        for (values, i) in rows.numbers.iter_mut().zip(&numbers) {
            values.push(number(*i));
        }
    }
    if left_out > 0 {
        collected.notes.push(format!(
            "The 3-D view shows the first {each} grasps of each object; {left_out} more are in \
             trials.csv."
        ));
    }
    Ok(objects)
}

fn packed(id: &str, rows: &ObjectRows, mesh: Option<&ViewMesh>) -> Value {
    let floats = |values: &[f32]| {
        STANDARD.encode(
            values
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect::<Vec<u8>>(),
        )
    };
    let grasps: Vec<u8> = rows.grasp.iter().flat_map(|g| g.to_le_bytes()).collect();
    let numbers: BTreeMap<&str, String> = NUMBERS
        .iter()
        .zip(&rows.numbers)
        .filter(|(_, values)| values.iter().any(|v| v.is_finite()))
        .map(|(name, values)| (*name, floats(values)))
        .collect();
    json!({
        "id": id,
        "mesh": mesh,
        "grasp": STANDARD.encode(grasps),
        "pose": floats(&rows.pose),
        "class": STANDARD.encode(&rows.class),
        "outcome": STANDARD.encode(&rows.outcome),
        "label": STANDARD.encode(&rows.label),
        "numbers": numbers,
    })
}

/// Replays in the order of their file names, spread over the run when not all fit.
fn replays(directory: &Path, notes: &mut Vec<String>) -> Vec<Replay> {
    let mut paths: Vec<_> = fs::read_dir(directory.join("replays"))
        .into_iter()
        .flatten()
        .filter_map(|e| Some(e.ok()?.path()))
        .collect();
    paths.sort();
    let size: usize = paths
        .iter()
        .filter_map(|p| Some(fs::metadata(p).ok()?.len() as usize))
        .sum();
    let step = size.div_ceil(REPLAY_BYTES_MAX).max(1);
    if step > 1 {
        notes.push(format!(
            "One in {step} of the {} recorded trials can be played here; all lie under replays/.",
            paths.len()
        ));
    }
    paths
        .iter()
        .step_by(step)
        .filter_map(|p| serde_json::from_slice(&fs::read(p).ok()?).ok())
        .collect()
}
