//! What part of eight triangles lies in a prism, a rectangle in y and z drawn out along x?

use fearless_simd::prelude::*;
use fearless_simd::{f32x8, mask32x8};

/// Eight triangles side by side, `corners[k][axis]`, metres.
pub(crate) type Triangles<S> = [[f32x8<S>; 3]; 3];

/// A face whose normal has less of x than this of y and z cannot tell x by y and z in f32.
const STEEP: f32 = 0.01;

/// The rectangle, metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Prism {
    /// `walls[side][axis]`: y and z of the low walls and of the high ones.
    walls: [[f32; 2]; 2],
}

/// Smallest and largest x of what lies in the prism; the former is the larger where nothing does.
pub(crate) struct Extent<S: Simd> {
    pub(crate) low: f32x8<S>,
    pub(crate) high: f32x8<S>,
    /// Bits of the steep triangles that an edge of the prism pierces: their extent is not known here.
    pub(crate) unknown: u32,
}

impl Prism {
    pub(crate) fn new(min: [f32; 2], max: [f32; 2]) -> Self {
        Self { walls: [min, max] }
    }

    /// How far the triangles in the places `among` (bits) reach along x inside the prism.
    ///
    /// The part inside is the hull of its corners: ends of the edges clipped to the rectangle
    /// (Y.-D. Liang and B. A. Barsky, ACM TOG 3(1), 1984), and where the prism's own edges pierce
    /// the triangle.
    #[inline(always)]
    pub(crate) fn extent<S: Simd>(&self, simd: S, corners: &Triangles<S>, among: u32) -> Extent<S> {
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let walls = self.splat(simd);
        let mut low = f32x8::splat(simd, f32::MAX);
        let mut high = f32x8::splat(simd, f32::MIN);
        let edges = edges(corners);
        let to_edges = [
            to_edges(&walls, &corners[0]),
            to_edges(&walls, &corners[1]),
            to_edges(&walls, &corners[2]),
        ];
        for k in 0..3 {
            let (p, d, to_wall) = (&corners[k], &edges[k], &to_edges[k]);
            let (mut enter, mut leave) = (zero, one);
            for axis in 0..2 {
                let inverse = one / not_zero(d[axis + 1]);
                let (t0, t1) = (to_wall[0][axis] * inverse, to_wall[1][axis] * inverse);
                enter = enter.max(t0.min(t1));
                leave = leave.min(t0.max(t1));
            }
            let hit = enter.simd_le(leave);
            let (x0, x1) = (p[0] + d[0] * enter, p[0] + d[0] * leave);
            low = hit.select(low.min(x0.min(x1)), low);
            high = hit.select(high.max(x0.max(x1)), high);
        }
        let mut extent = Extent {
            low,
            high,
            unknown: 0,
        };
        // Only what reaches over a wall in y and one in z can meet an edge.
        let ([y0, y1], [z0, z1]) = (range(corners, 1), range(corners, 2));
        let over_y = y0.simd_le(walls[0][0]) | y1.simd_ge(walls[1][0]);
        let over_z = z0.simd_le(walls[0][1]) | z1.simd_ge(walls[1][1]);
        if (over_y & over_z).to_bitmask() as u32 & among != 0 {
            pierce(&mut extent, corners, &edges, &to_edges);
        }
        extent
    }

    /// Low and high walls, in y and in z.
    #[inline(always)]
    pub(crate) fn splat<S: Simd>(&self, simd: S) -> [[f32x8<S>; 2]; 2] {
        let [[y0, z0], [y1, z1]] = self.walls;
        [
            [f32x8::splat(simd, y0), f32x8::splat(simd, z0)],
            [f32x8::splat(simd, y1), f32x8::splat(simd, z1)],
        ]
    }

    /// Height of the middle of the prism, metres.
    pub(crate) fn middle_z_m(&self) -> f32 {
        0.5 * (self.walls[0][1] + self.walls[1][1])
    }
}

