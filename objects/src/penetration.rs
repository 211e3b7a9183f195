//! Does a convex body meet the surface, and how deep?

use std::ops::ControlFlow;

use nalgebra::{Isometry3, Vector3};
use wide::f32x8;

use crate::convex::{ConvexBody, MAX_PLANES, Polygon};
use crate::surface::{LANES, Lanes, Surface};

const GROUPS: usize = MAX_PLANES.div_ceil(8);

/// Depth of the object's surface inside one body, seen from each of its planes.
///
/// `depth_m()` is the shortest way along one face normal of the body that takes every piece of
/// surface found inside out of it.
#[derive(Debug, Clone, Copy)]
pub struct Depth {
    /// Least distance beyond each plane; negative is inside.
    deepest: [f32x8; GROUPS],
    touched: bool,
}

impl Default for Depth {
    fn default() -> Self {
        Self {
            deepest: [f32x8::ZERO; GROUPS],
            touched: false,
        }
    }
}

impl Depth {
    /// Was any surface found inside the body?
    pub fn touched(&self) -> bool {
        self.touched
    }

    /// Adds a triangle of the surface, in the frame of the body.
    #[inline]
    pub fn add(&mut self, body: &Intruder, triangle: &[Vector3<f32>; 3]) {
        let mut cutting = 0u64;
        let mut nearest = [f32x8::ZERO; GROUPS];
        for (i, planes) in body.groups.iter().enumerate() {
            let [a, b, c] = [0, 1, 2].map(|k| planes.distances(&triangle[k]));
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            // Most triangles near a body lie wholly beyond one of its planes.
            if low.simd_gt(f32x8::ZERO).any() {
                return;
            }
            cutting |= u64::from(high.simd_gt(f32x8::ZERO).to_bitmask() as u8) << (8 * i);
            nearest[i] = low;
        }
        if cutting == 0 {
            self.touched = true;
            for (deepest, low) in self.deepest.iter_mut().zip(&nearest[..body.groups.len()]) {
                *deepest = deepest.min(*low);
            }
            return;
        }
        // Few planes cut a triangle; the small polygon is much cheaper to set up.
        if cutting.count_ones() <= 9 {
            self.add_clipped::<12>(body, triangle, cutting);
        } else {
            self.add_clipped::<{ MAX_PLANES + 3 }>(body, triangle, cutting);
        }
    }

    fn add_clipped<const N: usize>(
        &mut self,
        body: &Intruder,
        triangle: &[Vector3<f32>; 3],
        mut cutting: u64,
    ) {
        let mut polygon = Polygon::<N>::triangle(triangle);
        while cutting != 0 {
            let (normal, offset) = &body.planes[cutting.trailing_zeros() as usize];
            if !polygon.clip(normal, *offset) {
                return;
            }
            cutting &= cutting - 1;
        }
        self.touched = true;
        for (deepest, planes) in self.deepest.iter_mut().zip(&body.groups) {
            for corner in polygon.corners() {
                *deepest = deepest.min(planes.distances(corner));
            }
        }
    }

    /// The depth, metres; 0 if nothing was found inside.
    pub fn depth_m(&self, body: &Intruder) -> f32 {
        if !self.touched {
            return 0.0;
        }
        let lanes = self.deepest[..body.groups.len()]
            .iter()
            .flat_map(|d| d.to_array());
        lanes
            .take(body.planes.len())
            .fold(f32::MAX, |least, d| least.min(-d))
    }
}

/// Eight planes side by side.
#[derive(Debug, Clone, Copy)]
struct Planes {
    normal: [f32x8; 3],
    offset: f32x8,
}

impl Planes {
    /// Signed distances of a point from the planes, metres, positive beyond them.
    #[inline]
    fn distances(&self, p: &Vector3<f32>) -> f32x8 {
        let [x, y, z] = self.normal;
        x * f32x8::splat(p.x) + y * f32x8::splat(p.y) + z * f32x8::splat(p.z) - self.offset
    }
}

/// A convex body made ready to be held against surfaces, in f32 and its own frame, metres.
#[derive(Debug, Clone)]
pub struct Intruder {
    /// The exact body.
    pub body: ConvexBody,
    /// Smallest corner of its box.
    pub min: Vector3<f32>,
    /// Largest corner of its box.
    pub max: Vector3<f32>,
    /// Planes as `normal . x <= offset`.
    pub planes: Vec<(Vector3<f32>, f32)>,
    /// The same planes in groups; the last group is filled up with planes far away.
    groups: Vec<Planes>,
}

