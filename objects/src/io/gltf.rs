//! glTF 2.0 and GLB, read by `gltf`: the triangles of the default scene in scene coordinates.

use std::path::{Component, Path};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use gltf::Accessor;
use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::Source;
use gltf::mesh::Mode;
use nalgebra::{Matrix4, Point3};

use super::read::{MESH_BYTES_MAX, read_at_most};
use crate::error::{ObjectError, Place};
use crate::mesh::RawMesh;

/// Most vertices of a scene; a small file can name one mesh in many nodes.
const VERTICES_MAX: usize = 20_000_000;

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
                    let is_beside = |c: Component<'_>| matches!(c, Component::Normal(_));
                    if !Path::new(uri).components().all(is_beside) {
                        return Err(bad(format!("buffer {uri:?} does not lie beside the file")));
                    }
                    let file = path.parent().unwrap_or(Path::new(".")).join(uri);
                    read_at_most(&file, MESH_BYTES_MAX).map_err(|e| ObjectError::io(&file, e))?
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
    let mut seen = vec![false; gltf.nodes().len()];
    while let Some((node, parent)) = stack.pop() {
        if std::mem::replace(&mut seen[node.index()], true) {
            return Err(bad(format!(
                "node {} stands twice in the tree",
                node.index()
            )));
        }
        let local = node.transform().matrix();
        let local = Matrix4::from_fn(|i, j| f64::from(local[j][i]));
        let here = parent * local;
        if let Some(mesh) = node.mesh() {
            for primitive in mesh.primitives() {
                add(&primitive, &here, &buffers, &mut raw).map_err(&bad)?;
                if raw.vertices.len() > VERTICES_MAX {
                    return Err(bad(format!("the scene has over {VERTICES_MAX} vertices")));
                }
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
    // The reader panics on an accessor of another type or one that runs past its buffer.
    let positions = primitive.get(&gltf::Semantic::Positions);
    let is_vec3 =
        |a: &Accessor<'_>| a.data_type() == DataType::F32 && a.dimensions() == Dimensions::Vec3;
    if positions.is_some_and(|a| !is_vec3(&a)) {
        return Err("POSITION is not of three floats".into());
    }
    let is_index = |a: &Accessor<'_>| {
        let types = [DataType::U8, DataType::U16, DataType::U32];
        types.contains(&a.data_type()) && a.dimensions() == Dimensions::Scalar
    };
    if primitive.indices().is_some_and(|a| !is_index(&a)) {
        return Err("the indices are not unsigned integers".into());
    }
    for accessor in primitive
        .attributes()
        .map(|(_, a)| a)
        .chain(primitive.indices())
    {
        let view = accessor
            .view()
            .ok_or("sparse accessors are not supported")?;
        let stride = view.stride().unwrap_or_else(|| accessor.size());
        let past_last = |first: usize| {
            let strides = stride.checked_mul(accessor.count().saturating_sub(1))?;
            let last = first.checked_add(strides)?;
            last.checked_add(if accessor.count() > 0 {
                accessor.size()
            } else {
                0
            })
        };
        let view_end = view.offset().checked_add(view.length());
        let buffer = buffers[view.buffer().index()].len();
        if past_last(accessor.offset()).is_none_or(|end| end > view.length())
            || view_end.is_none_or(|end| end > buffer)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// What is said of a scene whose text was changed.
    fn complaint(from: &str, to: &str) -> String {
        let scene = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
            "nodes":[{"mesh":0},{"children":[0]}],
            "buffers":[{"byteLength":42,"uri":"data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIA"}],
            "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
            "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],
            "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",
            "min":[0,0,0],"max":[1,1,0]},{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}]}"#;
        let path = Path::new("scene.gltf");
        let mesh = parse(scene.as_bytes(), path).unwrap();
        assert_eq!((mesh.vertices.len(), mesh.faces.len()), (3, 1));
        assert!(scene.contains(from));
        match parse(scene.replace(from, to).as_bytes(), path) {
            Ok(_) => panic!("the scene was taken"),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn a_scene_on_which_the_reader_panics_is_an_error() {
        // An accessor that is not there: found by fuzzing.
        let text = r#"{"asset":{"version":"2.0"},"meshes":[{"primitives":[{"attributes":{"POSITION":5}}]}]}"#;
        let error = crate::io::parse_mesh(text.as_bytes(), Path::new("scene.gltf")).unwrap_err();
        assert!(error.to_string().contains("scene.gltf"), "{error}");
    }

    #[test]
    fn scenes_that_would_panic_loop_or_read_elsewhere_are_errors() {
        // Positions as integers: found by fuzzing.
        let error = complaint("5126", "5123");
        assert!(error.contains("not of three floats"), "{error}");
        let error = complaint(r#"[{"mesh":0}"#, r#"[{"mesh":0,"children":[1]}"#);
        assert!(error.contains("twice"), "{error}");
        for elsewhere in ["/dev/zero", "../secret.bin"] {
            let own = "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIA";
            let error = complaint(own, elsewhere);
            assert!(error.contains("beside"), "{error}");
        }
    }
}
