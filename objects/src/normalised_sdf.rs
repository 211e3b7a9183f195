//! What does a network see of an object? The distance grid as numbers in [-1, 1], read anywhere.

use nalgebra::Point3;

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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::Family;

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
}