/// Adds the points where the edges of the prism pierce the triangles; from corner `k` of a triangle
/// to the edge between a wall in y and one in z it is `to_edges[k][wall y][0]` and
/// `to_edges[k][wall z][1]`.
#[inline(always)]
fn pierce<S: Simd>(
    extent: &mut Extent<S>,
    corners: &Triangles<S>,
    edges: &Triangles<S>,
    to_edges: &[[[f32x8<S>; 2]; 2]; 3],
) {
    let normal = normal(edges);
    let steep = is_steep(&normal);
    let (dy, dz) = (normal[1] / normal[0], normal[2] / normal[0]);
    let [low, high] = range(corners, 0);
    for (y, z) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        // Exactly the opposite for the neighbour at an edge, so that nothing slips between both
        // (S. Woop, C. Benthin and I. Wald, JCGT 2(1), 2013).
        let [p, q, r] = to_edges;
        let a = p[y][0] * q[z][1] - p[z][1] * q[y][0];
        let b = q[y][0] * r[z][1] - q[z][1] * r[y][0];
        let c = r[y][0] * p[z][1] - r[z][1] * p[y][0];
        let pierced = a.min(b).min(c).simd_ge(0.0) | a.max(b).max(c).simd_le(0.0);
        let x = corners[0][0] - p[y][0] * dy - p[z][1] * dz;
        let x = x.max(low).min(high);
        let known = pierced & !steep;
        extent.low = known.select(extent.low.min(x), extent.low);
        extent.high = known.select(extent.high.max(x), extent.high);
        extent.unknown |= (pierced & steep).to_bitmask() as u32;
    }
}

/// Smallest and largest coordinate of each triangle.
#[inline(always)]
pub(crate) fn range<S: Simd>([a, b, c]: &Triangles<S>, axis: usize) -> [f32x8<S>; 2] {
    [
        a[axis].min(b[axis]).min(c[axis]),
        a[axis].max(b[axis]).max(c[axis]),
    ]
}

/// From each corner to the next.
#[inline(always)]
fn edges<S: Simd>([a, b, c]: &Triangles<S>) -> Triangles<S> {
    [minus(b, a), minus(c, b), minus(a, c)]
}

