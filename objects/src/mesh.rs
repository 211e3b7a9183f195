//! Is this a usable triangle mesh? Vertices in metres, f64, finite; faces with area, each once.

use std::collections::HashMap;
use std::path::Path;

use nalgebra::{Matrix3, Point3, Vector3};

use crate::error::{ObjectError, Place};

/// A validated triangle mesh: finite vertices, indices in range, no degenerate or duplicate face,
/// faces of one body wound the same way with their normals pointing outwards.
#[derive(Debug, Clone, PartialEq)]
pub struct TriMesh {
    vertices: Vec<Point3<f64>>,
    faces: Vec<[u32; 3]>,
}

/// What was found and mended while a mesh was validated.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub struct MeshReport {
    /// Vertices that stood at exactly the place of another one and were merged.
    pub merged_vertices: usize,
    /// Faces without area that were removed.
    pub degenerate_faces: usize,
    /// Faces that repeated another one (same three vertices) and were removed.
    pub duplicate_faces: usize,
    /// Faces that were turned so that all of one body wind the same way and outwards.
    pub flipped_faces: usize,
    /// Edges with one face only.
    pub boundary_edges: usize,
    /// Edges shared by more than two faces, or by two faces that run along it the same way.
    pub non_manifold_edges: usize,
    /// Parts connected through shared vertices.
    pub bodies: usize,
}

impl MeshReport {
    /// Is every edge shared by exactly two faces of opposite direction?
    pub fn is_watertight(&self) -> bool {
        self.boundary_edges == 0 && self.non_manifold_edges == 0
    }

    /// A sentence per mend, empty if the mesh was taken as it is.
    pub fn mends(&self) -> Vec<String> {
        let mut out = Vec::new();
        let mut say = |n: usize, what: &str| {
            if n > 0 {
                out.push(format!("{n} {what}"));
            }
        };
        say(self.merged_vertices, "repeated vertices merged");
        say(self.degenerate_faces, "degenerate faces removed");
        say(self.duplicate_faces, "duplicate faces removed");
        say(self.flipped_faces, "faces turned outwards");
        out
    }
}

/// A mesh as a reader found it, before validation, in file units.
#[derive(Debug, Clone, Default)]
pub struct RawMesh {
    /// Vertex positions.
    pub vertices: Vec<[f64; 3]>,
    /// Vertex indices of the triangles.
    pub faces: Vec<[u32; 3]>,
}

impl TriMesh {
    /// Returns the mesh and what had to be mended; `path` only serves the error message.
    ///
    /// # Errors
    /// A non-finite coordinate, an index out of range, or nothing left after the mends.
    pub fn from_raw(raw: RawMesh, path: &Path) -> Result<(Self, MeshReport), ObjectError> {
        for (i, v) in raw.vertices.iter().enumerate() {
            if !v.iter().all(|x| x.is_finite()) {
                return Err(ObjectError::bad(
                    path,
                    Place::Vertex(i),
                    format!("a coordinate is not a finite number ({v:?})"),
                    "repair the vertex or export the mesh again",
                ));
            }
        }
        if raw.faces.is_empty() {
            return Err(ObjectError::bad(
                path,
                Place::Whole,
                "the mesh has 0 faces",
                "a triangle surface is needed, not points or lines",
            ));
        }
        let mut report = MeshReport::default();
        let (vertices, index) = merge_vertices(&raw.vertices, &mut report);
        let mut faces = Vec::with_capacity(raw.faces.len());
        let mut seen = HashMap::with_capacity(raw.faces.len());
        for (i, face) in raw.faces.iter().enumerate() {
            if let Some(&bad) = face.iter().find(|&&v| v as usize >= index.len()) {
                return Err(ObjectError::bad(
                    path,
                    Place::Face(i),
                    format!("vertex index {bad} of {} vertices", index.len()),
                    "the face list does not belong to the vertex list",
                ));
            }
            let face = face.map(|v| index[v as usize]);
            let [a, b, c] = face.map(|v| vertices[v as usize]);
            let area_vector = (b - a).cross(&(c - a));
            if face[0] == face[1]
                || face[1] == face[2]
                || face[0] == face[2]
                || area_vector.norm_squared() == 0.0
            {
                report.degenerate_faces += 1;
                continue;
            }
            let mut key = face;
            key.sort_unstable();
            if seen.insert(key, ()).is_some() {
                report.duplicate_faces += 1;
                continue;
            }
            faces.push(face);
        }
        if faces.is_empty() {
            return Err(ObjectError::bad(
                path,
                Place::Whole,
                "every face of the mesh is degenerate",
                "check the export: all triangles have zero area",
            ));
        }
        // Removing a zero-area face tears a watertight mesh, so those stay when they close it.
        if report.degenerate_faces > 0 {
            keep_degenerates_that_close(&raw, &index, &mut faces, &mut report);
        }
        let mut mesh = Self { vertices, faces };
        orient(&mut mesh, &mut report);
        count_edges(&mesh, &mut report);
        Ok((mesh, report))
    }

