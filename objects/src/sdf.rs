//! How far is each node of a cubic grid from the surface? Exact distances, negative inside.
//!
//! The grid is cut into blocks. For a block with centre c and radius r, only triangles nearer to
//! c than d(c) + 2 r can be nearest to any of its nodes; they are gathered once per block. A
//! triangle is convex, so with q its point nearest to c and n the unit vector from q to c, it lies
//! behind the plane through q: its distance from a node p is at least d + n . (p - c). Only
//! triangles whose bound beats the best distance so far are measured.

use nalgebra::{Point3, Vector3};
use parry3d::math::Vector as Vec3f;
use parry3d::partitioning::TraversalAction;
use rayon::prelude::*;
use wide::f32x8;

use crate::surface::Surface;
use crate::triangle::{Feature, closest_point};

/// What divides the distances so that they lie in [-1, 1] (`scale` of the model contract undoes it).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Normalisation {
    /// The largest absolute distance on the grid, per instance, as in the RFMGrasp paper.
    #[default]
    MaxAbs,
    /// Half the edge of the grid; larger distances are clamped. Grid nodes then span [-1, 1].
    HalfEdge,
}

/// Signed distances on the nodes of a cube around an object.
#[derive(Debug, Clone, PartialEq)]
pub struct SdfGrid {
    /// Nodes along each edge.
    pub resolution: usize,
    /// Centre of the cube, object frame, metres: the middle of the object's axis-aligned box.
    pub centre_m: Point3<f64>,
    /// Half the edge of the cube, from first to last node, metres.
    pub half_edge_m: f64,
    /// Signed distances, metres, `values_m[(ix * resolution + iy) * resolution + iz]`.
    pub values_m: Vec<f32>,
}

/// Nodes along the edge of a block, and of the wide blocks that share one search of the tree.
const BLOCK: usize = 4;
const WIDE: usize = 16;

/// Rounding of f32 coordinates below a metre, with room: bounds give way by it, distances do not.
const ROUNDING_M: f32 = 1.0e-6;

impl SdfGrid {
    /// Bakes a grid of `resolution`^3 nodes whose cube is the object's longest axis-aligned
    /// extent grown by `padding` (0.1: 10 % longer). Blocks are spread over the current rayon pool.
    ///
    /// # Panics
    /// If `resolution < 2`.
    pub fn bake(surface: &Surface, resolution: usize, padding: f64) -> Self {
        assert!(resolution >= 2, "a grid needs two nodes along an edge");
        let (lo, hi) = surface.mesh().bounds();
        let centre_m = nalgebra::center(&lo, &hi);
        let half_edge_m = 0.5 * (hi - lo).max() * (1.0 + padding);
        let spacing = 2.0 * half_edge_m / (resolution - 1) as f64;
        let corner = centre_m - Vector3::repeat(half_edge_m);
        // One slab of blocks per task; each writes its own contiguous x-range.
        let mut values_m = vec![0.0f32; resolution.pow(3)];
        values_m
            .par_chunks_mut(BLOCK * resolution * resolution)
            .enumerate()
            .for_each(|(bx, slab)| {
                let mut wide = Near::default();
                let mut narrow = Near::default();
                let steps = |first: usize, size: usize| (first..resolution).step_by(size);
                let x = bx * BLOCK;
                let grid = Nodes {
                    corner,
                    spacing,
                    resolution,
                };
                for y in steps(0, WIDE) {
                    for z in steps(0, WIDE) {
                        let (centre, radius) = grid.ball([x, y, z], [BLOCK, WIDE, WIDE]);
                        wide.gather(surface, &centre, radius);
                        for by in (y..(y + WIDE).min(resolution)).step_by(BLOCK) {
                            for bz in (z..(z + WIDE).min(resolution)).step_by(BLOCK) {
                                let first = [x, by, bz];
                                let (centre, radius) = grid.ball(first, [BLOCK; 3]);
                                narrow.narrow(&wide, surface, &centre, radius);
                                bake_block(surface, &grid, first, &narrow, |i, d| {
                                    slab[((i[0] - x) * resolution + i[1]) * resolution + i[2]] = d;
                                });
                            }
                        }
                    }
                }
            });
        Self {
            resolution,
            centre_m,
            half_edge_m,
            values_m,
        }
    }

    /// The distances divided by `scale`, and that scale, metres.
    pub fn normalised(&self, normalisation: Normalisation) -> (Vec<f32>, f64) {
        let scale = match normalisation {
            Normalisation::MaxAbs => {
                f64::from(self.values_m.iter().fold(0.0f32, |m, v| m.max(v.abs())))
            }
            Normalisation::HalfEdge => self.half_edge_m,
        };
        let values = self
            .values_m
            .iter()
            .map(|&v| (f64::from(v) / scale).clamp(-1.0, 1.0) as f32)
            .collect();
        (values, scale)
    }

