//! `shakedown run`: the main job.

use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Instant;

use shakedown_gripper_assets::{Grasp, ReadOptions};
use shakedown_metrics::Row;
use shakedown_metrics::summary::{Throughput, summarise};
use shakedown_report::results::Results;
use shakedown_report::{Manifest, Store, baseline, markdown};
use shakedown_sim::Label;

use crate::args::{Format, Global, RunArgs};
use crate::failure::{Exit, Failure};
use crate::grasps;
use crate::plan::{Item, Plan};
use crate::progress;
use crate::settings::{Settings, Source};
use crate::work::{Bench, Cost};

/// Grasps per write: rows are on disk at least this often.
const CHUNK: usize = 4096;

pub fn run(global: &Global, args: &RunArgs) -> Result<Exit, Failure> {
    let started = Instant::now();
    let settings = Settings::resolve(args)?;
    let source = Source::resolve(&args.source)?;
    let mut plan = Plan::new(&args.source, &args.object)?;
    let options = args.source.read_options(&settings.gripper);
    let job = Job {
        global,
        args,
        settings: &settings,
        source: &source,
        options: &options,
    };
    let mut unreadable = Vec::new();
    let manifest = job.manifest(&mut plan, &mut unreadable)?;
    if args.dry_run {
        return job.dry_run(&plan, &manifest);
    }
    // The first object is made before anything is written: a misspelt file leaves no directory.
    let first = match plan.items.first().map(|item| job.prepare(item)) {
        Some(Err(e)) if !args.object.keep_going => return Err(e),
        first => first,
    };
    let out = args.out.clone().unwrap_or_else(|| default_out(&manifest));
    let mut store = Store::create(&out, manifest.clone())?;
    let cost = Mutex::new(Cost::default());
    let objects = job.execute(&plan, first, &mut store, &cost, &mut unreadable)?;
    let cost = *cost.lock().expect("all workers are done");
    if objects.iter().all(|(_, rows)| rows.is_empty()) {
        return Err(Failure::nothing(
            "no grasp was selected; look at --limit, --candidates and the grasp files",
        ));
    }
    let throughput = Throughput {
        trials: cost.trials,
        steps: cost.steps,
        cpu_s: cost.cpu_s,
        wall_s: started.elapsed().as_secs_f64(),
        trials_per_cpu_s: if cost.cpu_s > 0.0 {
            cost.trials as f64 / cost.cpu_s
        } else {
            0.0
        },
    };
    let names: Vec<&str> = Label::ALL.iter().map(|l| l.name()).collect();
    let summary = summarise(&objects, &names, throughput);
    let directory = store.directory().to_owned();
    store.finish(&summary)?;
    if let Some(name) = &args.save_baseline {
        let results = Results::open(&directory.display().to_string())?;
        let path = baseline::save(name, &results)?;
        progress::note(global, &format!("baseline: {}", path.display()));
    }
    match global.format {
        Format::Json => {
            println!(
                "{}",
                serde_json::to_string_pretty(&summary).expect("plain data")
            );
        }
        Format::Text | Format::Md => print!("{}", markdown::summary(&manifest, &summary)),
    }
    if !global.quiet {
        if let Some(line) = markdown::throughput(&summary) {
            eprintln!("\n{line}");
        }
        eprintln!("run directory: {}", directory.display());
    }
    for failure in &unreadable {
        eprintln!("skipped: {failure}");
    }
    Ok(if unreadable.is_empty() {
        Exit::Success
    } else {
        Exit::Incomplete
    })
}

/// Everything that does not change during a run.
struct Job<'a> {
    global: &'a Global,
    args: &'a RunArgs,
    settings: &'a Settings,
    source: &'a Source,
    options: &'a ReadOptions,
}

/// An object with its grasps, ready to run.
struct Prepared {
    bench: Bench,
    grasps: Vec<Grasp>,
}

impl Job<'_> {
    /// Describes every object; under `--keep-going` those that cannot be read leave the plan.
    fn manifest(
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
            engine: shakedown_sim::ENGINE.to_owned(),
            run_id: String::new(),
            protocol: constants.into(),
            classifier: serde_json::json!(self.settings.thresholds),
            gripper: serde_json::json!(self.settings.gripper),
            grasps: self.source.describe(&self.args.source),
            selection: serde_json::json!({
                "limit": self.args.limit,
                "filter": self.args.object.filter,
                "stages": stages,
            }),
            seed: self.global.seed,
            objects: described,
            command: std::env::args().collect(),
            platform: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        }
        .sealed())
    }

    fn prepare(&self, item: &Item) -> Result<Prepared, Failure> {
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
        let bench = Bench::new(object, self.settings)?;
        Ok(Prepared { bench, grasps })
    }

    /// Runs object after object in the order of their ids; the next one is prepared meanwhile.
    fn execute(
        &self,
        plan: &Plan,
        first: Option<Result<Prepared, Failure>>,
        store: &mut Store,
        cost: &Mutex<Cost>,
        unreadable: &mut Vec<Failure>,
    ) -> Result<Vec<(String, Vec<Row>)>, Failure> {
        let per_object = |item: &Item| match (&item.grasps, self.args.limit) {
            (_, Some(limit)) => limit,
            (Some(_), None) => 0,
            (None, None) => self.args.source.candidates,
        };
        let bar = progress::bar(self.global, plan.items.iter().map(per_object).sum());
        let mut results = Vec::new();
        let mut next = first;
        for (i, item) in plan.items.iter().enumerate() {
            let following = plan.items.get(i + 1);
            let prepared = match next.take().expect("one is prepared ahead") {
                Ok(p) => p,
                Err(e) if self.args.object.keep_going => {
                    unreadable.push(e);
                    next = following.map(|f| self.prepare(f));
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
            let (rows, prepared_next) = rayon::join(
                || self.try_all(&prepared, store, cost, &bar),
                || following.map(|f| self.prepare(f)),
            );
            next = prepared_next;
            results.push((item.id.clone(), rows?));
        }
        bar.finish_and_clear();
        Ok(results)
    }

    fn try_all(
        &self,
        prepared: &Prepared,
        store: &mut Store,
        cost: &Mutex<Cost>,
        bar: &indicatif::ProgressBar,
    ) -> Result<Vec<Row>, Failure> {
        let mut all = Vec::with_capacity(prepared.grasps.len());
        // Trials are slow, so their rows go to disk in small portions.
        let chunk = if self.settings.physics { 64 } else { CHUNK };
        for grasps in prepared.grasps.chunks(chunk) {
            let rows = prepared
                .bench
                .rows(self.settings, grasps, self.args.record, cost, || bar.inc(1));
            let mut cells = Vec::with_capacity(rows.len());
            for (cell, row, replay) in rows {
                cells.push(cell);
                all.push(row);
                if let Some(r) = replay {
                    let bytes = serde_json::to_vec(&r).expect("a replay is plain data");
                    store.add_replay(&r.file_name(), &bytes)?;
                }
            }
            store.append(&prepared.bench.object.id, &cells)?;
        }
        Ok(all)
    }

    fn dry_run(&self, plan: &Plan, manifest: &Manifest) -> Result<Exit, Failure> {
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

fn default_out(manifest: &Manifest) -> PathBuf {
    let protocol = manifest.protocol["name"].as_str().unwrap_or("run");
    PathBuf::from("runs").join(format!("{protocol}-{}", &manifest.run_id[..8]))
}
