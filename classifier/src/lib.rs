//! What geometry says of a grasp, before any physics: does the hand collide, does it reach the
//! object, does it close on it, centred and aligned?
//!
//! Everything is exact: triangles of the object are clipped against the convex parts of the hand
//! and against the region between the pads; nothing is sampled.

pub mod closing;
pub mod hand;
mod moments;
mod patch;
mod prism;
pub mod profile;
pub mod verdict;

pub use hand::HandModel;
pub use verdict::{Class, Thresholds, Verdict, classify};
