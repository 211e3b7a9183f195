//! Tries the grasps of a plan, object by object, and keeps the rows.

use std::collections::BTreeMap;
use std::sync::Mutex;

use shakedown_gripper_assets::{Grasp, ReadOptions};
use shakedown_report::journal::Done;
use shakedown_report::reference::Reference;
use shakedown_report::{Manifest, Store};

use crate::args::{Global, RunArgs};
use crate::failure::{Exit, Failure};
use crate::plan::{Item, Material, Plan};
use crate::settings::{Settings, Source};
use crate::work::{Bench, Cost};
use crate::{grasps, interrupt, progress};

/// Rows per write: so many are lost at most when the process is killed.
const TRIALS_PER_WRITE: usize = 64;
const CLASSES_PER_WRITE: usize = 4096;

/// Everything that does not change during a run.
pub struct Job<'a> {
    pub global: &'a Global,
    pub args: &'a RunArgs,
    pub settings: &'a Settings,
    pub source: &'a Source,
    pub options: &'a ReadOptions,
}

/// An object with the grasps that this process tries, ready to run.
pub struct Prepared {
    bench: Bench,
    grasps: Vec<Grasp>,
    reference: Option<Reference>,
}

/// How far a run came.
pub struct Progress {
    /// Rows in all, with those of earlier sittings.
    pub rows: u64,
    /// Was it stopped before the end?
    pub interrupted: bool,
}

