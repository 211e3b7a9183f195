//! `shakedown bench`: what each stage costs on this machine, CPU time of one thread, and what more
//! threads bring.

use std::path::Path;
use std::time::Instant;

use cpu_time::ThreadTime;
use rayon::prelude::*;
use shakedown_classifier::{HandModel, Thresholds, classify};
use shakedown_gripper_assets::{Grasp, Gripper, ReadOptions};
use shakedown_objects::{Object, SdfGrid};
use shakedown_report::table::aligned;
use shakedown_sampler::{AntipodalSettings, sample_antipodal};
use shakedown_sim::{Protocol, Scene, run_trial};

use crate::args::{BenchArgs, Format, Global, ObjectArgs, SourceArgs};
use crate::failure::{Exit, Failure};
use crate::grasps;
use crate::plan::Plan;

/// One measured stage.
struct Measured {
    name: &'static str,
    unit: &'static str,
    value: f64,
}

pub fn run(global: &Global, args: &BenchArgs) -> Result<Exit, Failure> {
    let gripper = Gripper::load("franka_panda")?;
    let protocol = args.protocol.load()?;
    let (object, grasps) = subject(global, args, &gripper)?;
    let mut results = geometry(&object, &gripper, &grasps)?;
    results.extend(physics(&object, &gripper, &protocol, &grasps)?);
    match global.format {
        Format::Json => {
            let list: Vec<serde_json::Value> = results
                .iter()
                .map(|m| serde_json::json!({"name": m.name, "unit": m.unit, "value": m.value, "extra": object.id}))
                .collect();
            println!(
                "{}",
                serde_json::to_string_pretty(&list).expect("plain data")
            );
        }
        Format::Text | Format::Md => {
            let rows: Vec<Vec<String>> = results
                .iter()
                .map(|m| vec![m.name.into(), format!("{:.1}", m.value), m.unit.into()])
                .collect();
            println!(
                "{} ({} faces), {} grasps, one thread\n",
                object.id,
                object.surface.mesh().faces().len(),
                grasps.len()
            );
            print!("{}", aligned(&["stage", "value", "unit"], &rows));
        }
    }
    Ok(Exit::Success)
}

fn subject(
    global: &Global,
    args: &BenchArgs,
    gripper: &Gripper,
) -> Result<(Object, Vec<Grasp>), Failure> {
    let is_file = Path::new(&args.object).extension().is_some();
    let mut object_args = ObjectArgs {
        mesh_root: args.mesh_root.clone(),
        ..ObjectArgs::default()
    };
    let mut source = SourceArgs::default();
    if is_file {
        source.grasps = vec![args.object.clone().into()];
    } else {
        object_args.filter = Some(format!("^{}$", regex::escape(&args.object)));
    }
    let plan = Plan::new(&source, &object_args)?;
    let item = &plan.items[0];
    let options = ReadOptions::default();
    let object = item.load(&object_args, &options)?;
    let mut grasps = match &item.grasps {
        Some(path) => shakedown_gripper_assets::read_grasps(path, &options)?.grasps,
        None => {
            let settings = AntipodalSettings::default();
            sample_antipodal(&object, gripper, args.trials, global.seed, &settings)
        }
    };
    grasps::limit(&mut grasps, Some(args.trials), global.seed, &item.id);
    if grasps.is_empty() {
        return Err(Failure::nothing("the object has no grasp to measure"));
    }
    Ok((object, grasps))
}

/// CPU seconds of `work`, repeated until at least 0.3 s have passed, per repetition.
fn cpu_s(mut work: impl FnMut()) -> f64 {
    work();
    let start = ThreadTime::now();
    let mut repeats = 0u32;
    while start.elapsed().as_secs_f64() < 0.3 {
        work();
        repeats += 1;
    }
    start.elapsed().as_secs_f64() / f64::from(repeats)
}