impl Intruder {
    /// Prepares a body. Planes are tried in their order, so those that separate soonest come first.
    pub fn new(body: ConvexBody) -> Self {
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
                let axis =
                    |a: usize| f32x8::from(std::array::from_fn::<f32, 8, _>(|i| plane(i).0[a]));
                Planes {
                    normal: [axis(0), axis(1), axis(2)],
                    offset: f32x8::from(std::array::from_fn::<f32, 8, _>(|i| plane(i).1)),
                }
            })
            .collect();
        Self {
            min: min.coords.map(|x| x as f32),
            max: max.coords.map(|x| x as f32),
            body,
            planes,
            groups,
        }
    }
}

/// All parts of a hand at one opening.
#[derive(Debug, Clone)]
pub struct Intruders {
    bodies: Vec<Intruder>,
    is_one_piece: bool,
}

impl Intruders {
    /// Prepares the parts.
    pub fn new(bodies: Vec<Intruder>) -> Self {
        Self {
            is_one_piece: hang_together(&bodies),
            bodies,
        }
    }

    /// The parts.
    pub fn bodies(&self) -> &[Intruder] {
        &self.bodies
    }

    /// Do the parts hang together, so that no surface runs between them without meeting one?
    pub fn is_one_piece(&self) -> bool {
        self.is_one_piece
    }

    /// For parts of which none meets the surface: is the whole hand certainly outside?
    pub fn is_outside(&self, surface: &Surface, object_from_frame: &Isometry3<f64>) -> bool {
        let is_out = |b: &Intruder| !surface.may_contain(&(object_from_frame * b.body.centre()));
        self.is_one_piece && self.bodies.iter().any(is_out)
    }
}

/// Can every body be reached from the first through corners that lie in another? True only if so.
fn hang_together(bodies: &[Intruder]) -> bool {
    let corner_in = |a: &ConvexBody, b: &ConvexBody| a.vertices.iter().any(|v| b.contains(v));
    let mut reached = vec![0];
    let mut next = 0;
    while next < reached.len() && !bodies.is_empty() {
        let body = &bodies[reached[next]].body;
        for (i, other) in bodies.iter().enumerate() {
            let other = &other.body;
            if !reached.contains(&i) && (corner_in(body, other) || corner_in(other, body)) {
                reached.push(i);
            }
        }
        next += 1;
    }
    reached.len() == bodies.len()
}

/// How deep the object reaches into the worst part of a hand at `object_from_frame`, metres, or
/// `None` if it meets none of them. A part wholly inside the object counts with the distance of
/// its centre from the surface.
pub fn penetration_m(
    surface: &Surface,
    hand: &Intruders,
    object_from_frame: &Isometry3<f64>,
) -> Option<f64> {
    let frame_from_object = object_from_frame.inverse();
    let mut worst: Option<f64> = None;
    let deeper = |worst: Option<f64>, depth_m: f64| Some(worst.map_or(depth_m, |w| w.max(depth_m)));
    let mut apart = Vec::new();
    for group in hand.bodies.chunks(LANES) {
        let mut lanes = Lanes::default();
        for (lane, body) in group.iter().enumerate() {
            lanes.set(lane, body.min, body.max);
        }
        let mut depths = [Depth::default(); LANES];
        surface.visit_near(&frame_from_object, &mut lanes, |_, _, triangle, mask| {
            for (lane, body) in group.iter().enumerate() {
                if mask >> lane & 1 == 1 {
                    depths[lane].add(body, &triangle);
                }
            }
            ControlFlow::Continue(())
        });
        for (depth, body) in depths.iter().zip(group) {
            if depth.touched() {
                worst = deeper(worst, f64::from(depth.depth_m(body)));
            } else {
                apart.push(body);
            }
        }
    }
    // Parts that meet no surface are inside or outside as a whole; so is a hand of one piece.
    if worst.is_some() || !hand.is_outside(surface, object_from_frame) {
        for body in apart {
            if let Some(depth) = inside_m(surface, body, object_from_frame) {
                worst = deeper(worst, depth);
            }
        }
    }
    worst
}

/// For a body that meets no surface: its distance from it if it is inside the object.
pub fn inside_m(
    surface: &Surface,
    body: &Intruder,
    object_from_frame: &Isometry3<f64>,
) -> Option<f64> {
    let centre = object_from_frame * body.body.centre();
    surface
        .contains(&centre)
        .then(|| -surface.signed_distance(&centre))
}