    /// Position of a node, object frame, metres.
    pub fn node(&self, ix: usize, iy: usize, iz: usize) -> Point3<f64> {
        let spacing = 2.0 * self.half_edge_m / (self.resolution - 1) as f64;
        self.centre_m - Vector3::repeat(self.half_edge_m)
            + Vector3::new(ix as f64, iy as f64, iz as f64) * spacing
    }
}

/// Eight triangles as seen from the centre of a block: distance from it, less rounding, and the
/// unit vector from the nearest point towards it.
#[derive(Clone, Copy)]
struct Candidates {
    distance: f32x8,
    towards: [f32x8; 3],
}

impl Candidates {
    /// Lower bounds of the distances from a node at `offset` from the centre.
    #[inline]
    fn bounds(&self, offset: &Vector3<f32>) -> f32x8 {
        let [x, y, z] = self.towards;
        self.distance
            + x * f32x8::splat(offset.x)
            + y * f32x8::splat(offset.y)
            + z * f32x8::splat(offset.z)
    }
}

/// Where the nodes are.
struct Nodes {
    corner: Point3<f64>,
    spacing: f64,
    resolution: usize,
}

impl Nodes {
    fn at(&self, i: [usize; 3]) -> Point3<f64> {
        self.corner + Vector3::from(i.map(|k| k as f64)) * self.spacing
    }

    /// One past the last node of a block, within the grid.
    fn end(&self, first: [usize; 3], size: [usize; 3]) -> [usize; 3] {
        std::array::from_fn(|k| (first[k] + size[k]).min(self.resolution))
    }

    /// Centre and radius of the ball around the nodes of a block.
    fn ball(&self, first: [usize; 3], size: [usize; 3]) -> (Point3<f64>, f64) {
        let (a, b) = (
            self.at(first),
            self.at(self.end(first, size).map(|k| k - 1)),
        );
        (nalgebra::center(&a, &b), (b - a).norm() / 2.0)
    }
}

/// The triangles that can be nearest to some point of a ball.
#[derive(Default)]
struct Near {
    centre: Point3<f64>,
    /// (distance from the centre, direction towards it, face)
    faces: Vec<(f64, Vector3<f64>, u32)>,
    groups: Vec<Candidates>,
    /// Nearest distance at the last centre a tree was searched from, and that centre.
    last: Option<(Point3<f64>, f64)>,
}

/// The nearest triangle of a point.
#[derive(Clone, Copy)]
struct Hit {
    distance: f64,
    face: u32,
    point: Point3<f64>,
    feature: Feature,
}

impl Near {
    /// Exact nearest triangle of a point of the ball; `hint` is measured first.
    #[inline]
    fn nearest(&self, surface: &Surface, p: &Point3<f64>, hint: u32) -> Hit {
        let measure = |face: u32| {
            let (point, feature) = closest_point(p, surface.triangle(face));
            let distance = (p - point).norm();
            Hit {
                distance,
                face,
                point,
                feature,
            }
        };
        let offset = (p - self.centre).map(|x| x as f32);
        let mut best = measure(hint);
        for (k, group) in self.groups.iter().enumerate() {
            let reach = f32x8::splat(best.distance as f32 + ROUNDING_M);
            let mut open = group.bounds(&offset).simd_lt(reach).to_bitmask();
            while open != 0 {
                let i = 8 * k + open.trailing_zeros() as usize;
                open &= open - 1;
                let hit = measure(self.faces[i].2);
                if hit.distance < best.distance {
                    best = hit;
                }
            }
        }
        best
    }

    /// Searches the tree for the ball.
    fn gather(&mut self, surface: &Surface, centre: &Point3<f64>, radius: f64) {
        let (bvh, origin) = surface.tree();
        let c = centre - origin;
        let local = Vec3f::new(c.x as f32, c.y as f32, c.z as f32);
        // Bounded by the neighbour's distance, then tightened on the way.
        let mut nearest = match self.last {
            Some((old, d)) => d + (centre - old).norm() + 1.0e-9,
            None => {
                let (_, q, _) = surface.closest(centre);
                (q - centre).norm()
            }
        };
        self.faces.clear();
        bvh.traverse(|node| {
            let gap = (node.mins() - local)
                .max(local - node.maxs())
                .max(Vec3f::ZERO);
            if f64::from(gap.length()) - f64::from(ROUNDING_M) > nearest + 2.0 * radius {
                return TraversalAction::Prune;
            }
            if let Some(face) = node.leaf_data() {
                let seen = seen_from(surface, centre, face);
                nearest = nearest.min(seen.0);
                self.faces.push(seen);
            }
            TraversalAction::Continue
        });
        self.last = Some((*centre, nearest));
        self.close(centre, nearest + 2.0 * radius);
    }

