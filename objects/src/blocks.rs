//! Which triangles touch these boxes? Triangles lie in blocks of eight, blocks under nodes of eight,
//! so that one test answers for eight children, and the boxes (parts of a hand) are asked about
//! together on one way through the tree.

use std::ops::ControlFlow;

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x8};
use nalgebra::{Matrix3, Vector3};
use parry3d::bounding_volume::Aabb;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, TraversalAction};

use crate::lanes::{Eight, Hits, LANES, Lanes, LanesOf, Row, bits};

/// Levels of nodes: enough for 8^10 faces.
const LEVELS_MAX: usize = 9;

/// Points side by side, by axis.
type Rows = [Row; 3];

/// How the frame of the lanes sees the tree.
struct View<S: Simd> {
    simd: S,
    rotation: [[f32x8<S>; 3]; 3],
    absolute: [[f32x8<S>; 3]; 3],
    shift: [f32x8<S>; 3],
}

impl<S: Simd> View<S> {
    #[inline(always)]
    fn new(simd: S, rotation: &Matrix3<f32>, shift: &Vector3<f32>) -> Self {
        let zero = f32x8::splat(simd, 0.0);
        let mut view = Self {
            simd,
            rotation: [[zero; 3]; 3],
            absolute: [[zero; 3]; 3],
            shift: [zero; 3],
        };
        for i in 0..3 {
            view.shift[i] = f32x8::splat(simd, shift[i]);
            for j in 0..3 {
                view.rotation[i][j] = f32x8::splat(simd, rotation[(i, j)]);
                view.absolute[i][j] = f32x8::splat(simd, rotation[(i, j)].abs());
            }
        }
        view
    }

    /// `rows` times the columns `p`.
    #[inline(always)]
    fn turned(&self, rows: &[[f32x8<S>; 3]; 3], p: &Rows) -> [f32x8<S>; 3] {
        let x = p[0].load(self.simd);
        let y = p[1].load(self.simd);
        let z = p[2].load(self.simd);
        let [r, s, t] = rows;
        [
            x * r[0] + y * r[1] + z * r[2],
            x * s[0] + y * s[1] + z * s[2],
            x * t[0] + y * t[1] + z * t[2],
        ]
    }

    #[inline(always)]
    fn point(&self, p: &Rows) -> [f32x8<S>; 3] {
        let [x, y, z] = self.turned(&self.rotation, p);
        [x + self.shift[0], y + self.shift[1], z + self.shift[2]]
    }
}

/// Boxes of up to eight children, object frame; a missing child has a box that nothing meets.
#[derive(Debug, Clone)]
struct Node {
    centre: Rows,
    half: Rows,
}

impl Node {
    fn new(children: &[Aabb]) -> Self {
        let of =
            |f: &dyn Fn(&Aabb) -> f32, none: f32| Row::new(|i| children.get(i).map_or(none, f));
        let centre = |a: usize| of(&|b| (b.mins[a] + b.maxs[a]) * 0.5, 0.0);
        let half = |a: usize| of(&|b| (b.maxs[a] - b.mins[a]) * 0.5, -1.0e9);
        Self {
            centre: std::array::from_fn(centre),
            half: std::array::from_fn(half),
        }
    }

    #[inline(always)]
    fn seen<S: Simd>(&self, view: &View<S>) -> Eight<S> {
        let c = view.point(&self.centre);
        let h = view.turned(&view.absolute, &self.half);
        Eight {
            low: [c[0] - h[0], c[1] - h[1], c[2] - h[2]],
            high: [c[0] + h[0], c[1] + h[1], c[2] + h[2]],
        }
    }
}

/// Up to eight neighbouring triangles, corner coordinates side by side.
#[derive(Debug, Clone)]
struct Block {
    /// `corners[k][axis]` of all triangles; unused places repeat the last triangle.
    corners: [Rows; 3],
    faces: [u32; LANES],
    len: usize,
}

