//! `shakedown label`: labelled grasps for new objects, laid out as ACRONYM's.

use std::fs;
use std::path::Path;

use rayon::prelude::*;
use shakedown_gripper_assets::io::acronym_h5::FlexMotions;
use shakedown_gripper_assets::io::acronym_h5_writer::{LabelledGrasps, write_labelled};
use shakedown_gripper_assets::{
    Grasp, GraspFile, GraspFormat, Gripper, ObjectReference, ReadOptions, write_grasps,
};
use shakedown_objects::Object;
use shakedown_report::table::{aligned, percent};
use shakedown_sampler::{AntipodalSettings, sample_antipodal};
use shakedown_sim::{Outcome, Protocol, Scene, run_trial};

use super::objects::obj_text;
use crate::args::{Format, Global, SourceArgs};
use crate::args_judging::LabelArgs;
use crate::failure::{Exit, Failure};
use crate::plan::{Item, Plan};
use crate::{interrupt, progress};

/// Trials between two looks at Ctrl-C.
const CHUNK: usize = 64;

pub fn run(global: &Global, args: &LabelArgs) -> Result<Exit, Failure> {
    let gripper = Gripper::load(&args.gripper)?;
    let protocol = args.protocol.load()?;
    let plan = Plan::new(&SourceArgs::default(), &args.object)?;
    let maker = Maker {
        global,
        args,
        gripper: &gripper,
        protocol: &protocol,
    };
    maker.claim()?;
    interrupt::listen();
    let bar = progress::bar(global, plan.items.len() as u64 * args.grasps_per_object);
    let mut lines = Vec::new();
    let mut unreadable = false;
    for item in &plan.items {
        bar.set_message(item.id.clone());
        match maker.label(item, &bar) {
            Ok(Some(line)) => lines.push(line),
            Ok(None) => {
                bar.finish_and_clear();
                eprintln!(
                    "interrupted: {} of {} objects are labelled; the same command goes on",
                    lines.len(),
                    plan.items.len()
                );
                return Ok(Exit::Incomplete);
            }
            Err(e) if args.object.keep_going => {
                bar.suspend(|| eprintln!("skipped: {e}"));
                unreadable = true;
            }
            Err(e) => return Err(e),
        }
    }
    bar.finish_and_clear();
    print(global, args, &lines);
    Ok(if unreadable {
        Exit::Incomplete
    } else {
        Exit::Success
    })
}

/// What became of one object.
#[derive(serde::Serialize)]
struct Line {
    object: String,
    candidates: usize,
    held: usize,
    closing_linear_median_m: Option<f64>,
    shaking_linear_median_m: Option<f64>,
    note: Option<String>,
}

struct Maker<'a> {
    global: &'a Global,
    args: &'a LabelArgs,
    gripper: &'a Gripper,
    protocol: &'a Protocol,
}

