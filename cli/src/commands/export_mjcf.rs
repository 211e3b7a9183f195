//! `shakedown export-mjcf`: one trial as a MuJoCo model.

use std::fs;
use std::path::Path;

use shakedown_gripper_assets::{Grasp, Gripper};
use shakedown_sim::{Scene, mjcf};

use crate::args::{ExportMjcfArgs, Global};
use crate::failure::{Exit, Failure};
use crate::grasps;
use crate::plan::Plan;
use crate::progress;
use crate::settings::Source;

pub fn run(global: &Global, args: &ExportMjcfArgs) -> Result<Exit, Failure> {
    let gripper = Gripper::load(&args.source.gripper)?;
    let protocol = args.protocol.load()?;
    let source = Source::resolve(&args.source)?;
    let plan = Plan::new(&args.source, &args.object)?;
    let [item] = plan.items.as_slice() else {
        return Err(Failure::usage(format!(
            "export-mjcf writes trials of one object, and {} are selected; use --filter",
            plan.items.len()
        )));
    };
    let options = args.source.read_options(&gripper);
    let object = item.load(&args.object, &options)?;
    let selected = grasps::of_item(
        item,
        &object,
        &gripper,
        &source,
        &args.source,
        &options,
        global.seed,
    )?;
    let cache = shakedown_objects::pieces::default_cache_directory();
    let friction = args.object.friction;
    let scene = Scene::new(&object, &gripper, &protocol, friction, cache.as_deref())?;
    for number in &args.grasp {
        let grasp = selected.grasps.iter().find(|g| g.index == *number);
        let Some(grasp) = grasp else {
            return Err(Failure::input(format!(
                "{} has no grasp {number}; it has {}",
                item.id,
                selected.grasps.len()
            )));
        };
        let directory = if args.grasp.len() == 1 {
            args.out.clone()
        } else {
            args.out.join(number.to_string())
        };
        write(&directory, &scene, &gripper, grasp)
            .map_err(|e| Failure::input(format!("cannot write {}: {e}", directory.display())))?;
    }
    progress::note(
        global,
        &format!(
            "{} trials of {} in {}",
            args.grasp.len(),
            item.id,
            args.out.display()
        ),
    );
    Ok(Exit::Success)
}

fn write(directory: &Path, scene: &Scene, gripper: &Gripper, grasp: &Grasp) -> std::io::Result<()> {
    fs::create_dir_all(directory)?;
    let pose = &grasp.object_from_hand;
    fs::write(
        directory.join("trial.xml"),
        mjcf::model(scene, gripper, pose),
    )?;
    let trial = serde_json::to_vec(&mjcf::trial(scene, pose)).expect("plain data");
    fs::write(directory.join("trial.json"), trial)
}
