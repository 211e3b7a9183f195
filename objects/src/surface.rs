//! What of this surface is near, inside or in the way? A bounding volume tree over the triangles.
//!
//! parry's tree serves signed distances (with pseudo-normals) and rays; which triangles touch the
//! parts of a hand is asked of `blocks`.

use std::collections::HashMap;
use std::ops::ControlFlow;

use fearless_simd::Simd;
use nalgebra::{Isometry3, Point3, Vector3};
use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector as Vec3f;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhLeafCost, TraversalAction};

use crate::blocks::BlockTree;
use crate::lanes::SLACK_M;
use crate::mesh::TriMesh;
use crate::triangle::{Feature, cast_ray, closest_point};

pub use crate::blocks::{Near, Visitor};
pub use crate::lanes::{LANES, Lanes, bits};

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
    blocks: BlockTree,
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
        let blocks = BlockTree::new(&corners, &boxes);
        let (face_normals, vertex_normals, edge_normals) = pseudo_normals(&mesh);
        Self {
            mesh,
            is_watertight,
            bvh,
            bounds: (lo, hi),
            origin,
            triangles,
            blocks,
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

    /// What single-precision coordinates are relative to: the middle of the bounding box, object frame.
    pub fn origin(&self) -> &Point3<f64> {
        &self.origin
    }

    /// Calls `visit(lanes, face, corners in the frame of the boxes, mask)` for every triangle whose
    /// box overlaps at least one lane, until it breaks; see [`Surface::visit_blocks`].
    #[inline]
    pub fn visit_near(
        &self,
        frame_from_object: &Isometry3<f64>,
        lanes: &mut Lanes,
        visit: impl FnMut(&mut Lanes, usize, [Vector3<f32>; 3], u32) -> ControlFlow<()>,
    ) {
        struct Each<F>(F);
        impl<F> Visitor for Each<F>
        where
            F: FnMut(&mut Lanes, usize, [Vector3<f32>; 3], u32) -> ControlFlow<()>,
        {
            #[inline(always)]
            fn visit<S: Simd>(&mut self, lanes: &mut Lanes, near: &Near<'_, S>) -> ControlFlow<()> {
                for i in bits(near.any()) {
                    self.0(lanes, near.face(i), near.triangle(i), near.lanes_of(i))?;
                }
                ControlFlow::Continue(())
            }
        }
        self.visit_blocks(frame_from_object, lanes, &mut Each(visit));
    }

    /// Shows `visitor` every block of triangles of which at least one has a box that overlaps a
    /// lane, until it breaks.
    ///
    /// `frame_from_object` maps the object into the frame of the boxes. The visitor may shrink the
    /// lanes meanwhile; what it no longer needs is then skipped. Conservative: a reported
    /// triangle may still miss the box, a triangle that touches it is always reported.
    pub fn visit_blocks(
        &self,
        frame_from_object: &Isometry3<f64>,
        lanes: &mut Lanes,
        visitor: &mut impl Visitor,
    ) {
        let rotation = frame_from_object.rotation.to_rotation_matrix();
        let rotation = rotation.matrix().map(|x| x as f32);
        let shift = (frame_from_object * self.origin).coords.map(|x| x as f32);
        self.blocks.visit_near(&rotation, &shift, lanes, visitor);
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
        self.may_contain(point) && self.signed_distance(point) < 0.0
    }

    /// Is the point inside the box around the solid?
    pub fn may_contain(&self, point: &Point3<f64>) -> bool {
        let (lo, hi) = self.bounds;
        (0..3).all(|k| point[k] >= lo[k] && point[k] <= hi[k])
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
