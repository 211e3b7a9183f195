//! What a trial looked like: poses at 60 Hz for replays.

use nalgebra::{Isometry3, Point3, Vector3};

/// Rate of recording, Hz.
pub const TRACE_HZ: f64 = 60.0;

/// One moment of a trial; world = the hand's frame at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Simulated time, s.
    pub t_s: f64,
    /// Pose of the hand.
    pub world_from_hand: Isometry3<f64>,
    /// Distance of each pad from the hand's axis, metres: left (+x), right (-x).
    pub finger_m: [f64; 2],
    /// Pose of the object's mesh frame.
    pub world_from_object: Isometry3<f64>,
    /// Centre of pressure of the left and the right finger, world, metres.
    pub contact_m: [Point3<f64>; 2],
    /// Their normal forces on the object, world axes, N; zero where nothing presses.
    pub contact_force_n: [Vector3<f64>; 2],
}

/// The frames of one trial in order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trace {
    /// At 60 Hz, and the last moment.
    pub frames: Vec<Frame>,
}
