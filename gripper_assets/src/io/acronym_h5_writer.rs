//! Writes ACRONYM's HDF5: every dataset of its files, with their names, types and shapes.

use std::fs;
use std::path::Path;

use hdf5_pure::FileBuilder;
use nalgebra::Isometry3;

use super::acronym_h5::FlexMotions;
use super::file::ObjectReference;
use crate::error::GraspError;

/// Labelled grasps of one object.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelledGrasps {
    /// The object; mesh path relative to the data set's root, scale, mass, density, friction,
    /// volume, centre of mass and inertia must be there.
    pub object: ObjectReference,
    /// Distance of each finger from the hand's axis before closing, metres.
    pub finger_m: f64,
    /// `object_from_hand`, ACRONYM frame.
    pub poses: Vec<Isometry3<f64>>,
    /// Did the grasp hold?
    pub labels: Vec<bool>,
    /// How the object moved in the hand; NaN where a trial did not come so far.
    pub motions: FlexMotions,
}

/// Writes the file whole or not at all.
///
/// # Errors
/// A property of the object that is missing, or a path that cannot be written.
///
/// # Panics
/// If the lists differ in length.
pub fn write_labelled(path: &Path, grasps: &LabelledGrasps) -> Result<(), GraspError> {
    let n = grasps.poses.len() as u64;
    let o = &grasps.object;
    let missing =
        |what: &str| GraspError::bad(path, format!("object/{what}"), "it is not known", "give it");
    let mesh = o.mesh.as_deref().ok_or_else(|| missing("file"))?;
    let mut file = FileBuilder::new();
    let mut object = file.create_group("object");
    object
        .create_dataset("file")
        .with_vlen_strings(&[mesh])
        .with_shape(&[]);
    let scalars = [
        ("scale", o.scale),
        ("mass", o.mass_kg),
        ("density", o.density_kg_m3),
        ("friction", o.friction),
        ("volume", o.volume_m3),
    ];
    for (name, value) in scalars {
        let value = value.ok_or_else(|| missing(name))?;
        object
            .create_dataset(name)
            .with_f64_data(&[value])
            .with_shape(&[]);
    }
    let com = o.com_m.ok_or_else(|| missing("com"))?;
    object
        .create_dataset("com")
        .with_f64_data(com.coords.as_slice())
        .with_shape(&[3]);
    // ACRONYM stores products of inertia with the other sign (docs/formats.md).
    let inertia = o.inertia_kg_m2.ok_or_else(|| missing("inertia"))?;
    let stored: Vec<f64> = (0..9)
        .map(|i| {
            let (r, c) = (i / 3, i % 3);
            if r == c {
                inertia[(r, c)]
            } else {
                -inertia[(r, c)]
            }
        })
        .collect();
    object
        .create_dataset("inertia")
        .with_f64_data(&stored)
        .with_shape(&[3, 3]);
    file.add_group(object.finish());
    let mut gripper = file.create_group("gripper");
    gripper
        .create_dataset("type")
        .with_vlen_strings(&["panda"])
        .with_shape(&[]);
    gripper
        .create_dataset("configuration")
        .with_f64_data(&[grasps.finger_m])
        .with_shape(&[1]);
    file.add_group(gripper.finish());
    let transforms: Vec<f64> = grasps
        .poses
        .iter()
        .flat_map(|p| {
            let m = p.to_homogeneous();
            (0..16).map(move |i| m[(i / 4, i % 4)])
        })
        .collect();
    let mut all = file.create_group("grasps");
    all.create_dataset("transforms")
        .with_f64_data(&transforms)
        .with_shape(&[n, 4, 4]);
    let mut qualities = all.create_group("qualities");
    let mut flex = qualities.create_group("flex");
    let labels: Vec<i64> = grasps.labels.iter().map(|l| i64::from(*l)).collect();
    flex.create_dataset("object_in_gripper")
        .with_i64_data(&labels)
        .with_shape(&[n]);
    let m = &grasps.motions;
    for (name, values) in [
        ("closing_linear", &m.closing_linear_m),
        ("closing_angular", &m.closing_angular_rad),
        ("shaking_linear", &m.shaking_linear_m),
        ("shaking_angular", &m.shaking_angular_rad),
    ] {
        assert_eq!(values.len() as u64, n, "{name}");
        flex.create_dataset(&format!("object_motion_during_{name}"))
            .with_f64_data(values)
            .with_shape(&[n]);
    }
    qualities.add_group(flex.finish());
    all.add_group(qualities.finish());
    file.add_group(all.finish());
    let new = path.with_extension("part");
    let bad = |what: String| GraspError::bad(path, "file", what, "choose another directory");
    let bytes = file.finish().map_err(|e| bad(e.to_string()))?;
    fs::write(&new, bytes)
        .and_then(|()| fs::rename(&new, path))
        .map_err(|e| bad(format!("cannot be written: {e}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::acronym_h5::read_motions;
    use crate::{ReadOptions, read_grasps};
    use nalgebra::{Matrix3, Point3, Translation3, UnitQuaternion};

    #[test]
    fn what_is_written_comes_back_through_the_reader() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("Mug_1.h5");
        let pose = |i: i32| {
            let turn = UnitQuaternion::from_euler_angles(0.1 * f64::from(i), 0.2, -0.3);
            Isometry3::from_parts(Translation3::new(0.01 * f64::from(i), 0.0, 0.1), turn)
        };
        let inertia = Matrix3::new(3e-4, 1e-5, -2e-5, 1e-5, 4e-4, 3e-5, -2e-5, 3e-5, 5e-4);
        let grasps = LabelledGrasps {
            object: ObjectReference {
                mesh: Some("meshes/Mug_1.obj".into()),
                scale: Some(1.0),
                mass_kg: Some(0.12),
                density_kg_m3: Some(150.0),
                friction: Some(1.0),
                volume_m3: Some(8e-4),
                com_m: Some(Point3::new(0.01, -0.02, 0.03)),
                inertia_kg_m2: Some(inertia),
            },
            finger_m: 0.04,
            poses: (0..5).map(pose).collect(),
            labels: vec![true, false, true, true, false],
            motions: FlexMotions {
                closing_linear_m: vec![0.001; 5],
                closing_angular_rad: vec![0.02; 5],
                shaking_linear_m: vec![0.003, f64::NAN, 0.0, 0.0, 1.5],
                shaking_angular_rad: vec![0.0; 5],
            },
        };
        write_labelled(&path, &grasps).unwrap();
        let back = read_grasps(&path, &ReadOptions::default()).unwrap();
        assert_eq!(back.object.mesh.as_deref(), Some("meshes/Mug_1.obj"));
        let found = back.object.inertia_kg_m2.unwrap();
        assert!((found - inertia).norm() < 1e-18);
        let labels: Vec<_> = back.grasps.iter().map(|g| g.label.unwrap()).collect();
        assert_eq!(labels, grasps.labels);
        for (a, b) in back.grasps.iter().zip(&grasps.poses) {
            assert!((a.object_from_hand.to_homogeneous() - b.to_homogeneous()).norm() < 1e-12);
        }
        let motions = read_motions(&path).unwrap();
        assert_eq!(motions.shaking_linear_m[4], 1.5);
        assert!(motions.shaking_linear_m[1].is_nan());
        let mut unknown = grasps;
        unknown.object.volume_m3 = None;
        let error = write_labelled(&path, &unknown).unwrap_err().to_string();
        assert!(error.contains("object/volume"), "{error}");
    }
}
