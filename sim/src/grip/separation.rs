//! Along which axis do a box and a triangle overlap least? Eight triangles at once.
//!
//! Separating axes (S. Gottschalk et al., "OBBTree", SIGGRAPH 1996): three faces of the box, the
//! triangle's plane, nine pairs of edges. The box's middle is the origin of its frame.

use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use nalgebra::{Matrix3, Vector3};

/// Triangles that are tested together.
pub(super) const EIGHT: usize = 8;

/// An edge whose cross product with an axis is shorter than this share of it is parallel to the axis
/// (squared).
const PARALLEL: f32 = 1e-6;

type Three<S> = [f32x8<S>; 3];

#[inline(always)]
fn dot<S: Simd>(a: &Three<S>, b: &Three<S>) -> f32x8<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn wide<S: Simd>(simd: S, [x, y, z]: &[[f32; EIGHT]; 3]) -> Three<S> {
    [
        (*x).simd_into(simd),
        (*y).simd_into(simd),
        (*z).simd_into(simd),
    ]
}

#[inline(always)]
fn minus<S: Simd>(a: &Three<S>, b: &Three<S>) -> Three<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn abs<S: Simd>(a: &Three<S>) -> Three<S> {
    [a[0].abs(), a[1].abs(), a[2].abs()]
}

/// Triangles side by side. Places that were never set hold zeros.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Eight {
    corners: [[[f32; EIGHT]; 3]; 3],
    normal: [[f32; EIGHT]; 3],
}

/// Triangles side by side, each in the frame of a box of its own.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pairs {
    triangles: Eight,
    half: [[f32; EIGHT]; 3],
}

/// The axis of least overlap of each triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axes {
    /// Triangles no farther away than was asked, as bits.
    pub near: u32,
    /// Distance along the axis; negative: overlap.
    gap: [f32; EIGHT],
    axis: [[f32; EIGHT]; 3],
}

impl Axes {
    /// Gap, and direction from the box to the triangle, of one of them.
    #[inline]
    pub fn of(&self, lane: usize) -> (f32, Vector3<f32>) {
        let [x, y, z] = &self.axis;
        (self.gap[lane], Vector3::new(x[lane], y[lane], z[lane]))
    }
}

/// The best axis so far.
struct Best<S: Simd> {
    gap: f32x8<S>,
    axis: Three<S>,
}

impl<S: Simd> Best<S> {
    #[inline(always)]
    fn none(simd: S) -> Self {
        Self {
            gap: f32x8::splat(simd, f32::MIN),
            axis: [f32x8::splat(simd, 0.0); 3],
        }
    }

    #[inline(always)]
    fn offer(&mut self, gap: f32x8<S>, [x, y, z]: Three<S>) {
        let wins = gap.simd_gt(self.gap);
        self.gap = wins.select(gap, self.gap);
        self.axis = [
            wins.select(x, self.axis[0]),
            wins.select(y, self.axis[1]),
            wins.select(z, self.axis[2]),
        ];
    }
}

impl Eight {
    /// Sets one triangle, with its unit normal.
    #[inline]
    pub fn set(&mut self, lane: usize, corners: &[Vector3<f32>; 3], normal: &Vector3<f32>) {
        for axis in 0..3 {
            self.normal[axis][lane] = normal[axis];
            for (place, corner) in self.corners.iter_mut().zip(corners) {
                place[axis][lane] = corner[axis];
            }
        }
    }

    /// One triangle.
    #[inline]
    pub fn triangle(&self, lane: usize) -> [Vector3<f32>; 3] {
        let corner = |k: usize| {
            let [x, y, z] = &self.corners[k];
            Vector3::new(x[lane], y[lane], z[lane])
        };
        [corner(0), corner(1), corner(2)]
    }

    /// In another frame.
    #[inline(always)]
    pub fn moved<S: Simd>(&self, simd: S, rotation: &Matrix3<f32>, shift: &Vector3<f32>) -> Self {
        let mut moved = Self::default();
        for i in 0..3 {
            let row = [0, 1, 2].map(|j| f32x8::splat(simd, rotation[(i, j)]));
            let shift = f32x8::splat(simd, shift[i]);
            for k in 0..3 {
                let turned = dot(&wide(simd, &self.corners[k]), &row);
                moved.corners[k][i] = (turned + shift).into();
            }
            moved.normal[i] = dot(&wide(simd, &self.normal), &row).into();
        }
        moved
    }

