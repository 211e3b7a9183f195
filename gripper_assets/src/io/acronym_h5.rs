//! ACRONYM's HDF5: `object/*`, `gripper/*`, `grasps/transforms`, `grasps/qualities/flex/*`.

use std::path::Path;

use hdf5_reader::Hdf5File;
use nalgebra::{Matrix3, Point3};

use super::file::{GraspFile, GraspFormat, ObjectReference, Poses, ReadOptions, check_length};
use crate::error::GraspError;
use crate::frame::HandFrame;
use crate::grasp::pose_of_matrix;

const FLEX: &str = "grasps/qualities/flex";

/// Object motions that FleX recorded; one entry per grasp, metres and radians.
///
/// The linear motions are those of the mesh origin, not of the centre of mass (`docs/formats.md`).
#[derive(Debug, Clone, PartialEq)]
pub struct FlexMotions {
    /// While the fingers closed, metres.
    pub closing_linear_m: Vec<f64>,
    /// While the fingers closed, radians.
    pub closing_angular_rad: Vec<f64>,
    /// While the hand shook, metres.
    pub shaking_linear_m: Vec<f64>,
    /// While the hand shook, radians.
    pub shaking_angular_rad: Vec<f64>,
}

/// The motions of a file that has them.
///
/// # Errors
/// An unreadable file or a missing dataset.
pub fn read_motions(path: &Path) -> Result<FlexMotions, GraspError> {
    let h5 = Reader::open(path)?;
    let read = |name: &str| h5.floats(&format!("{FLEX}/object_motion_during_{name}"));
    Ok(FlexMotions {
        closing_linear_m: read("closing_linear")?,
        closing_angular_rad: read("closing_angular")?,
        shaking_linear_m: read("shaking_linear")?,
        shaking_angular_rad: read("shaking_angular")?,
    })
}

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<GraspFile, GraspError> {
    let h5 = Reader::open(path)?;
    let shape = h5.shape("grasps/transforms")?;
    let [n, 4, 4] = shape[..] else {
        return Err(h5.bad(
            "grasps/transforms",
            format!("its shape is {shape:?}, not [N, 4, 4]"),
        ));
    };
    let transforms = if n == 0 {
        Vec::new()
    } else {
        h5.floats("grasps/transforms")?
    };
    let mut poses = Poses::new(path, options.frame.unwrap_or(HandFrame::Acronym), options);
    for (i, m) in transforms.chunks_exact(16).enumerate() {
        let rows: [[f64; 4]; 4] = std::array::from_fn(|r| std::array::from_fn(|c| m[4 * r + c]));
        poses.push(pose_of_matrix(&rows), || format!("grasps/transforms[{i}]"))?;
    }
    let label_path = format!("{FLEX}/object_in_gripper");
    if n > 0 && h5.has(&label_path) {
        let labels = h5.integers(&label_path)?;
        check_length(path, &label_path, labels.len(), poses.grasps.len())?;
        for (grasp, label) in poses.grasps.iter_mut().zip(labels) {
            grasp.label = Some(label != 0);
        }
    }
    if let Some(q) = h5
        .optional_floats("gripper/configuration")?
        .and_then(|q| q.first().copied())
    {
        for grasp in &mut poses.grasps {
            grasp.width_m = Some(2.0 * q);
        }
    }
    let number = |name: &str| -> Result<Option<f64>, GraspError> {
        Ok(h5
            .optional_floats(&format!("object/{name}"))?
            .and_then(|v| v.first().copied()))
    };
    let com = h5.optional_floats("object/com")?;
    // The file stores +integral(x y dm) off the diagonal; the inertia tensor has the minus.
    let inertia = h5.optional_floats("object/inertia")?.map(|v| {
        Matrix3::from_fn(|i, j| {
            let x = v.get(3 * i + j).copied().unwrap_or(f64::NAN);
            if i == j { x } else { -x }
        })
    });
    let object = ObjectReference {
        mesh: h5.optional_string("object/file")?,
        scale: number("scale")?,
        mass_kg: number("mass")?,
        density_kg_m3: number("density")?,
        friction: number("friction")?,
        volume_m3: number("volume")?,
        com_m: com
            .filter(|v| v.len() == 3)
            .map(|v| Point3::new(v[0], v[1], v[2])),
        inertia_kg_m2: inertia.filter(|m| m.iter().all(|x| x.is_finite())),
    };
    let gripper = h5
        .optional_string("gripper/type")?
        .map(|g| match g.as_str() {
            "panda" => "franka_panda".to_owned(),
            _ => g,
        });
    Ok(poses.finish(GraspFormat::AcronymH5, gripper, object))
}

struct Reader<'a> {
    path: &'a Path,
    file: Hdf5File,
}

impl<'a> Reader<'a> {
    fn open(path: &'a Path) -> Result<Self, GraspError> {
        let bytes = std::fs::read(path).map_err(|e| GraspError::io(path, e))?;
        let file = Hdf5File::from_vec(bytes).map_err(|e| {
            GraspError::bad(
                path,
                "header",
                e.to_string(),
                "the file is truncated or not HDF5",
            )
        })?;
        Ok(Self { path, file })
    }

    fn bad(&self, place: &str, what: String) -> GraspError {
        GraspError::bad(
            self.path,
            place,
            what,
            "the layout of ACRONYM is expected (docs/formats.md)",
        )
    }

    fn has(&self, name: &str) -> bool {
        self.file.dataset(name).is_ok()
    }

    fn dataset(&self, name: &str) -> Result<hdf5_reader::Dataset, GraspError> {
        self.file
            .dataset(name)
            .map_err(|e| self.bad(name, e.to_string()))
    }

    fn shape(&self, name: &str) -> Result<Vec<u64>, GraspError> {
        Ok(self.dataset(name)?.shape().to_vec())
    }

    fn floats(&self, name: &str) -> Result<Vec<f64>, GraspError> {
        let dataset = self.dataset(name)?;
        let values = dataset
            .read_array::<f64>()
            .map(|a| a.iter().copied().collect())
            .or_else(|_| {
                dataset
                    .read_array::<f32>()
                    .map(|a| a.iter().map(|&x| f64::from(x)).collect())
            });
        values.map_err(|e| self.bad(name, e.to_string()))
    }

    fn optional_floats(&self, name: &str) -> Result<Option<Vec<f64>>, GraspError> {
        if self.has(name) {
            self.floats(name).map(Some)
        } else {
            Ok(None)
        }
    }

    /// Integers of any of the types that files use for a flag.
    fn integers(&self, name: &str) -> Result<Vec<i64>, GraspError> {
        let dataset = self.dataset(name)?;
        let values = dataset
            .read_array::<i64>()
            .map(|a| a.iter().copied().collect())
            .or_else(|_| {
                dataset
                    .read_array::<i32>()
                    .map(|a| a.iter().map(|&x| x.into()).collect())
            })
            .or_else(|_| {
                dataset
                    .read_array::<i8>()
                    .map(|a| a.iter().map(|&x| x.into()).collect())
            })
            .or_else(|_| {
                dataset
                    .read_array::<u8>()
                    .map(|a| a.iter().map(|&x| x.into()).collect())
            });
        values.map_err(|e| self.bad(name, e.to_string()))
    }

    fn optional_string(&self, name: &str) -> Result<Option<String>, GraspError> {
        if !self.has(name) {
            return Ok(None);
        }
        self.dataset(name)?
            .read_string()
            .map(|s| Some(s.trim_end_matches('\0').to_owned()))
            .map_err(|e| self.bad(name, e.to_string()))
    }
}
