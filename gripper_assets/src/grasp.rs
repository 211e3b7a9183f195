//! A grasp: where a hand is on an object, and what its maker said of it.

use nalgebra::{Isometry3, Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};

/// Largest deviation of `R^T R` from the identity, or of a quaternion's norm from 1, that counts
/// as drift and is mended. Beyond it the numbers are something else than a rotation.
pub const ROTATION_TOLERANCE: f64 = 1.0e-3;

/// Drift below this is rounding and is not counted (f32 files reach 3e-7).
pub const ROTATION_ROUNDING: f64 = 1.0e-6;

/// Pose of a hand on an object, with what came along.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grasp {
    /// Number within its object, the key that pairs runs. Readers count from 0 in file order.
    pub index: u64,
    /// Pose of the ACRONYM hand frame in the object frame, metres.
    pub object_from_hand: Isometry3<f64>,
    /// Opening between the pads before closing, metres; the hand's maximum if unknown.
    pub width_m: Option<f64>,
    /// Higher is better, in the maker's units.
    pub score: Option<f64>,
    /// Did it hold, according to the file?
    pub label: Option<bool>,
}

impl Grasp {
    /// A bare pose.
    pub fn new(index: u64, object_from_hand: Isometry3<f64>) -> Self {
        Self {
            index,
            object_from_hand,
            width_m: None,
            score: None,
            label: None,
        }
    }
}

/// The pose of a row-major homogeneous matrix and whether drift was mended.
///
/// # Errors
/// Says what makes the numbers no rigid motion.
pub fn pose_of_matrix(rows: &[[f64; 4]; 4]) -> Result<(Isometry3<f64>, bool), String> {
    if !rows.iter().flatten().all(|x| x.is_finite()) {
        return Err("a number of the transform is not finite".into());
    }
    if rows[3] != [0.0, 0.0, 0.0, 1.0] {
        return Err(format!("the last row is {:?}, not 0 0 0 1", rows[3]));
    }
    let r = Matrix3::from_fn(|i, j| rows[i][j]);
    let drift = (r.transpose() * r - Matrix3::identity()).amax();
    if drift > ROTATION_TOLERANCE || r.determinant() <= 0.0 {
        return Err(format!(
            "not a rotation: |R^T R - 1| = {drift:.2e} (tolerance {ROTATION_TOLERANCE:.0e}), determinant {:.3}",
            r.determinant()
        ));
    }
    let rotation = if drift == 0.0 {
        Rotation3::from_matrix_unchecked(r)
    } else {
        let svd = r.svd(true, true);
        let (u, vt) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
        Rotation3::from_matrix_unchecked(u * vt)
    };
    let translation = Translation3::new(rows[0][3], rows[1][3], rows[2][3]);
    let pose = Isometry3::from_parts(translation, UnitQuaternion::from_rotation_matrix(&rotation));
    Ok((pose, drift > ROTATION_ROUNDING))
}

/// The pose of a position and an xyzw quaternion and whether drift was mended.
///
/// # Errors
/// Says what makes the numbers no rigid motion.
pub fn pose_of_quaternion(
    position: [f64; 3],
    [x, y, z, w]: [f64; 4],
) -> Result<(Isometry3<f64>, bool), String> {
    let q = Quaternion::new(w, x, y, z);
    if !position
        .iter()
        .chain(q.coords.iter())
        .all(|v| v.is_finite())
    {
        return Err("a number of the pose is not finite".into());
    }
    let drift = (q.norm() - 1.0).abs();
    if drift > ROTATION_TOLERANCE {
        return Err(format!(
            "not a rotation: the quaternion's norm is {:.4} (tolerance {ROTATION_TOLERANCE:.0e})",
            q.norm()
        ));
    }
    let rotation = if drift <= f64::EPSILON * 4.0 {
        UnitQuaternion::new_unchecked(q)
    } else {
        UnitQuaternion::from_quaternion(q)
    };
    let translation = Translation3::from(Vector3::from(position));
    Ok((
        Isometry3::from_parts(translation, rotation),
        drift > ROTATION_ROUNDING,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(m: &nalgebra::Matrix4<f64>) -> [[f64; 4]; 4] {
        std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)]))
    }

    #[test]
    fn drift_is_mended_and_told_while_shear_scale_and_mirror_are_refused() {
        let pose = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.3, 0.2, -1.0));
        let m = pose.to_homogeneous();
        let (clean, mended) = pose_of_matrix(&rows(&m)).unwrap();
        assert!(!mended && (clean.to_homogeneous() - m).norm() < 1e-14);

        let mut drifted = m;
        drifted[(0, 1)] += 1e-4;
        let (p, mended) = pose_of_matrix(&rows(&drifted)).unwrap();
        let r = p.rotation.to_rotation_matrix();
        assert!(
            mended && (r.matrix().transpose() * r.matrix() - Matrix3::identity()).amax() < 1e-14
        );

        type Change = fn(&mut nalgebra::Matrix4<f64>);
        let changes: [Change; 5] = [
            |m| m[(0, 1)] += 0.01,
            |m| m.fixed_view_mut::<3, 3>(0, 0).scale_mut(1.01),
            |m| m.fixed_view_mut::<3, 1>(0, 0).neg_mut(),
            |m| m[(3, 3)] = 2.0,
            |m| m[(1, 3)] = f64::NAN,
        ];
        for change in changes {
            let mut bad = m;
            change(&mut bad);
            assert!(pose_of_matrix(&rows(&bad)).is_err());
        }
    }

    #[test]
    fn a_quaternion_off_unit_norm_is_refused() {
        assert!(pose_of_quaternion([0.0; 3], [0.0, 0.0, 0.0, 1.0]).is_ok());
        assert!(
            pose_of_quaternion([0.0; 3], [0.0, 0.0, 0.0, 1.0001])
                .unwrap()
                .1
        );
        assert!(pose_of_quaternion([0.0; 3], [0.0, 0.0, 0.0, 1.1]).is_err());
        assert!(pose_of_quaternion([f64::NAN, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]).is_err());
    }
}
