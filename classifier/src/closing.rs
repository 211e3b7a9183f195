//! Where does each pad first touch when the fingers close, and on what slope?

use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use nalgebra::Vector3;
use shakedown_objects::surface::{Lanes, Near, bits};

use crate::hand::{HandModel, STRIP_LEFT, STRIP_RIGHT};
use crate::patch::{self, Patch, extent_in_region};
use crate::prism::Extent;

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
    /// Triangles that may belong to a contact patch.
    candidates: Vec<Candidate>,
}

struct Candidate {
    /// Smallest and largest x of what is in the region, metres.
    low: f32,
    high: f32,
    triangle: [Vector3<f32>; 3],
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

    /// Adds the triangles near the strips; these shrink to what could still be a first contact.
    #[inline(always)]
    pub(crate) fn add<S: Simd>(&mut self, hand: &HandModel, near: &Near<'_, S>, lanes: &mut Lanes) {
        let strips = near.of_lane(STRIP_LEFT) | near.of_lane(STRIP_RIGHT);
        let (low, high) = near.extent(0);
        let strips = strips & self.may_be_first(low, high);
        if strips == 0 {
            return;
        }
        let region = &hand.region_body;
        let Extent { low, high, unknown } = hand.prism.extent(near.simd(), &near.corners, strips);
        let (min, max) = (region.min.x, region.max.x);
        let meets = low.simd_le(high) & low.simd_le(max) & high.simd_ge(min);
        let (low, high) = (low.max(min), high.min(max));
        let known = self.may_be_first(low, high) & meets.to_bitmask() as u32;
        for i in bits(strips & (known | unknown)) {
            let triangle = near.triangle(i);
            let (mut low, mut high) = (low.as_array()[i], high.as_array()[i]);
            if unknown >> i & 1 == 1 {
                let Some(exact) = extent_in_region(region, &triangle) else {
                    continue;
                };
                (low, high) = exact;
            }
            if low < self.lo {
                self.lo = low;
                lanes.set_axis(STRIP_LEFT, 0, region.min.x, low + PATCH_DEPTH_M);
            }
            if high > self.hi {
                self.hi = high;
                lanes.set_axis(STRIP_RIGHT, 0, high - PATCH_DEPTH_M, region.max.x);
            }
            self.candidates.push(Candidate {
                low,
                high,
                triangle,
            });
        }
    }

    /// Bits of those extents along x that could belong to a first contact or its patch.
    #[inline(always)]
    fn may_be_first<S: Simd>(&self, low: f32x8<S>, high: f32x8<S>) -> u32 {
        let left = low.simd_le(self.lo + PATCH_DEPTH_M);
        let right = high.simd_ge(self.hi - PATCH_DEPTH_M);
        (left | right).to_bitmask() as u32
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
        let border = sign * x - PATCH_DEPTH_M;
        let members = || {
            let near = move |c: &&Candidate| (if sign > 0.0 { c.high } else { -c.low }) >= border;
            self.candidates.iter().filter(near).map(|c| &c.triangle)
        };
        let mut patch = Patch::new(hand, sign, border);
        members().for_each(|t| patch.add(t));
        patch.slope_and_height().unwrap_or_else(|| {
            // An edge seen from the side: nothing faces the pad.
            let z_m = patch::corner_height_m(hand, sign, border, members());
            (std::f64::consts::FRAC_PI_2, f64::from(z_m))
        })
    }
}
