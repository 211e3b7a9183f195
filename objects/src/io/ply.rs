//! PLY, text and binary, read by `ply-rs-bw`.

use std::path::Path;

use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};

use crate::error::{ObjectError, Place};
use crate::mesh::RawMesh;

/// Vertices and faces of the file; polygons are split into fans.
///
/// # Errors
/// Names the line of the header or the element that cannot be read.
pub fn parse(bytes: &[u8], path: &Path) -> Result<RawMesh, ObjectError> {
    let bad = |place, what: String| {
        ObjectError::bad(path, place, what, "correct it or export the mesh again")
    };
    let ply = Parser::<DefaultElement>::new()
        .read_ply(&mut &bytes[..])
        .map_err(|e| bad(Place::Whole, e.to_string()))?;
    let mut raw = RawMesh::default();
    let vertices = ply
        .payload
        .get("vertex")
        .ok_or_else(|| bad(Place::Whole, "there is no `vertex` element".into()))?;
    for (i, vertex) in vertices.iter().enumerate() {
        let mut position = [0.0; 3];
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            position[axis] = vertex
                .get(name)
                .and_then(number)
                .ok_or_else(|| bad(Place::Vertex(i), format!("there is no number `{name}`")))?;
        }
        raw.vertices.push(position);
    }
    for (i, face) in ply.payload.get("face").into_iter().flatten().enumerate() {
        let corners = face
            .get("vertex_indices")
            .or_else(|| face.get("vertex_index"))
            .and_then(indices)
            .ok_or_else(|| bad(Place::Face(i), "there is no list `vertex_indices`".into()))?;
        if corners.len() < 3 {
            return Err(bad(
                Place::Face(i),
                format!("a face with {} corners", corners.len()),
            ));
        }
        for k in 1..corners.len() - 1 {
            raw.faces.push([corners[0], corners[k], corners[k + 1]]);
        }
    }
    Ok(raw)
}

fn number(property: &Property) -> Option<f64> {
    match *property {
        Property::Float(x) => Some(f64::from(x)),
        Property::Double(x) => Some(x),
        Property::Char(x) => Some(f64::from(x)),
        Property::UChar(x) => Some(f64::from(x)),
        Property::Short(x) => Some(f64::from(x)),
        Property::UShort(x) => Some(f64::from(x)),
        Property::Int(x) => Some(f64::from(x)),
        Property::UInt(x) => Some(f64::from(x)),
        _ => None,
    }
}

/// Indices of any integer list; a negative one becomes out of range, which validation reports.
fn indices(property: &Property) -> Option<Vec<u32>> {
    let signed = |x: i64| u32::try_from(x).unwrap_or(u32::MAX);
    Some(match property {
        Property::ListChar(v) => v.iter().map(|&x| signed(x.into())).collect(),
        Property::ListUChar(v) => v.iter().map(|&x| x.into()).collect(),
        Property::ListShort(v) => v.iter().map(|&x| signed(x.into())).collect(),
        Property::ListUShort(v) => v.iter().map(|&x| x.into()).collect(),
        Property::ListInt(v) => v.iter().map(|&x| signed(x.into())).collect(),
        Property::ListUInt(v) => v.clone(),
        _ => return None,
    })
}