/// Up to eight neighbouring triangles of which some are near a lane, in the frame of the lanes.
pub struct Near<'a, S: Simd> {
    /// Corners of all eight side by side, `corners[k][axis]`, metres; what is not [`Near::any`] is
    /// any triangle.
    pub corners: [[f32x8<S>; 3]; 3],
    boxes: Eight<S>,
    hits: Hits,
    lanes: LanesOf,
    faces: &'a [u32; LANES],
}

impl<S: Simd> Near<'_, S> {
    /// What the machine can do.
    #[inline(always)]
    pub fn simd(&self) -> S {
        self.boxes.low[0].simd
    }

    /// Bits of the triangles whose boxes overlap at least one lane.
    #[inline(always)]
    pub fn any(&self) -> u32 {
        self.hits.any
    }

    /// Bits of those whose boxes overlap `lane`.
    #[inline(always)]
    pub fn of_lane(&self, lane: usize) -> u32 {
        self.hits.of_lane(lane)
    }

    /// Bits of the lanes that the box of triangle `i` overlaps.
    #[inline(always)]
    pub fn lanes_of(&self, i: usize) -> u32 {
        self.lanes.get(i)
    }

    /// Does any of the eight overlap one of the first `n` lanes, `n` below [`LANES`]?
    #[inline(always)]
    pub fn meets_first(&self, n: usize) -> bool {
        self.hits.meets_first(n)
    }

    /// Number of face `i` in the mesh.
    #[inline(always)]
    pub fn face(&self, i: usize) -> usize {
        self.faces[i] as usize
    }

    /// Corners of triangle `i`, metres.
    #[inline(always)]
    pub fn triangle(&self, i: usize) -> [Vector3<f32>; 3] {
        let mut triangle = [Vector3::zeros(); 3];
        for (corner, all) in triangle.iter_mut().zip(&self.corners) {
            for (x, all) in corner.iter_mut().zip(all) {
                *x = all.as_array()[i];
            }
        }
        triangle
    }

    /// Smallest and largest coordinate of each triangle along `axis`, metres.
    #[inline(always)]
    pub fn extent(&self, axis: usize) -> (f32x8<S>, f32x8<S>) {
        (self.boxes.low[axis], self.boxes.high[axis])
    }
}

/// Looks at triangles near the lanes, eight at a time.
pub trait Visitor {
    /// Called for every block of which at least one triangle is near a lane, until it breaks. What
    /// is to be compiled for the machine's widest registers must be `inline(always)`.
    fn visit<S: Simd>(&mut self, lanes: &mut Lanes, near: &Near<'_, S>) -> ControlFlow<()>;
}

/// The tree; coordinates are relative to an origin that its owner knows.
#[derive(Debug, Clone)]
pub(crate) struct BlockTree {
    blocks: Vec<Block>,
    /// Nodes over blocks, nodes over those, up to a single one; children stand in a row of eight.
    levels: Vec<Vec<Node>>,
}

impl BlockTree {
    pub(crate) fn new(corners: &[[Vector3<f32>; 3]], boxes: &[Aabb]) -> Self {
        let centroids: Vec<Vector3<f32>> = corners.iter().map(|t| t[0] + t[1] + t[2]).collect();
        let mut faces: Vec<u32> = (0..corners.len() as u32).collect();
        let mut groups: Vec<Vec<u32>> = Vec::new();
        split(&mut faces, &centroids, &mut groups);
        let bound = |g: &Vec<u32>| union(g.iter().map(|&f| &boxes[f as usize]));
        let mut bounds: Vec<Aabb> = groups.iter().map(bound).collect();
        // Neighbours in the order of a good binary tree make good nodes.
        let mut order = Vec::with_capacity(groups.len());
        Bvh::from_leaves(BvhBuildStrategy::Binned, &bounds).traverse(|node| {
            order.extend(node.leaf_data());
            TraversalAction::Continue
        });
        let blocks = order
            .iter()
            .map(|&i| Block::new(&groups[i as usize], corners))
            .collect();
        bounds = order.iter().map(|&i| bounds[i as usize]).collect();
        let mut levels = Vec::new();
        loop {
            levels.push(bounds.chunks(LANES).map(Node::new).collect());
            if bounds.len() <= LANES {
                assert!(levels.len() <= LEVELS_MAX, "a mesh of a billion faces");
                return Self { blocks, levels };
            }
            bounds = bounds.chunks(LANES).map(|c| union(c.iter())).collect();
        }
    }

