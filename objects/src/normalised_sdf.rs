//! What does a network see of an object? The distance grid as numbers in [-1, 1], read anywhere.

use nalgebra::{Matrix3, Point3, Vector3};
use wide::f32x8;

use crate::sdf::{Normalisation, SdfGrid};

/// A signed distance grid in the normalised frame of a flow model: origin at the grid's centre,
/// lengths divided by [`scale_m`](Self::scale_m).
#[derive(Debug, Clone, PartialEq)]
pub struct NormalisedSdf {
    /// Nodes along each edge.
    pub resolution: usize,
    /// Centre of the grid, object frame, metres.
    pub centre_m: Point3<f64>,
    /// The factor that undoes the normalisation, metres.
    pub scale_m: f64,
    /// Half the edge of the grid, normalised units.
    pub half_edge: f32,
    /// Normalised distances, `values[(ix * resolution + iy) * resolution + iz]`.
    pub values: Vec<f32>,
}

/// Points fixed to a body, read together wherever the body is.
#[derive(Debug, Clone)]
pub struct Probe {
    lanes: Vec<[f32x8; 3]>,
    len: usize,
}

impl Probe {
    /// Of points in the frame of the body, metres.
    pub fn new(points_m: &[[f64; 3]]) -> Self {
        let lanes = points_m.chunks(8).map(|eight| {
            let axis = |k: usize| {
                let mut lane = [0.0; 8];
                for (x, p) in lane.iter_mut().zip(eight) {
                    *x = p[k] as f32;
                }
                f32x8::from(lane)
            };
            [axis(0), axis(1), axis(2)]
        });
        Self {
            lanes: lanes.collect(),
            len: points_m.len(),
        }
    }

    /// How many points.
    #[expect(
        clippy::len_without_is_empty,
        reason = "an empty probe is nobody's question"
    )]
    pub fn len(&self) -> usize {
        self.len
    }
}

impl NormalisedSdf {
    /// Normalises a grid.
    pub fn new(grid: &SdfGrid, normalisation: Normalisation) -> Self {
        let (values, scale_m) = grid.normalised(normalisation);
        Self {
            resolution: grid.resolution,
            centre_m: grid.centre_m,
            scale_m,
            half_edge: (grid.half_edge_m / scale_m) as f32,
            values,
        }
    }

    /// Normalised distance at a point of the normalised frame: trilinear between the nodes; a
    /// point outside has the distance of the nearest point of the grid's cube.
    #[inline]
    pub fn at(&self, point: [f32; 3]) -> f32 {
        let n = self.resolution;
        let last = (n - 1) as f32;
        let scale = 0.5 * last / self.half_edge;
        let mut low = [0usize; 3];
        let mut f = [0f32; 3];
        for k in 0..3 {
            let place = (point[k] * scale + 0.5 * last).clamp(0.0, last);
            low[k] = (place as usize).min(n - 2);
            f[k] = place - low[k] as f32;
        }
        let base = (low[0] * n + low[1]) * n + low[2];
        let edge = |i: usize| self.values[i] + (self.values[i + 1] - self.values[i]) * f[2];
        let face = |i: usize| {
            let (a, b) = (edge(i), edge(i + n));
            a + (b - a) * f[1]
        };
        let (a, b) = (face(base), face(base + n * n));
        a + (b - a) * f[0]
    }

