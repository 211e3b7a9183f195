//! `shakedown merge` and `shakedown report`: a run directory from what lies on disk.

use std::fs;
use std::path::Path;

use shakedown_metrics::Summary;
use shakedown_metrics::summary::Throughput;
use shakedown_report::replay::{Replay, file_stem};
use shakedown_report::store::write_summary;
use shakedown_report::view::ViewMesh;
use shakedown_report::{Manifest, glb, journal, merge};

use super::run::{print, summary_of};
use crate::args::Global;
use crate::args_judging::{MergeArgs, ReportArgs};
use crate::failure::{Exit, Failure};

pub fn run(global: &Global, args: &MergeArgs) -> Result<Exit, Failure> {
    let manifest = merge::merge(&args.out, &args.shards)?;
    // What the shards cost is the sum of what they say.
    let mut total = Throughput::default();
    for shard in &args.shards {
        let cost = throughput_of(shard);
        total.trials += cost.trials;
        total.steps += cost.steps;
        total.cpu_s += cost.cpu_s;
        total.wall_s = total.wall_s.max(cost.wall_s);
    }
    if total.cpu_s > 0.0 {
        total.trials_per_cpu_s = total.trials as f64 / total.cpu_s;
    }
    let summary = summary_of(&args.out, total)?;
    write_summary(&args.out, &manifest, &summary)?;
    print(global, &manifest, &summary, &args.out);
    Ok(Exit::Success)
}

pub fn report(global: &Global, args: &ReportArgs) -> Result<Exit, Failure> {
    let directory = &args.directory;
    if journal::is_unfinished(directory) {
        return Err(Failure::input(format!(
            "{0}: the run is unfinished: shakedown resume {0}",
            directory.display()
        )));
    }
    let path = directory.join("manifest.json");
    let bytes = fs::read(&path)
        .map_err(|e| Failure::input(format!("cannot read {}: {e}", path.display())))?;
    let manifest: Manifest = serde_json::from_slice(&bytes)
        .map_err(|e| Failure::input(format!("{}: {e}", path.display())))?;
    if let (Some(path), Some(grasp)) = (&args.glb, args.grasp) {
        return animation(directory, &manifest, args.object.as_deref(), grasp, path);
    }
    let summary = summary_of(directory, throughput_of(directory))?;
    write_summary(directory, &manifest, &summary)?;
    print(global, &manifest, &summary, directory);
    Ok(Exit::Success)
}

/// Writes one recorded trial as GLB.
fn animation(
    directory: &Path,
    manifest: &Manifest,
    object: Option<&str>,
    grasp: u64,
    path: &Path,
) -> Result<Exit, Failure> {
    let object = match (object, &manifest.objects[..]) {
        (Some(id), _) => id,
        (None, [one]) => &one.id,
        (None, _) => {
            return Err(Failure::usage(
                "the run has several objects: say --object ID",
            ));
        }
    };
    let name = format!("{}_{grasp}.json", file_stem(object));
    let from = directory.join("replays").join(name);
    let read = |from: &Path, mend: &str| {
        fs::read(from)
            .map_err(|e| Failure::input(format!("cannot read {}: {e}; {mend}", from.display())))
    };
    let bad = |e: serde_json::Error| Failure::input(format!("{}: {e}", from.display()));
    let bytes = read(
        &from,
        "only trials of `run --record all` or `failures` can be replayed",
    )?;
    let replay: Replay = serde_json::from_slice(&bytes).map_err(bad)?;
    let view = directory
        .join("views")
        .join(format!("{}.json", file_stem(object)));
    let mesh: ViewMesh = serde_json::from_slice(&read(&view, "run it again")?).map_err(bad)?;
    let glb = glb::animated(&replay, &mesh, &manifest.gripper).map_err(Failure::input)?;
    fs::write(path, glb)
        .map_err(|e| Failure::input(format!("cannot write {}: {e}", path.display())))?;
    println!("{}", path.display());
    Ok(Exit::Success)
}

/// What an earlier summary says of the cost; nothing if there is none.
fn throughput_of(directory: &Path) -> Throughput {
    fs::read(directory.join("summary.json"))
        .ok()
        .and_then(|bytes| serde_json::from_slice::<Summary>(&bytes).ok())
        .map(|s| s.throughput)
        .unwrap_or_default()
}
