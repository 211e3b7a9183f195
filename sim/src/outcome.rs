//! How did a trial end, and by how much?

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

/// The outcome of a trial, in the order in which the cases are checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Label {
    /// A pose became non-finite or ran away more than 10 m.
    Diverged,
    /// Hand and object overlapped at the start.
    InitialCollision,
    /// The fingers closed without both touching the object.
    NoContact,
    /// Contact was lost after closing.
    Dropped,
    /// Still touched, but moved in the hand beyond the protocol's limit.
    Slipped,
    /// The protocol's success.
    Held,
}

impl Label {
    /// All labels, best first, as reports list them.
    pub const ALL: [Self; 6] = [
        Self::Held,
        Self::Slipped,
        Self::Dropped,
        Self::NoContact,
        Self::InitialCollision,
        Self::Diverged,
    ];

    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Slipped => "slipped",
            Self::Dropped => "dropped",
            Self::NoContact => "no_contact",
            Self::InitialCollision => "initial_collision",
            Self::Diverged => "diverged",
        }
    }
}

/// What a trial was doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Before the first step.
    Start,
    /// The fingers close.
    Closing,
    /// The force grows to the grip force.
    Squeeze,
    /// Rest before the load.
    Settle,
    /// Shake along the approach direction.
    ShakeLinear,
    /// Shake about the closing axis.
    ShakeAngular,
    /// A pull at the object.
    Tug,
    /// The hand goes up.
    Lift,
    /// Harder and harder shakes.
    Hardness,
    /// Rest before the verdict.
    Hold,
}

impl Stage {
    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Closing => "closing",
            Self::Squeeze => "squeeze",
            Self::Settle => "settle",
            Self::ShakeLinear => "shake_linear",
            Self::ShakeAngular => "shake_angular",
            Self::Tug => "tug",
            Self::Lift => "lift",
            Self::Hardness => "hardness",
            Self::Hold => "hold",
        }
    }
}

/// The end of one trial with its measurements. Lengths and angles are of the object in the hand
/// frame, at its centre of mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// How it ended.
    pub label: Label,
    /// The stage in which it ended.
    pub stage: Stage,
    /// Motion while the fingers closed, metres.
    pub closing_linear_m: Option<f64>,
    /// Rotation while the fingers closed, radians.
    pub closing_angular_rad: Option<f64>,
    /// Pose of the hand on the object at the end of closing: what the trial made of the grasp.
    pub closed_object_from_hand: Option<Isometry3<f64>>,
    /// Motion from the end of closing to the end, metres.
    pub slip_linear_m: Option<f64>,
    /// Rotation from the end of closing to the end, radians.
    pub slip_angular_rad: Option<f64>,
    /// Distance between the pads at the end of closing, metres.
    pub width_m: Option<f64>,
    /// Mean of both fingers' contact forces on the object at the end of closing, N.
    pub grip_force_n: Option<f64>,
    /// Under `hardness`: the largest peak acceleration survived, in multiples of 9.81 m/s2.
    pub margin_g: Option<f64>,
    /// Simulated time, s.
    pub sim_s: f64,
    /// Steps taken.
    pub steps: u32,
}

impl Outcome {
    /// Did the grasp hold?
    pub fn is_held(&self) -> bool {
        self.label == Label::Held
    }
}
