//! Writes the features and labels that `p_hold` is fitted on and judged by: every N-th grasp of
//! each ACRONYM file, tried under the preset `acronym`.
//!
//! `cargo run --release -p shakedown_tests --bin hold_features -- ROOT GRASPS_PER_FILE OUT.csv`
//! where ROOT holds `grasps/` and `meshes/`. A fourth word, `geometry`, leaves the trials out.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use shakedown_classifier::profile::profile;
use shakedown_classifier::{HandModel, Thresholds, classify};
use shakedown_gripper_assets::{Gripper, ReadOptions, read_grasps};
use shakedown_metrics::features::{NAMES, ObjectFacts, features};
use shakedown_objects::{Object, ObjectSpec};
use shakedown_sim::{Protocol, Scene, run_trial};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (Some((root, each, out)), geometry_only) = (match &arguments[..] {
        [root, each, out] => (Some((root, each, out)), false),
        [root, each, out, word] if word == "geometry" => (Some((root, each, out)), true),
        _ => (None, false),
    }) else {
        return Err("give ROOT GRASPS_PER_FILE OUT.csv [geometry]".into());
    };
    let each: usize = each.parse()?;
    let mut files: Vec<PathBuf> = fs::read_dir(Path::new(root).join("grasps"))?
        .filter_map(|e| Some(e.ok()?.path()))
        .filter(|p| p.extension().is_some_and(|e| e == "h5"))
        .collect();
    files.sort();
    let mut csv = std::io::BufWriter::new(fs::File::create(out)?);
    writeln!(csv, "object,grasp,label,{}", NAMES.join(","))?;
    for (i, path) in files.iter().enumerate() {
        eprintln!("{}/{} {}", i + 1, files.len(), path.display());
        for row in rows(Path::new(root), path, each, geometry_only)? {
            writeln!(csv, "{row}")?;
        }
        csv.flush()?;
    }
    Ok(())
}

fn rows(
    root: &Path,
    path: &Path,
    each: usize,
    geometry_only: bool,
) -> Result<Vec<String>, Box<dyn std::error::Error>> {
    let file = read_grasps(path, &ReadOptions::default())?;
    let id = shakedown_objects::object::stem(path);
    let reference = &file.object;
    let object = Object::load(&ObjectSpec {
        id: Some(id.clone()),
        mesh: root.join(reference.mesh.as_deref().ok_or("no mesh")?),
        scale: reference.scale,
        mass_kg: reference.mass_kg,
        density_kg_m3: reference.density_kg_m3,
        friction: reference.friction,
        ..ObjectSpec::default()
    })?;
    let gripper = Gripper::load("franka_panda")?;
    let hand = HandModel::new(&gripper, gripper.opening_max_m)?;
    let protocol = Protocol::load("acronym", &[])?;
    let cache = shakedown_objects::pieces::default_cache_directory();
    let scene = Scene::new(&object, &gripper, &protocol, None, cache.as_deref())?;
    let facts = ObjectFacts {
        mass_kg: scene.mass_kg,
        com_m: object.mass.com_m,
        extent_m: object.surface.mesh().extents().max(),
    };
    let step = (file.grasps.len() / each).max(1);
    let chosen: Vec<_> = file.grasps.iter().step_by(step).take(each).collect();
    Ok(chosen
        .par_iter()
        .map(|grasp| {
            let pose = &grasp.object_from_hand;
            let verdict = classify(&hand, &object.surface, pose, &Thresholds::default());
            let lines = profile(&hand, &object.surface, pose);
            let outcome = (!geometry_only).then(|| run_trial(&scene, pose));
            let values = features(&hand, &facts, pose, &verdict, &lines, outcome.as_ref());
            let label = grasp.label.map_or("", |l| if l { "1" } else { "0" });
            let mut row = format!("{id},{},{label}", grasp.index);
            for v in values {
                row.push(',');
                if !v.is_nan() {
                    row.push_str(&v.to_string());
                }
            }
            row
        })
        .collect())
}