    /// Vertex positions, metres, object frame.
    pub fn vertices(&self) -> &[Point3<f64>] {
        &self.vertices
    }

    /// Vertex indices of the faces, counter-clockwise seen from outside.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// The three corners of face `i`.
    pub fn triangle(&self, i: usize) -> [Point3<f64>; 3] {
        self.faces[i].map(|v| self.vertices[v as usize])
    }

    /// The mesh with all coordinates multiplied by `factor` (about the origin).
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            vertices: self.vertices.iter().map(|v| v * factor).collect(),
            faces: self.faces.clone(),
        }
    }

    /// The mesh under a linear map about the origin that keeps the orientation.
    pub fn mapped(&self, map: &Matrix3<f64>) -> Self {
        Self {
            vertices: self.vertices.iter().map(|v| map * v).collect(),
            faces: self.faces.clone(),
        }
    }

    /// Smallest and largest corner of the axis-aligned box, metres.
    pub fn bounds(&self) -> (Point3<f64>, Point3<f64>) {
        let first = self.vertices[self.faces[0][0] as usize];
        self.faces
            .iter()
            .flatten()
            .map(|&v| self.vertices[v as usize])
            .fold((first, first), |(lo, hi), v| (lo.inf(&v), hi.sup(&v)))
    }

    /// Lengths of the axis-aligned box, metres.
    pub fn extents(&self) -> Vector3<f64> {
        let (lo, hi) = self.bounds();
        hi - lo
    }

    /// blake3 of vertices and faces: the identity of the geometry.
    pub fn content_hash(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&(self.vertices.len() as u64).to_le_bytes());
        for v in &self.vertices {
            for x in v.iter() {
                hasher.update(&x.to_le_bytes());
            }
        }
        for f in &self.faces {
            for i in f {
                hasher.update(&i.to_le_bytes());
            }
        }
        hasher.finalize().to_hex().to_string()
    }
}

/// Distinct positions, and for each raw vertex the index of its position.
fn merge_vertices(raw: &[[f64; 3]], report: &mut MeshReport) -> (Vec<Point3<f64>>, Vec<u32>) {
    let mut vertices = Vec::with_capacity(raw.len());
    let mut places = HashMap::with_capacity(raw.len());
    let mut index = Vec::with_capacity(raw.len());
    for v in raw {
        let key = v.map(|x| (x + 0.0).to_bits());
        let id = *places.entry(key).or_insert_with(|| {
            vertices.push(Point3::from(*v));
            (vertices.len() - 1) as u32
        });
        index.push(id);
    }
    report.merged_vertices = raw.len() - vertices.len();
    (vertices, index)
}

