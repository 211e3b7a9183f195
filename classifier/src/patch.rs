//! How does the surface lie that a pad touches? Mean slope and height of a thin layer of it.

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x8, mask32x8};
use nalgebra::Vector3;
use shakedown_objects::convex::Polygon;
use shakedown_objects::penetration::Intruder;
use shakedown_objects::surface::{LANES, bits};

use crate::hand::HandModel;
use crate::prism::{self, Triangles};

/// Triangles that wait until they are eight.
struct Waiting {
    /// `places[corner][axis][place]`, metres.
    places: [[[f32; LANES]; 3]; 3],
    len: usize,
}

impl Waiting {
    const NONE: Self = Self {
        places: [[[0.0; LANES]; 3]; 3],
        len: 0,
    };

    /// Adds one; are they eight now?
    #[inline]
    fn push(&mut self, triangle: &[Vector3<f32>; 3]) -> bool {
        for (corner, places) in triangle.iter().zip(&mut self.places) {
            for (x, places) in corner.iter().zip(places) {
                places[self.len] = *x;
            }
        }
        self.len += 1;
        self.len == LANES
    }

    /// All of them and the bits of their places; none wait after that.
    #[inline(always)]
    fn take<S: Simd>(&mut self, simd: S) -> (Triangles<S>, u32) {
        let here = (1 << self.len) - 1;
        self.len = 0;
        let mut triangles = [[f32x8::splat(simd, 0.0); 3]; 3];
        for (corner, places) in triangles.iter_mut().zip(&self.places) {
            for (x, places) in corner.iter_mut().zip(places) {
                *x = f32x8::load_array_ref(simd, places);
            }
        }
        (triangles, here)
    }

    /// The triangle at a place.
    #[inline]
    fn triangle(&self, i: usize) -> [Vector3<f32>; 3] {
        self.places.map(|corner| corner.map(|axis| axis[i]).into())
    }
}

/// The surface that faces a pad, in the region and beyond `sign * x >= border`.
pub(crate) struct Patch<'a> {
    hand: &'a HandModel,
    sign: f32,
    border: f32,
    /// Integral of the unit normal, m2.
    normal: Vector3<f32>,
    /// Area, m2.
    area: f32,
    /// Integral of z, m3.
    height: f32,
    waiting: Waiting,
}

impl<'a> Patch<'a> {
    pub(crate) fn new(hand: &'a HandModel, sign: f32, border: f32) -> Self {
        Self {
            hand,
            sign,
            border,
            normal: Vector3::zeros(),
            area: 0.0,
            height: 0.0,
            waiting: Waiting::NONE,
        }
    }

    /// Adds a triangle.
    #[inline]
    pub(crate) fn add(&mut self, triangle: &[Vector3<f32>; 3]) {
        if self.waiting.push(triangle) {
            self.add_waiting();
        }
    }

    /// Angle of the mean normal with the closing axis (radians) and mean height (metres), if
    /// anything faces the pad.
    pub(crate) fn slope_and_height(mut self) -> Option<(f64, f64)> {
        self.add_waiting();
        if self.area <= 0.0 || self.normal.norm() <= 0.0 {
            return None;
        }
        let along = f64::from(self.normal.x * self.sign);
        let across = f64::from(self.normal.yz().norm());
        let [low, high] = self.hand.region;
        // A tiny patch has no digits left of its height.
        let height_m = f64::from(self.height / self.area).clamp(low.z, high.z);
        Some((across.atan2(along), height_m))
    }

    fn add_waiting(&mut self) {
        dispatch!(Level::new(), simd => self.add_eight(simd));
    }

