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

const BLOCK: usize = 4;

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
        let blocks = resolution.div_ceil(BLOCK);
        // One slab of blocks per task; each writes its own contiguous x-range.
        let mut values_m = vec![0.0f32; resolution.pow(3)];
        values_m
            .par_chunks_mut(BLOCK * resolution * resolution)
            .enumerate()
            .for_each(|(bx, slab)| {
                let mut scratch = Scratch::default();
                for by in 0..blocks {
                    for bz in 0..blocks {
                        let first = [bx * BLOCK, by * BLOCK, bz * BLOCK];
                        let last = first.map(|i| (i + BLOCK).min(resolution));
                        bake_block(
                            surface,
                            &corner,
                            spacing,
                            first,
                            last,
                            &mut scratch,
                            |i, d| {
                                slab[((i[0] - first[0]) * resolution + i[1]) * resolution + i[2]] =
                                    d;
                            },
                        );
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

/// A triangle as seen from the centre of a block.
#[derive(Clone, Copy)]
struct Candidate {
    /// Distance from the centre, metres.
    distance: f64,
    /// Unit vector from the nearest point towards the centre.
    towards: Vector3<f64>,
    face: u32,
}

#[derive(Default)]
struct Scratch {
    candidates: Vec<Candidate>,
    /// Nearest distance at the last block's centre, and that centre.
    last: Option<(Point3<f64>, f64)>,
}

fn bake_block(
    surface: &Surface,
    corner: &Point3<f64>,
    spacing: f64,
    first: [usize; 3],
    last: [usize; 3],
    scratch: &mut Scratch,
    mut write: impl FnMut([usize; 3], f32),
) {
    let node = |i: [usize; 3]| corner + Vector3::from(i.map(|k| k as f64)) * spacing;
    let (a, b) = (node(first), node(last.map(|k| k - 1)));
    let centre = nalgebra::center(&a, &b);
    let radius = (b - a).norm() / 2.0;
    gather(surface, &centre, radius, scratch);
    let faces = surface.mesh();
    let use_pseudo_normals = surface.is_watertight();
    let mut hint = 0usize;
    for ix in first[0]..last[0] {
        for iy in first[1]..last[1] {
            for iz in first[2]..last[2] {
                let p = node([ix, iy, iz]);
                let from_centre = p - centre;
                let length = from_centre.norm();
                let mut best = (f64::INFINITY, 0u32, p, Feature::Face);
                let mut consider = |face: u32| {
                    let (q, feature) = closest_point(&p, &faces.triangle(face as usize));
                    let d = (p - q).norm_squared();
                    if d < best.0 {
                        best = (d, face, q, feature);
                    }
                    best.0
                };
                // The winner of the node before is almost always close to the answer.
                let mut bound = consider(scratch.candidates[hint].face).sqrt();
                let mut winner = hint;
                for (k, candidate) in scratch.candidates.iter().enumerate() {
                    if candidate.distance - length >= bound {
                        break;
                    }
                    if candidate.distance + candidate.towards.dot(&from_centre) >= bound {
                        continue;
                    }
                    let d = consider(candidate.face).sqrt();
                    if d < bound {
                        bound = d;
                        winner = k;
                    }
                }
                hint = winner;
                let (_, face, q, feature) = best;
                let inside = if use_pseudo_normals {
                    (p - q).dot(surface.pseudo_normal(face as usize, feature)) < 0.0
                } else {
                    surface.winding_number(&p) > 0.5
                };
                write([ix, iy, iz], if inside { -bound } else { bound } as f32);
            }
        }
    }
}

/// Fills the candidates of a block, nearest first.
fn gather(surface: &Surface, centre: &Point3<f64>, radius: f64, scratch: &mut Scratch) {
    let (bvh, origin) = surface.tree();
    let c = centre - origin;
    let local = Vec3f::new(c.x as f32, c.y as f32, c.z as f32);
    // Nearest distance at the centre: bounded by the neighbour's, then tightened on the way.
    let mut nearest = match scratch.last {
        Some((old, d)) => d + (centre - old).norm() + 1.0e-9,
        None => {
            let (_, q, _) = surface.closest(centre);
            (q - centre).norm()
        }
    };
    scratch.candidates.clear();
    bvh.traverse(|node| {
        let gap = (node.mins() - local)
            .max(local - node.maxs())
            .max(Vec3f::ZERO);
        if f64::from(gap.length()) - 1.0e-6 > nearest + 2.0 * radius {
            return TraversalAction::Prune;
        }
        if let Some(face) = node.leaf_data() {
            let (q, _) = closest_point(centre, &surface.mesh().triangle(face as usize));
            let d = (q - centre).norm();
            nearest = nearest.min(d);
            if d <= nearest + 2.0 * radius {
                scratch.candidates.push(Candidate {
                    distance: d,
                    towards: if d > 0.0 {
                        (centre - q) / d
                    } else {
                        Vector3::zeros()
                    },
                    face,
                });
            }
        }
        TraversalAction::Continue
    });
    let limit = nearest + 2.0 * radius;
    scratch.candidates.retain(|c| c.distance <= limit);
    scratch
        .candidates
        .sort_unstable_by(|a, b| a.distance.total_cmp(&b.distance).then(a.face.cmp(&b.face)));
    scratch.last = Some((*centre, nearest));
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
