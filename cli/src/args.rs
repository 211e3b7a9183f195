//! The command line, as in the contract.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use shakedown_gripper_assets::{GraspFormat, Gripper, HandFrame, ReadOptions};
use shakedown_report::Shard;
use shakedown_sim::{Protocol, ProtocolError};

#[cfg(feature = "train")]
use crate::args_judging::TrainArgs;
use crate::args_judging::{CompareArgs, LabelArgs, MergeArgs, RankArgs, ReportArgs, ResumeArgs};

/// Does this grasp hold? Simulated grasp trials, regression benchmarking, candidate ranking.
///
/// Without a subcommand: `run` on the embedded objects with grasps drawn from the built-in model.
#[derive(Parser)]
#[command(
    name = "shakedown",
    version,
    args_conflicts_with_subcommands = true,
    after_help = "Exit codes: 0 success, 1 internal error, 2 usage, 3 bad input, 4 nothing to do, \
5 incomplete, 100 regression found.\n\nExample:\n  shakedown run --grasps my_grasps.csv --mesh mug.obj --frame tcp --out runs/mug"
)]
pub struct Cli {
    #[command(flatten)]
    pub global: Global,
    #[command(flatten)]
    pub run: RunArgs,
    #[command(subcommand)]
    pub command: Option<Command>,
}

/// Options of every subcommand.
#[derive(Args, Clone)]
pub struct Global {
    /// Seed of every random draw
    #[arg(long, global = true, default_value_t = 0)]
    pub seed: u64,
    /// Threads (default: all); results do not depend on it
    #[arg(long, global = true)]
    pub threads: Option<NonZeroUsize>,
    /// How the result is printed on stdout
    #[arg(long, global = true, value_enum, default_value_t = Format::Text)]
    pub format: Format,
    /// No progress, no notes
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// Colours on stderr (NO_COLOR is honoured)
    #[arg(long, global = true, value_enum, default_value_t = Color::Auto)]
    pub color: Color,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    Text,
    Json,
    Md,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Color {
    Auto,
    Always,
    Never,
}

#[derive(Subcommand)]
pub enum Command {
    /// The main job: grasps -> geometry -> physics -> run directory and summary
    #[command(
        after_help = "Examples:\n  shakedown run\n  shakedown run --grasps Mug.h5 --mesh-root acronym --limit 200 --out runs/mug\n  shakedown run --objects bottle.stl --scale 0.001 --candidates 50 --set friction=0.5"
    )]
    Run(RunArgs),
    /// Only draw grasps and write a grasp file
    #[command(
        after_help = "Example:\n  shakedown sample --objects mug.obj --candidates 200 --out mug.json"
    )]
    Sample(SampleArgs),
    /// Finish an interrupted run; the result is that of an uninterrupted one
    #[command(after_help = "Example:\n  shakedown resume runs/acronym-1a2b3c4d")]
    Resume(ResumeArgs),
    /// Join the shards of one run
    #[command(
        after_help = "Example:\n  shakedown run --shard 0/2 --out runs/part0\n  shakedown run --shard 1/2 --out runs/part1\n  shakedown merge runs/whole runs/part0 runs/part1"
    )]
    Merge(MergeArgs),
    /// Write summary and report.html of a run again
    #[command(
        after_help = "Examples:\n  shakedown report runs/acronym-1a2b3c4d\n  shakedown report runs/acronym-1a2b3c4d --glb trial.glb --object mug_0 --grasp 17"
    )]
    Report(ReportArgs),
    /// Only geometry: collision, reach, closing, alignment
    #[command(
        after_help = "Example:\n  shakedown classify --grasps poses.csv --mesh mug.obj --frame tcp --out runs/mug_geometry"
    )]
    Classify(RunArgs),
    /// Order the candidate grasps of one object, best first
    #[command(
        after_help = "Examples:\n  shakedown rank --objects mug.obj --candidates 200 --top 5\n  shakedown rank --grasps poses.csv --mesh mug.obj --frame tcp --top 10 --perturb 16 --out best.json\n\np_hold: calibrated on labels; with --perturb N the share of N trials that held under pose and friction noise."
    )]
    Rank(RankArgs),
    /// Make labelled grasps for new objects, laid out as ACRONYM's
    #[command(
        after_help = "Example:\n  shakedown label --objects bottle.stl cup.obj --scale 0.001 --grasps-per-object 2000 --out labels\n\nWrites labels/grasps/*.h5 with the datasets of ACRONYM, and labels/meshes/*.obj beside them. Run again to go on after an interrupt."
    )]
    Label(LabelArgs),
    /// Compare two runs grasp by grasp, and fail if the new one is worse
    #[command(
        after_help = "Examples:\n  shakedown compare runs/main runs/mine\n  shakedown compare main runs/mine --fail-on regression --junit gate.xml --summary gate.md\n  shakedown compare --plan --drop 0.03 --power 0.95\n\nExit code 100: regression. A baseline is saved by `run --save-baseline NAME`; a name, a run directory and a trials.csv are interchangeable."
    )]
    Compare(CompareArgs),
    /// List the embedded objects, or show what a mesh holds
    #[command(
        after_help = "Examples:\n  shakedown objects\n  shakedown objects bottle.stl --scale 0.001\n  shakedown objects --export meshes/"
    )]
    Objects(ObjectsArgs),
    /// List the built-in hands, or print one as TOML to copy and change
    #[command(after_help = "Example:\n  shakedown grippers franka_panda > my_hand.toml")]
    Grippers(NameArgs),
    /// List the presets, or print one with all constants as TOML
    #[command(after_help = "Example:\n  shakedown protocols acronym > my_protocol.toml")]
    Protocols(NameArgs),
    /// List the built-in flow models
    #[command(after_help = "Example:\n  shakedown models")]
    Models,
    /// Measure each stage on this machine
    #[command(after_help = "Example:\n  shakedown bench --format json > bench.json")]
    Bench(BenchArgs),
    /// Write one trial as a MuJoCo model: object, hand, schedule
    #[command(
        name = "export-mjcf",
        after_help = "Example:\n  shakedown export-mjcf --grasps Mug.h5 --mesh-root acronym --grasp 17 --out trial17\n\nWrites trial.xml (the model, seen from the hand) and trial.json (forces, schedule, verdict)."
    )]
    ExportMjcf(ExportMjcfArgs),
    /// Train a flow model and export it to ONNX
    #[cfg(feature = "train")]
    #[command(
        after_help = "Examples:\n  shakedown train --data embedded --out models/mine\n  shakedown train --data acronym/grasps --mesh-root acronym --preset best --minutes 60 --out models/acronym\n  shakedown train --data acronym/grasps --mesh-root acronym --out models/acronym --resume\n\nA killed training goes on with --resume and ends with the same weights."
    )]
    Train(TrainArgs),
    /// Print shell completions
    #[command(
        after_help = "Example:\n  shakedown completions bash > /etc/bash_completion.d/shakedown"
    )]
    Completions(CompletionsArgs),
}

