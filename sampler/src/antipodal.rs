//! Which poses put the pads on opposite sides of the object? The baseline without a model.
//!
//! As ACRONYM's candidates were made (C. Eppner, A. Mousavian, D. Fox, ICRA 2021, section III): a
//! point drawn uniformly on the surface, a ray drawn in the friction cone about the inward normal,
//! its exit as second contact; the hand is centred between both, turned by a random angle about
//! the closing axis and moved along the approach so that the contacts lie on the pads. Poses whose
//! open hand meets the object are drawn again.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use shakedown_gripper_assets::{Grasp, Gripper};
use shakedown_objects::penetration::{Intruder, Intruders, penetration_m};
use shakedown_objects::{ConvexBody, Object, Surface};

use crate::seed;

/// How candidates are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AntipodalSettings {
    /// Half angle of the cone about the inward normal at the first contact, radians.
    pub cone_rad: f64,
    /// Half angle of the cone that the ray must keep about the outward normal where it leaves, radians.
    pub exit_cone_rad: f64,
    /// Added to the heights between which the contacts may lie, which are those of the pads, metres along the
    /// approach.
    pub height_shift_m: [f64; 2],
    /// Free space on each side of the object before closing, metres.
    pub clearance_m: f64,
    /// Draws per candidate before it is given up.
    pub attempts: u32,
}

impl Default for AntipodalSettings {
    /// Cones of 30 degrees, contacts on the pads, 1 mm of clearance, 500 draws.
    fn default() -> Self {
        Self {
            cone_rad: 30f64.to_radians(),
            exit_cone_rad: 30f64.to_radians(),
            height_shift_m: [0.0; 2],
            clearance_m: 0.001,
            attempts: 500,
        }
    }
}

impl AntipodalSettings {
    /// As ACRONYM's candidates lie, good and bad together: any exit will do, and contacts reach from 12 mm before the
    /// pads to 8 mm short of the fingertips. Fitted to 20 of its objects (every fifth of `seen`): distances of
    /// 200 candidates 1.34, 1.11, 1.17 and 1.10 times their floors (W1 of translations and rotations, both EMDs); the
    /// default has 1.86, 1.23, 1.46 and 1.23. On ten others the EMD of SE(3)-DiffusionFields is 1.14, the default's 1.26
    /// (`tests/tests/acronym.rs`).
    pub fn like_acronym() -> Self {
        Self {
            cone_rad: 20f64.to_radians(),
            exit_cone_rad: 89f64.to_radians(),
            height_shift_m: [-0.012, -0.008],
            ..Self::default()
        }
    }
}

/// Up to `count` collision-free antipodal grasps of the object, in the order of their numbers.
///
/// Fewer come back when a candidate finds no free pose within its attempts: the object is too big
/// or too enclosed. Candidate `i` depends on seed, object id, hand and `i` alone. Its score is the
/// cosine of the worse contact angle.
pub fn sample_antipodal(
    object: &Object,
    gripper: &Gripper,
    count: u64,
    run_seed: u64,
    settings: &AntipodalSettings,
) -> Vec<Grasp> {
    let hand = Intruders::new(
        gripper
            .parts_at(gripper.opening_max_m)
            .iter()
            .filter_map(|(_, corners)| ConvexBody::hull(corners))
            .map(Intruder::new)
            .collect(),
    );
    let areas = cumulative_areas(&object.surface);
    (0..count)
        .filter_map(|index| {
            let mut rng = seed::stream(run_seed, "antipodal-v1", &object.id, &gripper.name, index);
            (0..settings.attempts)
                .find_map(|_| draw(&object.surface, gripper, &hand, &areas, settings, &mut rng))
                .map(|(pose, score)| Grasp {
                    score: Some(score),
                    width_m: Some(gripper.opening_max_m),
                    ..Grasp::new(index, pose)
                })
        })
        .collect()
}

fn cumulative_areas(surface: &Surface) -> Vec<f64> {
    let mesh = surface.mesh();
    let mut sum = 0.0;
    (0..mesh.faces().len())
        .map(|i| {
            let [a, b, c] = mesh.triangle(i);
            sum += (b - a).cross(&(c - a)).norm() / 2.0;
            sum
        })
        .collect()
}