#[inline(always)]
fn minus<S: Simd>(a: &[f32x8<S>; 3], b: &[f32x8<S>; 3]) -> [f32x8<S>; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// From a point to the low and the high walls, in y and in z.
#[inline(always)]
fn to_edges<S: Simd>([low, high]: &[[f32x8<S>; 2]; 2], p: &[f32x8<S>; 3]) -> [[f32x8<S>; 2]; 2] {
    [
        [low[0] - p[1], low[1] - p[2]],
        [high[0] - p[1], high[1] - p[2]],
    ]
}

#[inline(always)]
fn normal<S: Simd>([d, e, _]: &Triangles<S>) -> [f32x8<S>; 3] {
    [
        d[1] * e[2] - d[2] * e[1],
        d[2] * e[0] - d[0] * e[2],
        d[0] * e[1] - d[1] * e[0],
    ]
}

/// Normals of the triangles, twice their area long, and which of them are too steep for
/// [`Prism::moments`]; so are those of no area.
#[inline(always)]
pub(crate) fn normals<S: Simd>(corners: &Triangles<S>) -> ([f32x8<S>; 3], mask32x8<S>) {
    let normal = normal(&edges(corners));
    (normal, is_steep(&normal))
}

#[inline(always)]
fn is_steep<S: Simd>(normal: &[f32x8<S>; 3]) -> mask32x8<S> {
    let across = normal[1].abs() + normal[2].abs();
    normal[0].abs().simd_le(across * STEEP)
}

/// A divisor: zero is replaced by too little to matter elsewhere, so that the way along a wall is
/// all inside or all outside.
#[inline(always)]
pub(crate) fn not_zero<S: Simd>(x: f32x8<S>) -> f32x8<S> {
    x + 1.0e-20
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use nalgebra::Vector3;
    use proptest::prelude::*;
    use shakedown_objects::convex::Polygon;

    pub(crate) const MIN: [f32; 2] = [-0.00875, 0.0944];
    pub(crate) const MAX: [f32; 2] = [0.00875, 0.1129];

    /// Every instruction set that this machine has.
    pub(crate) fn levels() -> Vec<Level> {
        let level = Level::new();
        let mut levels = vec![Level::baseline(), level];
        #[cfg(target_arch = "x86_64")]
        levels.extend(
            [
                level.as_sse4_2().map(Level::Sse4_2),
                level.as_avx2().map(Level::Avx2),
            ]
            .into_iter()
            .flatten(),
        );
        levels
    }

    /// A triangle in and about the prism, from numbers between 0 and 1.
    pub(crate) fn triangle(x: &[f32; 9]) -> [Vector3<f32>; 3] {
        [0, 3, 6].map(|i| {
            Vector3::new(
                0.08 * x[i] - 0.04,
                0.06 * x[i + 1] - 0.03,
                0.06 * x[i + 2] + 0.075,
            )
        })
    }

    #[inline(always)]
    pub(crate) fn side_by_side<S: Simd>(simd: S, t: &[Vector3<f32>; 3]) -> Triangles<S> {
        let x = |k: usize, axis: usize| f32x8::splat(simd, t[k][axis]);
        let corner = |k: usize| [x(k, 0), x(k, 1), x(k, 2)];
        [corner(0), corner(1), corner(2)]
    }

    /// The triangle cut wall by wall.
    pub(crate) fn clipped(t: &[Vector3<f32>; 3]) -> Option<Polygon<10>> {
        let mut polygon = Polygon::triangle(t);
        let left = (0..2).all(|a| {
            polygon.clip_axis(a + 1, 1.0, MAX[a]) && polygon.clip_axis(a + 1, -1.0, -MIN[a])
        });
        left.then_some(polygon)
    }

    fn extent(level: Level, t: &[Vector3<f32>; 3]) -> (f32, f32, u32) {
        dispatch!(level, simd => {
            let extent = Prism::new(MIN, MAX).extent(simd, &side_by_side(simd, t), 1);
            (extent.low.to_array()[0], extent.high.to_array()[0], extent.unknown & 1)
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]
        #[test]
        fn the_extent_in_the_prism_is_that_of_the_polygon_cut_wall_by_wall(
            x in proptest::array::uniform9(0.0f32..1.0)
        ) {
            let t = triangle(&x);
            let (low, high, unknown) = extent(Level::new(), &t);
            let xs = clipped(&t).map(|p| p.corners().iter().map(|c| c.x).collect::<Vec<_>>());
            match xs {
                _ if unknown == 1 => {}
                None => prop_assert!(low > high),
                Some(xs) => {
                    let least = xs.iter().copied().fold(f32::MAX, f32::min);
                    let largest = xs.iter().copied().fold(f32::MIN, f32::max);
                    prop_assert!((low - least).abs() < 2e-6, "{low} {least}");
                    prop_assert!((high - largest).abs() < 2e-6, "{high} {largest}");
                }
            }
        }

        #[test]
        fn the_extent_is_the_same_to_the_bit_on_every_instruction_set(
            x in proptest::array::uniform9(0.0f32..1.0)
        ) {
            let t = triangle(&x);
            let bits = |(low, high, unknown): (f32, f32, u32)| (low.to_bits(), high.to_bits(), unknown);
            let here = bits(extent(Level::new(), &t));
            for level in levels() {
                prop_assert_eq!(bits(extent(level, &t)), here, "{:?}", level);
            }
        }
    }

    #[test]
    fn a_face_that_covers_the_prism_reaches_from_edge_to_edge() {
        // x = y + 2 z on a large triangle.
        let on = |y: f32, z: f32| Vector3::new(y + 2.0 * z, y, z);
        let t = [on(-0.5, -0.5), on(1.0, -0.5), on(-0.5, 1.0)];
        let (low, high, unknown) = extent(Level::new(), &t);
        assert_eq!(unknown, 0);
        assert!((low - (MIN[0] + 2.0 * MIN[1])).abs() < 1e-6);
        assert!((high - (MAX[0] + 2.0 * MAX[1])).abs() < 1e-6);
    }
}
