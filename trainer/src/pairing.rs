//! Which noise should become which grasp?

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use pathfinding::kuhn_munkres::kuhn_munkres_min;
use pathfinding::matrix::Matrix;

/// The hand's symmetry: half a turn about the approach direction.
pub fn half_turn() -> UnitQuaternion<f32> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f32::consts::PI)
}

/// The one of two poses equal under the half turn that is nearer in rotation.
pub fn nearer_flip(from: &Isometry3<f32>, to: &Isometry3<f32>) -> Isometry3<f32> {
    let flipped = Isometry3::from_parts(to.translation, to.rotation * half_turn());
    // |w| of the relative quaternion grows as the angle shrinks.
    let nearness = |p: &Isometry3<f32>| from.rotation.coords.dot(&p.rotation.coords).abs();
    if nearness(&flipped) > nearness(to) {
        flipped
    } else {
        *to
    }
}

/// Squared distance as the loss sees it: angle^2 + weight * |translation|^2, the angle up to the
/// half turn.
fn cost(from: &Isometry3<f32>, to: &Isometry3<f32>, unit: f32, weight: f32) -> f32 {
    let to = nearer_flip(from, to);
    let w = from.rotation.coords.dot(&to.rotation.coords).abs().min(1.0);
    let angle = 2.0 * w.acos();
    let way = (to.translation.vector - from.translation.vector) * unit;
    angle * angle + weight * way.norm_squared()
}

/// The grasp of least cost from a pose, in the flip that is nearer.
///
/// # Panics
/// If there is no grasp.
pub fn nearest(
    from: &Isometry3<f32>,
    grasps: &[Isometry3<f32>],
    unit: f32,
    weight: f32,
) -> Isometry3<f32> {
    let best = grasps
        .iter()
        .min_by(|a, b| cost(from, a, unit, weight).total_cmp(&cost(from, b, unit, weight)));
    nearer_flip(from, best.expect("there are grasps"))
}

/// The assignment `noise[i] -> grasps[result[i]]` of least total cost (H. W. Kuhn, 1955).
///
/// `unit` turns translations into the unit of the loss, `weight` is its weight there.
pub fn optimal(
    noise: &[Isometry3<f32>],
    grasps: &[Isometry3<f32>],
    unit: f32,
    weight: f32,
) -> Vec<usize> {
    // Whole numbers: sums are exact, so the optimum does not hang on rounding.
    let costs = Matrix::from_fn(noise.len(), grasps.len(), |(i, j)| {
        (cost(&noise[i], &grasps[j], unit, weight) * 1.0e4) as i64
    });
    kuhn_munkres_min(&costs).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_and_its_half_turn_are_one() {
        let from = Isometry3::identity();
        let to = Isometry3::from_parts(
            Vector3::new(0.1, 0.0, 0.0).into(),
            half_turn() * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.2),
        );
        let near = nearer_flip(&from, &to);
        assert!((near.rotation.angle() - 0.2).abs() < 1e-4);
        assert!((cost(&from, &to, 1.0, 1.0) - (0.04 + 0.01)).abs() < 1e-3);
    }

    #[test]
    fn the_pairing_undoes_a_shuffle() {
        let poses: Vec<_> = (0..9)
            .map(|i| Isometry3::translation(i as f32, 0.0, 0.0))
            .collect();
        let shuffled: Vec<_> = (0..9).map(|i| poses[(i * 4) % 9]).collect();
        let found = optimal(&poses, &shuffled, 1.0, 1.0);
        for (i, j) in found.iter().enumerate() {
            assert_eq!(shuffled[*j], poses[i]);
        }
    }
}