    /// See [`crate::Surface::visit_near`].
    pub(crate) fn visit_near(
        &self,
        rotation: &Matrix3<f32>,
        shift: &Vector3<f32>,
        lanes: &mut Lanes,
        visitor: &mut impl Visitor,
    ) {
        dispatch!(Level::new(), simd => self.walk(&View::new(simd, rotation, shift), lanes, visitor));
    }

    #[inline(always)]
    fn walk<S: Simd>(&self, view: &View<S>, lanes: &mut Lanes, visitor: &mut impl Visitor) {
        // At most seven wait on each level.
        let mut waiting = [(0, 0, 0u32); LANES * LEVELS_MAX];
        waiting[0] = (self.levels.len() - 1, 0, lanes.used);
        let mut len = 1;
        while len > 0 {
            len -= 1;
            let (level, node, among) = waiting[len];
            let hits = self.levels[level][node].seen(view).hits(lanes, among);
            let lanes_of = hits.lanes();
            if level == 0 {
                for child in bits(hits.any) {
                    let block = &self.blocks[LANES * node + child];
                    let among = lanes_of.get(child);
                    if block.visit(view, among, lanes, visitor).is_break() {
                        return;
                    }
                }
            } else {
                // The last one first, so that the first is taken next.
                let mut left = hits.any;
                while left != 0 {
                    let child = left.ilog2() as usize;
                    left ^= 1 << child;
                    waiting[len] = (level - 1, LANES * node + child, lanes_of.get(child));
                    len += 1;
                }
            }
        }
    }
}

impl Block {
    fn new(group: &[u32], corners: &[[Vector3<f32>; 3]]) -> Self {
        let face = |lane: usize| group[lane.min(group.len() - 1)];
        Self {
            corners: std::array::from_fn(|k| {
                std::array::from_fn(|axis| Row::new(|lane| corners[face(lane) as usize][k][axis]))
            }),
            faces: std::array::from_fn(face),
            len: group.len(),
        }
    }

    /// Turns the triangles into the frame of the lanes and visits them if any is near one.
    #[inline(always)]
    fn visit<S: Simd>(
        &self,
        view: &View<S>,
        among: u32,
        lanes: &mut Lanes,
        visitor: &mut impl Visitor,
    ) -> ControlFlow<()> {
        let [a, b, c] = &self.corners;
        let corners = [view.point(a), view.point(b), view.point(c)];
        let [a, b, c] = &corners;
        let boxes = Eight {
            low: [
                a[0].min(b[0]).min(c[0]),
                a[1].min(b[1]).min(c[1]),
                a[2].min(b[2]).min(c[2]),
            ],
            high: [
                a[0].max(b[0]).max(c[0]),
                a[1].max(b[1]).max(c[1]),
                a[2].max(b[2]).max(c[2]),
            ],
        };
        let hits = boxes.hits(lanes, among).of_first(self.len);
        if hits.any == 0 {
            return ControlFlow::Continue(());
        }
        let near = Near {
            corners,
            boxes,
            lanes: hits.lanes(),
            hits,
            faces: &self.faces,
        };
        visitor.visit(lanes, &near)
    }
}

fn union<'a>(mut boxes: impl Iterator<Item = &'a Aabb>) -> Aabb {
    let first = *boxes.next().expect("no group is empty");
    boxes.fold(first, |sum, b| {
        Aabb::new(sum.mins.min(b.mins), sum.maxs.max(b.maxs))
    })
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
