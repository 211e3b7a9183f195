//! Which triangles touch these boxes? Triangles lie in blocks of eight, blocks under nodes of eight,
//! so that one test answers for eight children, and the boxes (parts of a hand) are asked about
//! together on one way through the tree.

use std::ops::ControlFlow;

use nalgebra::{Matrix3, Vector3};
use parry3d::bounding_volume::Aabb;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, TraversalAction};
use wide::f32x8;

/// Boxes asked about at once, triangles of a block, children of a node.
pub const LANES: usize = 8;

/// Rounding of f32 coordinates below a metre, with room, metres.
pub(crate) const SLACK_M: f32 = 1.0e-6;

/// Up to eight axis-aligned boxes of one frame.
#[derive(Debug, Clone, Copy)]
pub struct Lanes {
    low: [[f32; 3]; LANES],
    high: [[f32; 3]; LANES],
    /// Lanes that are set, as bits.
    used: u32,
}

impl Default for Lanes {
    fn default() -> Self {
        Self {
            low: [[f32::MAX; 3]; LANES],
            high: [[f32::MIN; 3]; LANES],
            used: 0,
        }
    }
}

impl Lanes {
    /// Sets one box; a lane never set is never hit.
    pub fn set(&mut self, lane: usize, min: Vector3<f32>, max: Vector3<f32>) {
        for axis in 0..3 {
            self.set_axis(lane, axis, min[axis], max[axis]);
        }
        self.used |= 1 << lane;
    }

    /// Sets the extent of one box along one axis.
    #[inline]
    pub fn set_axis(&mut self, lane: usize, axis: usize, min: f32, max: f32) {
        self.low[lane][axis] = min - SLACK_M;
        self.high[lane][axis] = max + SLACK_M;
    }
}

/// Eight boxes side by side, in the frame of the lanes.
struct Eight {
    low: [f32x8; 3],
    high: [f32x8; 3],
}

/// Which of eight boxes overlap which lanes.
struct Hits {
    /// By lane, bits of the eight.
    by_lane: [u32; LANES],
    /// Of the eight that overlap any lane.
    any: u32,
}

impl Hits {
    /// Bits of the lanes among `lanes` that one of the eight overlaps.
    #[inline]
    fn lanes_of(&self, one: usize, lanes: u32) -> u32 {
        let mut mask = 0;
        for lane in bits(lanes) {
            mask |= (self.by_lane[lane] >> one & 1) << lane;
        }
        mask
    }
}

impl Eight {
    #[inline]
    fn hits(&self, lanes: &Lanes, among: u32) -> Hits {
        let mut hits = Hits {
            by_lane: [0; LANES],
            any: 0,
        };
        for lane in bits(among) {
            let axis = |a: usize| {
                self.low[a].simd_le(f32x8::splat(lanes.high[lane][a]))
                    & self.high[a].simd_ge(f32x8::splat(lanes.low[lane][a]))
            };
            hits.by_lane[lane] = (axis(0) & axis(1) & axis(2)).to_bitmask();
            hits.any |= hits.by_lane[lane];
        }
        hits
    }
}

/// The numbers of the bits that are set, lowest first.
#[inline]
pub fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (mask != 0).then(|| {
            let bit = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            bit
        })
    })
}

/// How the frame of the lanes sees the tree.
struct View {
    rotation: [[f32x8; 3]; 3],
    absolute: [[f32x8; 3]; 3],
    shift: [f32x8; 3],
}

impl View {
    fn new(rotation: &Matrix3<f32>, shift: &Vector3<f32>) -> Self {
        let splat = |m: &Matrix3<f32>| {
            std::array::from_fn(|i| std::array::from_fn(|j| f32x8::splat(m[(i, j)])))
        };
        Self {
            rotation: splat(rotation),
            absolute: splat(&rotation.abs()),
            shift: std::array::from_fn(|i| f32x8::splat(shift[i])),
        }
    }

    #[inline(always)]
    fn turned(rows: &[[f32x8; 3]; 3], [x, y, z]: &[f32x8; 3]) -> [f32x8; 3] {
        let row = |k: usize| *x * rows[k][0] + *y * rows[k][1] + *z * rows[k][2];
        [row(0), row(1), row(2)]
    }

