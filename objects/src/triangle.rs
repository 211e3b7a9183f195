//! What is the point of a triangle nearest to another point, and on which feature does it lie?

use nalgebra::Point3;

/// The part of a triangle that a closest point lies on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Feature {
    /// Corner 0, 1 or 2.
    Vertex(u8),
    /// Edge from corner `i` to corner `i + 1` (mod 3).
    Edge(u8),
    /// The inside.
    Face,
}

/// Closest point of the triangle `abc` to `p` and its feature.
///
/// C. Ericson, "Real-Time Collision Detection", 2005, section 5.1.5 (Voronoi regions).
#[inline]
pub fn closest_point(p: &Point3<f64>, [a, b, c]: &[Point3<f64>; 3]) -> (Point3<f64>, Feature) {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (*a, Feature::Vertex(0));
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return (*b, Feature::Vertex(1));
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (a + ab * (d1 / (d1 - d3)), Feature::Edge(0));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return (*c, Feature::Vertex(2));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (a + ac * (d2 / (d2 - d6)), Feature::Edge(2));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && (d4 - d3) >= 0.0 && (d5 - d6) >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return (b + (c - b) * w, Feature::Edge(1));
    }
    let denominator = 1.0 / (va + vb + vc);
    (
        a + ab * (vb * denominator) + ac * (vc * denominator),
        Feature::Face,
    )
}

/// Distance along `direction` (not necessarily a unit vector, in its lengths) at which the ray
/// from `origin` meets the triangle, either side, or `None`.
///
/// T. Moeller and B. Trumbore, J. Graphics Tools 2(1), 1997.
pub fn cast_ray(
    origin: &Point3<f64>,
    direction: &nalgebra::Vector3<f64>,
    [a, b, c]: &[Point3<f64>; 3],
) -> Option<f64> {
    let (e1, e2) = (b - a, c - a);
    let h = direction.cross(&e2);
    let det = e1.dot(&h);
    if det == 0.0 {
        return None;
    }
    let s = origin - a;
    let u = s.dot(&h) / det;
    if !(0.0..=1.0).contains(&u) {
        return None;
    }
    let q = s.cross(&e1);
    let v = direction.dot(&q) / det;
    if v < 0.0 || u + v > 1.0 {
        return None;
    }
    let t = e2.dot(&q) / det;
    (t >= 0.0).then_some(t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// No point of the triangle, on a fine barycentric raster, is nearer than the answer.
        #[test]
        fn no_point_of_the_triangle_is_nearer(x in proptest::array::uniform12(-1.0f64..1.0)) {
            let point = |i: usize| Point3::new(x[i], x[i + 1], x[i + 2]);
            let (p, t) = (point(0), [point(3), point(6), point(9)]);
            let (q, _) = closest_point(&p, &t);
            let best = (p - q).norm();
            for i in 0..=20 {
                for j in 0..=20 - i {
                    let (u, v) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
                    let r = t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v;
                    prop_assert!((p - r).norm() >= best - 1e-12);
                }
            }
        }
    }
}
