//! The `shakedown` binary: does this grasp hold?

mod args;
mod args_judging;
mod commands;
mod failure;
mod grasps;
mod interrupt;
mod job;
mod plan;
mod progress;
mod settings;
#[cfg(feature = "train")]
mod stretched;
#[cfg(feature = "train")]
mod teacher;
#[cfg(feature = "train")]
mod training_data;
mod work;

use clap::Parser as _;

use args::{Cli, Command};
use failure::{Exit, Failure};

fn main() -> std::process::ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(e) => {
            let _ = e.print();
            return if e.use_stderr() {
                Exit::Usage
            } else {
                Exit::Success
            }
            .into();
        }
    };
    match dispatch(&cli) {
        Ok(exit) => exit.into(),
        Err(failure) => {
            eprintln!("error: {failure}");
            failure.exit.into()
        }
    }
}

fn dispatch(cli: &Cli) -> Result<Exit, Failure> {
    if let Some(n) = cli.global.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(n.get())
            .build_global()
            .map_err(|e| Failure::internal(format!("the thread pool does not start: {e}")))?;
    }
    let global = &cli.global;
    match &cli.command {
        None => commands::run::run(global, &cli.run),
        Some(Command::Run(args)) => commands::run::run(global, args),
        Some(Command::Sample(args)) => commands::sample::run(global, args),
        Some(Command::Classify(args)) => commands::classify::run(global, args),
        Some(Command::Resume(args)) => commands::run::resume(args),
        Some(Command::Merge(args)) => commands::merge::run(global, args),
        Some(Command::Report(args)) => commands::merge::report(global, args),
        Some(Command::Rank(args)) => commands::rank::run(global, args),
        Some(Command::Label(args)) => commands::label::run(global, args),
        Some(Command::Compare(args)) => commands::compare::run(global, args),
        Some(Command::Objects(args)) => commands::objects::run(global, args),
        Some(Command::Grippers(args)) => commands::grippers::run(global, args),
        Some(Command::Protocols(args)) => commands::protocols::run(global, args),
        Some(Command::Models) => commands::models::run(global),
        Some(Command::Bench(args)) => commands::bench::run(global, args),
        Some(Command::ExportMjcf(args)) => commands::export_mjcf::run(global, args),
        #[cfg(feature = "train")]
        Some(Command::Train(args)) => commands::train::run(global, args),
        Some(Command::Completions(args)) => commands::completions::run(args),
    }
}
