//! The border between f64 nalgebra (ours) and f32 glam (rapier's).

use crate::rapier::math::{Pose, Real, Rotation, Vector};
use crate::rapier::prelude::MassProperties;
use nalgebra::{Isometry3, Matrix3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

pub(crate) fn vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x as Real, v.y as Real, v.z as Real)
}

pub(crate) fn point(p: &Point3<f64>) -> Vector {
    vector(&p.coords)
}

pub(crate) fn from_vector(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x.into(), v.y.into(), v.z.into())
}

pub(crate) fn rotation(q: &UnitQuaternion<f64>) -> Rotation {
    let q = q.coords;
    Rotation::from_xyzw(q.x as Real, q.y as Real, q.z as Real, q.w as Real)
}

pub(crate) fn pose(p: &Isometry3<f64>) -> Pose {
    Pose::from_parts(vector(&p.translation.vector), rotation(&p.rotation))
}

pub(crate) fn from_pose(p: &Pose) -> Isometry3<f64> {
    let (t, r) = (p.translation, p.rotation);
    let q = Quaternion::new(r.w.into(), r.x.into(), r.y.into(), r.z.into());
    Isometry3::from_parts(
        Translation3::from(from_vector(t)),
        UnitQuaternion::from_quaternion(q),
    )
}

/// The least principal moment of a real body as a share of the largest.
const LEAST_MOMENT: f64 = 1e-4;

/// Principal moments of inertia, none too small, and their axes. Found in f64: a tensor of
/// 1e-6 kg m2 has no digits to lose in f32.
fn principal(inertia_kg_m2: &Matrix3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
    let symmetric = (inertia_kg_m2 + inertia_kg_m2.transpose()) / 2.0;
    let mut eigen = symmetric.symmetric_eigen();
    if eigen.eigenvectors.determinant() < 0.0 {
        eigen.eigenvectors.swap_columns(1, 2);
        eigen.eigenvalues.swap_rows(1, 2);
    }
    let floor = eigen.eigenvalues.max() * LEAST_MOMENT;
    (eigen.eigenvalues.map(|x| x.max(floor)), eigen.eigenvectors)
}

/// The tensor itself, or the nearest that no engine stumbles over.
pub(crate) fn sound_inertia(inertia_kg_m2: &Matrix3<f64>) -> Matrix3<f64> {
    let (moments, axes) = principal(inertia_kg_m2);
    if moments.min() > moments.max() * LEAST_MOMENT {
        return *inertia_kg_m2;
    }
    axes * Matrix3::from_diagonal(&moments) * axes.transpose()
}

/// Mass properties about `com`, in the body frame.
pub(crate) fn mass_properties(
    com: &Point3<f64>,
    mass_kg: f64,
    inertia_kg_m2: &Matrix3<f64>,
) -> MassProperties {
    let (moments, axes) = principal(inertia_kg_m2);
    let axes = nalgebra::Rotation3::from_matrix_unchecked(axes);
    MassProperties::with_principal_inertia_frame(
        point(com),
        mass_kg as Real,
        vector(&moments),
        rotation(&UnitQuaternion::from_rotation_matrix(&axes)),
    )
}