    /// As [`at`](Self::at), bit by bit, for all points of a probe: point `p` of its frame lies at
    /// `turn p + shift`, where `turn` holds the rotation divided by [`scale_m`](Self::scale_m).
    ///
    /// # Panics
    /// If `out` has another length than the probe.
    pub fn at_probe(
        &self,
        probe: &Probe,
        turn: &Matrix3<f32>,
        shift: &Vector3<f32>,
        out: &mut [f32],
    ) {
        assert_eq!(out.len(), probe.len);
        let n = self.resolution;
        let last = (n - 1) as f32;
        let scale = f32x8::splat(0.5 * last / self.half_edge);
        let (middle, zero, last) = (f32x8::splat(0.5 * last), f32x8::ZERO, f32x8::splat(last));
        let highest = f32x8::splat((n - 2) as f32);
        for ([x, y, z], out) in probe.lanes.iter().zip(out.chunks_mut(8)) {
            let mut low = [[0i32; 8]; 3];
            let mut f = [zero; 3];
            for k in 0..3 {
                let entry = |j: usize| f32x8::splat(turn[(k, j)]);
                let q = entry(0) * *x + entry(1) * *y + entry(2) * *z + f32x8::splat(shift[k]);
                let place = (q * scale + middle).max(zero).min(last);
                let whole = place.min(highest).fast_trunc_int();
                f[k] = place - f32x8::from_i32x8(whole);
                low[k] = whole.to_array();
            }
            let mut corners = [[0f32; 8]; 8];
            for lane in 0..8 {
                let [i, j, k] = [0, 1, 2].map(|axis| low[axis][lane] as usize);
                let base = (i * n + j) * n + k;
                let near = &self.values[base..base + n * n + n + 2];
                for (c, at) in [0, n, n * n, n * n + n].into_iter().enumerate() {
                    corners[2 * c][lane] = near[at];
                    corners[2 * c + 1][lane] = near[at + 1];
                }
            }
            let c = corners.map(f32x8::from);
            let between = |a: f32x8, b: f32x8, f: f32x8| a + (b - a) * f;
            let edge = |e: usize| between(c[2 * e], c[2 * e + 1], f[2]);
            let face = |s: usize| between(edge(2 * s), edge(2 * s + 1), f[1]);
            let value = between(face(0), face(1), f[0]).to_array();
            for (out, value) in out.iter_mut().zip(value) {
                *out = value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::Family;
    use nalgebra::Rotation3;

    #[test]
    fn a_node_reads_its_own_value_and_a_far_point_that_of_the_border() {
        let object = Family::Mug.member(0).object().unwrap();
        let grid = SdfGrid::bake(&object.surface, 16, 0.1);
        let sdf = NormalisedSdf::new(&grid, Normalisation::HalfEdge);
        for [x, y, z] in [[0usize, 0, 0], [15, 15, 15], [3, 7, 11]] {
            let p = (grid.node(x, y, z) - grid.centre_m) / sdf.scale_m;
            let value = sdf.at([p.x as f32, p.y as f32, p.z as f32]);
            assert!((value - sdf.values[(x * 16 + y) * 16 + z]).abs() < 1e-5);
        }
        assert_eq!(sdf.at([9.0, 9.0, 9.0]), sdf.values[16 * 16 * 16 - 1]);
    }

    #[test]
    fn a_probe_reads_what_its_points_read_one_by_one() {
        let object = Family::Mug.member(0).object().unwrap();
        let grid = SdfGrid::bake(&object.surface, 16, 0.1);
        let sdf = NormalisedSdf::new(&grid, Normalisation::HalfEdge);
        let points: Vec<[f64; 3]> = (0..27)
            .map(|i| [i % 3, i / 3 % 3, i / 9].map(|k| 0.06 * (k as f64 - 1.0)))
            .collect();
        let probe = Probe::new(&points);
        let turn = *Rotation3::from_euler_angles(0.3, -1.1, 2.0).matrix() / sdf.scale_m as f32;
        for shift in [
            [0.0, 0.1, -0.2],
            [0.9, -3.0, 0.0],
            [f32::INFINITY, 0.0, 0.0],
        ] {
            let shift = Vector3::from(shift);
            let mut out = vec![0.0; probe.len()];
            sdf.at_probe(&probe, &turn, &shift, &mut out);
            for (p, d) in points.iter().zip(out) {
                let q = turn * Vector3::from(p.map(|x| x as f32)) + shift;
                assert_eq!(d.to_bits(), sdf.at([q.x, q.y, q.z]).to_bits());
            }
        }
    }
}
