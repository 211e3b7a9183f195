//! Which axes belong to an object itself, however its mesh happens to stand?

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use parry3d::math::Vector;

use crate::object::Object;

/// Angles tried about each axis: a quarter turn in steps, then finer about the best, degrees.
const COARSE_DEG: f64 = 1.0;
const FINE_DEG: f64 = 0.05;
/// Rounds over the three axes.
const ROUNDS: usize = 3;
/// A turn must save this share of the volume, so that a box that is snug already stays.
const WORTH_TURNING: f64 = 1e-3;
/// Principal axes as the start must beat the mesh's own by this share.
const WORTH_LEAVING: f64 = 1e-2;

impl Object {
    /// Turns the object's axes into those of a box that fits it snugly (`box_from_object`): least volume
    /// as far as turning about one axis after the other finds, from the mesh's own axes and from the
    /// principal axes of inertia. An object whose own box is snug keeps its axes. Which of the box's
    /// axes is which, and their signs, are left open.
    pub fn snug_axes(&self) -> UnitQuaternion<f64> {
        let corners = self.outer_corners();
        let own = descend(&corners, UnitQuaternion::identity());
        let eigen = self.mass.inertia_kg_m2.symmetric_eigen();
        let mut axes: Matrix3<f64> = eigen.eigenvectors.transpose();
        if axes.determinant() < 0.0 {
            axes.row_mut(2).neg_mut();
        }
        let rotation = Rotation3::from_matrix_unchecked(axes);
        let principal = descend(&corners, UnitQuaternion::from_rotation_matrix(&rotation));
        if principal.1 < own.1 * (1.0 - WORTH_LEAVING) {
            principal.0
        } else {
            own.0
        }
    }

    /// Corners of the convex hull about the middle of the box, or all corners of a flat mesh.
    fn outer_corners(&self) -> Vec<Vector3<f64>> {
        let mesh = self.surface.mesh();
        let (low, high) = mesh.bounds();
        let middle = nalgebra::center(&low, &high);
        let local: Vec<Vector3<f64>> = mesh.vertices().iter().map(|v| v - middle).collect();
        let single = |v: &Vector3<f64>| Vector::new(v.x as f32, v.y as f32, v.z as f32);
        let points: Vec<Vector> = local.iter().map(single).collect();
        match parry3d::transformation::try_convex_hull(&points) {
            Ok((hull, _)) => hull
                .iter()
                .map(|p| Vector3::new(p.x, p.y, p.z).map(f64::from))
                .collect(),
            Err(_) => local,
        }
    }
}

/// A snug box reached from some axes, and its volume.
fn descend(corners: &[Vector3<f64>], from: UnitQuaternion<f64>) -> (UnitQuaternion<f64>, f64) {
    let mut axes = from;
    let mut best = volume(corners, &axes);
    for _ in 0..ROUNDS {
        for k in 0..3 {
            let mut axis = Vector3::zeros();
            axis[k] = 1.0;
            let axis = nalgebra::Unit::new_unchecked(axis);
            let turned = |deg: f64| UnitQuaternion::from_axis_angle(&axis, deg.to_radians()) * axes;
            let least = |from: f64, step: f64, count: usize| {
                (0..count)
                    .map(|i| from + step * i as f64)
                    .map(|deg| (volume(corners, &turned(deg)), deg))
                    .min_by(|a, b| a.0.total_cmp(&b.0))
            };
            let coarse = least(-45.0, COARSE_DEG, (90.0 / COARSE_DEG) as usize);
            let fine = coarse.and_then(|(_, deg)| {
                let count = 2 * (COARSE_DEG / FINE_DEG) as usize;
                least(deg - COARSE_DEG, FINE_DEG, count)
            });
            if let Some((smaller, deg)) = fine
                && smaller < best * (1.0 - WORTH_TURNING)
            {
                axes = turned(deg);
                best = smaller;
            }
        }
    }
    (axes, best)
}

fn volume(corners: &[Vector3<f64>], axes: &UnitQuaternion<f64>) -> f64 {
    let matrix = axes.to_rotation_matrix();
    let start = Point3::from(matrix * corners[0]);
    let (low, high) = corners.iter().fold((start, start), |(low, high), c| {
        let p = Point3::from(matrix * c);
        (low.inf(&p), high.sup(&p))
    });
    (high - low).product()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::Family;

    fn size(object: &Object) -> Vector3<f64> {
        let (low, high) = object.surface.mesh().bounds();
        let mut size: Vec<f64> = (high - low).iter().copied().collect();
        size.sort_by(f64::total_cmp);
        Vector3::from_vec(size)
    }

    fn snug(object: &Object) -> Object {
        object.turned(&object.snug_axes())
    }

    #[test]
    fn however_an_object_is_turned_its_snug_box_is_the_same_and_stays() {
        for family in Family::ALL {
            let object = family.member(1).object().unwrap();
            let box_size = size(&snug(&object));
            for (a, b, c) in [(0.3, 1.1, -2.0), (2.0, -0.7, 0.5)] {
                let turn = UnitQuaternion::from_euler_angles(a, b, c);
                let snug_one = snug(&object.turned(&turn));
                let error = (size(&snug_one) - box_size).abs().max();
                assert!(
                    error < 0.05 * box_size.max(),
                    "{}: {:?} {box_size:?}",
                    object.id,
                    size(&snug_one)
                );
                assert_eq!(
                    snug_one.snug_axes(),
                    UnitQuaternion::identity(),
                    "{}",
                    object.id
                );
            }
        }
    }
}
