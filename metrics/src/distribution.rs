//! Are the drawn grasps spread as the good ones are? Earth mover's distances between two sets of
//! poses, each beside the distance of two halves of the reference from each other.

use nalgebra::Isometry3;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use wide::f32x8;

use crate::assignment::least_cost;

/// Poses of each set that are compared, at most.
pub const SIZE_MAX: usize = 400;

/// Four distances between two sets of poses: exact assignments, mean cost of a pair. Rotations are
/// compared up to the hand's half turn about its approach.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Distances {
    /// W1 of the translations, metres.
    pub w1_translation_m: f64,
    /// W1 of the rotations (geodesic angle), radians.
    pub w1_rotation_rad: f64,
    /// SE(3)-DiffusionFields' cost: |dp| (m) + 1 - cos(theta).
    pub emd_se3dif: f64,
    /// EquiGraspFlow's cost: sqrt(theta^2 + |dp|^2), rad and m.
    pub emd_equigraspflow: f64,
}

/// One of the distances.
pub type Part = fn(&Distances) -> f64;

/// The distances with their names for tables.
pub const DISTANCES: [(&str, Part); 4] = [
    ("W1 translation, m", |d| d.w1_translation_m),
    ("W1 rotation, rad", |d| d.w1_rotation_rad),
    ("EMD, SE(3)-DiffusionFields", |d| d.emd_se3dif),
    ("EMD, EquiGraspFlow", |d| d.emd_equigraspflow),
];

/// The block of `summary.json`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Distribution {
    /// Drawn grasps against the reference.
    #[serde(flatten)]
    pub drawn: Distances,
    /// One half of the reference against the other, of the same size.
    pub floor: Distances,
    /// Poses of each set, mean over the objects.
    pub n: f64,
    /// Share of the reference within 2 cm of a drawn grasp over the number drawn, area under that
    /// curve.
    pub coverage_auc: Option<f64>,
}

fn way(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    (a.translation.vector - b.translation.vector).norm()
}

fn angle(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    // Half a turn about z maps (x, y, z, w) to (y, -x, w, -z): the nearer of both poses counts.
    let (p, q) = (a.rotation.coords, b.rotation.coords);
    let flipped = nalgebra::Vector4::new(q.y, -q.x, q.w, -q.z);
    let w = p.dot(&q).abs().max(p.dot(&flipped).abs());
    2.0 * w.min(1.0).acos()
}

/// [`angle`] of every pair, row by row, eight at once: twice the arc over the chord of two unit
/// quaternions, which loses no digits where both are close.
fn angles(a: &[Isometry3<f64>], b: &[Isometry3<f64>]) -> Vec<f32> {
    let coordinates = |poses: &[Isometry3<f64>]| -> [f32x8; 4] {
        std::array::from_fn(|k| {
            let of = |i: usize| poses[i.min(poses.len() - 1)].rotation.coords[k] as f32;
            f32x8::from(std::array::from_fn::<f32, 8, _>(of))
        })
    };
    let blocks: Vec<[f32x8; 4]> = b.chunks(8).map(coordinates).collect();
    let mut all = Vec::with_capacity(a.len() * (b.len() + 8));
    for pose in a {
        let [x, y, z, w] = coordinates(std::slice::from_ref(pose));
        let start = all.len();
        for q in &blocks {
            let square = |p: [f32x8; 4]| -> f32x8 {
                let (mut minus, mut plus) = (f32x8::ZERO, f32x8::ZERO);
                for k in 0..4 {
                    minus += (p[k] - q[k]) * (p[k] - q[k]);
                    plus += (p[k] + q[k]) * (p[k] + q[k]);
                }
                minus.min(plus)
            };
            let chord = square([x, y, z, w]).min(square([y, -x, w, -z])).sqrt();
            let half = (chord * f32x8::splat(0.5)).min(f32x8::ONE);
            all.extend((half.asin() * f32x8::splat(4.0)).to_array());
        }
        all.truncate(start + b.len());
    }
    all
}

/// Mean cost of a pair in the pairing of least total cost.
fn mean_cost(
    a: &[Isometry3<f64>],
    b: &[Isometry3<f64>],
    cost: impl Fn(&Isometry3<f64>, &Isometry3<f64>) -> f64,
) -> f64 {
    let mut costs: Vec<f32> = Vec::with_capacity(a.len() * b.len());
    for a in a {
        costs.extend(b.iter().map(|b| cost(a, b) as f32));
    }
    mean_of_least(&costs, a.len())
}

fn mean_of_least(costs: &[f32], n: usize) -> f64 {
    let pairs = least_cost(costs, n);
    let sum: f64 = pairs
        .iter()
        .enumerate()
        .map(|(i, j)| f64::from(costs[i * n + j]))
        .sum();
    sum / n as f64
}

/// W1 of the translations, metres.
///
/// # Panics
/// If the sizes differ.
pub fn w1_translation_m(a: &[Isometry3<f64>], b: &[Isometry3<f64>]) -> f64 {
    assert_eq!(a.len(), b.len());
    mean_cost(a, b, way)
}

/// W1 of the rotations (geodesic angle up to the hand's half turn), radians.
///
/// # Panics
/// If the sizes differ.
pub fn w1_rotation_rad(a: &[Isometry3<f64>], b: &[Isometry3<f64>]) -> f64 {
    assert_eq!(a.len(), b.len());
    mean_of_least(&angles(a, b), a.len())
}