/// Where candidates come from when no grasp file is given.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Sampler {
    Antipodal,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Stage {
    Geometry,
    Physics,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Record {
    None,
    Failures,
    All,
}

/// What the grasps are tried on.
#[derive(Args, Clone, Default)]
pub struct ObjectArgs {
    /// `embedded`, a set (TOML), meshes, or ACRONYM files
    #[arg(long, num_args = 1.., value_name = "SET|FILE")]
    pub objects: Vec<String>,
    /// Where the mesh paths inside grasp files start
    #[arg(long, value_name = "DIR")]
    pub mesh_root: Option<PathBuf>,
    /// The mesh of a grasp file that names none
    #[arg(long, value_name = "FILE")]
    pub mesh: Option<PathBuf>,
    /// Metres per mesh unit
    #[arg(long, value_name = "X")]
    pub scale: Option<f64>,
    /// Mass of the object, kg
    #[arg(long)]
    pub mass_kg: Option<f64>,
    /// Density of the object, kg/m3
    #[arg(long)]
    pub density_kg_m3: Option<f64>,
    /// Friction coefficient of hand and object
    #[arg(long)]
    pub friction: Option<f64>,
    /// Only objects whose id matches
    #[arg(long, value_name = "REGEX")]
    pub filter: Option<String>,
    /// Skip objects that cannot be read; ends with exit code 5
    #[arg(long)]
    pub keep_going: bool,
}

/// Where the grasps come from.
#[derive(Args, Clone, Default)]
pub struct SourceArgs {
    /// Grasp files: ACRONYM h5/json, GraspGen json, isaac_grasp yaml, npz, csv
    #[arg(long, num_args = 1.., value_name = "FILE", conflicts_with_all = ["model", "sampler"])]
    pub grasps: Vec<PathBuf>,
    /// Format of the grasp files; recognised by content otherwise
    #[arg(long, value_name = "FORMAT")]
    pub grasp_format: Option<GraspFormat>,
    /// Frame of the poses: acronym, panda_hand or tcp
    #[arg(long, value_name = "FRAME")]
    pub frame: Option<HandFrame>,
    /// Flow model: a built-in name (default: rfm-embedded), or a directory with model.toml,
    /// encoder.onnx, velocity.onnx and, if its card speaks of one, evaluator.onnx
    #[arg(long, value_name = "NAME|DIR", conflicts_with = "sampler")]
    pub model: Option<String>,
    /// ONNX Runtime library to use instead of the built-in tract
    #[arg(long, value_name = "FILE")]
    pub ort: Option<PathBuf>,
    /// Integration steps of the model (default: its card's)
    #[arg(long)]
    pub steps: Option<NonZeroUsize>,
    /// How often a grasp that the model's evaluator does not believe in is drawn anew at most (default:
    /// its card's; 0: everything that the flow draws)
    #[arg(long, value_name = "N")]
    pub redraws: Option<usize>,
    /// Show the model each object turned at random (by the seed); its grasps are turned back
    #[arg(long)]
    pub turn_objects: bool,
    /// Draw candidates without a model
    #[arg(long, value_enum)]
    pub sampler: Option<Sampler>,
    /// Candidates per object, for samplers
    #[arg(long, default_value_t = 100)]
    pub candidates: u64,
    /// The hand: a name or a TOML file
    #[arg(long, default_value = "franka_panda", value_name = "NAME|FILE")]
    pub gripper: String,
}

#[derive(Args, Clone)]
pub struct RunArgs {
    #[command(flatten)]
    pub source: SourceArgs,
    #[command(flatten)]
    pub object: ObjectArgs,
    #[command(flatten)]
    pub protocol: ProtocolArgs,
    /// At most N grasps per object: a random subset that depends on the seed; N grows by adding
    #[arg(long, value_name = "N")]
    pub limit: Option<u64>,
    /// Which stages run
    #[arg(long, value_enum, value_delimiter = ',', default_values = ["geometry", "physics"])]
    pub stages: Vec<Stage>,
    /// Which trials are recorded under replays/
    #[arg(long, value_enum, default_value_t = Record::None)]
    pub record: Record,
    /// Fill the columns `epsilon` and `wrench_volume`: analytic quality of the contacts that the trial
    /// found, or, where it found none, of those that geometry predicts
    #[arg(long)]
    pub wrench: bool,
    /// Only print what would be run
    #[arg(long)]
    pub dry_run: bool,
    /// The run directory (default: runs/ and a name that tells protocol and run id)
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Try only part I of N of the grasps (I from 0; auto/N: from SLURM_ARRAY_TASK_ID or
    /// JOB_COMPLETION_INDEX); `merge` joins the parts
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,
    /// The command line as given
    #[arg(skip = std::env::args().skip(1).collect::<Vec<String>>())]
    pub words: Vec<String>,
    /// Keep the results as baselines/NAME.json, for `compare`
    #[arg(long, value_name = "NAME")]
    pub save_baseline: Option<String>,
}

#[derive(Args)]
pub struct SampleArgs {
    #[command(flatten)]
    pub source: SourceArgs,
    #[command(flatten)]
    pub object: ObjectArgs,
    /// Grasp file to write (.json, .yaml, .npz, .csv), or a directory for several objects
    #[arg(long, value_name = "FILE|DIR")]
    pub out: PathBuf,
    /// Format to write; told by the extension otherwise (json: GraspGen's)
    #[arg(long, value_name = "FORMAT")]
    pub out_format: Option<GraspFormat>,
}

#[derive(Args)]
pub struct ObjectsArgs {
    /// Meshes, sets or ACRONYM files to look at (default: the embedded set)
    pub files: Vec<String>,
    /// Metres per mesh unit
    #[arg(long)]
    pub scale: Option<f64>,
    /// Where the mesh paths inside ACRONYM files start
    #[arg(long, value_name = "DIR")]
    pub mesh_root: Option<PathBuf>,
    /// Write the meshes there as OBJ
    #[arg(long, value_name = "DIR")]
    pub export: Option<PathBuf>,
}

#[derive(Args)]
pub struct NameArgs {
    /// Print this one
    pub name: Option<String>,
}

#[derive(Args)]
pub struct BenchArgs {
    /// Grasps that are measured
    #[arg(long, default_value_t = 64)]
    pub trials: u64,
    /// Object: an embedded one or an ACRONYM file
    #[arg(long, default_value = "mug_0", value_name = "ID|FILE")]
    pub object: String,
    /// Where the mesh path inside an ACRONYM file starts
    #[arg(long, value_name = "DIR")]
    pub mesh_root: Option<PathBuf>,
    #[command(flatten)]
    pub protocol: ProtocolArgs,
}

#[derive(Args)]
pub struct CompletionsArgs {
    /// Shell
    pub shell: clap_complete::Shell,
}

/// How a trial goes.
#[derive(Args, Clone)]
pub struct ProtocolArgs {
    /// The protocol: a name or a TOML file
    #[arg(long, default_value = "acronym", value_name = "NAME|FILE")]
    pub protocol: String,
    /// Override one constant of the protocol
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

impl ProtocolArgs {
    pub fn load(&self) -> Result<Protocol, ProtocolError> {
        Protocol::load(&self.protocol, &self.set)
    }
}

impl SourceArgs {
    /// How grasp files are read for this hand.
    pub fn read_options(&self, gripper: &Gripper) -> ReadOptions {
        ReadOptions {
            format: self.grasp_format,
            frame: self.frame,
            tcp_z_m: gripper.tcp_z_m,
        }
    }
}

/// Which trial is written, and where.
#[derive(Args, Clone)]
pub struct ExportMjcfArgs {
    #[command(flatten)]
    pub source: SourceArgs,
    #[command(flatten)]
    pub object: ObjectArgs,
    #[command(flatten)]
    pub protocol: ProtocolArgs,
    /// Numbers of the grasps within the object; several make a folder each
    #[arg(long, num_args = 1.., default_value = "0", value_name = "N")]
    pub grasp: Vec<u64>,
    /// The directory of trial.xml and trial.json
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}