fn geometry(
    object: &Object,
    gripper: &Gripper,
    grasps: &[Grasp],
) -> Result<Vec<Measured>, Failure> {
    let hand = HandModel::new(gripper, gripper.opening_max_m)?;
    let thresholds = Thresholds::default();
    let mut sum = 0.0;
    let verdicts = cpu_s(|| {
        for g in grasps {
            sum += classify(&hand, &object.surface, &g.object_from_hand, &thresholds).penetration_m;
        }
    });
    // One thread for the grid too, so that its CPU time is that of this thread.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .map_err(Failure::internal)?;
    let sdf = pool.install(|| {
        cpu_s(|| sum += f64::from(SdfGrid::bake(&object.surface, 64, 0.1).values_m[0]))
    });
    let settings = AntipodalSettings::default();
    let antipodal =
        cpu_s(|| sum += sample_antipodal(object, gripper, 16, 1, &settings).len() as f64);
    // Used, so that no stage can be optimised away.
    if sum.is_nan() {
        return Err(Failure::internal("a stage returned no number"));
    }
    Ok(vec![
        Measured {
            name: "geometric verdict",
            unit: "poses per CPU-second",
            value: grasps.len() as f64 / verdicts,
        },
        Measured {
            name: "signed distance grid 64^3",
            unit: "ms",
            value: 1e3 * sdf,
        },
        Measured {
            name: "antipodal sampler",
            unit: "candidates per CPU-second",
            value: 16.0 / antipodal,
        },
    ])
}

fn physics(
    object: &Object,
    gripper: &Gripper,
    protocol: &Protocol,
    grasps: &[Grasp],
) -> Result<Vec<Measured>, Failure> {
    let cache = shakedown_objects::pieces::default_cache_directory();
    let start = ThreadTime::now();
    let scene = Scene::new(object, gripper, protocol, None, cache.as_deref())?;
    let scene_s = start.elapsed().as_secs_f64();
    let start = ThreadTime::now();
    let steps: u64 = grasps
        .iter()
        .map(|g| u64::from(run_trial(&scene, &g.object_from_hand).steps))
        .sum();
    let trials_s = start.elapsed().as_secs_f64();
    let closing_s = {
        // The same trials without a load: what is left is closing and finding contacts.
        let sets = ["shake_linear_m=0", "shake_angular_rad=0", "hold_s=0"];
        let sets: Vec<String> = sets.iter().map(|s| (*s).to_owned()).collect();
        let still = Protocol::load("acronym", &sets)?;
        let scene = Scene::new(object, gripper, &still, None, cache.as_deref())?;
        let start = ThreadTime::now();
        for g in grasps {
            run_trial(&scene, &g.object_from_hand);
        }
        start.elapsed().as_secs_f64()
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let (alone, crowd) = (wall_s(&scene, grasps, 1)?, wall_s(&scene, grasps, threads)?);
    Ok(vec![
        Measured {
            name: "scene (pieces cached or not)",
            unit: "ms",
            value: 1e3 * scene_s,
        },
        Measured {
            name: "trials",
            unit: "trials per CPU-second",
            value: grasps.len() as f64 / trials_s,
        },
        Measured {
            name: "step",
            unit: "us",
            value: 1e6 * trials_s / steps.max(1) as f64,
        },
        Measured {
            name: "closing alone, preset acronym",
            unit: "ms per trial",
            value: 1e3 * closing_s / grasps.len() as f64,
        },
        Measured {
            name: "trials on all threads",
            unit: "per second of wall time",
            value: grasps.len() as f64 / crowd,
        },
        Measured {
            name: "speed-up over one thread",
            unit: "times",
            value: alone / crowd,
        },
    ])
}

/// Wall time of all trials on so many threads, the best of three.
fn wall_s(scene: &Scene, grasps: &[Grasp], threads: usize) -> Result<f64, Failure> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(Failure::internal)?;
    let times = (0..3).map(|_| {
        let start = Instant::now();
        pool.install(|| {
            grasps.par_iter().for_each(|g| {
                run_trial(scene, &g.object_from_hand);
            });
        });
        start.elapsed().as_secs_f64()
    });
    Ok(times.fold(f64::MAX, f64::min))
}
