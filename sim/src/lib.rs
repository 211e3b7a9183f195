//! What physics says of a grasp: one trial, in our own engine for gripped objects or in rapier3d.
//!
//! A [`Scene`] holds what all trials of an object share (shapes, masses, the [`Protocol`]); a trial
//! builds a fresh world in the hand's frame, closes the fingers, shakes, and ends in an
//! [`Outcome`]. Nothing is shared between trials, so their order and thread do not matter.

#[cfg(not(feature = "f64"))]
use rapier3d as rapier;
#[cfg(feature = "f64")]
use rapier3d_f64 as rapier;

mod approach;
mod convert;
mod grip;
mod load;
pub mod mjcf;
pub mod outcome;
pub mod probe;
pub mod protocol;
mod rapier_engine;
pub mod scene;
pub mod shake;
pub mod trace;
pub mod trial;
mod world;

pub use outcome::{Label, Outcome, Stage};
pub use protocol::{Protocol, ProtocolError};
pub use scene::{Scene, SceneError};
pub use trace::{Frame, Trace};
pub use trial::{run_trial, run_trial_traced};
pub use world::{FingerContact, FingerState, ObjectLoad};

/// Our own engine and its version; results of other versions may differ.
pub const GRIP: &str = "grip 1 (contacts by parry3d 0.31.1)";
/// The second engine.
#[cfg(not(feature = "f64"))]
pub const RAPIER: &str = "rapier3d 0.36.1";
/// The second engine.
#[cfg(feature = "f64")]
pub const RAPIER: &str = "rapier3d-f64 0.36.1";