impl Job<'_> {
    /// Describes every object; under `--keep-going` those that cannot be read leave the plan.
    pub fn manifest(
        &self,
        plan: &mut Plan,
        unreadable: &mut Vec<Failure>,
    ) -> Result<Manifest, Failure> {
        let mut described = Vec::new();
        let mut readable = Vec::new();
        for item in plan.items.drain(..) {
            match item.describe(&self.args.object, self.options) {
                Ok(d) => {
                    described.push(d);
                    readable.push(item);
                }
                Err(e) if self.args.object.keep_going => unreadable.push(e),
                Err(e) => return Err(e),
            }
        }
        plan.items = readable;
        let value = |v: toml::Value| serde_json::to_value(v).expect("TOML is plain data");
        let constants: serde_json::Map<String, serde_json::Value> = self
            .settings
            .protocol
            .constants()
            .into_iter()
            .map(|(k, v)| (k, value(v)))
            .collect();
        let stages: Vec<&str> = [
            (self.settings.geometry, "geometry"),
            (self.settings.physics, "physics"),
        ]
        .into_iter()
        .filter(|(on, _)| *on)
        .map(|(_, name)| name)
        .collect();
        Ok(Manifest {
            contract: 1,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            engine: self.settings.protocol.engine().to_owned(),
            run_id: String::new(),
            protocol: constants.into(),
            classifier: serde_json::json!(self.settings.thresholds),
            gripper: serde_json::json!(self.settings.gripper),
            grasps: self.source.describe(&self.args.source),
            selection: serde_json::json!({
                "limit": self.args.limit,
                "filter": self.args.object.filter,
                "stages": stages,
                "shard": self.args.shard.map(|s| s.to_string()),
            }),
            seed: self.global.seed,
            objects: described,
            command: command(&self.args.words),
            platform: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        }
        .sealed())
    }

    /// Loads item number `index` of the plan and draws or reads its grasps.
    ///
    /// # Errors
    /// Whatever is wrong with mesh, grasp file or model.
    pub fn prepare(&self, index: usize, item: &Item) -> Result<Prepared, Failure> {
        let object = item.load(&self.args.object, self.options)?;
        for mend in object.report.mends() {
            progress::note(self.global, &format!("{}: {mend}", item.id));
        }
        let seed = self.global.seed;
        let gripper = &self.settings.gripper;
        let selected = grasps::of_item(
            item,
            &object,
            gripper,
            self.source,
            &self.args.source,
            self.options,
            seed,
        )?;
        if selected.reorthonormalised > 0 {
            let n = selected.reorthonormalised;
            progress::note(
                self.global,
                &format!("{}: {n} rotations had drifted and were mended", item.id),
            );
        }
        let mut grasps = selected.grasps;
        if item.grasps.is_none() && (grasps.len() as u64) < self.args.source.candidates {
            let text = format!(
                "{}: {} of {} candidates found a free pose; is the object too big for the hand?",
                item.id,
                grasps.len(),
                self.args.source.candidates
            );
            progress::note(self.global, &text);
        }
        grasps::limit(&mut grasps, self.args.limit, seed, &item.id);
        if let Some(shard) = self.args.shard {
            let mut position = 0..;
            grasps.retain(|_| shard.has(index, position.next().expect("endless")));
        }
        let bench = Bench::new(object, self.settings)?;
        Ok(Prepared {
            bench,
            grasps,
            reference: self.reference(item)?,
        })
    }

    /// The successful grasps of an ACRONYM file whose object gets new ones from a sampler.
    fn reference(&self, item: &Item) -> Result<Option<Reference>, Failure> {
        let (Material::GraspFile(path), None) = (&item.material, &item.grasps) else {
            return Ok(None);
        };
        let file = shakedown_gripper_assets::read_grasps(path, self.options)?;
        let good: Vec<_> = file
            .grasps
            .iter()
            .filter(|g| g.label == Some(true))
            .map(|g| g.object_from_hand)
            .collect();
        let tcp_z_m = self.settings.gripper.tcp_z_m;
        Ok((!good.is_empty()).then(|| Reference::new(&item.id, tcp_z_m, &good)))
    }

    /// Runs object after object in the order of their ids; the next one is prepared meanwhile.
    /// Rows that are `done` already are skipped.
    ///
    /// # Errors
    /// Unreadable input, a disk that cannot be written; what was finished stays.
    pub fn execute(
        &self,
        plan: &Plan,
        first: Option<Result<Prepared, Failure>>,
        done: &[Done],
        store: &mut Store,
        cost: &Mutex<Cost>,
        unreadable: &mut Vec<Failure>,
    ) -> Result<Progress, Failure> {
        let per_object = |item: &Item| match (&item.grasps, self.args.limit) {
            (_, Some(limit)) => limit,
            (Some(_), None) => 0,
            (None, None) => self.args.source.candidates,
        };
        let done: BTreeMap<&str, u64> = done.iter().map(|d| (d.object.as_str(), d.rows)).collect();
        let shards = self.args.shard.map_or(1, |s| s.of);
        let total: u64 = plan.items.iter().map(per_object).sum();
        let bar = progress::bar(self.global, total / shards);
        let mut progress = Progress {
            rows: 0,
            interrupted: false,
        };
        let mut next = first;
        for (i, item) in plan.items.iter().enumerate() {
            let following = plan.items.get(i + 1);
            let prepared = match next.take().expect("one is prepared ahead") {
                Ok(p) => p,
                Err(e) if self.args.object.keep_going => {
                    unreadable.push(e);
                    next = following.map(|f| self.prepare(i + 1, f));
                    continue;
                }
                Err(e) => {
                    bar.finish_and_clear();
                    return Err(e);
                }
            };
            bar.set_message(item.id.clone());
            if per_object(item) == 0 {
                bar.inc_length(prepared.grasps.len() as u64);
            }
            let skip = done.get(item.id.as_str()).copied().unwrap_or(0);
            bar.inc(skip);
            let (rows, prepared_next) = rayon::join(
                || self.try_all(&prepared, skip as usize, store, cost, &bar),
                || following.map(|f| self.prepare(i + 1, f)),
            );
            next = prepared_next;
            progress.rows += rows?;
            if interrupt::requested() {
                progress.interrupted = true;
                break;
            }
        }
        bar.finish_and_clear();
        Ok(progress)
    }

    /// Tries the grasps after the first `skip`; returns how many of the object are on disk.
    fn try_all(
        &self,
        prepared: &Prepared,
        skip: usize,
        store: &mut Store,
        cost: &Mutex<Cost>,
        bar: &indicatif::ProgressBar,
    ) -> Result<u64, Failure> {
        let chunk = if self.settings.physics {
            TRIALS_PER_WRITE
        } else {
            CLASSES_PER_WRITE
        };
        store.add_view(&prepared.bench.view())?;
        if let Some(reference) = &prepared.reference {
            store.add_reference(reference)?;
        }
        let mut on_disk = skip.min(prepared.grasps.len());
        for grasps in prepared.grasps[on_disk..].chunks(chunk) {
            let rows = prepared
                .bench
                .rows(self.settings, grasps, self.args.record, cost, || bar.inc(1));
            // After an interrupt only the trials that were already running come back.
            let rows: Vec<_> = rows.into_iter().map_while(|r| r).collect();
            let mut cells = Vec::with_capacity(rows.len());
            for (cell, replay) in rows {
                cells.push(cell);
                if let Some(r) = replay {
                    let bytes = serde_json::to_vec(&r).expect("a replay is plain data");
                    store.add_replay(&r.file_name(), &bytes)?;
                }
            }
            store.append(&prepared.bench.object.id, &cells)?;
            on_disk += cells.len();
            if interrupt::requested() {
                break;
            }
        }
        Ok(on_disk as u64)
    }

    /// Prints the plan.
    ///
    /// # Errors
    /// An unreadable grasp file.
    pub fn dry_run(&self, plan: &Plan, manifest: &Manifest) -> Result<Exit, Failure> {
        let mut total = 0;
        for item in &plan.items {
            let n = match &item.grasps {
                Some(path) => {
                    let file = shakedown_gripper_assets::read_grasps(path, self.options)?;
                    (file.grasps.len() as u64).min(self.args.limit.unwrap_or(u64::MAX))
                }
                None => self
                    .args
                    .source
                    .candidates
                    .min(self.args.limit.unwrap_or(u64::MAX)),
            };
            println!("{} {n}", item.id);
            total += n;
        }
        println!(
            "run {}: {} objects, {total} grasps",
            manifest.run_id,
            plan.items.len()
        );
        Ok(Exit::Success)
    }
}

/// The words of the command that matter for its results: not where they go, by how many threads,
/// in which shard, or how they are printed.
fn command(words: &[String]) -> Vec<String> {
    const WITH_VALUE: [&str; 6] = [
        "--out",
        "--shard",
        "--threads",
        "--format",
        "--color",
        "--save-baseline",
    ];
    let mut kept = vec!["shakedown".to_owned()];
    let mut words = words.iter();
    while let Some(word) = words.next() {
        if WITH_VALUE.contains(&word.as_str()) {
            words.next();
        } else if !["--quiet", "-q"].contains(&word.as_str())
            && !WITH_VALUE
                .iter()
                .any(|w| word.starts_with(&format!("{w}=")))
        {
            kept.push(word.clone());
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_recorded_command_says_what_was_run_not_where() {
        let words = [
            "run",
            "--shard",
            "0/3",
            "--set",
            "friction=1",
            "--out=x",
            "-q",
            "--threads",
            "2",
        ];
        let words: Vec<String> = words.map(str::to_owned).into();
        assert_eq!(command(&words), ["shakedown", "run", "--set", "friction=1"]);
    }
}