/// Puts zero-area faces with three distinct vertices back where they alone close the surface.
fn keep_degenerates_that_close(
    raw: &RawMesh,
    index: &[u32],
    faces: &mut Vec<[u32; 3]>,
    report: &mut MeshReport,
) {
    let open = |faces: &[[u32; 3]]| {
        let mut probe = MeshReport::default();
        let edges = directed_edges(faces);
        count(&edges, &mut probe);
        probe.boundary_edges
    };
    let before = open(faces);
    if before == 0 {
        return;
    }
    let mut with = faces.clone();
    let mut added = 0;
    let have: std::collections::HashSet<[u32; 3]> = faces.iter().copied().collect();
    for face in &raw.faces {
        let face = face.map(|v| index[v as usize]);
        let distinct = face[0] != face[1] && face[1] != face[2] && face[0] != face[2];
        if distinct && !have.contains(&face) {
            with.push(face);
            added += 1;
        }
    }
    if open(&with) < before {
        *faces = with;
        report.degenerate_faces -= added.min(report.degenerate_faces);
    }
}

type Edges = HashMap<(u32, u32), (usize, usize)>;

/// For each undirected edge: how many faces run along it forwards and backwards.
fn directed_edges(faces: &[[u32; 3]]) -> Edges {
    let mut edges: Edges = HashMap::with_capacity(faces.len() * 2);
    for f in faces {
        for (a, b) in [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])] {
            let entry = edges.entry((a.min(b), a.max(b))).or_default();
            if a < b {
                entry.0 += 1;
            } else {
                entry.1 += 1;
            }
        }
    }
    edges
}

fn count(edges: &Edges, report: &mut MeshReport) {
    report.boundary_edges = edges.values().filter(|(f, b)| f + b == 1).count();
    report.non_manifold_edges = edges.values().filter(|(f, b)| f + b > 1 && f != b).count();
}

fn count_edges(mesh: &TriMesh, report: &mut MeshReport) {
    count(&directed_edges(&mesh.faces), report);
}

/// Turns faces so that neighbours agree and every body encloses a positive volume where it must:
/// a body whose winding had to be mended is turned outwards on its own; bodies that were
/// consistent keep their sense (an inner shell is a cavity) unless the whole is inside out.
fn orient(mesh: &mut TriMesh, report: &mut MeshReport) {
    let mut by_edge: HashMap<(u32, u32), Vec<u32>> = HashMap::new();
    for (i, f) in mesh.faces.iter().enumerate() {
        for (a, b) in [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])] {
            by_edge
                .entry((a.min(b), a.max(b)))
                .or_default()
                .push(i as u32);
        }
    }
    let forward = |f: &[u32; 3], a: u32, b: u32| {
        (f[0] == a && f[1] == b) || (f[1] == a && f[2] == b) || (f[2] == a && f[0] == b)
    };
    let mut body_of = vec![u32::MAX; mesh.faces.len()];
    let mut stack = Vec::new();
    for start in 0..mesh.faces.len() {
        if body_of[start] != u32::MAX {
            continue;
        }
        let body = report.bodies as u32;
        report.bodies += 1;
        body_of[start] = body;
        stack.push(start);
        let mut members = vec![start];
        let mut turned = 0;
        while let Some(i) = stack.pop() {
            let f = mesh.faces[i];
            for (a, b) in [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])] {
                let Some(sharing) = by_edge.get(&(a.min(b), a.max(b))) else {
                    continue;
                };
                for &j in sharing {
                    let j = j as usize;
                    if body_of[j] != u32::MAX {
                        continue;
                    }
                    if sharing.len() == 2 && forward(&mesh.faces[j], a, b) {
                        mesh.faces[j].swap(1, 2);
                        turned += 1;
                    }
                    body_of[j] = body;
                    members.push(j);
                    stack.push(j);
                }
            }
        }
        if turned > 0 {
            let inside_out = signed_volume(mesh, members.iter().copied()) < 0.0;
            if inside_out {
                for &i in &members {
                    mesh.faces[i].swap(1, 2);
                }
            }
            report.flipped_faces += if inside_out {
                members.len() - turned
            } else {
                turned
            };
        }
    }
    if signed_volume(mesh, 0..mesh.faces.len()) < 0.0 {
        for f in &mut mesh.faces {
            f.swap(1, 2);
        }
        report.flipped_faces += mesh.faces.len();
    }
}

