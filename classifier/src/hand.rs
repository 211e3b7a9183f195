//! The hand as the classifier holds it against an object: convex bodies and the closing region.

use nalgebra::Vector3;
use shakedown_gripper_assets::Gripper;
use shakedown_objects::ConvexBody;
use shakedown_objects::penetration::Intruder;
use shakedown_objects::surface::{LANES, Lanes};

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
    pub bodies: Vec<Intruder>,
    /// Corners of the closing region, hand frame, metres.
    pub region: [Vector3<f64>; 2],
    /// Opening, metres.
    pub opening_m: f64,
    pub(crate) region_body: Intruder,
    /// Bodies in groups that fit the lanes; the last two lanes of the first group are the strips.
    pub(crate) groups: Vec<(Vec<usize>, Lanes)>,
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
        let mut groups = Vec::new();
        let indices: Vec<usize> = (0..bodies.len()).collect();
        for chunk in indices.chunks(LANES - 2) {
            let mut lanes = Lanes::default();
            for (lane, &i) in chunk.iter().enumerate() {
                lanes.set(lane, bodies[i].min, bodies[i].max);
            }
            groups.push((chunk.to_vec(), lanes));
        }
        for strip in [STRIP_LEFT, STRIP_RIGHT] {
            groups[0].1.set(strip, region_body.min, region_body.max);
        }
        Ok(Self {
            part_names,
            bodies,
            region,
            opening_m,
            region_body,
            groups,
        })
    }
}
