//! A convex body that is held against a surface: a box or the hull of some points.

use nalgebra::{Isometry3, Point3, Vector3};

/// Most planes a [`ConvexBody`] may have.
pub const MAX_PLANES: usize = 60;

/// A closed convex body as half-spaces `normal . x <= offset` and its corners, in its own frame.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvexBody {
    /// Outward unit normals and offsets (metres).
    pub planes: Vec<(Vector3<f64>, f64)>,
    /// Corners, metres.
    pub vertices: Vec<Point3<f64>>,
}

impl ConvexBody {
    /// A box of full size `size_m`, at the pose `frame_from_box`.
    pub fn cuboid(size_m: Vector3<f64>, frame_from_box: &Isometry3<f64>) -> Self {
        let half = size_m / 2.0;
        let planes = (0..6)
            .map(|i| {
                let axis = i % 3;
                let sign = if i < 3 { 1.0 } else { -1.0 };
                let mut n = Vector3::zeros();
                n[axis] = sign;
                let normal = frame_from_box.rotation * n;
                let offset = half[axis] + normal.dot(&frame_from_box.translation.vector);
                (normal, offset)
            })
            .collect();
        let vertices = (0..8)
            .map(|i| {
                let corner = Point3::new(
                    if i & 1 == 0 { -half.x } else { half.x },
                    if i & 2 == 0 { -half.y } else { half.y },
                    if i & 4 == 0 { -half.z } else { half.z },
                );
                frame_from_box * corner
            })
            .collect();
        Self { planes, vertices }
    }

    /// The hull of some points, or `None` if they span no volume or need over [`MAX_PLANES`].
    pub fn hull(points: &[Point3<f64>]) -> Option<Self> {
        let (lo, hi) = bounds(points);
        let centre = nalgebra::center(&lo, &hi);
        let size = (hi - lo).norm();
        let local: Vec<parry3d::math::Vector> = points
            .iter()
            .map(|p| {
                let q = (p - centre) / size;
                parry3d::math::Vector::new(q.x as f32, q.y as f32, q.z as f32)
            })
            .collect();
        let (corners, faces) = parry3d::transformation::try_convex_hull(&local).ok()?;
        let vertices: Vec<Point3<f64>> = corners
            .iter()
            .map(|v| {
                // Back to the exact input point, so that f32 does not leak into the shape.
                let q =
                    centre + Vector3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z)) * size;
                *points
                    .iter()
                    .min_by(|a, b| (*a - q).norm_squared().total_cmp(&(*b - q).norm_squared()))
                    .expect("a hull has corners")
            })
            .collect();
        let mut planes: Vec<(Vector3<f64>, f64)> = Vec::new();
        for f in &faces {
            let [a, b, c] = f.map(|i| vertices[i as usize]);
            let Some(normal) = (b - a).cross(&(c - a)).try_normalize(1e-12) else {
                continue;
            };
            // The support in this direction makes the plane contain every corner.
            let offset = vertices
                .iter()
                .map(|v| normal.dot(&v.coords))
                .fold(f64::MIN, f64::max);
            let known = planes
                .iter()
                .any(|(n, d)| n.dot(&normal) > 1.0 - 1e-9 && (d - offset).abs() < 1e-9);
            if !known {
                planes.push((normal, offset));
            }
        }
        (planes.len() >= 4 && planes.len() <= MAX_PLANES).then_some(Self { planes, vertices })
    }

    /// The body in another frame.
    pub fn transformed(&self, frame_from_body: &Isometry3<f64>) -> Self {
        Self {
            planes: self
                .planes
                .iter()
                .map(|(n, d)| {
                    let normal = frame_from_body.rotation * n;
                    (normal, d + normal.dot(&frame_from_body.translation.vector))
                })
                .collect(),
            vertices: self.vertices.iter().map(|v| frame_from_body * v).collect(),
        }
    }

    /// Its faces as triangles, counter-clockwise seen from outside.
    pub fn triangles(&self) -> Vec<[Point3<f64>; 3]> {
        let size = (self.bounds().1 - self.bounds().0).norm();
        let mut triangles = Vec::new();
        for (normal, offset) in &self.planes {
            let on_plane = |v: &&Point3<f64>| (normal.dot(&v.coords) - offset).abs() < 1e-6 * size;
            let mut corners: Vec<Point3<f64>> =
                self.vertices.iter().filter(on_plane).copied().collect();
            let Some(first) = corners.first().copied() else {
                continue;
            };
            let sum: Vector3<f64> = corners.iter().map(|v| v.coords).sum();
            let middle = sum / corners.len() as f64;
            let across = (first.coords - middle).normalize();
            let along = normal.cross(&across);
            let angle = |v: &Point3<f64>| {
                let arm = v.coords - middle;
                along.dot(&arm).atan2(across.dot(&arm))
            };
            corners.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
            let fan = corners.windows(2).skip(1);
            triangles.extend(fan.map(|pair| [corners[0], pair[0], pair[1]]));
        }
        triangles
    }

    /// Axis-aligned box, metres.
    pub fn bounds(&self) -> (Point3<f64>, Point3<f64>) {
        bounds(&self.vertices)
    }

    /// Mean of the corners: a point inside.
    pub fn centre(&self) -> Point3<f64> {
        let sum: Vector3<f64> = self.vertices.iter().map(|v| v.coords).sum();
        Point3::from(sum / self.vertices.len() as f64)
    }

    /// Is the point inside or on the border?
    pub fn contains(&self, point: &Point3<f64>) -> bool {
        self.planes.iter().all(|(n, d)| n.dot(&point.coords) <= *d)
    }
}