    #[inline(always)]
    fn add_eight<S: Simd>(&mut self, simd: S) {
        let (corners, here) = self.waiting.take(simd);
        let (normal, steep) = prism::normals(&corners);
        let facing = (normal[0] * self.sign).simd_gt(0.0);
        let region = &self.hand.region_body;
        let [low, high] = prism::range(&corners, 0);
        let outside = low.simd_lt(region.min.x) | high.simd_gt(region.max.x);
        let one_by_one = steep | outside;
        for i in bits((facing & one_by_one).to_bitmask() as u32 & here) {
            self.add_clipped(&self.waiting.triangle(i));
        }
        let together = facing & !one_by_one & mask32x8::from_bitmask(simd, u64::from(here));
        if together.to_bitmask() == 0 {
            return;
        }
        let (area, moment) = self
            .hand
            .prism
            .moments(simd, &corners, self.sign, self.border);
        // Seen along x the area is smaller by the cosine of the slope, n_x / |n|.
        let weight = together.select(f32x8::splat(simd, 1.0) / normal[0], f32x8::splat(simd, 0.0));
        let length = (normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]).sqrt();
        let scale = weight * area;
        self.normal += Vector3::new(
            sum(normal[0] * scale),
            sum(normal[1] * scale),
            sum(normal[2] * scale),
        );
        let height = (scale * self.hand.prism.middle_z_m() + moment * weight) * length;
        self.area += sum(length * scale);
        self.height += sum(height);
    }

    /// Adds a triangle by cutting it plane by plane.
    fn add_clipped(&mut self, t: &[Vector3<f32>; 3]) {
        let Some(polygon) = clipped(&self.hand.region_body, self.sign, self.border, t) else {
            return;
        };
        let Some(unit) = (t[1] - t[0]).cross(&(t[2] - t[0])).try_normalize(0.0) else {
            return;
        };
        for [a, b, c] in polygon.fan() {
            let area = 0.5 * (b - a).cross(&(c - a)).norm();
            self.normal += unit * area;
            self.area += area;
            self.height += area * (a.z + b.z + c.z) / 3.0;
        }
    }
}

/// In an order of its own, so that it is the same on every machine.
#[inline(always)]
fn sum<S: Simd>(numbers: f32x8<S>) -> f32 {
    numbers.to_array().iter().sum()
}

/// Mean height of the corners of the layer, metres; 0 if there are none.
pub(crate) fn corner_height_m<'a>(
    hand: &HandModel,
    sign: f32,
    border: f32,
    triangles: impl Iterator<Item = &'a [Vector3<f32>; 3]>,
) -> f32 {
    let (mut height, mut count) = (0.0f32, 0.0f32);
    for polygon in triangles.filter_map(|t| clipped(&hand.region_body, sign, border, t)) {
        for corner in polygon.corners() {
            height += corner.z;
            count += 1.0;
        }
    }
    height / count.max(1.0)
}

/// Smallest and largest x of the part of a triangle inside the region.
pub(crate) fn extent_in_region(
    region: &Intruder,
    triangle: &[Vector3<f32>; 3],
) -> Option<(f32, f32)> {
    let mut polygon = Piece::triangle(triangle);
    if !clip_to_region(region, triangle, &mut polygon) {
        return None;
    }
    let xs = polygon.corners().iter().map(|c| c.x);
    Some(xs.fold((f32::MAX, f32::MIN), |(lo, hi), x| (lo.min(x), hi.max(x))))
}

/// A triangle cut by the six planes of the region and the one of a contact patch.
type Piece = Polygon<10>;

/// What of the triangle is in the region and beyond the border.
fn clipped(
    region: &Intruder,
    sign: f32,
    border: f32,
    triangle: &[Vector3<f32>; 3],
) -> Option<Piece> {
    let mut polygon = Piece::triangle(triangle);
    let left = clip_to_region(region, triangle, &mut polygon);
    (left && polygon.clip_axis(0, -sign, -border)).then_some(polygon)
}

/// Cuts `polygon`, which is the triangle, to the region; returns whether anything is left.
fn clip_to_region(region: &Intruder, triangle: &[Vector3<f32>; 3], polygon: &mut Piece) -> bool {
    let [a, b, c] = triangle;
    let (lo, hi) = (a.inf(b).inf(c), a.sup(b).sup(c));
    (0..3).all(|axis| {
        let (min, max) = (region.min[axis], region.max[axis]);
        lo[axis] <= max
            && hi[axis] >= min
            && (hi[axis] <= max || polygon.clip_axis(axis, 1.0, max))
            && (lo[axis] >= min || polygon.clip_axis(axis, -1.0, -min))
    })
}
