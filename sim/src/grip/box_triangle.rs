//! Where does a box meet a triangle of a closed surface?
//!
//! The box's face and the triangle are laid over each other along the axis of least overlap, which
//! `separation` finds, and every corner of the common outline is a contact. What parry does for the
//! same pair, with the box's own axes as frame, so that no point is turned; the test below holds both
//! against each other.

use std::ops::RangeInclusive;

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::convert;
use crate::rapier::math::Vector;
use crate::rapier::parry::shape::TrianglePseudoNormals;

/// Which directions out of the surface a triangle allows a contact to have: from its own normal to as
/// far beyond an edge's normal as that is from its own. Else a flat face would push sideways at the
/// seams between its triangles.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cone {
    pub(super) face: Vector3<f32>,
    pub(super) edges: [Vector3<f32>; 3],
}

impl Cone {
    pub(crate) fn new(normals: &TrianglePseudoNormals) -> Self {
        let vector = |v: Vector| convert::from_vector(v).map(|x| x as f32);
        Self {
            face: vector(normals.face),
            edges: normals.edges.map(vector),
        }
    }

    /// Where a contact along `axis`, from the box to the triangle, may really point: the same way, or
    /// the nearest that is allowed; none if that would be into the surface. Frame of the box, into
    /// which `rotation` turns the object's.
    #[inline(always)]
    pub(super) fn allowed(
        &self,
        axis: &Vector3<f32>,
        rotation: &Matrix3<f32>,
    ) -> Option<Vector3<f32>> {
        let direction = -rotation.tr_mul(axis);
        let along = direction.dot(&self.face);
        let dots = self.edges.map(|e| e.dot(&direction));
        let mut best = 0;
        for i in 1..3 {
            if dots[i] > dots[best] {
                best = i;
            }
        }
        let edge = &self.edges[best];
        let cos = self.face.dot(edge);
        if along >= 2.0 * cos * cos - 1.0 {
            return Some(*axis);
        }
        if along < 0.0 {
            return None;
        }
        let aside = direction - self.face * along;
        let length = aside.norm();
        if length < 1e-6 {
            return Some(-(rotation * self.face));
        }
        let sin = (edge - self.face * cos).norm();
        let rim = (self.face * cos + aside * (sin / length)).normalize();
        Some(rotation * (self.face - rim * (2.0 * self.face.dot(&rim))))
    }
}

/// The contacts of one pair.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Meeting {
    /// From the box into the object, frame of the box.
    pub normal: Vector3<f32>,
    /// Points of the box, and distance from there to the triangle along the normal.
    points: [(Vector3<f32>, f32); 16],
    len: usize,
}

impl Meeting {
    pub fn points(&self) -> &[(Vector3<f32>, f32)] {
        &self.points[..self.len]
    }
}

/// Contacts along `normal` nearer than `prediction`, lengths in metres, everything in the frame of the
/// box, whose middle is the origin; `best` is the gap along the axis of least overlap.
#[inline(always)]
pub(super) fn meet(
    half: &Vector3<f32>,
    triangle: &[Vector3<f32>; 3],
    normal: Vector3<f32>,
    best: f32,
    prediction: f32,
    meeting: &mut Meeting,
) {
    meeting.len = 0;
    meeting.normal = normal;
    // A turned normal may meet a far face at a depth that has nothing to do with this pair.
    let deepest = if best >= 0.0 {
        f32::MIN
    } else {
        (5.0 * best).min(0.0)
    };
    overlay(half, triangle, deepest..=prediction, meeting);
}

