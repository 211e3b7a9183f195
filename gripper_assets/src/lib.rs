//! What grasps: hands as data ([`Gripper`]), poses of a hand on an object ([`Grasp`]), and the
//! readers and writers of everybody's grasp files ([`io`]).

pub mod error;
pub mod frame;
pub mod grasp;
pub mod gripper;
pub mod io;

pub use error::GraspError;
pub use frame::HandFrame;
pub use grasp::Grasp;
pub use gripper::{Gripper, Part};
pub use io::{GraspFile, GraspFormat, ObjectReference, ReadOptions, read_grasps, write_grasps};
