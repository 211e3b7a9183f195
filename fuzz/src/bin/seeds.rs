//! Writes one good input or more for each target, where fuzzing starts: `seeds DIRECTORY`.

#[path = "../../../sampler/tests/fixture/mod.rs"]
mod fixture;

use std::fs;
use std::path::{Path, PathBuf};

use shakedown_gripper_assets::io::acronym_h5::FlexMotions;
use shakedown_gripper_assets::io::acronym_h5_writer::{LabelledGrasps, write_labelled};
use shakedown_gripper_assets::{
    Grasp, GraspFile, GraspFormat, Gripper, ObjectReference, write_grasps,
};
use shakedown_sim::Protocol;

const CUBE: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [0.04, 0.0, 0.0], [0.0, 0.05, 0.0], [0.0, 0.0, 0.06]];
const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

fn main() {
    let out = PathBuf::from(std::env::args().nth(1).expect("a directory"));
    let seed = |target: &str, name: &str, bytes: &[u8]| {
        let directory = out.join(target);
        fs::create_dir_all(&directory).expect("a directory");
        fs::write(directory.join(name), bytes).expect("a seed");
    };
    meshes(&seed);
    grasps(&seed);
    for name in Protocol::names() {
        let text = Protocol::source_text(name).expect("a preset");
        seed("settings", name, format!("\0{text}").as_bytes());
    }
    for name in Gripper::names() {
        let text = Gripper::source_text(name).expect("a built-in hand");
        seed("settings", name, format!("\x01{text}").as_bytes());
    }
    let preset = shakedown_trainer::Preset::load("best").expect("a preset");
    seed("settings", "best", format!("\x03{}", preset.to_toml()).as_bytes());
    let set = "[[object]]\nid = 'mug'\nmesh = 'mug.obj'\nscale = 0.001\nmass_kg = 0.3\n";
    seed("settings", "set", format!("\x04{set}").as_bytes());
    store(&seed);
    model(&out, &seed);
}

fn meshes(seed: &impl Fn(&str, &str, &[u8])) {
    let corners = |row: &dyn Fn([f64; 3]) -> String| CUBE.map(row).concat();
    let xyz = corners(&|[x, y, z]| format!("{x} {y} {z}\n"));
    let three = FACES.map(|[a, b, c]| format!("3 {a} {b} {c}\n")).concat();
    let obj = corners(&|[x, y, z]| format!("v {x} {y} {z}\n"))
        + &FACES.map(|[a, b, c]| format!("f {} {}//1 {}/1\n", a + 1, b + 1, c + 1)).concat();
    seed("mesh_obj", "tetrahedron", obj.as_bytes());
    seed("mesh_off", "tetrahedron", format!("OFF\n4 4 6\n{xyz}{three}").as_bytes());
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
             property float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    let ascii = header("ascii") + &xyz + &three;
    seed("mesh_ply", "ascii", ascii.as_bytes());
    let mut ply = header("binary_little_endian").into_bytes();
    for x in CUBE.concat() {
        ply.extend((x as f32).to_le_bytes());
    }
    for face in FACES {
        ply.push(3);
        ply.extend(face.iter().flat_map(|i| (*i as i32).to_le_bytes()));
    }
    seed("mesh_ply", "binary", &ply);
    let mut ascii = String::from("solid t\n");
    let mut binary = vec![0u8; 80];
    binary.extend(4u32.to_le_bytes());
    for face in FACES {
        ascii += "facet normal 0 0 1\nouter loop\n";
        binary.extend([0u8; 12]);
        for [x, y, z] in face.map(|i| CUBE[i]) {
            ascii += &format!("vertex {x} {y} {z}\n");
            binary.extend([x, y, z].iter().flat_map(|v| (*v as f32).to_le_bytes()));
        }
        binary.extend([0u8; 2]);
        ascii += "endloop\nendfacet\n";
    }
    seed("mesh_stl", "ascii", (ascii + "endsolid t\n").as_bytes());
    seed("mesh_stl", "binary", &binary);
    seed("mesh_glb", "tetrahedron", &glb());
}

fn glb() -> Vec<u8> {
    let mut buffer: Vec<u8> = CUBE.concat().iter().flat_map(|x| (*x as f32).to_le_bytes()).collect();
    buffer.extend(FACES.concat().iter().flat_map(|i| (*i as u16).to_le_bytes()));
    let mut json = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
        "nodes":[{"mesh":0,"scale":[1,1,1]}],"buffers":[{"byteLength":72}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
        "bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":24}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3",
        "min":[0,0,0],"max":[0.04,0.05,0.06]},
        {"bufferView":1,"componentType":5123,"count":12,"type":"SCALAR"}]}"#
        .as_bytes()
        .to_vec();
    while json.len() % 4 != 0 {
        json.push(b' ');
    }
    let mut bytes = b"glTF".to_vec();
    let total = 12 + 8 + json.len() + 8 + buffer.len();
    let word = |bytes: &mut Vec<u8>, n: usize| bytes.extend((n as u32).to_le_bytes());
    word(&mut bytes, 2);
    word(&mut bytes, total);
    word(&mut bytes, json.len());
    bytes.extend(b"JSON");
    bytes.extend(&json);
    word(&mut bytes, buffer.len());
    bytes.extend(b"BIN\0");
    bytes.extend(&buffer);
    bytes
}

