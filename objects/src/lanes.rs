//! Up to eight boxes that are asked about together, and which of eight others overlap them.

use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use nalgebra::Vector3;

/// Boxes asked about at once, triangles of a block, children of a node.
pub const LANES: usize = 8;

/// Rounding of f32 coordinates below a metre, with room, metres.
pub(crate) const SLACK_M: f32 = 1.0e-6;

/// Up to eight axis-aligned boxes of one frame.
#[derive(Debug, Clone, Copy)]
pub struct Lanes {
    low: [[f32; 3]; LANES],
    high: [[f32; 3]; LANES],
    /// Lanes that are set, as bits.
    pub(crate) used: u32,
}

impl Default for Lanes {
    fn default() -> Self {
        Self {
            low: [[f32::MAX; 3]; LANES],
            high: [[f32::MIN; 3]; LANES],
            used: 0,
        }
    }
}

impl Lanes {
    /// Sets one box; a lane never set is never hit.
    pub fn set(&mut self, lane: usize, min: Vector3<f32>, max: Vector3<f32>) {
        for axis in 0..3 {
            self.set_axis(lane, axis, min[axis], max[axis]);
        }
        self.used |= 1 << lane;
    }

    /// Sets the extent of one box along one axis.
    #[inline]
    pub fn set_axis(&mut self, lane: usize, axis: usize, min: f32, max: f32) {
        self.low[lane][axis] = min - SLACK_M;
        self.high[lane][axis] = max + SLACK_M;
    }
}

/// Eight numbers side by side.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub(crate) struct Row(pub(crate) [f32; LANES]);

impl Row {
    pub(crate) fn new(number: impl FnMut(usize) -> f32) -> Self {
        Self(std::array::from_fn(number))
    }

    #[inline(always)]
    pub(crate) fn load<S: Simd>(&self, simd: S) -> f32x8<S> {
        f32x8::load_array_ref(simd, &self.0)
    }
}

/// Eight boxes side by side, in the frame of the lanes.
pub(crate) struct Eight<S: Simd> {
    pub(crate) low: [f32x8<S>; 3],
    pub(crate) high: [f32x8<S>; 3],
}

/// Which of eight boxes overlap which lanes.
pub(crate) struct Hits {
    /// By lane, bits of the eight.
    pub(crate) by_lane: [u32; LANES],
    /// Of the eight that overlap any lane.
    pub(crate) any: u32,
}

impl Hits {
    /// Bits of the lanes among `lanes` that one of the eight overlaps.
    #[inline(always)]
    pub(crate) fn lanes_of(&self, one: usize, lanes: u32) -> u32 {
        let mut mask = 0;
        for lane in bits(lanes) {
            mask |= (self.by_lane[lane] >> one & 1) << lane;
        }
        mask
    }
}

impl<S: Simd> Eight<S> {
    #[inline(always)]
    pub(crate) fn hits(&self, lanes: &Lanes, among: u32) -> Hits {
        let mut hits = Hits {
            by_lane: [0; LANES],
            any: 0,
        };
        for lane in bits(among) {
            let (low, high) = (&lanes.low[lane], &lanes.high[lane]);
            let x = self.low[0].simd_le(high[0]) & self.high[0].simd_ge(low[0]);
            let y = self.low[1].simd_le(high[1]) & self.high[1].simd_ge(low[1]);
            let z = self.low[2].simd_le(high[2]) & self.high[2].simd_ge(low[2]);
            hits.by_lane[lane] = (x & y & z).to_bitmask() as u32;
            hits.any |= hits.by_lane[lane];
        }
        hits
    }
}

/// The numbers of the bits that are set, lowest first.
#[inline(always)]
pub fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (mask != 0).then(|| {
            let bit = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            bit
        })
    })
}
