//! What physics says of a grasp: one trial in rapier3d.
//!
//! A [`Scene`] holds what all trials of an object share (shapes, masses, the [`Protocol`]); a trial
//! builds a fresh world in the hand's frame, closes the fingers, shakes, and ends in an
//! [`Outcome`]. Nothing is shared between trials, so their order and thread do not matter.

mod approach;
pub mod contact;
mod convert;
pub mod hand;
mod load;
pub mod mjcf;
pub mod outcome;
mod patch;
pub mod probe;
pub mod protocol;
pub mod scene;
pub mod shake;
mod torsion;
pub mod trace;
pub mod trial;
mod world;

pub use outcome::{Label, Outcome, Stage};
pub use protocol::{Protocol, ProtocolError};
pub use scene::{Scene, SceneError};
pub use trace::{Frame, Trace};
pub use world::ObjectLoad;
pub use trial::{run_trial, run_trial_traced};

/// Version of the physics engine, part of every manifest.
pub const ENGINE: &str = concat!("rapier3d ", "0.36.1");
