//! Wavefront OBJ, read by `tobj`; this file adds what it does not tell: the line of a defect.

use std::path::Path;

use crate::error::{ObjectError, Place};
use crate::mesh::RawMesh;

/// All objects and groups of the file as one raw mesh; polygons are split into triangles.
///
/// # Errors
/// Names the line that cannot be read.
pub fn parse(bytes: &[u8], path: &Path) -> Result<RawMesh, ObjectError> {
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    if let Some((line, what)) = first_defect(bytes) {
        return Err(bad(path, Place::Line(line), what));
    }
    let (models, _) = tobj::load_obj_buf(&mut &bytes[..], &options, |_| Ok(Default::default()))
        .map_err(|e| bad(path, Place::Whole, e.to_string()))?;
    let mut raw = RawMesh::default();
    for model in models {
        let base = raw.vertices.len() as u32;
        raw.vertices.extend(
            model
                .mesh
                .positions
                .chunks_exact(3)
                .map(|p| [p[0], p[1], p[2]]),
        );
        raw.faces.extend(
            model
                .mesh
                .indices
                .chunks_exact(3)
                .map(|f| [f[0] + base, f[1] + base, f[2] + base]),
        );
    }
    Ok(raw)
}

fn bad(path: &Path, place: Place, what: String) -> ObjectError {
    ObjectError::bad(
        path,
        place,
        what,
        "correct the line or export the mesh again",
    )
}

/// The first line that no reader could use, and why.
fn first_defect(bytes: &[u8]) -> Option<(usize, String)> {
    let mut vertices = 0i64;
    for (i, line) in bytes.split(|&b| b == b'\n').enumerate() {
        let number = i + 1;
        let Ok(line) = std::str::from_utf8(line) else {
            return Some((number, "not text: is this really an OBJ file?".into()));
        };
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                vertices += 1;
                for axis in ["x", "y", "z"] {
                    let word = words.next().unwrap_or("");
                    match word.parse::<f64>() {
                        Ok(x) if x.is_finite() => {}
                        Ok(x) => return Some((number, format!("vertex {axis} is {x}"))),
                        Err(_) => {
                            return Some((number, format!("vertex {axis} is no number: {word:?}")));
                        }
                    }
                }
            }
            Some("f") => {
                let corners: Vec<&str> = words.take_while(|w| !w.starts_with('#')).collect();
                if corners.len() < 3 {
                    return Some((number, format!("a face with {} corners", corners.len())));
                }
                for corner in corners {
                    let index = corner.split('/').next().and_then(|w| w.parse::<i64>().ok());
                    match index {
                        Some(k) if (k >= 1 && k <= vertices) || (k < 0 && -k <= vertices) => {}
                        _ => {
                            return Some((
                                number,
                                format!("face corner {corner:?} of {vertices} vertices so far"),
                            ));
                        }
                    }
                }
            }
            _ => {}
        }
    }
    None
}
