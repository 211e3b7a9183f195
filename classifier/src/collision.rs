//! Does a part of the hand meet the object, and how deep?

use nalgebra::Vector3;
use shakedown_objects::convex::{MAX_PLANES, Polygon};
use wide::f32x8;

use crate::hand::Body;

const GROUPS: usize = MAX_PLANES.div_ceil(8);

/// Depth of the object's surface inside one body, seen from each of its planes.
///
/// `depth_m()` is the shortest way along one face normal of the body that takes every piece of
/// surface found inside out of it.
#[derive(Clone, Copy)]
pub(crate) struct Depth {
    /// Least distance beyond each plane; negative is inside.
    deepest: [f32x8; GROUPS],
    touched: bool,
}

impl Depth {
    pub(crate) fn new() -> Self {
        Self {
            deepest: [f32x8::ZERO; GROUPS],
            touched: false,
        }
    }

    pub(crate) fn touched(&self) -> bool {
        self.touched
    }

    /// Adds a triangle of the surface, in the frame of the body.
    #[inline]
    pub(crate) fn add(&mut self, body: &Body, triangle: &[Vector3<f32>; 3]) {
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
        body: &Body,
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

    pub(crate) fn depth_m(&self, body: &Body) -> f32 {
        if !self.touched {
            return 0.0;
        }
        let lanes = self.deepest[..body.groups.len()].iter().flat_map(|d| d.to_array());
        lanes
            .take(body.planes.len())
            .fold(f32::MAX, |least, d| least.min(-d))
    }
}
