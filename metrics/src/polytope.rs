//! Convex hulls in six dimensions, where wrenches live.
//!
//! Incremental insertion with the horizon of the visible facets (K. Clarkson and P. Shor, 1989). The
//! libraries at hand either stop at three dimensions, need a C compiler with libclang, or fail on
//! points as symmetric as friction cones are.

use std::collections::HashMap;

/// A point or a direction: force and scaled torque.
pub type Point6 = [f64; 6];

/// Inputs are shifted by this share of their size, each in its own direction, so that no seven of
/// them lie in a hyperplane.
const JOGGLE: f64 = 1.0e-7;

#[derive(Debug, Clone)]
struct Facet {
    corners: [u16; 6],
    /// Outward unit normal.
    normal: Point6,
    offset: f64,
}

/// The hull of some points.
#[derive(Debug, Clone)]
pub struct Polytope {
    points: Vec<Point6>,
    facets: Vec<Facet>,
    inner: Point6,
}

fn dot(a: &Point6, b: &Point6) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn minus(a: &Point6, b: &Point6) -> Point6 {
    std::array::from_fn(|k| a[k] - b[k])
}

/// A direction at right angles to the rows and the volume they span, by elimination with full
/// pivoting.
fn normal_to(mut rows: [Point6; 5]) -> (Point6, f64) {
    let mut order = [0, 1, 2, 3, 4, 5];
    let mut volume = 1.0f64;
    for k in 0..5 {
        let (mut best, mut at) = (-1.0, (k, k));
        for (i, row) in rows.iter().enumerate().skip(k) {
            for (j, c) in order.iter().enumerate().skip(k) {
                if row[*c].abs() > best {
                    (best, at) = (row[*c].abs(), (i, j));
                }
            }
        }
        rows.swap(k, at.0);
        order.swap(k, at.1);
        volume *= best;
        let pivot = rows[k][order[k]];
        if pivot == 0.0 {
            return ([0.0; 6], 0.0);
        }
        for i in k + 1..5 {
            let factor = rows[i][order[k]] / pivot;
            for c in &order[k..] {
                rows[i][*c] -= factor * rows[k][*c];
            }
        }
    }
    let mut normal = [0.0; 6];
    normal[order[5]] = 1.0;
    for k in (0..5).rev() {
        let sum: f64 = order[k + 1..]
            .iter()
            .map(|c| rows[k][*c] * normal[*c])
            .sum();
        normal[order[k]] = -sum / rows[k][order[k]];
    }
    let length = dot(&normal, &normal).sqrt();
    (normal.map(|x| x / length), volume * length)
}

impl Polytope {
    /// The hull, or `None` if the points span no volume.
    pub fn hull(points: &[Point6]) -> Option<Self> {
        let size = points.iter().map(|p| dot(p, p).sqrt()).fold(0.0, f64::max);
        let points: Vec<Point6> = points
            .iter()
            .enumerate()
            .map(|(i, p)| joggled(p, i, JOGGLE * size))
            .collect();
        let simplex = simplex(&points, 1.0e-5 * size)?;
        let inner =
            std::array::from_fn(|k| simplex.iter().map(|i| points[*i][k]).sum::<f64>() / 7.0);
        let mut hull = Self {
            points,
            facets: Vec::new(),
            inner,
        };
        for left_out in 0..7 {
            let mut corners = [0u16; 6];
            let others = (0..7).filter(|k| *k != left_out);
            for (c, k) in corners.iter_mut().zip(others) {
                *c = simplex[k] as u16;
            }
            let facet = hull.facet(corners);
            hull.facets.push(facet);
        }
        for i in (0..hull.points.len()).filter(|i| !simplex.contains(i)) {
            hull.insert(i);
        }
        Some(hull)
    }

    fn facet(&self, mut corners: [u16; 6]) -> Facet {
        corners.sort_unstable();
        let at = |k: usize| &self.points[usize::from(corners[k])];
        let rows = [1, 2, 3, 4, 5].map(|k| minus(at(k), at(0)));
        let (mut normal, _) = normal_to(rows);
        let mut offset = dot(&normal, at(0));
        if dot(&normal, &self.inner) > offset {
            normal = normal.map(|x| -x);
            offset = -offset;
        }
        Facet {
            corners,
            normal,
            offset,
        }
    }

    fn insert(&mut self, i: usize) {
        let p = self.points[i];
        let sees = |f: &Facet| dot(&f.normal, &p) > f.offset;
        if !self.facets.iter().any(sees) {
            return;
        }
        let (visible, kept): (Vec<Facet>, Vec<Facet>) = self.facets.drain(..).partition(sees);
        self.facets = kept;
        // A ridge of two visible facets vanishes, one of a single facet is on the horizon.
        let mut ridges: HashMap<[u16; 5], u8> = HashMap::new();
        for facet in &visible {
            for left_out in 0..6 {
                *ridges.entry(without(&facet.corners, left_out)).or_default() += 1;
            }
        }
        for facet in &visible {
            for left_out in 0..6 {
                let ridge = without(&facet.corners, left_out);
                if ridges[&ridge] == 1 {
                    let [a, b, c, d, e] = ridge;
                    let new = self.facet([a, b, c, d, e, i as u16]);
                    self.facets.push(new);
                }
            }
        }
    }