    /// Which of the first `count` triangles, in the frame of a box of half size `half`, neither its faces
    /// nor their own planes keep farther away than `reach`; as bits.
    #[inline(always)]
    pub fn near<S: Simd>(&self, simd: S, count: usize, half: &Vector3<f32>, reach: f32) -> u32 {
        let half = [half.x, half.y, half.z].map(|x| f32x8::splat(simd, x));
        let normal = wide(simd, &self.normal);
        let [a, b, c] = &self.corners;
        let (a, b, c) = (wide(simd, a), wide(simd, b), wide(simd, c));
        let reach = f32x8::splat(simd, reach);
        let plane = dot(&normal, &a).abs() - dot(&abs(&normal), &half);
        let mut near = plane.simd_le(reach);
        for i in 0..3 {
            let limit = half[i] + reach;
            let low = a[i].min(b[i]).min(c[i]);
            let high = a[i].max(b[i]).max(c[i]);
            near &= low.simd_le(limit) & high.simd_ge(-limit);
        }
        near.to_bitmask() as u32 & ((1 << count) - 1)
    }
}

impl Pairs {
    /// Sets one pair: half size of the box, and lane `from` of some triangles in its frame.
    #[inline]
    pub fn set(&mut self, lane: usize, half: &Vector3<f32>, triangles: &Eight, from: usize) {
        for axis in 0..3 {
            self.half[axis][lane] = half[axis];
            self.triangles.normal[axis][lane] = triangles.normal[axis][from];
            for corner in 0..3 {
                self.triangles.corners[corner][axis][lane] = triangles.corners[corner][axis][from];
            }
        }
    }

    /// The triangle of one pair.
    #[inline]
    pub fn triangle(&self, lane: usize) -> [Vector3<f32>; 3] {
        self.triangles.triangle(lane)
    }

    /// Axes of least overlap of the first `count` pairs; near are those not more than `prediction` apart.
    #[inline(always)]
    pub fn axes<S: Simd>(&self, simd: S, count: usize, prediction: f32) -> Axes {
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let half = wide(simd, &self.half);
        let face = wide(simd, &self.triangles.normal);
        let [a, b, c] = &self.triangles.corners;
        let (a, b, c) = (wide(simd, a), wide(simd, b), wide(simd, c));
        let prediction = f32x8::splat(simd, prediction);
        let used = (1u32 << count) - 1;

        let mut best = Best::none(simd);
        for i in 0..3 {
            let low = a[i].min(b[i]).min(c[i]);
            let high = a[i].max(b[i]).max(c[i]);
            for (sign, gap) in [(one, low - half[i]), (-one, -high - half[i])] {
                let mut axis = [zero; 3];
                axis[i] = sign;
                best.offer(gap, axis);
            }
        }
        let offset = dot(&face, &a);
        let face_gap = offset.abs() - dot(&abs(&face), &half);
        let mut near = best.gap.simd_le(prediction) & face_gap.simd_le(prediction);
        let mut edges = Best::none(simd);
        // Both ends of an edge project to the same point.
        let sides = [
            (minus(&b, &a), &a, &c),
            (minus(&c, &b), &b, &a),
            (minus(&a, &c), &a, &b),
        ];
        for (edge, end, other) in &sides {
            let least = f32x8::splat(simd, PARALLEL) * dot(edge, edge);
            for cross in [
                [zero, -edge[2], edge[1]],
                [edge[2], zero, -edge[0]],
                [-edge[1], edge[0], zero],
            ] {
                let square = dot(&cross, &cross);
                let (p, q) = (dot(&cross, end), dot(&cross, other));
                let (min, max) = (p.min(q), p.max(q));
                let reach = dot(&abs(&cross), &half);
                let ahead = min.simd_gt(-max);
                let per_length = one / square.sqrt();
                let gap = (ahead.select(min, -max) - reach) * per_length;
                let gap = square
                    .simd_le(least)
                    .select(f32x8::splat(simd, f32::MIN), gap);
                let scale = ahead.select(per_length, -per_length);
                edges.offer(gap, [cross[0] * scale, cross[1] * scale, cross[2] * scale]);
            }
        }
        near &= edges.gap.simd_le(prediction);

        let toward = offset.simd_gt(zero).select(one, -one);
        let by_face = face_gap.simd_gt(best.gap) & face_gap.simd_gt(edges.gap);
        let by_edge = edges.gap.simd_gt(best.gap);
        let pick = |box_face: f32x8<S>, plane: f32x8<S>, edge: f32x8<S>| {
            let best = by_face.select(plane, by_edge.select(edge, box_face));
            best.into()
        };
        let along = |k: usize| pick(best.axis[k], face[k] * toward, edges.axis[k]);
        Axes {
            near: near.to_bitmask() as u32 & used,
            gap: pick(best.gap, face_gap, edges.gap),
            axis: [along(0), along(1), along(2)],
        }
    }
}
