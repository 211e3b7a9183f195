//! Does a convex body meet the surface, and how deep?

use std::ops::ControlFlow;

use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use nalgebra::{Isometry3, Vector3};

use crate::convex::{ConvexBody, MAX_PLANES, Polygon};
use crate::lanes::{LANES, Lanes, Row, SLACK_M, bits};
use crate::surface::{Near, Surface, Visitor};

const GROUPS: usize = MAX_PLANES.div_ceil(LANES);

/// Depth of the object's surface inside one body, seen from each of its planes.
///
/// `depth_m()` is the shortest way along one face normal of the body that takes every piece of
/// surface found inside out of it.
#[derive(Debug, Clone, Copy)]
pub struct Depth {
    /// Least distance beyond each plane, negative is inside; means something once touched.
    deepest: [Row; GROUPS],
    touched: bool,
}

impl Default for Depth {
    fn default() -> Self {
        Self {
            deepest: [Row([0.0; LANES]); GROUPS],
            touched: false,
        }
    }
}

impl Depth {
    /// As new.
    pub fn clear(&mut self) {
        self.touched = false;
    }

    /// Was any surface found inside the body?
    pub fn touched(&self) -> bool {
        self.touched
    }

    /// Adds a triangle of the surface, in the frame of the body.
    #[inline(always)]
    pub fn add<S: Simd>(&mut self, simd: S, body: &Intruder, triangle: &[Vector3<f32>; 3]) {
        let mut cutting = 0u64;
        let [a, b, c] = triangle;
        for (i, planes) in body.groups.iter().enumerate() {
            let a = planes.distances(simd, a);
            let b = planes.distances(simd, b);
            let c = planes.distances(simd, c);
            // Most triangles near a body lie wholly beyond one of its planes.
            if a.min(b).min(c).simd_gt(0.0).any_true() {
                return;
            }
            cutting |= a.max(b).max(c).simd_gt(0.0).to_bitmask() << (LANES * i);
        }
        if cutting == 0 {
            self.deepen(simd, body, triangle);
            return;
        }
        if body.is_beside(simd, triangle) {
            return;
        }
        // Few planes cut a triangle; the small polygon is much cheaper to set up.
        if cutting.count_ones() <= 9 {
            if let Some(polygon) = body.cut::<12>(triangle, cutting) {
                self.deepen(simd, body, polygon.corners());
            }
        } else if let Some(polygon) = body.cut::<{ MAX_PLANES + 3 }>(triangle, cutting) {
            self.deepen(simd, body, polygon.corners());
        }
    }

    /// Takes in points inside the body.
    #[inline(always)]
    fn deepen<S: Simd>(&mut self, simd: S, body: &Intruder, points: &[Vector3<f32>]) {
        for (deepest, planes) in self.deepest.iter_mut().zip(&body.groups) {
            let mut least = if self.touched {
                deepest.load(simd)
            } else {
                f32x8::splat(simd, 0.0)
            };
            for point in points {
                least = least.min(planes.distances(simd, point));
            }
            least.store_array(&mut deepest.0);
        }
        self.touched = true;
    }

    /// The depth, metres; 0 if nothing was found inside.
    pub fn depth_m(&self, body: &Intruder) -> f32 {
        if !self.touched {
            return 0.0;
        }
        let lanes = self.deepest[..body.groups.len()].iter().flat_map(|d| d.0);
        lanes
            .take(body.planes.len())
            .fold(f32::MAX, |least, d| least.min(-d))
    }
}

/// Eight planes side by side.
#[derive(Debug, Clone, Copy)]
struct Planes {
    normal: [Row; 3],
    offset: Row,
}

impl Planes {
    /// Signed distances of a point from the planes, metres, positive beyond them.
    #[inline(always)]
    fn distances<S: Simd>(&self, simd: S, p: &Vector3<f32>) -> f32x8<S> {
        let [x, y, z] = &self.normal;
        x.load(simd) * p.x + y.load(simd) * p.y + z.load(simd) * p.z - self.offset.load(simd)
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
    /// The corners in groups, side by side; the last group repeats the last corner.
    corners: Vec<[Row; 3]>,
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
            .chunks(LANES)
            .map(|chunk| {
                let far = (Vector3::zeros(), 1.0e9);
                let plane = |i: usize| chunk.get(i).copied().unwrap_or(far);
                Planes {
                    normal: [0, 1, 2].map(|axis| Row::new(|i| plane(i).0[axis])),
                    offset: Row::new(|i| plane(i).1),
                }
            })
            .collect();
        let corners = body
            .vertices
            .chunks(LANES)
            .map(|chunk| {
                let corner = |i: usize| chunk[i.min(chunk.len() - 1)];
                [0, 1, 2].map(|axis| Row::new(|i| corner(i)[axis] as f32))
            })
            .collect();
        Self {
            corners,
            min: min.coords.map(|x| x as f32),
            max: max.coords.map(|x| x as f32),
            body,
            planes,
            groups,
        }
    }

    /// Does the body clearly lie on one side of the triangle's plane, or wholly beyond one of its
    /// edges?
    #[inline(always)]
    fn is_beside<S: Simd>(&self, simd: S, [a, b, c]: &[Vector3<f32>; 3]) -> bool {
        let normal = (b - a).cross(&(c - a));
        self.is_beyond(simd, &normal, a)
            || self.is_beyond(simd, &-normal, a)
            || self.is_beyond(simd, &(b - a).cross(&normal), a)
            || self.is_beyond(simd, &(c - b).cross(&normal), b)
            || self.is_beyond(simd, &(a - c).cross(&normal), c)
    }

    /// Do all corners clearly lie further along `direction` than `point`?
    #[inline(always)]
    fn is_beyond<S: Simd>(&self, simd: S, direction: &Vector3<f32>, point: &Vector3<f32>) -> bool {
        let least = direction.dot(point) + SLACK_M * direction.abs().sum();
        for [x, y, z] in &self.corners {
            let along = x.load(simd) * direction.x + y.load(simd) * direction.y;
            let along = along + z.load(simd) * direction.z;
            if !along.simd_gt(least).all_true() {
                return false;
            }
        }
        true
    }

    /// What of the triangle is inside the body, which only the planes in `cutting` cut.
    fn cut<const N: usize>(
        &self,
        triangle: &[Vector3<f32>; 3],
        cutting: u64,
    ) -> Option<Polygon<N>> {
        let mut polygon = Polygon::<N>::triangle(triangle);
        let mut left = cutting;
        while left != 0 {
            let (normal, offset) = &self.planes[left.trailing_zeros() as usize];
            if !polygon.clip(normal, *offset) {
                return None;
            }
            left &= left - 1;
        }
        Some(polygon)
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

/// Bodies held against a surface, each in the lane of its number.
struct Depths<'a> {
    group: &'a [Intruder],
    depths: [Depth; LANES],
}

impl Visitor for Depths<'_> {
    #[inline(always)]
    fn visit<S: Simd>(&mut self, _: &mut Lanes, near: &Near<'_, S>) -> ControlFlow<()> {
        for (lane, body) in self.group.iter().enumerate() {
            for i in bits(near.of_lane(lane)) {
                self.depths[lane].add(near.simd(), body, &near.triangle(i));
            }
        }
        ControlFlow::Continue(())
    }
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
        let mut depths = Depths {
            group,
            depths: [Depth::default(); LANES],
        };
        surface.visit_blocks(&frame_from_object, &mut lanes, &mut depths);
        for (depth, body) in depths.depths.iter().zip(group) {
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