/// The four distances of two sets of the same size, which is not 0.
///
/// # Panics
/// If the sizes differ.
pub fn distances(a: &[Isometry3<f64>], b: &[Isometry3<f64>]) -> Distances {
    assert_eq!(a.len(), b.len());
    Distances {
        w1_translation_m: w1_translation_m(a, b),
        w1_rotation_rad: w1_rotation_rad(a, b),
        emd_se3dif: mean_cost(a, b, |a, b| way(a, b) + 1.0 - angle(a, b).cos()),
        emd_equigraspflow: mean_cost(a, b, |a, b| way(a, b).hypot(angle(a, b))),
    }
}

/// Drawn grasps of one object against its reference; `None` if either has fewer than two.
///
/// Poses should be those of the tcp, where an error of angle moves nothing. Subsets are drawn at
/// random from a fixed stream.
pub fn of_object(drawn: &[Isometry3<f64>], reference: &[Isometry3<f64>]) -> Option<Distribution> {
    let n = drawn.len().min(reference.len() / 2).min(SIZE_MAX);
    if n < 2 {
        return None;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(0x6469_7374);
    let mut shuffled = reference.to_vec();
    for i in (1..shuffled.len()).rev() {
        shuffled.swap(i, rng.random_range(0..=i));
    }
    let (one, other) = (&shuffled[..n], &shuffled[n..2 * n]);
    Some(Distribution {
        drawn: distances(&drawn[..n], one),
        floor: distances(other, one),
        n: n as f64,
        coverage_auc: Some(coverage_auc(&drawn[..n], one)),
    })
}

/// Mean over k = 1..=n of the share of the reference within 2 cm of one of the first k grasps.
fn coverage_auc(drawn: &[Isometry3<f64>], reference: &[Isometry3<f64>]) -> f64 {
    const REACH_M: f64 = 0.02;
    let total: usize = reference
        .iter()
        .map(|r| {
            let near = |d: &Isometry3<f64>| {
                (d.translation.vector - r.translation.vector).norm() <= REACH_M
            };
            drawn.iter().position(near).map_or(0, |k| drawn.len() - k)
        })
        .sum();
    total as f64 / (drawn.len() * reference.len()) as f64
}

/// Means over objects; `None` without any.
pub fn mean(objects: &[Distribution]) -> Option<Distribution> {
    if objects.is_empty() {
        return None;
    }
    let over = |f: &dyn Fn(&Distribution) -> f64| {
        objects.iter().map(f).sum::<f64>() / objects.len() as f64
    };
    let each = |part: &dyn Fn(&Distribution) -> Distances| Distances {
        w1_translation_m: over(&|d| part(d).w1_translation_m),
        w1_rotation_rad: over(&|d| part(d).w1_rotation_rad),
        emd_se3dif: over(&|d| part(d).emd_se3dif),
        emd_equigraspflow: over(&|d| part(d).emd_equigraspflow),
    };
    Some(Distribution {
        drawn: each(&|d| d.drawn),
        floor: each(&|d| d.floor),
        n: over(&|d| d.n),
        coverage_auc: Some(over(&|d| d.coverage_auc.unwrap_or(0.0))),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    #[test]
    fn angles_of_eight_pairs_at_once_are_those_of_one() {
        let pose = |i: usize| {
            let i = i as f64;
            let turn = UnitQuaternion::from_euler_angles(i, 2.3 * i, 0.7 * i * i);
            Isometry3::from_parts(Translation3::identity(), turn)
        };
        let a: Vec<_> = (0..13).map(pose).collect();
        let mut b: Vec<_> = (5..24).map(pose).collect();
        b[3].rotation *= UnitQuaternion::from_euler_angles(0.0, 0.0, 1e-4);
        let all = angles(&a, &b);
        assert_eq!(all.len(), a.len() * b.len());
        for (i, a) in a.iter().enumerate() {
            for (j, b_j) in b.iter().enumerate() {
                let (one, many) = (angle(a, b_j), f64::from(all[i * b.len() + j]));
                assert!((one - many).abs() < 2e-6, "{one} {many}");
            }
        }
    }

    fn pose(x: f64, turn: f64) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::new(x, 0.0, 0.0),
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), turn),
        )
    }

    #[test]
    fn a_set_moved_by_a_little_is_that_far_away_and_half_a_turn_is_none() {
        let a: Vec<_> = (0..20).map(|i| pose(0.1 * f64::from(i), 0.3)).collect();
        let half = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
        let b: Vec<_> = a
            .iter()
            .rev()
            .map(|p| Translation3::new(0.0, 0.01, 0.0) * p * half)
            .collect();
        let d = distances(&a, &b);
        assert!((d.w1_translation_m - 0.01).abs() < 1e-6);
        assert!(d.w1_rotation_rad < 1e-3, "{}", d.w1_rotation_rad);
        let turned: Vec<_> = (0..20).map(|i| pose(0.1 * f64::from(i), 0.5)).collect();
        let d = distances(&a, &turned);
        assert!((d.w1_rotation_rad - 0.2).abs() < 1e-3);
        assert!((d.emd_equigraspflow - 0.2).abs() < 1e-3);
        assert!((d.emd_se3dif - (1.0 - 0.2f64.cos())).abs() < 1e-3);
    }

    #[test]
    fn the_same_set_has_full_coverage_from_the_first_on() {
        let same = vec![pose(0.0, 0.0); 10];
        assert_eq!(coverage_auc(&same, &same), 1.0);
        let far = vec![pose(1.0, 0.0); 10];
        assert_eq!(coverage_auc(&far, &same), 0.0);
        assert!(of_object(&same[..1], &same).is_none());
    }
}
