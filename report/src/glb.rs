//! One recorded trial as an animated GLB: opens in Blender and any glTF viewer.

use std::borrow::Cow;
use std::f32::consts::FRAC_1_SQRT_2;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use gltf::binary::{Glb, Header};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use serde_json::{Value, json};
use shakedown_objects::ConvexBody;

use crate::replay::Replay;
use crate::view::ViewMesh;

const FLOAT: u32 = 5126;
const U16: u32 = 5123;

/// The bytes of a GLB with the object, the hand and the motion.
///
/// `gripper` is the hand as the manifest has it.
///
/// # Errors
/// A replay or mesh whose data does not hold what it says.
pub fn animated(replay: &Replay, mesh: &ViewMesh, gripper: &Value) -> Result<Vec<u8>, String> {
    let frames = replay
        .numbers()
        .ok_or("the replay's data does not hold its frames")?;
    let mut file = Builder::default();
    let object_mesh = file.object(mesh)?;
    let palm: Vec<usize> = parts(gripper, "palm").map(|b| file.body(&b)).collect();
    let finger: Vec<usize> = parts(gripper, "finger").map(|b| file.body(&b)).collect();
    let leaf = |mesh: &usize| json!({ "mesh": mesh });
    // Nodes: 0 root, 1 object, 2 hand, 3 and 4 fingers, then the parts.
    let first = 5;
    let part_nodes: Vec<Value> = palm
        .iter()
        .chain(&finger)
        .chain(&finger)
        .map(leaf)
        .collect();
    let children =
        |from: usize, n: usize| -> Vec<usize> { (first + from..first + from + n).collect() };
    let mut hand_children = vec![3, 4];
    hand_children.extend(children(0, palm.len()));
    let mut nodes = vec![
        // glTF has y up; the hand's approach points down.
        json!({"name": "trial", "children": [1, 2], "rotation": [FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2]}),
        json!({"name": replay.object, "mesh": object_mesh}),
        json!({"name": "hand", "children": hand_children}),
        json!({"name": "finger_left", "children": children(palm.len(), finger.len())}),
        json!({
            "name": "finger_right",
            "children": children(palm.len() + finger.len(), finger.len()),
            // The first finger turned by half a turn about the approach direction.
            "rotation": [0.0, 0.0, 1.0, 0.0],
        }),
    ];
    nodes.extend(part_nodes);
    let times: Vec<f32> = frames.iter().map(|f| f[0]).collect();
    let input = file.floats(&times, "SCALAR", true);
    let mut channels = Vec::new();
    let mut samplers = Vec::new();
    let mut track = |file: &mut Builder, node: usize, path: &str, values: Vec<f32>, kind: &str| {
        let output = file.floats(&values, kind, false);
        samplers.push(json!({"input": input, "output": output, "interpolation": "LINEAR"}));
        let sampler = samplers.len() - 1;
        channels.push(json!({"sampler": sampler, "target": {"node": node, "path": path}}));
    };
    for (node, at) in [(2, 1), (1, 8)] {
        let pick = |from: usize, n: usize| -> Vec<f32> {
            frames
                .iter()
                .flat_map(|f| f[from..from + n].to_vec())
                .collect()
        };
        track(&mut file, node, "translation", pick(at, 3), "VEC3");
        track(&mut file, node, "rotation", pick(at + 3, 4), "VEC4");
    }
    for (node, at, sign) in [(3, 15, 1.0), (4, 16, -1.0)] {
        let shifts = frames
            .iter()
            .flat_map(|f| [sign * f[at], 0.0, 0.0])
            .collect();
        track(&mut file, node, "translation", shifts, "VEC3");
    }
    let document = json!({
        "asset": {"version": "2.0", "generator": "shakedown"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": file.meshes,
        "materials": [
            {"name": "object", "pbrMetallicRoughness": {"baseColorFactor": [0.35, 0.5, 0.65, 1.0], "metallicFactor": 0.0}, "doubleSided": true},
            {"name": "hand", "pbrMetallicRoughness": {"baseColorFactor": [0.7, 0.72, 0.75, 1.0], "metallicFactor": 0.1}},
        ],
        "animations": [{"name": replay.outcome, "channels": channels, "samplers": samplers}],
        "accessors": file.accessors,
        "bufferViews": file.views,
        "buffers": [{"byteLength": file.bytes.len()}],
    });
    let json = document.to_string().into_bytes();
    Glb {
        header: Header {
            magic: *b"glTF",
            version: 2,
            length: 0,
        },
        json: Cow::Owned(json),
        bin: Some(Cow::Owned(file.bytes)),
    }
    .to_vec()
    .map_err(|e| e.to_string())
}

/// The parts of a kind, hand or finger frame.
fn parts<'a>(gripper: &'a Value, kind: &str) -> impl Iterator<Item = ConvexBody> + use<'a> {
    let vector = |v: &Value| Vector3::from_fn(|k, _| v[k].as_f64().unwrap_or(0.0));
    let list = gripper[kind].as_array().into_iter().flatten();
    list.filter_map(move |part| match part["hull_m"].as_array() {
        Some(points) => {
            let corners: Vec<_> = points.iter().map(|p| Point3::from(vector(p))).collect();
            ConvexBody::hull(&corners)
        }
        None => {
            let cuboid = &part["box"];
            let rpy = vector(&cuboid["rpy_rad"]);
            let pose = Isometry3::from_parts(
                Translation3::from(vector(&cuboid["centre_m"])),
                UnitQuaternion::from_euler_angles(rpy.x, rpy.y, rpy.z),
            );
            Some(ConvexBody::cuboid(vector(&cuboid["size_m"]), &pose))
        }
    })
}

