//! Grasp files of ACRONYM, GraspGen, isaac_grasp, and plain pose lists, read and written.

pub mod acronym_h5;
pub mod acronym_h5_writer;
pub mod acronym_json;
pub mod csv;
pub mod graspgen_json;
pub mod isaac_yaml;
pub mod npz;

mod file;

pub use file::{GraspFile, GraspFormat, ObjectReference, ReadOptions, read_grasps, write_grasps};