    /// Takes what a smaller ball needs out of the list of a larger one.
    fn narrow(&mut self, wide: &Self, surface: &Surface, centre: &Point3<f64>, radius: f64) {
        let hint = wide.faces[0].2;
        let limit = wide.nearest(surface, centre, hint).distance + 2.0 * radius;
        let offset = (centre - wide.centre).map(|x| x as f32);
        let reach = f32x8::splat(limit as f32 + ROUNDING_M);
        self.faces.clear();
        for (k, group) in wide.groups.iter().enumerate() {
            let mut open = group.bounds(&offset).simd_lt(reach).to_bitmask();
            while open != 0 {
                let i = 8 * k + open.trailing_zeros() as usize;
                open &= open - 1;
                self.faces.push(seen_from(surface, centre, wide.faces[i].2));
            }
        }
        self.close(centre, limit);
    }

    /// Drops what is beyond the limit and lines up the rest for the search.
    fn close(&mut self, centre: &Point3<f64>, limit: f64) {
        self.centre = *centre;
        self.faces.retain(|(d, _, _)| *d <= limit);
        self.groups.clear();
        for chunk in self.faces.chunks(8) {
            let mut distance = [f32::MAX; 8];
            let mut towards = [[0.0f32; 8]; 3];
            for (lane, (d, n, _)) in chunk.iter().enumerate() {
                distance[lane] = *d as f32 - ROUNDING_M;
                for axis in 0..3 {
                    towards[axis][lane] = n[axis] as f32;
                }
            }
            self.groups.push(Candidates {
                distance: f32x8::from(distance),
                towards: towards.map(f32x8::from),
            });
        }
    }
}

/// Distance and direction of a triangle from a centre.
fn seen_from(surface: &Surface, centre: &Point3<f64>, face: u32) -> (f64, Vector3<f64>, u32) {
    let (q, _) = closest_point(centre, surface.triangle(face));
    let away = centre - q;
    let d = away.norm();
    let towards = if d > 0.0 { away / d } else { Vector3::zeros() };
    (d, towards, face)
}

fn bake_block(
    surface: &Surface,
    grid: &Nodes,
    first: [usize; 3],
    near: &Near,
    mut write: impl FnMut([usize; 3], f32),
) {
    let end = grid.end(first, [BLOCK; 3]);
    // The winner of the node before is almost always close to the answer.
    let mut hint = near.faces[0].2;
    for ix in first[0]..end[0] {
        for iy in first[1]..end[1] {
            for iz in first[2]..end[2] {
                let p = grid.at([ix, iy, iz]);
                let hit = near.nearest(surface, &p, hint);
                hint = hit.face;
                let inside = if surface.is_watertight() {
                    let normal = surface.pseudo_normal(hit.face as usize, hit.feature);
                    (p - hit.point).dot(normal) < 0.0
                } else {
                    surface.winding_number(&p) > 0.5
                };
                let distance = if inside { -hit.distance } else { hit.distance };
                write([ix, iy, iz], distance as f32);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::Family;

    #[test]
    fn the_grid_equals_the_brute_force_distance_at_every_node() {
        let shape = Family::Mug.member(0);
        let surface = Surface::new(shape.mesh().unwrap(), true);
        let grid = SdfGrid::bake(&surface, 17, 0.2);
        for ix in 0..17 {
            for iy in 0..17 {
                for iz in 0..17 {
                    let p = grid.node(ix, iy, iz);
                    let brute = (0..surface.mesh().faces().len())
                        .map(|f| {
                            let (q, _) = closest_point(&p, &surface.mesh().triangle(f));
                            (p - q).norm()
                        })
                        .fold(f64::INFINITY, f64::min);
                    let value = f64::from(grid.values_m[(ix * 17 + iy) * 17 + iz]);
                    assert!((value.abs() - brute).abs() < 1e-8, "{value} {brute}");
                    let inside = surface.winding_number(&p) > 0.5;
                    assert!(inside == (value < 0.0) || brute < 1e-9, "sign at {p}");
                }
            }
        }
    }

    #[test]
    fn normalised_distances_lie_in_the_unit_interval_and_scale_undoes_it() {
        let surface = Surface::new(Family::Bottle.member(1).mesh().unwrap(), true);
        let grid = SdfGrid::bake(&surface, 12, 0.1);
        for kind in [Normalisation::MaxAbs, Normalisation::HalfEdge] {
            let (values, scale) = grid.normalised(kind);
            assert!(values.iter().all(|v| (-1.0..=1.0).contains(v)));
            for (v, m) in values.iter().zip(&grid.values_m) {
                let clamped = f64::from(v.abs()) >= 1.0;
                assert!(clamped || (f64::from(*v) * scale - f64::from(*m)).abs() < 1e-8);
            }
        }
        let (values, _) = grid.normalised(Normalisation::MaxAbs);
        assert!((values.iter().fold(0.0f32, |m, v| m.max(v.abs())) - 1.0).abs() < 1e-6);
    }
}