fn draw(
    surface: &Surface,
    gripper: &Gripper,
    hand: &Intruders,
    areas: &[f64],
    settings: &AntipodalSettings,
    rng: &mut ChaCha8Rng,
) -> Option<(Isometry3<f64>, f64)> {
    let (face, first) = surface_point(surface, areas, rng);
    let inward = -surface.face_normal(face);
    let direction = in_cone(&inward, settings.cone_rad, rng);
    // Any exit may be the second contact: the near wall of a cup or the far one.
    let exits: Vec<(f64, f64)> = surface
        .ray_hits(&first, &direction)
        .into_iter()
        .map(|(t, f)| (t, surface.face_normal(f).dot(&direction)))
        .filter(|&(t, cosine)| {
            t > 1e-6
                && cosine >= settings.exit_cone_rad.cos()
                && t + 2.0 * settings.clearance_m <= gripper.opening_max_m
        })
        .collect();
    if exits.is_empty() {
        return None;
    }
    let (width, exit_cosine) = exits[rng.random_range(0..exits.len())];
    let middle = first + direction * (width / 2.0);
    let closing = if rng.random::<bool>() {
        direction
    } else {
        -direction
    };
    let approach = perpendicular(&closing, TAU * rng.random::<f64>());
    let pad = &gripper.pad;
    let [low, high] = settings.height_shift_m;
    let (low, high) = (pad.z_min_m + low, pad.z_max_m + high);
    let height = low + (high - low) * rng.random::<f64>();
    let axes = Matrix3::from_columns(&[closing, approach.cross(&closing), approach]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    let pose = Isometry3::from_parts(
        Translation3::from(middle.coords - approach * height),
        rotation,
    );
    if penetration_m(surface, hand, &pose).is_some() {
        return None;
    }
    Some((pose, exit_cosine.min(inward.dot(&direction))))
}

/// A point uniform on the surface, and its face.
fn surface_point(surface: &Surface, areas: &[f64], rng: &mut ChaCha8Rng) -> (usize, Point3<f64>) {
    let total = areas.last().copied().unwrap_or(0.0);
    let target = total * rng.random::<f64>();
    let face = areas.partition_point(|&a| a <= target).min(areas.len() - 1);
    let [a, b, c] = surface.mesh().triangle(face);
    // R. Osada et al., "Shape distributions", ACM TOG 21(4), 2002, equation 1.
    let (u, v): (f64, f64) = (rng.random::<f64>().sqrt(), rng.random());
    let point = a.coords * (1.0 - u) + b.coords * (u * (1.0 - v)) + c.coords * (u * v);
    (face, Point3::from(point))
}

/// A direction uniform on the spherical cap of half angle `cone_rad` about `axis`.
fn in_cone(axis: &Vector3<f64>, cone_rad: f64, rng: &mut ChaCha8Rng) -> Vector3<f64> {
    let cosine = 1.0 - (1.0 - cone_rad.cos()) * rng.random::<f64>();
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    (axis * cosine + perpendicular(axis, TAU * rng.random::<f64>()) * sine).normalize()
}

/// The unit vector normal to `axis` at an angle about it.
fn perpendicular(axis: &Vector3<f64>, angle_rad: f64) -> Vector3<f64> {
    let helper = if axis.x.abs() < 0.9 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let u = axis.cross(&helper).normalize();
    let v = axis.cross(&u);
    u * angle_rad.cos() + v * angle_rad.sin()
}

#[cfg(test)]
mod tests {
    use super::*;
    use shakedown_objects::shapes::Family;

    #[test]
    fn candidates_are_free_antipodal_and_their_number_does_not_change_them() {
        let gripper = Gripper::load("franka_panda").unwrap();
        let parts = gripper.parts_at(gripper.opening_max_m);
        let part = |corners| Intruder::new(ConvexBody::hull(corners).unwrap());
        let hand = Intruders::new(parts.iter().map(|(_, c)| part(c)).collect());
        let both = [
            AntipodalSettings::default(),
            AntipodalSettings::like_acronym(),
        ];
        let families = [Family::Box, Family::Mug, Family::Knife];
        for (settings, family) in both.iter().flat_map(|s| families.map(|f| (s, f))) {
            let object = family.member(0).object().unwrap();
            let many = sample_antipodal(&object, &gripper, 12, 5, settings);
            let few = sample_antipodal(&object, &gripper, 4, 5, settings);
            assert_eq!(few[..], many[..few.len()]);
            assert!(many.len() >= 10, "{family:?}");
            let widest = settings.cone_rad.max(settings.exit_cone_rad);
            for g in &many {
                assert!(penetration_m(&object.surface, &hand, &g.object_from_hand).is_none());
                assert!(g.score.unwrap() >= widest.cos() - 1e-12);
            }
        }
    }
}
