//! What of this surface is near, inside or in the way? A bounding volume tree over the triangles.
//!
//! parry's tree stores and builds; the queries that grasping needs (which triangles touch the
//! parts of a hand, signed distance with pseudo-normals, all hits of a ray) are here.

use std::collections::HashMap;
use std::ops::ControlFlow;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector as Vec3f;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhLeafCost, TraversalAction};
use wide::f32x8;

use crate::mesh::TriMesh;
use crate::triangle::{Feature, cast_ray, closest_point};

/// Bodies tested at once by [`Surface::visit_near`].
pub const LANES: usize = 8;

/// Rounding of f32 coordinates below a metre, with room, metres.
const SLACK_M: f32 = 1.0e-6;

/// Up to eight axis-aligned boxes of one frame, side by side.
#[derive(Debug, Clone, Copy)]
pub struct Lanes {
    centre: [[f32; LANES]; 3],
    half: [[f32; LANES]; 3],
}

impl Default for Lanes {
    fn default() -> Self {
        Self {
            centre: [[0.0; LANES]; 3],
            half: [[-1.0e9; LANES]; 3],
        }
    }
}

impl Lanes {
    /// Sets one box; a lane never set is never hit.
    pub fn set(&mut self, lane: usize, min: Vector3<f32>, max: Vector3<f32>) {
        for axis in 0..3 {
            self.centre[axis][lane] = (min[axis] + max[axis]) / 2.0;
            self.half[axis][lane] = (max[axis] - min[axis]) / 2.0 + SLACK_M;
        }
    }

    /// Sets the extent of one box along one axis.
    #[inline]
    pub fn set_axis(&mut self, lane: usize, axis: usize, min: f32, max: f32) {
        self.centre[axis][lane] = (min + max) / 2.0;
        self.half[axis][lane] = (max - min) / 2.0 + SLACK_M;
    }

    /// Bit `i` is set if box `i` overlaps the box of this centre and half size.
    #[inline]
    fn overlaps(&self, centre: &Vector3<f32>, half: &Vector3<f32>) -> u32 {
        let axis = |k: usize| {
            (f32x8::from(self.centre[k]) - f32x8::splat(centre[k]))
                .abs()
                .simd_le(f32x8::from(self.half[k]) + f32x8::splat(half[k]))
        };
        (axis(0) & axis(1) & axis(2)).to_bitmask()
    }
}

/// Up to eight neighbouring triangles, corner coordinates side by side.
#[derive(Debug, Clone)]
struct Block {
    /// `corners[k][axis]` of all triangles; unused places repeat the last triangle.
    corners: [[f32x8; 3]; 3],
    faces: [u32; LANES],
    len: usize,
}

/// A mesh with what is needed to ask it questions fast.
#[derive(Debug, Clone)]
pub struct Surface {
    mesh: TriMesh,
    is_watertight: bool,
    bvh: Bvh,
    bounds: (Point3<f64>, Point3<f64>),
    /// f32 coordinates are relative to this point, so that they keep their digits.
    origin: Point3<f64>,
    /// Corners of each face side by side: one cache line instead of three look-ups.
    triangles: Vec<[Point3<f64>; 3]>,
    /// Triangles in blocks, and the tree over the blocks.
    blocks: Vec<Block>,
    block_bvh: Bvh,
    face_normals: Vec<Vector3<f64>>,
    vertex_normals: Vec<Vector3<f64>>,
    edge_normals: Vec<[Vector3<f64>; 3]>,
}

