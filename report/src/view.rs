//! What the 3-D view shows of an object: a small mesh, kept beside the rows under `views/`.

use std::collections::BTreeMap;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::{Deserialize, Serialize};

use crate::replay::file_stem;

/// Meshes with more triangles are thinned out, for the view alone.
const TRIANGLES_MAX: usize = 8000;

/// A mesh in 16-bit steps from a corner.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ViewMesh {
    /// The object.
    pub object: String,
    /// Lowest corner, object frame, metres.
    pub low: [f32; 3],
    /// Length of a step, metres.
    pub step_m: f32,
    /// Steps of x, y, z of each vertex: little-endian u16, base64.
    pub vertices: String,
    /// Three vertex numbers a triangle: little-endian u16, base64.
    pub faces: String,
    /// Triangles of the mesh that was tried, if the view has fewer.
    pub thinned_from: Option<usize>,
    /// Corners of each convex piece that the trial used, packed as the vertices are.
    #[serde(default)]
    pub pieces: Vec<String>,
}

impl ViewMesh {
    /// Packs a mesh; above 8 000 triangles vertices are merged on a grid (J. Rossignac and
    /// P. Borrel, 1993) that is made coarser until the rest is small enough.
    pub fn new(object: &str, vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> Self {
        let mut low = [f64::MAX; 3];
        let mut high = [f64::MIN; 3];
        for v in vertices {
            for k in 0..3 {
                low[k] = low[k].min(v[k]);
                high[k] = high[k].max(v[k]);
            }
        }
        let extent = (0..3)
            .map(|k| high[k] - low[k])
            .fold(0.0, f64::max)
            .max(1e-9);
        let step = extent / 65535.0;
        let quantised: Vec<[u16; 3]> = vertices
            .iter()
            .map(|v| std::array::from_fn(|k| ((v[k] - low[k]) / step).round() as u16))
            .collect();
        let mut cell = 1u32;
        let mut mesh = merged(&quantised, faces, cell);
        while mesh.1.len() > TRIANGLES_MAX || mesh.0.len() > usize::from(u16::MAX) {
            cell = if cell == 1 { 256 } else { cell * 5 / 4 };
            mesh = merged(&quantised, faces, cell);
        }
        let pack = |numbers: &mut dyn Iterator<Item = u16>| {
            STANDARD.encode(numbers.flat_map(u16::to_le_bytes).collect::<Vec<u8>>())
        };
        Self {
            object: object.to_owned(),
            low: low.map(|x| x as f32),
            step_m: step as f32,
            vertices: pack(&mut mesh.0.iter().flatten().copied()),
            faces: pack(&mut mesh.1.iter().flatten().copied()),
            thinned_from: (cell > 1).then_some(faces.len()),
            pieces: Vec::new(),
        }
    }

    /// Adds the convex pieces of the object, corners in its frame, metres.
    #[must_use]
    pub fn with_pieces(mut self, pieces: &[Vec<[f64; 3]>]) -> Self {
        // Pieces may stick out of the mesh a little; the view clips them to its box.
        let steps = |x: f64, k: usize| {
            ((x - f64::from(self.low[k])) / f64::from(self.step_m)).round() as u16
        };
        self.pieces = pieces
            .iter()
            .map(|corners| {
                let numbers = corners
                    .iter()
                    .flat_map(|c| [0, 1, 2].map(|k| steps(c[k], k)));
                STANDARD.encode(numbers.flat_map(u16::to_le_bytes).collect::<Vec<u8>>())
            })
            .collect();
        self
    }

    /// Bytes it takes in a file.
    pub fn size(&self) -> usize {
        let pieces: usize = self.pieces.iter().map(String::len).sum();
        self.vertices.len() + self.faces.len() + pieces
    }

    /// The file's name under `views/`.
    pub fn file_name(&self) -> String {
        format!("{}.json", file_stem(&self.object))
    }
}

/// Vertices in the same cell become one; triangles that lose a corner go.
fn merged(vertices: &[[u16; 3]], faces: &[[u32; 3]], cell: u32) -> (Vec<[u16; 3]>, Vec<[u16; 3]>) {
    let mut number = BTreeMap::new();
    let mut kept: Vec<[u16; 3]> = Vec::new();
    let place: Vec<usize> = vertices
        .iter()
        .map(|v| {
            let key = v.map(|x| u32::from(x) / cell);
            *number.entry(key).or_insert_with(|| {
                kept.push(*v);
                kept.len() - 1
            })
        })
        .collect();
    if kept.len() > usize::from(u16::MAX) {
        return (kept, Vec::new());
    }
    let triangles = faces
        .iter()
        .map(|f| f.map(|i| place[i as usize] as u16))
        .filter(|[a, b, c]| a != b && b != c && a != c)
        .collect();
    (kept, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_mesh_stays_whole_and_a_large_one_is_thinned() {
        let grid = |n: u32| {
            let vertices: Vec<[f64; 3]> = (0..n * n)
                .map(|i| [f64::from(i % n) * 0.001, f64::from(i / n) * 0.001, 0.0])
                .collect();
            let faces: Vec<[u32; 3]> = (0..n - 1)
                .flat_map(|y| (0..n - 1).map(move |x| y * n + x))
                .flat_map(|a| [[a, a + 1, a + n], [a + 1, a + n + 1, a + n]])
                .collect();
            (vertices, faces)
        };
        let (v, f) = grid(10);
        let small = ViewMesh::new("small", &v, &f);
        assert_eq!(small.thinned_from, None);
        let bytes = STANDARD.decode(&small.faces).unwrap();
        assert_eq!(bytes.len(), f.len() * 6);
        let (v, f) = grid(150);
        let large = ViewMesh::new("large", &v, &f);
        assert_eq!(large.thinned_from, Some(f.len()));
        let left = STANDARD.decode(&large.faces).unwrap().len() / 6;
        assert!((1000..=TRIANGLES_MAX).contains(&left), "{left}");
    }
}
