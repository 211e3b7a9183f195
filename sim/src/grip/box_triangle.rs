//! Where does a box meet a triangle of a closed surface?
//!
//! Separating axes (S. Gottschalk et al., "OBBTree", SIGGRAPH 1996): three faces of the box, the
//! triangle's plane, nine pairs of edges; then the box's face and the triangle are laid over each
//! other along the axis of least overlap, and every corner of the common outline is a contact. What
//! parry does for the same pair, with the box's own axes as frame, so that no point is turned; the
//! test below holds both against each other.

use nalgebra::{Vector2, Vector3};

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

    /// The nearest direction allowed; none for one that points into the surface.
    fn nearest(&self, direction: &Vector3<f32>) -> Option<Vector3<f32>> {
        let along = direction.dot(&self.face);
        let dots = self.edges.map(|e| e.dot(direction));
        let mut best = 0;
        for i in 1..3 {
            if dots[i] > dots[best] {
                best = i;
            }
        }
        let edge = &self.edges[best];
        let cos = self.face.dot(edge);
        if along >= 2.0 * cos * cos - 1.0 {
            return Some(*direction);
        }
        if along < 0.0 {
            return None;
        }
        let aside = direction - self.face * along;
        let length = aside.norm();
        if length < 1e-6 {
            return Some(self.face);
        }
        let sin = (edge - self.face * cos).norm();
        let rim = (self.face * cos + aside * (sin / length)).normalize();
        Some(rim * (2.0 * self.face.dot(&rim)) - self.face)
    }
}

/// The contacts of one pair.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Meeting {
    /// From the box into the object, frame of the box.
    pub normal: Vector3<f32>,
    /// Points of the box, and distance from there to the triangle along the normal.
    pub points: [(Vector3<f32>, f32); 16],
    pub len: usize,
}

/// Contacts nearer than `prediction`, lengths in metres, everything in the frame of the box, whose
/// middle is the origin. `None` if there is none.
pub(super) fn meet(
    half: &Vector3<f32>,
    triangle: &[Vector3<f32>; 3],
    cone: &Cone,
    prediction: f32,
) -> Option<Meeting> {
    let [a, b, c] = triangle;
    let (low, high) = (a.inf(b).inf(c), a.sup(b).sup(c));
    let (mut best, mut axis) = (f32::MIN, Vector3::zeros());
    for i in 0..3 {
        for (sign, gap) in [(1.0, low[i] - half[i]), (-1.0, -high[i] - half[i])] {
            if gap > best {
                best = gap;
                axis = Vector3::zeros();
                axis[i] = sign;
            }
        }
    }
    if best > prediction {
        return None;
    }
    let offset = cone.face.dot(a);
    let gap = offset.abs() - cone.face.abs().dot(half);
    if gap > prediction {
        return None;
    }
    let (face_gap, face_axis) = (gap, cone.face * if offset > 0.0 { 1.0 } else { -1.0 });
    let (mut edge_gap, mut edge_axis) = (f32::MIN, Vector3::zeros());
    for (edge, one, other) in [(b - a, a, c), (c - b, b, a), (a - c, a, b)] {
        let axes = [
            Vector3::new(0.0, -edge.z, edge.y),
            Vector3::new(edge.z, 0.0, -edge.x),
            Vector3::new(-edge.y, edge.x, 0.0),
        ];
        let least = 1e-6 * edge.norm_squared();
        for cross in axes {
            let square = cross.norm_squared();
            if square <= least {
                continue;
            }
            let (p, q) = (cross.dot(one), cross.dot(other));
            let (min, max) = (p.min(q), p.max(q));
            let reach = cross.abs().dot(half);
            let (sign, gap) = if min > -max { (1.0, min) } else { (-1.0, -max) };
            let length = square.sqrt();
            let gap = (gap - reach) / length;
            if gap > edge_gap {
                if gap > prediction {
                    return None;
                }
                edge_gap = gap;
                edge_axis = cross * (sign / length);
            }
        }
    }
    if face_gap > best && face_gap > edge_gap {
        (best, axis) = (face_gap, face_axis);
    } else if edge_gap > best {
        (best, axis) = (edge_gap, edge_axis);
    }
    let normal = -cone.nearest(&-axis)?;
    let mut meeting = Meeting {
        normal,
        ..Meeting::default()
    };
    overlay(half, triangle, &mut meeting);
    // A turned normal may meet a far face at a depth that has nothing to do with this pair.
    let mut kept = 0;
    for i in 0..meeting.len {
        let (point, gap) = meeting.points[i];
        let is_near = best >= 0.0 || gap >= 0.0 || gap >= 5.0 * best;
        if is_near && gap <= prediction {
            meeting.points[kept] = (point, gap);
            kept += 1;
        }
    }
    meeting.len = kept;
    (kept > 0).then_some(meeting)
}

