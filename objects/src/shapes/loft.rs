//! Closed surfaces from rings of points: every embedded shape is a skin over a row of rings.

use nalgebra::{Isometry3, Point3, Vector3};
use std::f64::consts::TAU;

use crate::convex::ConvexBody;
use crate::mesh::RawMesh;

/// A closed ring of points; all rings of one skin have the same number.
pub type Ring = Vec<[f64; 3]>;

/// A skin over `rings` in order, with a flat cap on the first and the last.
pub fn capped(rings: &[Ring]) -> RawMesh {
    capped_with_holes(rings, &[])
}

/// Like [`capped`], with holes left in the side.
pub fn capped_with_holes(rings: &[Ring], holes: &[Hole]) -> RawMesh {
    let mut mesh = tube(rings, holes);
    let n = rings[0].len() as u32;
    for (ring, base, turn) in [
        (&rings[0], 0, true),
        (&rings[rings.len() - 1], n * (rings.len() as u32 - 1), false),
    ] {
        let centre = ring
            .iter()
            .fold(Vector3::zeros(), |sum, p| sum + Vector3::from(*p))
            / ring.len() as f64;
        let hub = mesh.vertices.len() as u32;
        mesh.vertices.push(centre.into());
        for j in 0..n {
            let (a, b) = (base + j, base + (j + 1) % n);
            mesh.faces
                .push(if turn { [hub, b, a] } else { [hub, a, b] });
        }
    }
    mesh
}

/// A skin over `rings` whose last ring is joined to the first.
pub fn closed(rings: &[Ring]) -> RawMesh {
    let n = (rings.len() * rings[0].len()) as u32;
    let mut all = rings.to_vec();
    all.push(rings[0].clone());
    let mut mesh = tube(&all, &[]);
    mesh.vertices.truncate(n as usize);
    for index in mesh.faces.iter_mut().flatten() {
        *index %= n;
    }
    mesh
}

/// Four quads left out of a tube: rows `row..row + 2`, columns `column..column + 2` (mod n).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hole {
    /// First ring.
    pub row: usize,
    /// First point of the ring.
    pub column: usize,
}

impl Hole {
    /// The eight points around the hole, counter-clockwise seen along -row x column.
    pub fn border(&self) -> [(usize, usize); 8] {
        let (i, j) = (self.row, self.column);
        [
            (i, j),
            (i, j + 1),
            (i, j + 2),
            (i + 1, j + 2),
            (i + 2, j + 2),
            (i + 2, j + 1),
            (i + 2, j),
            (i + 1, j),
        ]
    }
}

/// The side of a skin without caps; quads inside a hole are left out.
pub fn tube(rings: &[Ring], holes: &[Hole]) -> RawMesh {
    let n = rings[0].len();
    let mut mesh = RawMesh {
        vertices: rings.iter().flatten().copied().collect(),
        faces: Vec::new(),
    };
    for i in 0..rings.len() - 1 {
        for j in 0..n {
            let inside = |h: &Hole| (h.row..h.row + 2).contains(&i) && (j + n - h.column) % n < 2;
            if holes.iter().any(inside) {
                continue;
            }
            let at = |i: usize, j: usize| (i * n + j % n) as u32;
            let (a, b, c, d) = (at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j));
            mesh.faces.push([a, b, c]);
            mesh.faces.push([a, c, d]);
        }
    }
    mesh
}

/// A horizontal circle of `n` points.
pub fn circle(radius: f64, z: f64, n: usize) -> Ring {
    ellipse(radius, radius, z, n)
}

/// A horizontal ellipse of `n` points.
pub fn ellipse(rx: f64, ry: f64, z: f64, n: usize) -> Ring {
    (0..n)
        .map(|j| {
            let angle = TAU * j as f64 / n as f64;
            [rx * angle.cos(), ry * angle.sin(), z]
        })
        .collect()
}

/// A horizontal rectangle with rounded corners, `4 * per_corner` points.
pub fn rounded_rectangle(hx: f64, hy: f64, radius: f64, z: f64, per_corner: usize) -> Ring {
    // Corners that met would leave edges without length.
    let radius = radius.min(0.95 * hx).min(0.95 * hy);
    let mut ring = Vec::with_capacity(4 * per_corner);
    for (quarter, (sx, sy)) in [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
        .into_iter()
        .enumerate()
    {
        for k in 0..per_corner {
            let angle = TAU / 4.0 * (quarter as f64 + k as f64 / (per_corner - 1) as f64);
            ring.push([
                sx * (hx - radius) + radius * angle.cos(),
                sy * (hy - radius) + radius * angle.sin(),
                z,
            ]);
        }
    }
    ring
}

/// A box about the origin.
pub fn cuboid(size_m: Vector3<f64>) -> RawMesh {
    let corners = ConvexBody::cuboid(size_m, &Isometry3::identity()).vertices;
    let ring = |z: usize| [0, 1, 3, 2].map(|k| corners[4 * z + k].into()).to_vec();
    let rings: [Ring; 2] = [ring(0), ring(1)];
    let mut mesh = tube(&rings, &[]);
    mesh.faces
        .extend([[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]);
    mesh
}

/// A bar of eight-sided section along `path`, from `first` to `last` border (both of the same
/// vertex order as the section), appended to `mesh`. `side` is normal to the plane of the path.
pub fn add_bar(
    mesh: &mut RawMesh,
    path: &[Point3<f64>],
    side: &Vector3<f64>,
    (half_side, half_up): (f64, f64),
    first: &[u32; 8],
    last: &[u32; 8],
) {
    const SECTION: [(f64, f64); 8] = [
        (-0.8, -0.8),
        (0.0, -1.0),
        (0.8, -0.8),
        (1.0, 0.0),
        (0.8, 0.8),
        (0.0, 1.0),
        (-0.8, 0.8),
        (-1.0, 0.0),
    ];
    let mut before = *first;
    for i in 1..path.len() - 1 {
        let tangent = (path[i + 1] - path[i - 1]).normalize();
        let up = tangent.cross(side);
        let base = mesh.vertices.len() as u32;
        for (s, u) in SECTION {
            let p = path[i] + side * (s * half_side) + up * (u * half_up);
            mesh.vertices.push(p.into());
        }
        let here: [u32; 8] = std::array::from_fn(|k| base + k as u32);
        join(mesh, &before, &here);
        before = here;
    }
    join(mesh, &before, last);
}

fn join(mesh: &mut RawMesh, a: &[u32; 8], b: &[u32; 8]) {
    for k in 0..8 {
        let l = (k + 1) % 8;
        mesh.faces.push([a[k], a[l], b[l]]);
        mesh.faces.push([a[k], b[l], b[k]]);
    }
}