#[derive(Default)]
struct Builder {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
}

impl Builder {
    fn view(&mut self, data: &[u8]) -> usize {
        while !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0);
        }
        self.views.push(json!({
            "buffer": 0,
            "byteOffset": self.bytes.len(),
            "byteLength": data.len(),
        }));
        self.bytes.extend_from_slice(data);
        self.views.len() - 1
    }

    fn floats(&mut self, values: &[f32], kind: &str, with_range: bool) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            _ => 4,
        };
        let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&data);
        let mut accessor = json!({
            "bufferView": view,
            "componentType": FLOAT,
            "count": values.len() / width,
            "type": kind,
        });
        if with_range {
            let column = |k: usize| values.iter().skip(k).step_by(width).copied();
            let low: Vec<f32> = (0..width)
                .map(|k| column(k).fold(f32::MAX, f32::min))
                .collect();
            let high: Vec<f32> = (0..width)
                .map(|k| column(k).fold(f32::MIN, f32::max))
                .collect();
            accessor["min"] = json!(low);
            accessor["max"] = json!(high);
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn mesh(&mut self, positions: &[f32], indices: &[u8], material: usize) -> usize {
        let position = self.floats(positions, "VEC3", true);
        let view = self.view(indices);
        self.accessors.push(json!({
            "bufferView": view,
            "componentType": U16,
            "count": indices.len() / 2,
            "type": "SCALAR",
        }));
        let index = self.accessors.len() - 1;
        self.meshes.push(json!({"primitives": [{
            "attributes": {"POSITION": position},
            "indices": index,
            "material": material,
        }]}));
        self.meshes.len() - 1
    }

    fn object(&mut self, mesh: &ViewMesh) -> Result<usize, String> {
        let decode = |text: &str| STANDARD.decode(text).map_err(|e| format!("the mesh: {e}"));
        let positions: Vec<f32> = decode(&mesh.vertices)?
            .chunks_exact(2)
            .enumerate()
            .map(|(i, b)| {
                mesh.low[i % 3] + mesh.step_m * f32::from(u16::from_le_bytes([b[0], b[1]]))
            })
            .collect();
        Ok(self.mesh(&positions, &decode(&mesh.faces)?, 0))
    }

    fn body(&mut self, body: &ConvexBody) -> usize {
        let triangles = body.triangles();
        let positions: Vec<f32> = triangles
            .iter()
            .flatten()
            .flat_map(|v| v.coords.iter().map(|x| *x as f32).collect::<Vec<_>>())
            .collect();
        let corners = 0..(3 * triangles.len()) as u16;
        let indices: Vec<u8> = corners.flat_map(u16::to_le_bytes).collect();
        self.mesh(&positions, &indices, 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gltf_reader_finds_the_motion_of_the_replay() {
        let frame = |k: usize| {
            std::array::from_fn(|i| match i {
                0 => k as f32 / 60.0,
                7 | 14 => 1.0,
                8 => 0.01 * k as f32,
                15 | 16 => 0.04,
                _ => 0.0,
            })
        };
        let replay = Replay::new("mug", 3, "held", (0..10).map(frame));
        let vertices = [
            [0.0, 0.0, 0.0],
            [0.1, 0.0, 0.0],
            [0.0, 0.1, 0.0],
            [0.0, 0.0, 0.1],
        ];
        let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
        let mesh = ViewMesh::new("mug", &vertices, &faces);
        let gripper = json!({
            "palm": [{"hull_m": [[-0.1, -0.02, 0.0], [0.1, 0.02, 0.0], [0.1, -0.02, 0.0], [0.0, 0.0, 0.06]]}],
            "finger": [{"box": {"size_m": [0.01, 0.02, 0.05], "centre_m": [0.005, 0.0, 0.08]}}],
        });
        let bytes = animated(&replay, &mesh, &gripper).unwrap();
        let file = gltf::Gltf::from_slice(&bytes).unwrap();
        let blob = file.blob.as_ref().unwrap();
        let palm = file.nodes().nth(5).unwrap().mesh().unwrap();
        let corners = palm.primitives().next().unwrap().indices().unwrap().count();
        assert_eq!(corners, 12, "the palm is a tetrahedron");
        let animation = file.animations().next().unwrap();
        let object = animation
            .channels()
            .find(|c| {
                c.target().node().index() == 1
                    && c.target().property() == gltf::animation::Property::Translation
            })
            .unwrap();
        let reader = object.reader(|_| Some(&blob[..]));
        let times: Vec<f32> = reader.read_inputs().unwrap().collect();
        assert_eq!(times.len(), 10);
        let Some(gltf::animation::util::ReadOutputs::Translations(moves)) = reader.read_outputs()
        else {
            panic!("translations");
        };
        let last = moves.last().unwrap();
        assert!(
            (last[0] - 0.09).abs() < 1e-6 && last[1..] == [0.0, 0.0],
            "{last:?}"
        );
    }
}