impl Surface {
    /// Builds the tree and the pseudo-normals.
    pub fn new(mesh: TriMesh, is_watertight: bool) -> Self {
        let (lo, hi) = mesh.bounds();
        let origin = nalgebra::center(&lo, &hi);
        let triangles: Vec<[Point3<f64>; 3]> =
            (0..mesh.faces().len()).map(|i| mesh.triangle(i)).collect();
        let corners: Vec<[Vector3<f32>; 3]> = triangles
            .iter()
            .map(|t| t.map(|v| (v - origin).map(|x| x as f32)))
            .collect();
        let boxes: Vec<Aabb> = corners
            .iter()
            .map(|t| {
                let v = t.map(|p| Vec3f::new(p.x, p.y, p.z));
                Aabb::new(v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2]))
            })
            .collect();
        let bvh = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        let (blocks, block_bvh) = block_tree(&corners, &boxes);
        let (face_normals, vertex_normals, edge_normals) = pseudo_normals(&mesh);
        Self {
            mesh,
            is_watertight,
            bvh,
            bounds: (lo, hi),
            origin,
            triangles,
            blocks,
            block_bvh,
            face_normals,
            vertex_normals,
            edge_normals,
        }
    }

    /// The mesh, object frame, metres.
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    /// Is the surface closed, so that "inside" is well defined?
    pub fn is_watertight(&self) -> bool {
        self.is_watertight
    }

    /// The corners of a face, object frame, metres.
    #[inline]
    pub fn triangle(&self, face: u32) -> &[Point3<f64>; 3] {
        &self.triangles[face as usize]
    }

    /// Outward unit normal of a face, object frame.
    pub fn face_normal(&self, face: usize) -> &Vector3<f64> {
        &self.face_normals[face]
    }

    /// Calls `visit(lanes, face, corners in the frame of the boxes, mask)` for every triangle whose
    /// box overlaps at least one lane, until it breaks.
    ///
    /// `frame_from_object` maps the object into the frame of the boxes. `visit` may shrink the
    /// lanes while it runs; what it no longer needs is then skipped. Conservative: a reported
    /// triangle may still miss the box, a triangle that touches it is always reported.
    #[inline]
    pub fn visit_near(
        &self,
        frame_from_object: &Isometry3<f64>,
        lanes: &mut Lanes,
        mut visit: impl FnMut(&mut Lanes, usize, [Vector3<f32>; 3], u32) -> ControlFlow<()>,
    ) {
        let rotation: Matrix3<f32> = frame_from_object
            .rotation
            .to_rotation_matrix()
            .matrix()
            .map(|x| x as f32);
        let shift: Vector3<f32> = (frame_from_object * self.origin).coords.map(|x| x as f32);
        let absolute = rotation.abs();
        self.block_bvh.traverse(|node| {
            let (min, max) = (node.mins(), node.maxs());
            let centre = Vector3::new(min.x + max.x, min.y + max.y, min.z + max.z) * 0.5;
            let half = Vector3::new(max.x - min.x, max.y - min.y, max.z - min.z) * 0.5;
            let mask = lanes.overlaps(&(rotation * centre + shift), &(absolute * half));
            if mask == 0 {
                return TraversalAction::Prune;
            }
            if let Some(i) = node.leaf_data() {
                let flow = visit_block(
                    &self.blocks[i as usize],
                    &rotation,
                    &shift,
                    lanes,
                    mask,
                    &mut visit,
                );
                if flow.is_break() {
                    return TraversalAction::EarlyExit;
                }
            }
            TraversalAction::Continue
        });
    }

    /// Nearest face, the point on it and the feature that point lies on.
    pub fn closest(&self, point: &Point3<f64>) -> (usize, Point3<f64>, Feature) {
        let p = point - self.origin;
        let local = Vec3f::new(p.x as f32, p.y as f32, p.z as f32);
        let (face, nearest) = self
            .bvh
            .find_best(
                f32::MAX,
                |node, _| {
                    let d = (node.mins() - local)
                        .max(local - node.maxs())
                        .max(Vec3f::ZERO);
                    (d.length() - SLACK_M).max(0.0)
                },
                |face, _| {
                    let (q, feature) = closest_point(point, self.triangle(face));
                    let distance_m = (q - point).norm() as f32;
                    Some(Nearest {
                        q,
                        feature,
                        distance_m,
                    })
                },
            )
            .expect("a mesh has faces");
        (face as usize, nearest.q, nearest.feature)
    }

    /// Signed distance to the surface, metres, negative inside. The sign comes from the
    /// angle-weighted pseudo-normal of the nearest feature when the mesh is watertight
    /// (J. A. Baerentzen and H. Aanaes, IEEE TVCG 11(3), 2005), else from the generalised winding
    /// number (A. Jacobson et al., ACM TOG 32(4), 2013).
    pub fn signed_distance(&self, point: &Point3<f64>) -> f64 {
        let (face, q, feature) = self.closest(point);
        let distance = (point - q).norm();
        let inside = if self.is_watertight {
            (point - q).dot(self.pseudo_normal(face, feature)) < 0.0
        } else {
            self.winding_number(point) > 0.5
        };
        if inside { -distance } else { distance }
    }

    /// Is the point inside the solid?
    pub fn contains(&self, point: &Point3<f64>) -> bool {
        let (lo, hi) = self.bounds;
        let in_box = (0..3).all(|k| point[k] >= lo[k] && point[k] <= hi[k]);
        in_box && self.signed_distance(point) < 0.0
    }

    /// Normal that tells inside from outside at a feature of a face; not of unit length.
    #[inline]
    pub(crate) fn pseudo_normal(&self, face: usize, feature: Feature) -> &Vector3<f64> {
        match feature {
            Feature::Face => &self.face_normals[face],
            Feature::Edge(e) => &self.edge_normals[face][e as usize],
            Feature::Vertex(v) => {
                &self.vertex_normals[self.mesh.faces()[face][v as usize] as usize]
            }
        }
    }

    /// How often the surface winds around the point: 1 inside, 0 outside, in between near holes.
    pub fn winding_number(&self, point: &Point3<f64>) -> f64 {
        let mut sum = 0.0;
        for i in 0..self.mesh.faces().len() {
            let [a, b, c] = self.mesh.triangle(i).map(|v| v - point);
            let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
            // A. van Oosterom and J. Strackee, IEEE Trans. Biomed. Eng. 30(2), 1983.
            let numerator = a.dot(&b.cross(&c));
            let denominator = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
            sum += 2.0 * numerator.atan2(denominator);
        }
        sum / (4.0 * std::f64::consts::PI)
    }

    /// All faces hit by the ray `origin + t direction`, t >= 0, as (t, face), nearest first.
    pub fn ray_hits(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Vec<(f64, usize)> {
        let o = origin - self.origin;
        let ray = parry3d::query::Ray::new(
            Vec3f::new(o.x as f32, o.y as f32, o.z as f32),
            Vec3f::new(direction.x as f32, direction.y as f32, direction.z as f32),
        );
        let mut hits = Vec::new();
        self.bvh.traverse(|node| {
            let slack = Vec3f::splat(SLACK_M);
            let grown = Aabb::new(node.mins() - slack, node.maxs() + slack);
            if !parry3d::query::RayCast::intersects_local_ray(&grown, &ray, f32::MAX) {
                return TraversalAction::Prune;
            }
            if let Some(face) = node.leaf_data() {
                let t = cast_ray(origin, direction, self.triangle(face));
                hits.extend(t.map(|t| (t, face as usize)));
            }
            TraversalAction::Continue
        });
        hits.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        hits
    }

    /// The tree and its origin, for the signed distance grid.
    pub(crate) fn tree(&self) -> (&Bvh, &Point3<f64>) {
        (&self.bvh, &self.origin)
    }
}

