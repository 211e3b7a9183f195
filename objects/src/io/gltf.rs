//! glTF 2.0 and GLB, read by `gltf`: the triangles of the default scene in scene coordinates.

use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use gltf::buffer::Source;
use gltf::mesh::Mode;
use nalgebra::{Matrix4, Point3};

use crate::error::{ObjectError, Place};
use crate::mesh::RawMesh;

/// All triangle primitives, each under the transform of its node.
///
/// # Errors
/// Broken JSON or buffers; a scene with no triangles is left to validation.
pub fn parse(bytes: &[u8], path: &Path) -> Result<RawMesh, ObjectError> {
    let bad = |what: String| {
        ObjectError::bad(
            path,
            Place::Whole,
            what,
            "export the scene again, as GLB if in doubt",
        )
    };
    let gltf = gltf::Gltf::from_slice(bytes).map_err(|e| bad(format!("not glTF 2.0: {e}")))?;
    let blob = gltf.blob.clone();
    let mut buffers = Vec::new();
    for buffer in gltf.buffers() {
        let data = match buffer.source() {
            Source::Bin => blob
                .clone()
                .ok_or_else(|| bad("the binary chunk is missing".into()))?,
            Source::Uri(uri) => match uri.split_once(";base64,") {
                Some((head, data)) if head.starts_with("data:") => STANDARD
                    .decode(data)
                    .map_err(|e| bad(format!("buffer {}: {e}", buffer.index())))?,
                _ => {
                    let file = path.parent().unwrap_or(Path::new(".")).join(uri);
                    std::fs::read(&file).map_err(|e| ObjectError::io(&file, e))?
                }
            },
        };
        if data.len() < buffer.length() {
            return Err(bad(format!(
                "buffer {} has {} of {} bytes",
                buffer.index(),
                data.len(),
                buffer.length()
            )));
        }
        buffers.push(data);
    }
    let mut raw = RawMesh::default();
    let scene = gltf.default_scene().or_else(|| gltf.scenes().next());
    let mut stack: Vec<(gltf::Node<'_>, Matrix4<f64>)> = scene
        .iter()
        .flat_map(|s| s.nodes())
        .map(|n| (n, Matrix4::identity()))
        .collect();
    while let Some((node, parent)) = stack.pop() {
        let local = node.transform().matrix();
        let local = Matrix4::from_fn(|i, j| f64::from(local[j][i]));
        let here = parent * local;
        if let Some(mesh) = node.mesh() {
            for primitive in mesh.primitives() {
                add(&primitive, &here, &buffers, &mut raw).map_err(&bad)?;
            }
        }
        stack.extend(node.children().map(|child| (child, here)));
    }
    Ok(raw)
}

fn add(
    primitive: &gltf::Primitive<'_>,
    scene_from_mesh: &Matrix4<f64>,
    buffers: &[Vec<u8>],
    raw: &mut RawMesh,
) -> Result<(), String> {
    if primitive.mode() != Mode::Triangles {
        return Ok(());
    }
    // The accessor reader panics on an accessor that runs past its buffer, so bounds come first.
    for accessor in primitive
        .attributes()
        .map(|(_, a)| a)
        .chain(primitive.indices())
    {
        let view = accessor
            .view()
            .ok_or("sparse accessors are not supported")?;
        let stride = view.stride().unwrap_or_else(|| accessor.size());
        let end = accessor.offset()
            + stride * accessor.count().saturating_sub(1)
            + if accessor.count() > 0 {
                accessor.size()
            } else {
                0
            };
        if end > view.length()
            || view.offset() + view.length() > buffers[view.buffer().index()].len()
        {
            return Err(format!(
                "accessor {} runs past its buffer",
                accessor.index()
            ));
        }
    }
    let reader = primitive.reader(|b| buffers.get(b.index()).map(Vec::as_slice));
    let base = raw.vertices.len() as u32;
    let positions = reader
        .read_positions()
        .ok_or("a primitive has no POSITION")?;
    for p in positions {
        let p = Point3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]));
        raw.vertices
            .push(scene_from_mesh.transform_point(&p).into());
    }
    let count = raw.vertices.len() as u32 - base;
    let indices: Vec<u32> = match reader.read_indices() {
        Some(indices) => indices.into_u32().collect(),
        None => (0..count).collect(),
    };
    for f in indices.chunks_exact(3) {
        if f.iter().any(|&i| i >= count) {
            return Err(format!("an index of {f:?} is not below {count}"));
        }
        raw.faces.push([f[0] + base, f[1] + base, f[2] + base]);
    }
    Ok(())
}