fn bounds(points: &[Point3<f64>]) -> (Point3<f64>, Point3<f64>) {
    points
        .iter()
        .fold((points[0], points[0]), |(lo, hi), p| (lo.inf(p), hi.sup(p)))
}

/// A convex polygon on the stack: a triangle cut by at most `N - 3` planes, f32, metres.
#[derive(Clone, Copy)]
pub struct Polygon<const N: usize> {
    corners: [Vector3<f32>; N],
    len: usize,
}

impl<const N: usize> Polygon<N> {
    /// The triangle as a polygon.
    #[inline]
    pub fn triangle(t: &[Vector3<f32>; 3]) -> Self {
        // Every slot below `len` is written before it is read; a corner is as good as zeros.
        let mut corners = [t[0]; N];
        corners[1] = t[1];
        corners[2] = t[2];
        Self { corners, len: 3 }
    }

    /// Its corners in order.
    #[inline]
    pub fn corners(&self) -> &[Vector3<f32>] {
        &self.corners[..self.len]
    }

    /// Cuts away what lies beyond `normal . x <= offset`; returns whether anything is left.
    #[inline]
    pub fn clip(&mut self, normal: &Vector3<f32>, offset: f32) -> bool {
        self.keep_where(|c| normal.dot(c) - offset)
    }

    /// Cuts away what lies beyond `sign * x[axis] <= offset`; returns whether anything is left.
    #[inline]
    pub fn clip_axis(&mut self, axis: usize, sign: f32, offset: f32) -> bool {
        self.keep_where(|c| sign * c[axis] - offset)
    }

    /// Keeps what has no positive distance.
    ///
    /// I. Sutherland and G. Hodgman, "Reentrant polygon clipping", CACM 17(1), 1974. In place: a
    /// cut of a convex polygon never writes past what it has read.
    #[inline]
    fn keep_where(&mut self, distance: impl Fn(&Vector3<f32>) -> f32) -> bool {
        let first = self.corners[0];
        let first_distance = distance(&first);
        let (mut a, mut da) = (first, first_distance);
        let mut n = 0;
        for i in 0..self.len {
            let (b, db) = if i + 1 < self.len {
                (self.corners[i + 1], distance(&self.corners[i + 1]))
            } else {
                (first, first_distance)
            };
            if da <= 0.0 {
                self.corners[n] = a;
                n += 1;
            }
            if (da <= 0.0) != (db <= 0.0) {
                self.corners[n] = a + (b - a) * (da / (da - db));
                n += 1;
            }
            (a, da) = (b, db);
        }
        self.len = n;
        n > 0
    }

    /// Its triangles about the first corner; none if it has fewer than three corners.
    pub fn fan(&self) -> impl Iterator<Item = [Vector3<f32>; 3]> {
        let corners = self.corners();
        corners
            .windows(2)
            .skip(1)
            .map(|pair| [corners[0], pair[0], pair[1]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_triangles_of_a_body_enclose_its_volume() {
        let pose = Isometry3::new(Vector3::new(0.3, -0.1, 0.2), Vector3::new(0.4, 1.0, -0.3));
        let body = ConvexBody::cuboid(Vector3::new(0.1, 0.2, 0.3), &pose);
        let hull = ConvexBody::hull(&body.vertices).unwrap();
        for body in [body, hull] {
            let volume: f64 = body
                .triangles()
                .iter()
                .map(|[a, b, c]| a.coords.dot(&b.coords.cross(&c.coords)) / 6.0)
                .sum();
            assert!((volume - 0.006).abs() < 1e-9, "{volume}");
        }
    }

    #[test]
    fn the_hull_of_a_box_is_the_box() {
        let pose = Isometry3::new(Vector3::new(0.3, 0.1, -0.2), Vector3::new(0.2, -0.4, 0.9));
        let cuboid = ConvexBody::cuboid(Vector3::new(0.02, 0.03, 0.05), &pose);
        let hull = ConvexBody::hull(&cuboid.vertices).unwrap();
        assert_eq!(hull.planes.len(), 6);
        assert_eq!(hull.vertices.len(), 8);
        for (n, d) in &hull.planes {
            let twin = cuboid.planes.iter().find(|(m, _)| m.dot(n) > 1.0 - 1e-9);
            assert!((twin.unwrap().1 - d).abs() < 1e-12);
        }
    }

    #[test]
    fn clipping_a_triangle_by_a_box_leaves_the_area_inside() {
        let t = [
            Vector3::new(-1.0, -1.0, 0.0),
            Vector3::new(3.0, -1.0, 0.0),
            Vector3::new(-1.0, 3.0, 0.0),
        ];
        let cuboid = ConvexBody::cuboid(Vector3::new(2.0, 2.0, 2.0), &Isometry3::identity());
        let mut p = Polygon::<16>::triangle(&t);
        for (n, d) in &cuboid.planes {
            assert!(p.clip(&n.map(|x| x as f32), *d as f32));
        }
        // The hypotenuse x + y = 2 touches the square [-1, 1]^2 only at (1, 1).
        let area: f32 = p
            .fan()
            .map(|[a, b, c]| 0.5 * (b - a).cross(&(c - a)).norm())
            .sum();
        assert!((area - 4.0).abs() < 1e-6);
    }
}
