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
#[derive(Clone, Copy)]
pub(crate) struct Hits {
    /// Bits of the eight, a byte a lane.
    by_lane: u64,
    /// Of the eight that overlap any lane.
    pub(crate) any: u32,
}

impl Hits {
    /// Without those that come after the first `n` of the eight.
    #[inline(always)]
    pub(crate) fn of_first(self, n: usize) -> Self {
        let first = (1u64 << n) - 1;
        Self {
            by_lane: self.by_lane & (first * 0x0101_0101_0101_0101),
            any: self.any & first as u32,
        }
    }

    /// Bits of the eight that overlap `lane`.
    #[inline(always)]
    pub(crate) fn of_lane(&self, lane: usize) -> u32 {
        (self.by_lane >> (LANES * lane)) as u32 & 0xff
    }

    /// Does any of the eight overlap one of the first `n` lanes?
    #[inline(always)]
    pub(crate) fn meets_first(&self, n: usize) -> bool {
        self.by_lane & ((1 << (LANES * n)) - 1) != 0
    }

    /// Bits of the lanes, a byte each of the eight.
    #[inline(always)]
    pub(crate) fn lanes(&self) -> LanesOf {
        // H. S. Warren, "Hacker's Delight", 2nd ed. 2012, section 7-3: squares of 1, 2 and 4 bits
        // change places across the diagonal.
        let mut x = self.by_lane;
        for (shift, mask) in [
            (7, 0x00aa_00aa_00aa_00aa_u64),
            (14, 0x0000_cccc_0000_cccc),
            (28, 0x0000_0000_f0f0_f0f0),
        ] {
            let t = (x ^ (x >> shift)) & mask;
            x ^= t ^ (t << shift);
        }
        LanesOf(x)
    }
}

/// The lanes that each of eight boxes overlaps.
#[derive(Clone, Copy)]
pub(crate) struct LanesOf(u64);

impl LanesOf {
    /// Bits of the lanes that one of them overlaps.
    #[inline(always)]
    pub(crate) fn get(self, one: usize) -> u32 {
        (self.0 >> (LANES * one)) as u32 & 0xff
    }
}

impl<S: Simd> Eight<S> {
    #[inline(always)]
    pub(crate) fn hits(&self, lanes: &Lanes, among: u32) -> Hits {
        let mut hits = Hits { by_lane: 0, any: 0 };
        for lane in bits(among) {
            let (low, high) = (&lanes.low[lane], &lanes.high[lane]);
            let x = self.low[0].simd_le(high[0]) & self.high[0].simd_ge(low[0]);
            let y = self.low[1].simd_le(high[1]) & self.high[1].simd_ge(low[1]);
            let z = self.low[2].simd_le(high[2]) & self.high[2].simd_ge(low[2]);
            let mask = (x & y & z).to_bitmask();
            hits.by_lane |= mask << (LANES * lane);
            hits.any |= mask as u32;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lanes_of_a_box_are_those_that_it_is_a_box_of() {
        let by_lane = 0x8001_37ff_00a5_c312;
        let hits = Hits { by_lane, any: 0xff };
        for one in 0..LANES {
            for lane in 0..LANES {
                assert_eq!(
                    hits.lanes().get(one) >> lane & 1,
                    hits.of_lane(lane) >> one & 1
                );
            }
        }
    }
}
