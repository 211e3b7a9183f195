//! Along which axis do a box and a triangle overlap least? Eight triangles at once.
//!
//! Separating axes (S. Gottschalk et al., "OBBTree", SIGGRAPH 1996): three faces of the box, the
//! triangle's plane, nine pairs of edges. The box's middle is the origin of its frame.

use nalgebra::{Matrix3, Vector3};
use wide::f32x8;

/// Triangles that are tested together.
pub(super) const EIGHT: usize = 8;

/// An edge whose cross product with an axis is shorter than this share of it is parallel to the axis
/// (squared).
const PARALLEL: f32 = 1e-6;

type Three = [f32x8; 3];

#[inline(always)]
fn dot(a: &Three, b: &Three) -> f32x8 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn wide([x, y, z]: &[[f32; EIGHT]; 3]) -> Three {
    [f32x8::from(*x), f32x8::from(*y), f32x8::from(*z)]
}

#[inline(always)]
fn minus(a: &Three, b: &Three) -> Three {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn abs(a: &Three) -> Three {
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
struct Best {
    gap: f32x8,
    axis: Three,
}

impl Best {
    #[inline(always)]
    fn none() -> Self {
        Self {
            gap: f32x8::splat(f32::MIN),
            axis: [f32x8::ZERO; 3],
        }
    }

    #[inline(always)]
    fn offer(&mut self, gap: f32x8, [x, y, z]: Three) {
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
    #[inline]
    pub fn moved(&self, rotation: &Matrix3<f32>, shift: &Vector3<f32>) -> Self {
        let mut moved = Self::default();
        for i in 0..3 {
            let row = [0, 1, 2].map(|j| f32x8::splat(rotation[(i, j)]));
            let shift = f32x8::splat(shift[i]);
            let turned = |[x, y, z]: &[[f32; EIGHT]; 3]| {
                f32x8::from(*x) * row[0] + f32x8::from(*y) * row[1] + f32x8::from(*z) * row[2]
            };
            for k in 0..3 {
                moved.corners[k][i] = (turned(&self.corners[k]) + shift).to_array();
            }
            moved.normal[i] = turned(&self.normal).to_array();
        }
        moved
    }

    /// Which of the first `count` triangles, in the frame of a box of half size `half`, neither its faces
    /// nor their own planes keep farther away than `reach`; as bits.
    #[inline]
    pub fn near(&self, count: usize, half: &Vector3<f32>, reach: f32) -> u32 {
        let half = [half.x, half.y, half.z].map(f32x8::splat);
        let normal = wide(&self.normal);
        let [a, b, c] = &self.corners;
        let (a, b, c) = (wide(a), wide(b), wide(c));
        let reach = f32x8::splat(reach);
        let plane = dot(&normal, &a).abs() - dot(&abs(&normal), &half);
        let mut near = plane.simd_le(reach);
        for i in 0..3 {
            let limit = half[i] + reach;
            let low = a[i].fast_min(b[i]).fast_min(c[i]);
            let high = a[i].fast_max(b[i]).fast_max(c[i]);
            near &= low.simd_le(limit) & high.simd_ge(-limit);
        }
        near.to_bitmask() & ((1 << count) - 1)
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
    pub fn axes(&self, count: usize, prediction: f32) -> Axes {
        let (zero, one) = (f32x8::ZERO, f32x8::ONE);
        let half = wide(&self.half);
        let face = wide(&self.triangles.normal);
        let [a, b, c] = &self.triangles.corners;
        let (a, b, c) = (wide(a), wide(b), wide(c));
        let prediction = f32x8::splat(prediction);
        let used = (1u32 << count) - 1;

        let mut best = Best::none();
        for i in 0..3 {
            let low = a[i].fast_min(b[i]).fast_min(c[i]);
            let high = a[i].fast_max(b[i]).fast_max(c[i]);
            for (sign, gap) in [(one, low - half[i]), (-one, -high - half[i])] {
                let mut axis = [zero; 3];
                axis[i] = sign;
                best.offer(gap, axis);
            }
        }
        let offset = dot(&face, &a);
        let face_gap = offset.abs() - dot(&abs(&face), &half);
        let mut near = best.gap.simd_le(prediction) & face_gap.simd_le(prediction);
        let mut edges = Best::none();
        // Both ends of an edge project to the same point.
        let sides = [
            (minus(&b, &a), &a, &c),
            (minus(&c, &b), &b, &a),
            (minus(&a, &c), &a, &b),
        ];
        for (edge, end, other) in &sides {
            let least = f32x8::splat(PARALLEL) * dot(edge, edge);
            for cross in [
                [zero, -edge[2], edge[1]],
                [edge[2], zero, -edge[0]],
                [-edge[1], edge[0], zero],
            ] {
                let square = dot(&cross, &cross);
                let (p, q) = (dot(&cross, end), dot(&cross, other));
                let (min, max) = (p.fast_min(q), p.fast_max(q));
                let reach = dot(&abs(&cross), &half);
                let ahead = min.simd_gt(-max);
                let per_length = one / square.sqrt();
                let gap = (ahead.select(min, -max) - reach) * per_length;
                let gap = square.simd_le(least).select(f32x8::splat(f32::MIN), gap);
                let scale = ahead.select(per_length, -per_length);
                edges.offer(gap, [cross[0] * scale, cross[1] * scale, cross[2] * scale]);
            }
        }
        near &= edges.gap.simd_le(prediction);

        let toward = offset.simd_gt(zero).select(one, -one);
        let by_face = face_gap.simd_gt(best.gap) & face_gap.simd_gt(edges.gap);
        let by_edge = edges.gap.simd_gt(best.gap);
        let pick = |box_face: f32x8, plane: f32x8, edge: f32x8| {
            by_face
                .select(plane, by_edge.select(edge, box_face))
                .to_array()
        };
        let along = |k: usize| pick(best.axis[k], face[k] * toward, edges.axis[k]);
        Axes {
            near: near.to_bitmask() & used,
            gap: pick(best.gap, face_gap, edges.gap),
            axis: [along(0), along(1), along(2)],
        }
    }
}