fn grasps(seed: &impl Fn(&str, &str, &[u8])) {
    let directory = tempfile::tempdir().expect("a directory");
    let pose = |k: u64| nalgebra::Isometry3::translation(0.0, 0.01 * k as f64, 0.05);
    let mut list: Vec<Grasp> = (0..3).map(|k| Grasp::new(k, pose(k))).collect();
    for (k, grasp) in list.iter_mut().enumerate() {
        grasp.width_m = Some(0.08);
        grasp.score = Some(0.5);
        grasp.label = Some(k != 1);
    }
    let object = ObjectReference {
        mesh: Some("meshes/mug.obj".into()),
        ..ObjectReference::default()
    };
    for (format, target) in [
        (GraspFormat::AcronymJson, "grasps_acronym_json"),
        (GraspFormat::GraspGenJson, "grasps_graspgen_json"),
        (GraspFormat::IsaacYaml, "grasps_isaac_yaml"),
        (GraspFormat::Npz, "grasps_npz"),
        (GraspFormat::Csv, "grasps_csv"),
    ] {
        let file = GraspFile {
            path: directory.path().join("grasps"),
            format,
            gripper: Some("franka_panda".into()),
            object: object.clone(),
            grasps: list.clone(),
            reorthonormalised: 0,
        };
        write_grasps(&file).expect("a grasp file");
        seed(target, "three", &fs::read(&file.path).expect("a grasp file"));
    }
    let path = directory.path().join("grasps.h5");
    write_labelled(&path, &labelled(&list)).expect("an h5 file");
    seed("grasps_acronym_h5", "three", &fs::read(&path).expect("an h5 file"));
}

fn labelled(list: &[Grasp]) -> LabelledGrasps {
    let zeros = || vec![0.0; list.len()];
    LabelledGrasps {
        object: ObjectReference {
            mesh: Some("meshes/mug.obj".into()),
            scale: Some(0.001),
            mass_kg: Some(0.1),
            density_kg_m3: Some(150.0),
            friction: Some(1.0),
            volume_m3: Some(1e-4),
            com_m: Some(nalgebra::Point3::origin()),
            inertia_kg_m2: Some(nalgebra::Matrix3::identity() * 1e-4),
        },
        finger_m: 0.04,
        poses: list.iter().map(|g| g.object_from_hand).collect(),
        labels: list.iter().map(|g| g.label == Some(true)).collect(),
        motions: FlexMotions {
            closing_linear_m: zeros(),
            closing_angular_rad: zeros(),
            shaking_linear_m: zeros(),
            shaking_angular_rad: zeros(),
        },
    }
}

fn store(seed: &impl Fn(&str, &str, &[u8])) {
    let mut csv = Vec::new();
    shakedown_report::trials::write_header(&mut csv).expect("a header");
    let columns = String::from_utf8(csv.clone()).expect("text").matches(',').count() + 1;
    let row = "mug,0,0.5,1,0.01,0.02,0.03,0,0,0,1,0.08,optimal,0,1,1,1,1,,held,1,0.001,0.01,0.002,0.03,20,2.2";
    let mut row = row.to_owned();
    while row.matches(',').count() + 1 < columns {
        row.push(',');
    }
    let rows = |kind: u8, second: &str| {
        let mut bytes = vec![kind];
        bytes.extend(&csv);
        bytes.extend(row.as_bytes());
        bytes.extend(b"\n\0");
        bytes.extend(second.as_bytes());
        bytes
    };
    seed("store", "run", &rows(0, "{}"));
    let hash = blake3::hash(row.as_bytes()).to_hex();
    let entry = format!(r#"{{"object":"mug","rows":1,"end":{},"hash":"{hash}"}}"#, row.len());
    seed("store", "journal", &rows(1, &entry));
    let start = r#"{"arguments":["run"],"working_directory":"/tmp"}"#;
    seed("store", "start", &rows(1, start));
    seed("store", "baseline", &[b"\x02".as_slice(), br#"{"name":"b","objects":{}}"#].concat());
}

fn model(out: &Path, seed: &impl Fn(&str, &str, &[u8])) {
    let good = out.join("good_model");
    fs::create_dir_all(&good).expect("a directory");
    fixture::card(&good, 9, 2, "");
    fixture::save(&fixture::small_encoder(9), &good.join("encoder.onnx"));
    let velocity = fixture::spring_velocity([0.5; 9], [0.1; 3], [0.2; 3]);
    fixture::save(&velocity, &good.join("velocity.onnx"));
    for (kind, name) in [(0u8, "encoder"), (1, "velocity")] {
        let graph = fs::read(good.join(format!("{name}.onnx"))).expect("a graph");
        seed("model", name, &[vec![kind], graph].concat());
    }
    let card = fs::read_to_string(good.join("model.toml")).expect("a card");
    seed("settings", "card", format!("\x02{card}").as_bytes());
}
