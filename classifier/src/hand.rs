//! The hand as the classifier holds it against an object: convex bodies and the closing region.

use nalgebra::Vector3;
use shakedown_gripper_assets::Gripper;
use shakedown_objects::ConvexBody;
use shakedown_objects::surface::{LANES, Lanes};
use wide::f32x8;

/// Why a hand cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HandError(pub String);

impl std::fmt::Display for HandError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for HandError {}

/// Eight planes side by side.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Planes {
    pub normal: [f32x8; 3],
    pub offset: f32x8,
}

impl Planes {
    /// Signed distances of a point from the planes, metres, positive beyond them.
    #[inline]
    pub fn distances(&self, p: &Vector3<f32>) -> f32x8 {
        let [x, y, z] = self.normal;
        x * f32x8::splat(p.x) + y * f32x8::splat(p.y) + z * f32x8::splat(p.z) - self.offset
    }
}

/// A convex body of the hand in f32, planes as `normal . x <= offset`, hand frame, metres.
#[derive(Debug, Clone)]
pub(crate) struct Body {
    pub planes: Vec<(Vector3<f32>, f32)>,
    /// The same planes in groups of eight; the last group is filled up with planes far away.
    pub groups: Vec<Planes>,
    pub min: Vector3<f32>,
    pub max: Vector3<f32>,
}

/// A hand at one opening, ready to be held against objects.
#[derive(Debug, Clone)]
pub struct HandModel {
    /// Names of the parts, in the order of the bodies.
    pub part_names: Vec<String>,
    pub(crate) bodies: Vec<Body>,
    /// The exact bodies, hand frame.
    pub convex_bodies: Vec<ConvexBody>,
    /// Corners of the closing region, hand frame, metres.
    pub region: [Vector3<f64>; 2],
    /// Opening, metres.
    pub opening_m: f64,
    pub(crate) region_body: Body,
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
        let centre = nalgebra::Isometry3::from(nalgebra::Translation3::from(
            (region[0] + region[1]) / 2.0,
        ));
        let region_body = single(&ConvexBody::cuboid(size, &centre));
        // Planes that face the object come first: they separate soonest.
        let target = (region[0] + region[1]) / 2.0;
        for body in &mut convex_bodies {
            let towards = target - body.centre().coords;
            body.planes
                .sort_by(|(a, _), (b, _)| b.dot(&towards).total_cmp(&a.dot(&towards)));
        }
        let bodies: Vec<Body> = convex_bodies.iter().map(single).collect();
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
            convex_bodies,
            region,
            opening_m,
            region_body,
            groups,
        })
    }
}

fn single(body: &ConvexBody) -> Body {
    let (min, max) = body.bounds();
    let planes: Vec<(Vector3<f32>, f32)> = body
        .planes
        .iter()
        .map(|(n, d)| (n.map(|x| x as f32), *d as f32))
        .collect();
    let groups = planes
        .chunks(8)
        .map(|chunk| {
            let far = (Vector3::zeros(), 1.0e9);
            let plane = |i: usize| chunk.get(i).copied().unwrap_or(far);
            let axis = |a: usize| f32x8::from(std::array::from_fn::<f32, 8, _>(|i| plane(i).0[a]));
            Planes {
                normal: [axis(0), axis(1), axis(2)],
                offset: f32x8::from(std::array::from_fn::<f32, 8, _>(|i| plane(i).1)),
            }
        })
        .collect();
    Body {
        planes,
        groups,
        min: min.coords.map(|x| x as f32),
        max: max.coords.map(|x| x as f32),
    }
}