    #[inline(always)]
    fn point(&self, p: &[f32x8; 3]) -> [f32x8; 3] {
        let [x, y, z] = Self::turned(&self.rotation, p);
        [x + self.shift[0], y + self.shift[1], z + self.shift[2]]
    }
}

/// Boxes of up to eight children, object frame; a missing child has a box that nothing meets.
#[derive(Debug, Clone)]
struct Node {
    centre: [f32x8; 3],
    half: [f32x8; 3],
}

impl Node {
    fn new(children: &[Aabb]) -> Self {
        let of = |f: &dyn Fn(&Aabb) -> f32, none: f32| {
            f32x8::from(std::array::from_fn::<f32, LANES, _>(|i| {
                children.get(i).map_or(none, f)
            }))
        };
        let centre = |a: usize| of(&|b| (b.mins[a] + b.maxs[a]) * 0.5, 0.0);
        let half = |a: usize| of(&|b| (b.maxs[a] - b.mins[a]) * 0.5, -1.0e9);
        Self {
            centre: std::array::from_fn(centre),
            half: std::array::from_fn(half),
        }
    }

    #[inline]
    fn seen(&self, view: &View) -> Eight {
        let c = view.point(&self.centre);
        let h = View::turned(&view.absolute, &self.half);
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
    corners: [[f32x8; 3]; 3],
    faces: [u32; LANES],
    len: usize,
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
                return Self { blocks, levels };
            }
            bounds = bounds.chunks(LANES).map(|c| union(c.iter())).collect();
        }
    }

    /// See [`crate::Surface::visit_near`].
    #[inline]
    pub(crate) fn visit_near(
        &self,
        rotation: &Matrix3<f32>,
        shift: &Vector3<f32>,
        lanes: &mut Lanes,
        visit: &mut impl FnMut(&mut Lanes, usize, [Vector3<f32>; 3], u32) -> ControlFlow<()>,
    ) {
        let view = View::new(rotation, shift);
        let among = lanes.used;
        let _ = self.descend(&view, self.levels.len() - 1, 0, among, lanes, visit);
    }

    fn descend(
        &self,
        view: &View,
        level: usize,
        node: usize,
        among: u32,
        lanes: &mut Lanes,
        visit: &mut impl FnMut(&mut Lanes, usize, [Vector3<f32>; 3], u32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let hits = self.levels[level][node].seen(view).hits(lanes, among);
        for child in bits(hits.any) {
            let among = hits.lanes_of(child, among);
            let child = LANES * node + child;
            if level > 0 {
                self.descend(view, level - 1, child, among, lanes, visit)?;
            } else {
                self.blocks[child].visit(view, among, lanes, visit)?;
            }
        }
        ControlFlow::Continue(())
    }
}

impl Block {
    fn new(group: &[u32], corners: &[[Vector3<f32>; 3]]) -> Self {
        let face = |lane: usize| group[lane.min(group.len() - 1)];
        Self {
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
    }

    /// Turns the triangles into the frame of the lanes and visits those near one.
    #[inline]
    fn visit(
        &self,
        view: &View,
        among: u32,
        lanes: &mut Lanes,
        visit: &mut impl FnMut(&mut Lanes, usize, [Vector3<f32>; 3], u32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let [a, b, c] = &self.corners;
        let (a, b, c) = (view.point(a), view.point(b), view.point(c));
        let low = |i: usize| a[i].fast_min(b[i]).fast_min(c[i]);
        let high = |i: usize| a[i].fast_max(b[i]).fast_max(c[i]);
        let eight = Eight {
            low: [low(0), low(1), low(2)],
            high: [high(0), high(1), high(2)],
        };
        let hits = eight.hits(lanes, among);
        let any = hits.any & ((1 << self.len) - 1);
        if any == 0 {
            return ControlFlow::Continue(());
        }
        let corners = [a, b, c].map(|corner| corner.map(f32x8::to_array));
        for i in bits(any) {
            let triangle = corners.map(|c| Vector3::new(c[0][i], c[1][i], c[2][i]));
            let mask = hits.lanes_of(i, among);
            visit(lanes, self.faces[i] as usize, triangle, mask)?;
        }
        ControlFlow::Continue(())
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