/// The sum of signed tetrahedra over some faces, about the first vertex.
fn signed_volume(mesh: &TriMesh, faces: impl Iterator<Item = usize>) -> f64 {
    let origin = mesh.vertices[mesh.faces[0][0] as usize];
    faces
        .map(|i| {
            let [a, b, c] = mesh.triangle(i).map(|v| v - origin);
            a.dot(&b.cross(&c)) / 6.0
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The unit cube, outward winding.
    pub(crate) fn cube() -> RawMesh {
        let vertices = (0..8)
            .map(|i| [f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)])
            .collect();
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let faces = quads
            .iter()
            .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
            .collect();
        RawMesh { vertices, faces }
    }

    fn validate(raw: RawMesh) -> Result<(TriMesh, MeshReport), ObjectError> {
        TriMesh::from_raw(raw, Path::new("test.obj"))
    }

    #[test]
    fn a_clean_cube_needs_no_mend() {
        let (mesh, report) = validate(cube()).unwrap();
        assert!(report.is_watertight());
        assert_eq!(report.bodies, 1);
        assert!(report.mends().is_empty(), "{:?}", report.mends());
        assert!((signed_volume(&mesh, 0..12) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn mixed_and_inverted_winding_is_mended_and_counted() {
        let mut mixed = cube();
        mixed.faces[3].swap(1, 2);
        let (mesh, report) = validate(mixed).unwrap();
        assert_eq!(report.flipped_faces, 1);
        assert!(report.is_watertight());
        assert!((signed_volume(&mesh, 0..12) - 1.0).abs() < 1e-15);

        let mut inverted = cube();
        inverted.faces.iter_mut().for_each(|f| f.swap(1, 2));
        let (mesh, report) = validate(inverted).unwrap();
        assert_eq!(report.flipped_faces, 12);
        assert!((signed_volume(&mesh, 0..12) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn degenerate_duplicate_and_split_are_mended_and_counted() {
        let mut raw = cube();
        raw.faces.push([0, 0, 1]);
        raw.faces.push(raw.faces[0]);
        raw.vertices.push(raw.vertices[7]);
        raw.faces.iter_mut().for_each(|f| {
            if f == &[4, 5, 7] {
                f[2] = 8;
            }
        });
        let (mesh, report) = validate(raw).unwrap();
        assert_eq!(
            (
                report.degenerate_faces,
                report.duplicate_faces,
                report.merged_vertices
            ),
            (1, 1, 1)
        );
        assert_eq!(mesh.faces().len(), 12);
        assert!(report.is_watertight());
    }

    #[test]
    fn an_open_box_is_not_watertight() {
        let mut raw = cube();
        raw.faces.truncate(10);
        let (_, report) = validate(raw).unwrap();
        assert_eq!(report.boundary_edges, 4);
        assert!(!report.is_watertight());
    }

    #[test]
    fn what_cannot_be_mended_is_an_error_that_names_the_place() {
        let mut nan = cube();
        nan.vertices[5][1] = f64::NAN;
        let message = validate(nan).unwrap_err().to_string();
        assert!(
            message.contains("vertex 5") && message.contains("test.obj"),
            "{message}"
        );

        let mut range = cube();
        range.faces[2][0] = 99;
        let message = validate(range).unwrap_err().to_string();
        assert!(
            message.contains("face 2") && message.contains("99"),
            "{message}"
        );

        let empty = RawMesh {
            vertices: cube().vertices,
            faces: vec![],
        };
        let message = validate(empty).unwrap_err().to_string();
        assert!(message.contains("0 faces"), "{message}");
    }
}
