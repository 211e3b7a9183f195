//! Options of the subcommands that judge runs and grasps, or make labels and models.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use shakedown_gripper_assets::GraspFormat;
use shakedown_report::results::Metric;

use crate::args::{ObjectArgs, ProtocolArgs, SourceArgs};

#[derive(Args, Clone)]
pub struct ResumeArgs {
    /// The run directory
    pub directory: PathBuf,
}

#[derive(Args, Clone)]
pub struct ReportArgs {
    /// The run directory
    pub directory: PathBuf,
    /// Instead: write a recorded trial as an animated GLB (Blender, any glTF viewer)
    #[arg(long, value_name = "FILE", requires = "grasp")]
    pub glb: Option<PathBuf>,
    /// With --glb: number of the grasp
    #[arg(long, value_name = "N")]
    pub grasp: Option<u64>,
    /// With --glb: the object, if the run has several
    #[arg(long, value_name = "ID")]
    pub object: Option<String>,
}

#[derive(Args, Clone)]
pub struct MergeArgs {
    /// The directory of the whole run; new or empty
    pub out: PathBuf,
    /// The directories of all its shards
    #[arg(required = true)]
    pub shards: Vec<PathBuf>,
}

#[derive(Args, Clone)]
pub struct LabelArgs {
    #[command(flatten)]
    pub object: ObjectArgs,
    #[command(flatten)]
    pub protocol: ProtocolArgs,
    /// Antipodal candidates per object
    #[arg(long, default_value_t = 2000, value_name = "N")]
    pub grasps_per_object: u64,
    /// GraspGen JSON beside each h5
    #[arg(long)]
    pub json: bool,
    /// The hand: a name or a TOML file
    #[arg(long, default_value = "franka_panda", value_name = "NAME|FILE")]
    pub gripper: String,
    /// The directory of the labels
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

#[derive(Args, Clone)]
pub struct RankArgs {
    #[command(flatten)]
    pub source: SourceArgs,
    #[command(flatten)]
    pub object: ObjectArgs,
    #[command(flatten)]
    pub protocol: ProtocolArgs,
    /// Candidates to list and write
    #[arg(long, default_value_t = 10, value_name = "K")]
    pub top: usize,
    /// Candidates that geometry likes best and that are tried in physics (default: 4 K, at least
    /// 100)
    #[arg(long, value_name = "N")]
    pub try_best: Option<usize>,
    /// Disturbed trials per candidate, at most
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub perturb: u32,
    /// With --perturb: standard deviation of the hand's position along each axis, metres
    #[arg(long, default_value_t = 0.003)]
    pub noise_m: f64,
    /// With --perturb: standard deviation of the hand's rotation about each axis, radians
    #[arg(long, default_value_t = 0.05)]
    pub noise_rad: f64,
    /// With --perturb: standard deviation of the logarithm of friction
    #[arg(long, default_value_t = 0.2)]
    pub noise_friction: f64,
    /// Grasp file of the top K to write (.json, .yaml, .npz, .csv)
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Format to write; told by the extension otherwise (json: GraspGen's)
    #[arg(long, value_name = "FORMAT")]
    pub out_format: Option<GraspFormat>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum MetricName {
    Held,
    Optimal,
    OptimalStrict,
    CollisionFree,
    Graspable,
}

impl From<MetricName> for Metric {
    fn from(name: MetricName) -> Self {
        match name {
            MetricName::Held => Self::Held,
            MetricName::Optimal => Self::Optimal,
            MetricName::OptimalStrict => Self::OptimalStrict,
            MetricName::CollisionFree => Self::CollisionFree,
            MetricName::Graspable => Self::Graspable,
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum FailOn {
    Regression,
    Never,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PairBy {
    /// By grasp where most poses agree, else by object
    Auto,
    Grasp,
    Object,
}

#[derive(Args, Clone)]
pub struct CompareArgs {
    /// Run directory, trials.csv or baseline
    pub base: Option<String>,
    /// Run directory, trials.csv or baseline
    pub new: Option<String>,
    /// What counts as a success
    #[arg(long, value_enum, default_value_t = MetricName::Held)]
    pub metric: MetricName,
    /// Significance level, two-sided
    #[arg(long, default_value_t = 0.05)]
    pub alpha: f64,
    /// Smallest change of the rate that matters
    #[arg(long, default_value_t = 0.02)]
    pub min_effect: f64,
    /// When to end with exit code 100
    #[arg(long, value_enum, default_value_t = FailOn::Regression)]
    pub fail_on: FailOn,
    /// How grasps are matched
    #[arg(long, value_enum, default_value_t = PairBy::Auto)]
    pub pair_by: PairBy,
    /// Compare although protocol, version, hand or objects differ; the verdict says so
    #[arg(long)]
    pub allow_protocol_change: bool,
    /// Write the two runs side by side as a page there; changed grasps can be watched in both
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Write JUnit XML there (- for stdout)
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Write a Markdown job summary there
    #[arg(long, value_name = "FILE")]
    pub summary: Option<PathBuf>,
    /// Write a JSON list for benchmark trackers there
    #[arg(long, value_name = "FILE")]
    pub tracker: Option<PathBuf>,
    /// Say how many grasps and objects are needed, instead of comparing
    #[arg(long)]
    pub plan: bool,
    /// With --plan: the true drop to find (default 0.03)
    #[arg(long, requires = "plan")]
    pub drop: Option<f64>,
    /// With --plan: the chance to find it (default 0.95)
    #[arg(long, requires = "plan")]
    pub power: Option<f64>,
    /// With --plan: share of grasps that change sides by themselves (default 0.04)
    #[arg(long, requires = "plan")]
    pub discordance: Option<f64>,
    /// With --plan: standard deviation of the change over objects (default 0.02)
    #[arg(long, requires = "plan")]
    pub object_sd: Option<f64>,
}

/// What is learned from, how, and where the model goes.
#[cfg(feature = "train")]
#[derive(Args, Clone)]
pub struct TrainArgs {
    /// `embedded`, or ACRONYM files and directories of them
    #[arg(long, num_args = 1.., default_value = "embedded", value_name = "embedded|DIR|FILE")]
    pub data: Vec<String>,
    /// Where the mesh paths inside the files start
    #[arg(long, value_name = "DIR")]
    pub mesh_root: Option<PathBuf>,
    /// Learn only from grasps that also held in these runs (directories of `shakedown run`)
    #[arg(long, num_args = 1.., value_name = "DIR")]
    pub held_in: Vec<PathBuf>,
    /// Learn only from grasps whose p_hold by geometry is at least this
    #[arg(long, value_name = "P")]
    pub min_p_hold: Option<f64>,
    /// With files: learn from N stretched copies of each object too, by antipodal candidates where geometry says
    /// that they hold
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub stretched: u64,
    /// With files: keep N of the objects out of the training and validate on them
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub hold_out: usize,
    /// With `embedded`: variants of each of the twelve families
    #[arg(long, default_value_t = 16, value_name = "N")]
    pub variants: u64,
    /// With `embedded`: antipodal candidates tried on each variant; with --stretched: candidates on each copy
    #[arg(long, default_value_t = 200, value_name = "N")]
    pub candidates: u64,
    /// `best`, `paper`, or a TOML file of the same keys
    #[arg(long, default_value = "best", value_name = "NAME|FILE")]
    pub preset: String,
    /// Second stage: straighten the paths of the model trained in DIR and correct its mistakes
    #[arg(long, value_name = "DIR")]
    pub rectify: Option<PathBuf>,
    /// With --rectify: from that time on; before it the flow is learned as in a first stage
    #[arg(long, default_value_t = 0.0, value_name = "T")]
    pub rectify_from: f64,
    /// With --rectify: paths per object
    #[arg(long, default_value_t = 1000, value_name = "N")]
    pub paths: u64,
    /// With --rectify: the end of a path is good only if it also holds in a trial
    #[arg(long, requires = "rectify")]
    pub try_ends: bool,
    /// Train no flow but an evaluator of this one's grasps: it draws --paths of them on each object, each
    /// is tried, and --out becomes that model with `evaluator.onnx`. Begun again it goes on from the trials it has
    #[arg(
        long,
        value_name = "NAME|DIR",
        conflicts_with_all = ["rectify", "preset", "held_in", "min_p_hold", "minutes", "resume"]
    )]
    pub evaluator_for: Option<String>,
    /// With --evaluator-for: a grasp whose score is lower is drawn anew
    #[arg(long, default_value_t = 0.6, value_name = "P")]
    pub least_score: f64,
    /// With --evaluator-for: so often at most
    #[arg(long, default_value_t = 15, value_name = "N")]
    pub redraws: usize,
    /// With --evaluator-for: steps from noise to grasp, instead of the model's
    #[arg(long, value_name = "N")]
    pub draw_steps: Option<NonZeroUsize>,
    /// Steps, instead of the preset's
    #[arg(long, value_name = "N")]
    pub steps: Option<u64>,
    /// Highest learning rate, instead of the preset's
    #[arg(long, value_name = "X")]
    pub learning_rate: Option<f32>,
    /// Stop after that long; `--resume` goes on
    #[arg(long, value_name = "M")]
    pub minutes: Option<f64>,
    /// Go on from the checkpoint in --out
    #[arg(long)]
    pub resume: bool,
    /// Name of the model (default: of the directory)
    #[arg(long)]
    pub name: Option<String>,
    /// Licence of the weights, for the card
    #[arg(long, value_name = "TEXT")]
    pub licence: Option<String>,
    /// ONNX Runtime library to validate with instead of the built-in tract
    #[arg(long, value_name = "FILE")]
    pub ort: Option<PathBuf>,
    /// The hand: a name or a TOML file
    #[arg(long, default_value = "franka_panda", value_name = "NAME|FILE")]
    pub gripper: String,
    #[command(flatten)]
    pub protocol: ProtocolArgs,
    /// Where the model, its checkpoint and its log go
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}
