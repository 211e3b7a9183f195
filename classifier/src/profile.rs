//! What lies between the pads, line by line? A grid of lines along the closing axis, from one pad
//! to the other, and where each meets the surface first from either side.

use nalgebra::{Isometry3, Point3, Vector3};
use shakedown_objects::Surface;

use crate::hand::HandModel;

/// Lines across the pad (along y) and down from its tip (along -z).
pub const COLUMNS: usize = 5;
/// Rows of lines, the first nearest to the tip.
pub const ROWS: usize = 9;
/// Distance of rows from each other and of the first one from the tip, metres.
const ROW_STEP_M: f64 = 0.004;
const FIRST_ROW_M: f64 = 0.002;

/// One line: both first contacts along the closing axis, and the cosine of each contact normal with
/// it (1: the face looks straight at the pad).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// First contact seen from -x and from +x, hand frame, metres.
    pub x_m: [f64; 2],
    /// Cosines of the outward normals with the direction towards that pad.
    pub cosine: [f64; 2],
    /// The outward normals, hand frame.
    pub normal: [Vector3<f64>; 2],
}

/// The lines between the pads; `None` where a line meets nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// `lines[row][column]`.
    pub lines: [[Option<Line>; COLUMNS]; ROWS],
    /// Height of each row, hand frame, metres.
    pub row_z_m: [f64; ROWS],
    /// Place of each column, hand frame, metres.
    pub column_y_m: [f64; COLUMNS],
}

/// Casts the lines for a hand at `object_from_hand`.
pub fn profile(hand: &HandModel, surface: &Surface, object_from_hand: &Isometry3<f64>) -> Profile {
    let [low, high] = hand.region;
    let row_z_m = std::array::from_fn(|i| high.z - FIRST_ROW_M - ROW_STEP_M * i as f64);
    let column_y_m =
        std::array::from_fn(|j| low.y + (high.y - low.y) * (j as f64 + 0.5) / COLUMNS as f64);
    let direction = object_from_hand * Vector3::x();
    let line = |z: f64, y: f64| {
        let origin = object_from_hand * Point3::new(low.x, y, z);
        let hits = surface.ray_hits(&origin, &direction);
        let mut inside = hits.iter().filter(|(t, _)| *t <= high.x - low.x);
        let first = inside.next()?;
        let last = inside.next_back().unwrap_or(first);
        let normal =
            |face: usize| object_from_hand.inverse_transform_vector(surface.face_normal(face));
        let normal = [normal(first.1), normal(last.1)];
        Some(Line {
            x_m: [low.x + first.0, low.x + last.0],
            cosine: [-normal[0].x, normal[1].x],
            normal,
        })
    };
    Profile {
        lines: row_z_m.map(|z| column_y_m.map(|y| line(z, y))),
        row_z_m,
        column_y_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shakedown_gripper_assets::Gripper;
    use shakedown_objects::shapes::Family;

    #[test]
    fn a_box_between_the_pads_has_parallel_faces_as_far_as_it_reaches() {
        let gripper = Gripper::load("franka_panda").unwrap();
        let hand = HandModel::new(&gripper, gripper.opening_max_m).unwrap();
        let object = Family::Box.member(0).object().unwrap();
        let (lo, hi) = object.surface.mesh().bounds();
        // From above, the tip 10 mm below the top, closing along the box's shorter side.
        let turn = nalgebra::UnitQuaternion::from_euler_angles(std::f64::consts::PI, 0.0, 0.0);
        let middle = nalgebra::center(&lo, &hi);
        let tip = hand.region[1].z;
        let at = Point3::new(middle.x, middle.y, hi.z - 0.010 + tip);
        let pose = Isometry3::from_parts(at.coords.into(), turn);
        let profile = profile(&hand, &object.surface, &pose);
        let size = hi.x - lo.x;
        if size < gripper.opening_max_m {
            let line = profile.lines[0][2].unwrap();
            assert!((line.x_m[1] - line.x_m[0] - size).abs() < 2e-4);
            assert!(line.cosine.iter().all(|c| *c > 0.999));
            assert!(
                profile.lines[4][2].is_none(),
                "18 mm from the tip there is only air"
            );
        }
    }
}