impl Maker<'_> {
    /// Makes the directory, or goes on in one that was started with the same settings.
    fn claim(&self) -> Result<(), Failure> {
        let out = &self.args.out;
        let write =
            |e: std::io::Error| Failure::input(format!("cannot write {}: {e}", out.display()));
        for name in ["grasps", "meshes"] {
            fs::create_dir_all(out.join(name)).map_err(write)?;
        }
        let settings = serde_json::json!({
            "contract": 1,
            "version": env!("CARGO_PKG_VERSION"),
            "engine": self.protocol.engine(),
            "protocol": self.protocol,
            "gripper": self.gripper.name,
            "candidates": "antipodal-v1",
            "grasps_per_object": self.args.grasps_per_object,
            "seed": self.global.seed,
        });
        let text = serde_json::to_string_pretty(&settings).expect("plain data");
        let path = out.join("labels.json");
        match fs::read_to_string(&path) {
            Ok(old) if old != text => Err(Failure::input(format!(
                "{}: belongs to labels made with other settings; choose another --out",
                path.display()
            ))),
            Ok(_) => Ok(()),
            Err(_) => fs::write(&path, text).map_err(write),
        }
    }

    /// Labels one object; `None` if the user interrupted.
    fn label(&self, item: &Item, bar: &indicatif::ProgressBar) -> Result<Option<Line>, Failure> {
        let object = item.load(&self.args.object, &ReadOptions::default())?;
        let stem = shakedown_report::replay::file_stem(&item.id);
        let path = self.args.out.join("grasps").join(format!("{stem}.h5"));
        let empty = |note: &str| Line {
            object: item.id.clone(),
            candidates: 0,
            held: 0,
            closing_linear_median_m: None,
            shaking_linear_median_m: None,
            note: Some(note.to_owned()),
        };
        if path.is_file() {
            return self.done(item, &path).map(Some);
        }
        let grasps = sample_antipodal(
            &object,
            self.gripper,
            self.args.grasps_per_object,
            self.global.seed,
            &AntipodalSettings::default(),
        );
        bar.inc(self.args.grasps_per_object - grasps.len() as u64);
        if grasps.is_empty() {
            return Ok(Some(empty(
                "no candidate fits: too big for the hand, or too enclosed",
            )));
        }
        let cache = shakedown_objects::pieces::default_cache_directory();
        let scene = Scene::new(&object, self.gripper, self.protocol, None, cache.as_deref())?;
        let mut outcomes = Vec::with_capacity(grasps.len());
        for chunk in grasps.chunks(CHUNK) {
            if interrupt::requested() {
                return Ok(None);
            }
            outcomes.par_extend(
                chunk
                    .par_iter()
                    .map(|g| run_trial(&scene, &g.object_from_hand)),
            );
            bar.inc(chunk.len() as u64);
        }
        self.write(&object, &scene, &stem, &path, &grasps, &outcomes)?;
        Ok(Some(line(item, &outcomes)))
    }

    fn write(
        &self,
        object: &Object,
        scene: &Scene,
        stem: &str,
        path: &Path,
        grasps: &[Grasp],
        outcomes: &[Outcome],
    ) -> Result<(), Failure> {
        let mesh = format!("meshes/{stem}.obj");
        let mesh_path = self.args.out.join(&mesh);
        fs::write(&mesh_path, obj_text(object.surface.mesh()))
            .map_err(|e| Failure::input(format!("cannot write {}: {e}", mesh_path.display())))?;
        let mass = object.mass.with_mass(scene.mass_kg);
        let reference = ObjectReference {
            mesh: Some(mesh),
            scale: Some(1.0),
            mass_kg: Some(scene.mass_kg),
            density_kg_m3: Some(scene.mass_kg / mass.volume_m3),
            friction: Some(object.friction.unwrap_or(self.protocol.friction)),
            volume_m3: Some(mass.volume_m3),
            com_m: Some(mass.com_m),
            inertia_kg_m2: Some(mass.inertia_kg_m2),
        };
        let each = |f: fn(&Outcome) -> Option<f64>| -> Vec<f64> {
            outcomes.iter().map(|o| f(o).unwrap_or(f64::NAN)).collect()
        };
        write_labelled(
            path,
            &LabelledGrasps {
                object: reference.clone(),
                finger_m: self.gripper.opening_max_m / 2.0,
                poses: grasps.iter().map(|g| g.object_from_hand).collect(),
                labels: outcomes.iter().map(Outcome::is_held).collect(),
                motions: FlexMotions {
                    closing_linear_m: each(|o| o.closing_linear_m),
                    closing_angular_rad: each(|o| o.closing_angular_rad),
                    shaking_linear_m: each(|o| o.slip_linear_m),
                    shaking_angular_rad: each(|o| o.slip_angular_rad),
                },
            },
        )?;
        if self.args.json {
            let labelled = grasps.iter().zip(outcomes).map(|(g, o)| Grasp {
                label: Some(o.is_held()),
                ..*g
            });
            write_grasps(&GraspFile {
                path: path.with_extension("json"),
                format: GraspFormat::GraspGenJson,
                gripper: Some(self.gripper.name.clone()),
                object: reference,
                grasps: labelled.collect(),
                reorthonormalised: 0,
            })?;
        }
        Ok(())
    }

    /// What an earlier sitting wrote.
    fn done(&self, item: &Item, path: &Path) -> Result<Line, Failure> {
        let file = shakedown_gripper_assets::read_grasps(path, &ReadOptions::default())?;
        Ok(Line {
            object: item.id.clone(),
            candidates: file.grasps.len(),
            held: file.grasps.iter().filter(|g| g.label == Some(true)).count(),
            closing_linear_median_m: None,
            shaking_linear_median_m: None,
            note: Some("labelled before".into()),
        })
    }
}

fn line(item: &Item, outcomes: &[Outcome]) -> Line {
    let held = outcomes.iter().filter(|o| o.is_held()).count();
    let median = |f: fn(&Outcome) -> Option<f64>| {
        let mut values: Vec<f64> = outcomes.iter().filter_map(f).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    Line {
        object: item.id.clone(),
        candidates: outcomes.len(),
        held,
        closing_linear_median_m: median(|o| o.closing_linear_m),
        shaking_linear_median_m: median(|o| o.slip_linear_m),
        note: (held == 0).then(|| "no stable grasp among the candidates".into()),
    }
}

fn print(global: &Global, args: &LabelArgs, lines: &[Line]) {
    if global.format == Format::Json {
        println!(
            "{}",
            serde_json::to_string_pretty(lines).expect("plain data")
        );
        return;
    }
    let mm = |x: Option<f64>| x.map_or("-".into(), |x| format!("{:.2}", 1e3 * x));
    let rows: Vec<Vec<String>> = lines
        .iter()
        .map(|l| {
            vec![
                l.object.clone(),
                l.candidates.to_string(),
                l.held.to_string(),
                percent(l.held as f64 / l.candidates.max(1) as f64),
                mm(l.closing_linear_median_m),
                mm(l.shaking_linear_median_m),
                l.note.clone().unwrap_or_default(),
            ]
        })
        .collect();
    let header = [
        "object",
        "candidates",
        "held",
        "rate",
        "closing, median mm",
        "shaking, median mm",
        "note",
    ];
    print!("{}", aligned(&header, &rows));
    println!("\nlabels: {}", args.out.join("grasps").display());
}
