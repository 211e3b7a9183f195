//! The hand as the classifier holds it against an object: convex bodies and the closing region.

use nalgebra::Vector3;
use shakedown_gripper_assets::Gripper;
use shakedown_objects::ConvexBody;
use shakedown_objects::penetration::{Intruder, Intruders};
use shakedown_objects::surface::{LANES, Lanes};

use crate::prism::Prism;

/// Why a hand cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HandError(pub String);

impl std::fmt::Display for HandError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for HandError {}

/// A hand at one opening, ready to be held against objects.
#[derive(Debug, Clone)]
pub struct HandModel {
    /// Names of the parts, in the order of the bodies.
    pub part_names: Vec<String>,
    /// The parts, hand frame.
    pub bodies: Intruders,
    /// Corners of the closing region, hand frame, metres.
    pub region: [Vector3<f64>; 2],
    /// Opening, metres.
    pub opening_m: f64,
    pub(crate) region_body: Intruder,
    pub(crate) prism: Prism,
    /// Bodies behind each lane; the last two lanes are the strips of the closing region.
    pub(crate) members: Vec<Vec<usize>>,
    pub(crate) lanes: Lanes,
}

/// Lanes of the strips that look for the first contact of each pad.
pub(crate) const STRIP_LEFT: usize = LANES - 2;
pub(crate) const STRIP_RIGHT: usize = LANES - 1;

impl HandModel {
    /// The hand at an opening.
    ///
    /// # Errors
    /// A part that spans no volume or needs more planes than can be handled.
    pub fn new(gripper: &Gripper, opening_m: f64) -> Result<Self, HandError> {
        let mut part_names = Vec::new();
        let mut convex_bodies = Vec::new();
        for (name, corners) in gripper.parts_at(opening_m) {
            let body = ConvexBody::hull(&corners).ok_or_else(|| {
                HandError(format!(
                    "part {name:?} of {} is flat or has too many faces",
                    gripper.name
                ))
            })?;
            part_names.push(name);
            convex_bodies.push(body);
        }
        let region = gripper.closing_region(opening_m);
        let size = region[1] - region[0];
        let centre =
            nalgebra::Isometry3::from(nalgebra::Translation3::from((region[0] + region[1]) / 2.0));
        let region_body = Intruder::new(ConvexBody::cuboid(size, &centre));
        // Planes that face the object come first: they separate soonest.
        let target = (region[0] + region[1]) / 2.0;
        for body in &mut convex_bodies {
            let towards = target - body.centre().coords;
            body.planes
                .sort_by(|(a, _), (b, _)| b.dot(&towards).total_cmp(&a.dot(&towards)));
        }
        let bodies: Vec<Intruder> = convex_bodies.into_iter().map(Intruder::new).collect();
        let (members, mut lanes) = share_lanes(&bodies);
        for strip in [STRIP_LEFT, STRIP_RIGHT] {
            lanes.set(strip, region_body.min, region_body.max);
        }
        Ok(Self {
            part_names,
            bodies: Intruders::new(bodies),
            region,
            opening_m,
            prism: Prism::new(region_body.min.yz().into(), region_body.max.yz().into()),
            region_body,
            members,
            lanes,
        })
    }
}

/// Gives every body a lane; where there are more bodies than lanes, those whose common box is
/// smallest share one.
fn share_lanes(bodies: &[Intruder]) -> (Vec<Vec<usize>>, Lanes) {
    let mut members: Vec<Vec<usize>> = (0..bodies.len()).map(|i| vec![i]).collect();
    let common = |group: &[usize]| {
        let first = &bodies[group[0]];
        group.iter().fold((first.min, first.max), |(lo, hi), &i| {
            (lo.inf(&bodies[i].min), hi.sup(&bodies[i].max))
        })
    };
    while members.len() > STRIP_LEFT {
        let mut best = (f32::MAX, 0, 1);
        for i in 0..members.len() {
            for j in i + 1..members.len() {
                let (lo, hi) = common(&[&members[i][..], &members[j][..]].concat());
                let volume = (hi - lo).product();
                if volume < best.0 {
                    best = (volume, i, j);
                }
            }
        }
        let merged = members.remove(best.2);
        members[best.1].extend(merged);
    }
    let mut lanes = Lanes::default();
    for (lane, group) in members.iter().enumerate() {
        let (lo, hi) = common(group);
        lanes.set(lane, lo, hi);
    }
    (members, lanes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_of_the_panda_hang_together_and_the_links_of_the_robotiq_stand_apart() {
        for (name, is_one_piece) in [("franka_panda", true), ("robotiq_2f_85", false)] {
            let gripper = Gripper::load(name).unwrap();
            let hand = HandModel::new(&gripper, gripper.opening_max_m).unwrap();
            assert_eq!(hand.bodies.is_one_piece(), is_one_piece, "{name}");
        }
    }
}