    /// Radius of the largest ball about the origin within the hull; negative if the origin lies
    /// outside, by that distance from the furthest facet.
    pub fn ball(&self) -> f64 {
        self.facets
            .iter()
            .map(|f| f.offset)
            .fold(f64::MAX, f64::min)
    }

    /// Six-dimensional volume.
    pub fn volume(&self) -> f64 {
        let cone = |f: &Facet| {
            let at = |k: usize| &self.points[usize::from(f.corners[k])];
            let (_, base) = normal_to([1, 2, 3, 4, 5].map(|k| minus(at(k), at(0))));
            base * (f.offset - dot(&f.normal, &self.inner)) / 720.0
        };
        self.facets.iter().map(cone).sum()
    }

    /// Number of facets.
    pub fn facets(&self) -> usize {
        self.facets.len()
    }
}

fn without(corners: &[u16; 6], left_out: usize) -> [u16; 5] {
    std::array::from_fn(|k| corners[k + usize::from(k >= left_out)])
}

/// A shift that depends on the index alone.
fn joggled(p: &Point6, index: usize, size: f64) -> Point6 {
    let mut state = index as u64;
    std::array::from_fn(|k| {
        // splitmix64 (G. Steele et al., 2014).
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        let unit = (z >> 11) as f64 / (1u64 << 53) as f64;
        p[k] + size * (2.0 * unit - 1.0)
    })
}

/// Seven points that span a volume, each as far as possible from the span of those before it.
fn simplex(points: &[Point6], least: f64) -> Option<[usize; 7]> {
    let mut chosen = [0; 7];
    let mut basis: Vec<Point6> = Vec::new();
    let first = (0..points.len()).max_by(|a, b| {
        let size = |i: usize| dot(&points[i], &points[i]);
        size(*a).total_cmp(&size(*b))
    })?;
    chosen[0] = first;
    for slot in &mut chosen[1..] {
        let beyond = |i: usize| {
            let mut way = minus(&points[i], &points[first]);
            for b in &basis {
                let along = dot(&way, b);
                way = std::array::from_fn(|k| way[k] - along * b[k]);
            }
            way
        };
        let length = |i: usize| dot(&beyond(i), &beyond(i)).sqrt();
        let best = (0..points.len()).max_by(|a, b| length(*a).total_cmp(&length(*b)))?;
        if length(best) < least {
            return None;
        }
        let unit = beyond(best).map(|x| x / length(best));
        basis.push(unit);
        *slot = best;
    }
    Some(chosen)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cross_polytope_and_the_cube_have_their_known_balls_and_volumes() {
        let axes: Vec<Point6> = (0..12)
            .map(|i| {
                std::array::from_fn(|k| {
                    if k == i % 6 {
                        1.0 - 2.0 * (i / 6) as f64
                    } else {
                        0.0
                    }
                })
            })
            .collect();
        let hull =
            Polytope::hull(&axes.iter().map(|a| a.map(|x| x * 2.0)).collect::<Vec<_>>()).unwrap();
        assert!(
            (hull.ball() - 2.0 / 6f64.sqrt()).abs() < 1e-5,
            "{}",
            hull.ball()
        );
        let volume = 4f64.powi(6) / 720.0;
        assert!((hull.volume() / volume - 1.0).abs() < 1e-5);
        assert_eq!(hull.facets(), 64);
        let cube: Vec<Point6> = (0..64)
            .map(|i| std::array::from_fn(|k| if i >> k & 1 == 1 { 1.0 } else { -1.0 }))
            .collect();
        let hull = Polytope::hull(&cube).unwrap();
        assert!((hull.ball() - 1.0).abs() < 1e-5);
        assert!(
            (hull.volume() / 64.0 - 1.0).abs() < 1e-5,
            "{}",
            hull.volume()
        );
    }

    /// Reference values: scipy.spatial.ConvexHull (Qhull) on the same points.
    #[test]
    fn forty_random_points_have_the_hull_that_qhull_finds() {
        let mut state = 1u32;
        let mut unit = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24)
        };
        let points: Vec<Point6> = (0..40)
            .map(|_| std::array::from_fn(|_| 2.0 * unit() - 1.0))
            .collect();
        let hull = Polytope::hull(&points).unwrap();
        assert_eq!(hull.facets(), 1197);
        assert!((hull.volume() / 2.362_375_278_551_916 - 1.0).abs() < 1e-4);
        assert!((hull.ball() / 0.433_156_158_180_796_6 - 1.0).abs() < 1e-4);
    }

    #[test]
    fn an_origin_outside_and_flat_points_are_told() {
        let corners: Vec<Point6> = (0..7)
            .map(|i| std::array::from_fn(|k| 2.0 + if i == k { 1.0 } else { 0.0 }))
            .collect();
        assert!(Polytope::hull(&corners).unwrap().ball() < 0.0);
        let flat: Vec<Point6> = corners
            .iter()
            .map(|p| [p[0], p[1], p[2], p[3], p[4], 0.0])
            .collect();
        assert!(Polytope::hull(&flat).is_none());
    }
}
