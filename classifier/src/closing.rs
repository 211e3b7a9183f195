//! Where does each pad first touch when the fingers close, and on what slope?

use nalgebra::Vector3;
use shakedown_objects::convex::Polygon;
use shakedown_objects::penetration::Intruder;
use shakedown_objects::surface::Lanes;

use crate::hand::{HandModel, STRIP_LEFT, STRIP_RIGHT};

/// The rubber of a pad gives by about this much, so contact is a patch of that depth, metres.
pub const PATCH_DEPTH_M: f32 = 5.0e-4;

/// Contact of both pads with what lies between them; hand frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closing {
    /// First contact of the pad that comes from -x and of the one from +x, metres.
    pub x_m: [f64; 2],
    /// Angle between each contact patch's mean outward normal and the closing axis, radians.
    pub angle_rad: [f64; 2],
    /// Mean height of each contact patch along the approach direction, metres.
    pub z_m: [f64; 2],
}

impl Closing {
    /// Distance between the pads when both touch, metres.
    pub fn width_m(&self) -> f64 {
        self.x_m[1] - self.x_m[0]
    }

    /// Offset of the middle between both contacts from the hand's axis, metres.
    pub fn offset_m(&self) -> f64 {
        (self.x_m[0] + self.x_m[1]) / 2.0
    }
}

/// Collects the surface between the pads while it is visited.
pub(crate) struct Sweep {
    lo: f32,
    hi: f32,
    /// Triangles that may belong to a contact patch, with the smallest and largest x of the whole.
    candidates: Vec<(f32, f32, [Vector3<f32>; 3])>,
}

impl Sweep {
    /// Nothing seen yet.
    pub(crate) const NEW: Self = Self {
        lo: f32::MAX,
        hi: f32::MIN,
        candidates: Vec::new(),
    };

    pub(crate) fn clear(&mut self) {
        self.lo = f32::MAX;
        self.hi = f32::MIN;
        self.candidates.clear();
    }

    pub(crate) fn reached(&self) -> bool {
        self.lo <= self.hi
    }

    /// Adds a triangle; the strips shrink to what could still be a first contact.
    #[inline]
    pub(crate) fn add(
        &mut self,
        region: &Intruder,
        triangle: &[Vector3<f32>; 3],
        lanes: &mut Lanes,
    ) {
        let [a, b, c] = triangle.map(|v| v.x);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        if low > self.lo + PATCH_DEPTH_M && high < self.hi - PATCH_DEPTH_M {
            return;
        }
        // What is outside can only raise the lowest point of what is inside.
        if low < self.lo || high > self.hi {
            let Some((lo, hi)) = extent_in_region(region, triangle, low, high) else {
                return;
            };
            if lo < self.lo {
                self.lo = lo;
                lanes.set_axis(STRIP_LEFT, 0, region.min.x, lo + PATCH_DEPTH_M);
            }
            if hi > self.hi {
                self.hi = hi;
                lanes.set_axis(STRIP_RIGHT, 0, hi - PATCH_DEPTH_M, region.max.x);
            }
        }
        self.candidates.push((low, high, *triangle));
    }

    /// The contacts, if anything lies between the pads.
    pub(crate) fn closing(&self, hand: &HandModel) -> Option<Closing> {
        if !self.reached() {
            return None;
        }
        // Outward means away from the material: -x for the pad on -x.
        let (left_angle, left_z) = self.patch(hand, -1.0, self.lo);
        let (right_angle, right_z) = self.patch(hand, 1.0, self.hi);
        Some(Closing {
            x_m: [f64::from(self.lo), f64::from(self.hi)],
            angle_rad: [left_angle, right_angle],
            z_m: [left_z, right_z],
        })
    }

    /// Mean slope and height of the surface within [`PATCH_DEPTH_M`] of the contact at `x`,
    /// weighted by area; only what faces the pad counts.
    fn patch(&self, hand: &HandModel, sign: f32, x: f32) -> (f64, f64) {
        let region = &hand.region_body;
        let (mut normal, mut area, mut height) = (Vector3::<f32>::zeros(), 0.0f32, 0.0f32);
        let (mut edge_height, mut edge_count) = (0.0f32, 0.0f32);
        for (lo, hi, t) in &self.candidates {
            let (near, far) = if sign > 0.0 { (*hi, *lo) } else { (-*lo, -*hi) };
            let border = sign * x - PATCH_DEPTH_M;
            if near < border {
                continue;
            }
            let mut polygon = Piece::triangle(t);
            if !is_inside(region, t) && !clip_to_region(region, t, &mut polygon) {
                continue;
            }
            if far < border && !polygon.clip_axis(0, -sign, -border) {
                continue;
            }
            for c in polygon.corners() {
                edge_height += c.z;
                edge_count += 1.0;
            }
            let face = (t[1] - t[0]).cross(&(t[2] - t[0]));
            if face.x * sign <= 0.0 {
                continue;
            }
            let Some(unit) = face.try_normalize(0.0) else {
                continue;
            };
            let a = polygon.area();
            normal += unit * a;
            area += a;
            height += a * polygon.corners().iter().map(|c| c.z).sum::<f32>()
                / polygon.corners().len() as f32;
        }
        if area > 0.0 && normal.norm() > 0.0 {
            let along = f64::from(normal.x * sign);
            let across = f64::from(normal.yz().norm());
            (across.atan2(along), f64::from(height / area))
        } else {
            // An edge seen from the side: nothing faces the pad.
            let z = if edge_count > 0.0 {
                edge_height / edge_count
            } else {
                0.0
            };
            (std::f64::consts::FRAC_PI_2, f64::from(z))
        }
    }
}

/// Smallest and largest x of the part of a triangle inside the region.
#[inline]
fn extent_in_region(
    region: &Intruder,
    triangle: &[Vector3<f32>; 3],
    low: f32,
    high: f32,
) -> Option<(f32, f32)> {
    if is_inside(region, triangle) {
        return Some((low, high));
    }
    let mut polygon = Piece::triangle(triangle);
    if !clip_to_region(region, triangle, &mut polygon) {
        return None;
    }
    let xs = polygon.corners().iter().map(|c| c.x);
    Some(xs.fold((f32::MAX, f32::MIN), |(lo, hi), x| (lo.min(x), hi.max(x))))
}

#[inline]
fn is_inside(region: &Intruder, triangle: &[Vector3<f32>; 3]) -> bool {
    let [a, b, c] = triangle;
    let (lo, hi) = (a.inf(b).inf(c), a.sup(b).sup(c));
    (0..3).all(|k| lo[k] >= region.min[k] && hi[k] <= region.max[k])
}

/// A triangle cut by the six planes of the region and the one of a contact patch.
type Piece = Polygon<10>;

/// Cuts `polygon`, which is the triangle, to the region; returns whether anything is left.
#[inline]
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