/// Lays the box's face and the triangle over each other along the normal; keeps what is `within`.
fn overlay(
    half: &Vector3<f32>,
    triangle: &[Vector3<f32>; 3],
    within: RangeInclusive<f32>,
    meeting: &mut Meeting,
) {
    let Meeting {
        normal,
        points,
        len,
    } = meeting;
    let k = normal.iamax();
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    let level = if normal[k] < 0.0 { -half[k] } else { half[k] };
    // Along the normal onto the plane of the face: a shear, in which the face stays a rectangle.
    let per_up = 1.0 / normal[k];
    let slope = [normal[i] * per_up, normal[j] * per_up];
    let [a, b, c] = triangle;
    let flatten = |v: &Vector3<f32>| {
        let up = v[k] - level;
        Vector2::new(v[i] - slope[0] * up, v[j] - slope[1] * up)
    };
    let flat = [flatten(a), flatten(b), flatten(c)];
    // Distance along the normal.
    let rise = [a, b, c].map(|v| (v[k] - level) * per_up);
    let (hi, hj) = (half[i], half[j]);
    let low = flat[0].inf(&flat[1]).inf(&flat[2]);
    let high = flat[0].sup(&flat[1]).sup(&flat[2]);
    if low.x > hi || high.x < -hi || low.y > hj || high.y < -hj {
        return;
    }
    let mut push = |at: &Vector2<f32>, gap: f32| {
        if within.contains(&gap) && *len < points.len() {
            let (point, its_gap) = &mut points[*len];
            point[i] = at.x;
            point[j] = at.y;
            point[k] = level;
            *its_gap = gap;
            *len += 1;
        }
    };
    if low.x >= -hi && high.x <= hi && low.y >= -hj && high.y <= hj {
        for (at, gap) in flat.iter().zip(rise) {
            push(at, gap);
        }
        return;
    }
    // Corners of the triangle over the face.
    for v in 0..3 {
        if flat[v].x.abs() <= hi && flat[v].y.abs() <= hj {
            push(&flat[v], rise[v]);
        }
    }
    // Corners of the face under the triangle.
    let [ab, ac] = [flat[1] - flat[0], flat[2] - flat[0]];
    let area = ab.perp(&ac);
    if area.abs() > 1e-12 {
        let per_area = 1.0 / area;
        for (x, y) in [(hi, hj), (-hi, hj), (-hi, -hj), (hi, -hj)] {
            let at = Vector2::new(x, y) - flat[0];
            let (s, t) = (at.perp(&ac) * per_area, ab.perp(&at) * per_area);
            if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
                let gap = rise[0] + s * (rise[1] - rise[0]) + t * (rise[2] - rise[0]);
                push(&Vector2::new(x, y), gap);
            }
        }
    }
    // Edges across each other.
    for v in 0..3 {
        let (p, q) = (flat[v], flat[(v + 1) % 3]);
        let (from, to) = (rise[v], rise[(v + 1) % 3]);
        let way = q - p;
        for (axis, limit, other) in [(0, hi, hj), (1, hj, hi)] {
            for border in [limit, -limit] {
                let (start, end) = (p[axis] - border, q[axis] - border);
                if start * end < 0.0 {
                    let s = start / (start - end);
                    let at = p + way * s;
                    if at[1 - axis].abs() < other {
                        push(&at, from + s * (to - from));
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::separation::{Eight, Pairs};
    use super::*;
    use crate::rapier::math::Pose;
    use crate::rapier::parry::query::ContactManifold;
    use crate::rapier::parry::query::details::contact_manifold_cuboid_triangle;
    use crate::rapier::parry::shape::{Cuboid, Triangle};
    use fearless_simd::{Level, dispatch};

    /// A sequence of numbers in [-1, 1] that looks random.
    struct Numbers(u32);

    impl Numbers {
        fn next(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (self.0 >> 8) as f32 / (1 << 23) as f32 - 1.0
        }

        fn vector(&mut self, size: f32) -> Vector3<f32> {
            Vector3::new(self.next(), self.next(), self.next()) * size
        }
    }

    #[test]
    fn contacts_of_box_and_triangle_are_those_of_parry() {
        // In centimetres: parry skips short edges by an absolute length.
        let half = Vector3::new(0.7, 0.9, 0.9);
        let prediction = 0.05;
        let mut numbers = Numbers(7);
        let (mut met, mut missed) = (0, 0);
        for _ in 0..20_000 {
            let middle = numbers.vector(1.5);
            let triangle = [0; 3].map(|_| middle + numbers.vector(1.0));
            let [a, b, c] = triangle;
            let Some(face) = (b - a).cross(&(c - a)).try_normalize(1e-3) else {
                continue;
            };
            let edges = [0; 3].map(|_| (face + numbers.vector(0.6)).normalize());
            let mut own = Meeting::default();
            let mut eight = Eight::default();
            eight.set(0, &triangle, &face);
            let mut pairs = Pairs::default();
            pairs.set(0, &half, &eight, 0);
            let axes = dispatch!(Level::new(), simd => pairs.axes(simd, 1, prediction));
            let near = dispatch!(Level::new(), simd => eight.near(simd, 1, &half, prediction));
            assert!(axes.near <= near);
            let (gap, axis) = axes.of(0);
            let cone = Cone { face, edges };
            let allowed = cone.allowed(&axis, &Matrix3::identity());
            if let Some(normal) = allowed.filter(|_| axes.near == 1) {
                meet(&half, &triangle, normal, gap, prediction, &mut own);
            }
            let glam = |v: Vector3<f32>| Vector::new(v.x as _, v.y as _, v.z as _);
            let mut theirs = ContactManifold::<(), ()>::new();
            contact_manifold_cuboid_triangle(
                &Pose::IDENTITY,
                &Pose::IDENTITY,
                &Cuboid::new(glam(half)),
                &Triangle::new(glam(a), glam(b), glam(c)),
                None,
                Some(&TrianglePseudoNormals {
                    face: glam(face),
                    edges: edges.map(glam),
                    two_sided: false,
                }),
                prediction as _,
                &mut theirs,
                false,
            );
            let deepest = theirs.points.iter().map(|p| f64::from(p.dist) as f32);
            let deepest = deepest.fold(f32::MAX, f32::min);
            let nearest = own.points().iter().map(|p| p.1).fold(f32::MAX, f32::min);
            if own.points().is_empty() {
                missed += usize::from(deepest <= prediction);
            } else if (nearest - deepest).abs() < 1e-3
                && (glam(own.normal) - theirs.local_n1).length() < 1e-3
            {
                met += 1;
            } else {
                missed += 1;
            }
        }
        assert!(met > 5_000 && missed * 500 < met, "{met} {missed}");
    }
}