/// Splits the faces into compact groups of eight (the last one may be smaller): the longest axis
/// of the centroids is cut at the multiple of eight nearest to its median.
fn split(faces: &mut [u32], centroids: &[Vector3<f32>], groups: &mut Vec<Vec<u32>>) {
    if faces.len() <= LANES {
        groups.push(faces.to_vec());
        return;
    }
    let first = centroids[faces[0] as usize];
    let (lo, hi) = faces.iter().fold((first, first), |(lo, hi), &f| {
        let c = &centroids[f as usize];
        (lo.inf(c), hi.sup(c))
    });
    let axis = (hi - lo).imax();
    let middle = (faces.len() / 2)
        .next_multiple_of(LANES)
        .min(faces.len() - 1);
    faces.select_nth_unstable_by(middle, |&a, &b| {
        let key = |f: u32| centroids[f as usize][axis];
        key(a).total_cmp(&key(b)).then(a.cmp(&b))
    });
    let (left, right) = faces.split_at_mut(middle);
    split(left, centroids, groups);
    split(right, centroids, groups);
}

/// Blocks of eight neighbouring triangles and a tree over them.
fn block_tree(corners: &[[Vector3<f32>; 3]], boxes: &[Aabb]) -> (Vec<Block>, Bvh) {
    let centroids: Vec<Vector3<f32>> = corners.iter().map(|t| t[0] + t[1] + t[2]).collect();
    let mut faces: Vec<u32> = (0..corners.len() as u32).collect();
    let mut groups: Vec<Vec<u32>> = Vec::new();
    split(&mut faces, &centroids, &mut groups);
    let block = |group: &Vec<u32>| {
        let face = |lane: usize| group[lane.min(group.len() - 1)];
        Block {
            corners: std::array::from_fn(|k| {
                std::array::from_fn(|axis| {
                    f32x8::from(std::array::from_fn::<f32, LANES, _>(|lane| {
                        corners[face(lane) as usize][k][axis]
                    }))
                })
            }),
            faces: std::array::from_fn(face),
            len: group.len(),
        }
    };
    let bounds: Vec<Aabb> = groups
        .iter()
        .map(|g| {
            let first = boxes[g[0] as usize];
            g.iter().fold(first, |sum, &f| {
                let b = &boxes[f as usize];
                Aabb::new(sum.mins.min(b.mins), sum.maxs.max(b.maxs))
            })
        })
        .collect();
    let tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &bounds);
    (groups.iter().map(block).collect(), tree)
}

