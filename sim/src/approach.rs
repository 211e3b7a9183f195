//! How far can the fingers close before anything can touch? Steps in free air decide nothing.

use std::ops::ControlFlow;

use nalgebra::Isometry3;
use shakedown_objects::surface::{LANES, Lanes};

use crate::scene::Scene;

/// Free air left before the first touch, metres: contacts are prepared half a millimetre ahead, and
/// the fingers must have found their speed by then.
const MARGIN_M: f64 = 0.004;

/// The opening at which a trial starts, metres: the hand's largest, less what both fingers can
/// close without coming nearer than [`MARGIN_M`] to any triangle in their way.
///
/// Conservative: triangles count with their boxes, so the true first touch is never skipped.
pub(crate) fn start_opening_m(scene: &Scene, object_from_hand: &Isometry3<f64>) -> f64 {
    let hand_from_object = object_from_hand.inverse();
    let mut free = scene.opening_max_m / 2.0;
    for (sign, parts) in [
        (1.0f32, &scene.finger_parts[0]),
        (-1.0, &scene.finger_parts[1]),
    ] {
        for group in parts.chunks(LANES) {
            let mut lanes = Lanes::default();
            for (lane, &i) in group.iter().enumerate() {
                let (mut min, mut max) = (scene.hand.bodies()[i].min, scene.hand.bodies()[i].max);
                // The way to the middle of the hand.
                if sign > 0.0 {
                    min.x = 0.0;
                } else {
                    max.x = 0.0;
                }
                lanes.set(lane, min, max);
            }
            scene
                .surface
                .visit_near(&hand_from_object, &mut lanes, |_, _, triangle, mask| {
                    for (lane, &i) in group.iter().enumerate() {
                        if mask >> lane & 1 == 1 {
                            let body = &scene.hand.bodies()[i];
                            let face = if sign > 0.0 { body.min.x } else { -body.max.x };
                            let reach =
                                triangle.iter().map(|v| sign * v.x).fold(f32::MIN, f32::max);
                            free = free.min(f64::from(face - reach));
                        }
                    }
                    ControlFlow::Continue(())
                });
        }
    }
    scene.opening_max_m - 2.0 * (free - MARGIN_M).max(0.0)
}
