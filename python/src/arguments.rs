//! From what Python passes to what the crates take.

use std::array::from_fn;
use std::collections::BTreeMap;

use nalgebra::Isometry3;
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use shakedown_gripper_assets::HandFrame;
use shakedown_gripper_assets::grasp::{pose_of_matrix, pose_of_quaternion};
use shakedown_objects::{Object, ObjectSpec};

create_exception!(
    _shakedown,
    ShakedownError,
    PyValueError,
    "Input that cannot be used; the message names what and where."
);

/// Any error of the crates as an exception.
pub fn raised(error: impl std::fmt::Display) -> PyErr {
    ShakedownError::new_err(error.to_string())
}

/// `object_from_hand` in the ACRONYM frame from an array `(N, 4, 4)` or `(N, 7)` (x, y, z, qx, qy,
/// qz, qw) of poses of `frame`.
pub fn poses(
    array: &PyReadonlyArrayDyn<'_, f64>,
    frame: &str,
    tcp_z_m: f64,
) -> PyResult<Vec<Isometry3<f64>>> {
    let frame: HandFrame = frame.parse().map_err(raised)?;
    let view = array.as_array();
    let numbers: Vec<f64> = view.iter().copied().collect();
    // The readers of grasp files take the same numbers the same way.
    type Read = fn(&[f64]) -> Result<(Isometry3<f64>, bool), String>;
    let read: Read = match array.shape() {
        [_, 4, 4] => |m| pose_of_matrix(&from_fn(|i| from_fn(|j| m[4 * i + j]))),
        [_, 7] => |p| pose_of_quaternion(from_fn(|i| p[i]), from_fn(|i| p[3 + i])),
        other => {
            return Err(raised(format!(
                "poses have the shape {other:?}; give (N, 4, 4) matrices or (N, 7) x, y, z, qx, qy, qz, qw"
            )));
        }
    };
    let width = numbers.len() / array.shape()[0].max(1);
    numbers
        .chunks(width.max(1))
        .enumerate()
        .map(|(i, pose)| {
            let (pose, _) = read(pose).map_err(|what| raised(format!("pose {i}: {what}")))?;
            Ok(if frame == HandFrame::Acronym {
                pose
            } else {
                frame.to_hand(&pose, tcp_z_m)
            })
        })
        .collect()
}

/// What is said of an object beside its mesh file.
#[derive(Debug, Clone, Copy, Default)]
pub struct ObjectFacts {
    pub scale: Option<f64>,
    pub mass_kg: Option<f64>,
    pub density_kg_m3: Option<f64>,
    pub friction: Option<f64>,
}

impl ObjectFacts {
    /// From a dictionary of the same names.
    pub fn of(object: &str, facts: &BTreeMap<String, f64>) -> PyResult<Self> {
        let mut out = Self::default();
        for (name, value) in facts {
            let place = match name.as_str() {
                "scale" => &mut out.scale,
                "mass_kg" => &mut out.mass_kg,
                "density_kg_m3" => &mut out.density_kg_m3,
                "friction" => &mut out.friction,
                other => {
                    return Err(raised(format!(
                        "{object}: {other:?} is none of scale, mass_kg, density_kg_m3, friction"
                    )));
                }
            };
            *place = Some(*value);
        }
        Ok(out)
    }
}

/// Reads a mesh file.
pub fn object(mesh: std::path::PathBuf, facts: ObjectFacts) -> PyResult<Object> {
    let spec = ObjectSpec {
        mesh,
        scale: facts.scale,
        mass_kg: facts.mass_kg,
        density_kg_m3: facts.density_kg_m3,
        friction: facts.friction,
        ..ObjectSpec::default()
    };
    Object::load(&spec).map_err(raised)
}

/// Runs `work` on `threads` threads (all if `None`) without the interpreter's lock.
pub fn detached<T: Send>(
    py: Python<'_>,
    threads: Option<usize>,
    work: impl FnOnce() -> T + Send,
) -> PyResult<T> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build()
        .map_err(raised)?;
    Ok(py.detach(|| pool.install(work)))
}
