//! STL, text and binary, read by `stl_io`.

use std::io::Cursor;
use std::path::Path;

use crate::error::{ObjectError, Place};
use crate::mesh::RawMesh;

const HEADER_BYTES: usize = 84;
const FACE_BYTES: usize = 50;

/// The triangles of the file; vertices of equal position are joined later, at validation.
///
/// # Errors
/// A file that ends too early, with the byte; text that is not STL.
pub fn parse(bytes: &[u8], path: &Path) -> Result<RawMesh, ObjectError> {
    let is_text = bytes.starts_with(b"solid")
        && bytes.get(..512.min(bytes.len())).is_some_and(|head| {
            head.windows(5).any(|w| w == b"facet") || bytes.len() < HEADER_BYTES
        });
    if !is_text {
        check_length(bytes, path)?;
    }
    let iter = stl_io::create_stl_reader(&mut Cursor::new(bytes))
        .map_err(|e| bad(path, Place::Whole, e.to_string()))
        .and_then(|reader| {
            reader
                .enumerate()
                .map(|(i, t)| t.map_err(|e| bad(path, Place::Face(i), e.to_string())))
                .collect::<Result<Vec<_>, _>>()
        })?;
    let mut raw = RawMesh::default();
    for (i, triangle) in iter.iter().enumerate() {
        for v in &triangle.vertices {
            let p: [f64; 3] = std::array::from_fn(|k| f64::from(v[k]));
            if !p.iter().all(|x| x.is_finite()) {
                return Err(bad(path, Place::Face(i), format!("a coordinate is {p:?}")));
            }
            raw.vertices.push(p);
        }
        let base = 3 * i as u32;
        raw.faces.push([base, base + 1, base + 2]);
    }
    Ok(raw)
}

fn check_length(bytes: &[u8], path: &Path) -> Result<(), ObjectError> {
    let Some(count) = bytes.get(80..HEADER_BYTES) else {
        return Err(bad(
            path,
            Place::Byte(bytes.len() as u64),
            "the file ends inside its header".into(),
        ));
    };
    let count = u32::from_le_bytes(count.try_into().expect("four bytes")) as usize;
    let needed = HEADER_BYTES as u64 + FACE_BYTES as u64 * count as u64;
    if (bytes.len() as u64) < needed {
        return Err(bad(
            path,
            Place::Byte(bytes.len() as u64),
            format!("the header promises {count} faces ({needed} bytes), but the file ends here"),
        ));
    }
    Ok(())
}

fn bad(path: &Path, place: Place, what: String) -> ObjectError {
    ObjectError::bad(
        path,
        place,
        what,
        "the file is truncated or not STL; export it again",
    )
}