/// Lays the box's face and the triangle over each other along the normal.
fn overlay(half: &Vector3<f32>, triangle: &[Vector3<f32>; 3], meeting: &mut Meeting) {
    let normal = meeting.normal;
    let k = normal.iamax();
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    let sign = if normal[k] < 0.0 { -1.0 } else { 1.0 };
    // Along the normal onto the plane of the face: a shear, in which the face stays a rectangle.
    let slope = [normal[i] / normal[k], normal[j] / normal[k]];
    let level = sign * half[k];
    let flat = triangle.map(|v| {
        let up = v[k] - level;
        Vector2::new(v[i] - slope[0] * up, v[j] - slope[1] * up)
    });
    // Distance along the normal.
    let rise = triangle.map(|v| (v[k] - level) / normal[k]);
    let (hi, hj) = (half[i], half[j]);
    let face_point = |at: Vector2<f32>| {
        let mut p = Vector3::zeros();
        p[i] = at.x;
        p[j] = at.y;
        p[k] = level;
        p
    };
    let mut push = |at: Vector2<f32>, gap: f32| {
        if meeting.len < meeting.points.len() {
            meeting.points[meeting.len] = (face_point(at), gap);
            meeting.len += 1;
        }
    };
    // Corners of the triangle over the face.
    for v in 0..3 {
        if flat[v].x.abs() <= hi && flat[v].y.abs() <= hj {
            push(flat[v], rise[v]);
        }
    }
    // Corners of the face under the triangle.
    let [ab, ac] = [flat[1] - flat[0], flat[2] - flat[0]];
    let area = ab.perp(&ac);
    if area.abs() > 1e-12 {
        for (x, y) in [(hi, hj), (-hi, hj), (-hi, -hj), (hi, -hj)] {
            let at = Vector2::new(x, y) - flat[0];
            let (s, t) = (at.perp(&ac) / area, ab.perp(&at) / area);
            if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
                let gap = rise[0] + s * (rise[1] - rise[0]) + t * (rise[2] - rise[0]);
                push(Vector2::new(x, y), gap);
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
                        push(at, from + s * (to - from));
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rapier::math::Pose;
    use crate::rapier::parry::query::ContactManifold;
    use crate::rapier::parry::query::details::contact_manifold_cuboid_triangle;
    use crate::rapier::parry::shape::{Cuboid, Triangle};

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
            let own = meet(&half, &triangle, &Cone { face, edges }, prediction);
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
            match own {
                None => missed += usize::from(deepest <= prediction),
                Some(own) => {
                    let gap = own.points[..own.len]
                        .iter()
                        .map(|p| p.1)
                        .fold(f32::MAX, f32::min);
                    let same = (gap - deepest).abs() < 1e-3
                        && (glam(own.normal) - theirs.local_n1).length() < 1e-3;
                    if same {
                        met += 1;
                    } else {
                        missed += 1;
                    }
                }
            }
        }
        assert!(met > 5_000 && missed * 500 < met, "{met} {missed}");
    }
}