/// Turns the triangles of a block into the frame of the boxes and visits those near a lane.
#[inline]
fn visit_block(
    block: &Block,
    rotation: &Matrix3<f32>,
    shift: &Vector3<f32>,
    lanes: &mut Lanes,
    mask: u32,
    visit: &mut impl FnMut(&mut Lanes, usize, [Vector3<f32>; 3], u32) -> ControlFlow<()>,
) -> ControlFlow<()> {
    let turned: [[f32x8; 3]; 3] = std::array::from_fn(|k| {
        let [x, y, z] = block.corners[k];
        std::array::from_fn(|axis| {
            x * f32x8::splat(rotation[(axis, 0)])
                + y * f32x8::splat(rotation[(axis, 1)])
                + z * f32x8::splat(rotation[(axis, 2)])
                + f32x8::splat(shift[axis])
        })
    });
    let low: [f32x8; 3] = std::array::from_fn(|a| turned[0][a].min(turned[1][a]).min(turned[2][a]));
    let high: [f32x8; 3] =
        std::array::from_fn(|a| turned[0][a].max(turned[1][a]).max(turned[2][a]));
    let mut near = [0u32; LANES];
    let mut any = 0u32;
    let mut left = mask;
    while left != 0 {
        let lane = left.trailing_zeros() as usize;
        left &= left - 1;
        let axis = |a: usize| {
            let (centre, half) = (lanes.centre[a][lane], lanes.half[a][lane]);
            low[a].simd_le(f32x8::splat(centre + half))
                & high[a].simd_ge(f32x8::splat(centre - half))
        };
        near[lane] = (axis(0) & axis(1) & axis(2)).to_bitmask();
        any |= near[lane];
    }
    any &= (1 << block.len) - 1;
    if any == 0 {
        return ControlFlow::Continue(());
    }
    let corners = turned.map(|c| c.map(f32x8::to_array));
    while any != 0 {
        let i = any.trailing_zeros() as usize;
        any &= any - 1;
        let mut here = 0;
        let mut left = mask;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            here |= (near[lane] >> i & 1) << lane;
        }
        let triangle = corners.map(|c| Vector3::new(c[0][i], c[1][i], c[2][i]));
        visit(lanes, block.faces[i] as usize, triangle, here)?;
    }
    ControlFlow::Continue(())
}

/// What [`Surface::closest`] keeps of a face.
struct Nearest {
    q: Point3<f64>,
    feature: Feature,
    distance_m: f32,
}

impl BvhLeafCost for Nearest {
    fn cost(&self) -> f32 {
        self.distance_m
    }
}

type Normals = (Vec<Vector3<f64>>, Vec<Vector3<f64>>, Vec<[Vector3<f64>; 3]>);

fn pseudo_normals(mesh: &TriMesh) -> Normals {
    let faces = mesh.faces();
    let mut face_normals = Vec::with_capacity(faces.len());
    let mut vertex_normals = vec![Vector3::zeros(); mesh.vertices().len()];
    let mut by_edge: HashMap<(u32, u32), Vector3<f64>> = HashMap::with_capacity(faces.len() * 2);
    for (i, f) in faces.iter().enumerate() {
        let t = mesh.triangle(i);
        let n = (t[1] - t[0])
            .cross(&(t[2] - t[0]))
            .try_normalize(0.0)
            .unwrap_or_else(Vector3::zeros);
        for k in 0..3 {
            let (u, v) = (t[(k + 1) % 3] - t[k], t[(k + 2) % 3] - t[k]);
            let angle = u.cross(&v).norm().atan2(u.dot(&v));
            vertex_normals[f[k] as usize] += n * angle;
            let (a, b) = (f[k], f[(k + 1) % 3]);
            *by_edge
                .entry((a.min(b), a.max(b)))
                .or_insert_with(Vector3::zeros) += n;
        }
        face_normals.push(n);
    }
    let edge_normals = faces
        .iter()
        .map(|f| {
            std::array::from_fn(|k| {
                let (a, b) = (f[k], f[(k + 1) % 3]);
                by_edge[&(a.min(b), a.max(b))]
            })
        })
        .collect();
    (face_normals, vertex_normals, edge_normals)
}
