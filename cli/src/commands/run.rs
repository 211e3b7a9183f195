//! `shakedown run` and `shakedown resume`: the main job.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

use clap::Parser as _;
use shakedown_metrics::Summary;
use shakedown_metrics::summary::{Throughput, summarise};
use shakedown_report::journal::{self, Start};
use shakedown_report::results::Results;
use shakedown_report::{Manifest, Store, baseline, markdown, reference, rows};
use shakedown_sim::Label;

use crate::args::{Cli, Command, Format, Global, RunArgs};
use crate::args_judging::ResumeArgs;
use crate::failure::{Exit, Failure};
use crate::job::Job;
use crate::plan::Plan;
use crate::settings::{Settings, Source};
use crate::work::Cost;
use crate::{interrupt, progress};

/// `run`, `classify`, and no subcommand.
pub fn run(global: &Global, args: &RunArgs) -> Result<Exit, Failure> {
    execute(global, args, None)
}

/// `resume DIR`: repeats the command that started the run, from the directory where it was given.
pub fn resume(args: &ResumeArgs) -> Result<Exit, Failure> {
    let directory = std::path::absolute(&args.directory)
        .map_err(|e| Failure::input(format!("{}: {e}", args.directory.display())))?;
    let start = journal::start_of(&directory)?;
    std::env::set_current_dir(&start.working_directory).map_err(|e| {
        Failure::input(format!(
            "the run was started in {}, which is not there: {e}",
            start.working_directory.display()
        ))
    })?;
    let words = std::iter::once("shakedown".to_owned()).chain(start.arguments.iter().cloned());
    let cli = Cli::try_parse_from(words)
        .map_err(|e| Failure::internal(format!("the journal's command cannot be read: {e}")))?;
    let mut again = match cli.command {
        None => cli.run,
        Some(Command::Run(args)) => args,
        Some(Command::Classify(args)) => super::classify::only_geometry(&args),
        Some(_) => return Err(Failure::internal("the journal is not of a run")),
    };
    again.words = start.arguments;
    execute(&cli.global, &again, Some(&directory))
}

fn execute(global: &Global, args: &RunArgs, resumed: Option<&Path>) -> Result<Exit, Failure> {
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
    let first = match plan.items.first().map(|item| job.prepare(0, item)) {
        Some(Err(e)) if !args.object.keep_going => return Err(e),
        first => first,
    };
    interrupt::listen();
    let (mut store, done) = match resumed {
        Some(directory) => Store::resume(directory, manifest.clone())?,
        None => {
            let out = args.out.clone().unwrap_or_else(|| default_out(&manifest));
            let working_directory = std::env::current_dir()
                .map_err(|e| Failure::input(format!("the working directory: {e}")))?;
            let start = Start {
                arguments: args.words.clone(),
                working_directory,
            };
            (Store::create(&out, manifest.clone(), &start)?, Vec::new())
        }
    };
    let directory = store.directory().to_owned();
    let cost = Mutex::new(Cost::default());
    let progress = job.execute(&plan, first, &done, &mut store, &cost, &mut unreadable)?;
    if progress.interrupted {
        eprintln!(
            "interrupted: {} rows are on disk; shakedown resume {}",
            progress.rows,
            directory.display()
        );
        return Ok(Exit::Incomplete);
    }
    if progress.rows == 0 && args.shard.is_none() {
        return Err(Failure::nothing(
            "no grasp was selected; look at --limit, --candidates and the grasp files",
        ));
    }
    let cost = *cost.lock().expect("all workers are done");
    let throughput = cost.throughput(started.elapsed().as_secs_f64());
    let summary = summary_of(&directory, throughput)?;
    store.finish(&summary)?;
    if let Some(name) = &args.save_baseline {
        let results = Results::open(&directory.display().to_string())?;
        let path = baseline::save(name, &results)?;
        progress::note(global, &format!("baseline: {}", path.display()));
    }
    print(global, &manifest, &summary, &directory);
    for failure in &unreadable {
        eprintln!("skipped: {failure}");
    }
    Ok(if unreadable.is_empty() {
        Exit::Success
    } else {
        Exit::Incomplete
    })
}

/// The summary of the rows in a run directory.
pub fn summary_of(directory: &Path, throughput: Throughput) -> Result<Summary, Failure> {
    let names = Label::ALL.map(Label::name);
    let objects = rows::read(&directory.join("trials.csv"), &names)?;
    let mut summary = summarise(&objects, &names, throughput);
    summary.add_distribution(&reference::distributions(directory)?);
    Ok(summary)
}

/// Prints a summary on stdout as the user asked.
pub fn print(global: &Global, manifest: &Manifest, summary: &Summary, directory: &Path) {
    match global.format {
        Format::Json => println!(
            "{}",
            serde_json::to_string_pretty(&summary).expect("plain data")
        ),
        Format::Text | Format::Md => print!("{}", markdown::summary(manifest, summary)),
    }
    if !global.quiet {
        if std::io::stdout().is_terminal() && global.format == Format::Text {
            println!("\n{}", markdown::bars(summary));
        }
        if let Some(line) = markdown::throughput(summary) {
            eprintln!("\n{line}");
        }
        eprintln!("run directory: {}", directory.display());
    }
}

fn default_out(manifest: &Manifest) -> PathBuf {
    let protocol = manifest.protocol["name"].as_str().unwrap_or("run");
    PathBuf::from("runs").join(format!("{protocol}-{}", &manifest.run_id[..8]))
}

impl Cost {
    fn throughput(&self, wall_s: f64) -> Throughput {
        Throughput {
            trials: self.trials,
            steps: self.steps,
            cpu_s: self.cpu_s,
            wall_s,
            trials_per_cpu_s: if self.cpu_s > 0.0 {
                self.trials as f64 / self.cpu_s
            } else {
                0.0
            },
        }
    }
}
