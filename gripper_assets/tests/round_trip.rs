//! What is written comes back: every writable format, every field it can carry.

use std::fs;

use nalgebra::{Isometry3, Vector3};
use shakedown_gripper_assets::{
    Grasp, GraspFile, GraspFormat, HandFrame, ObjectReference, ReadOptions, read_grasps,
    write_grasps,
};

fn sample(format: GraspFormat, path: &std::path::Path) -> GraspFile {
    let grasps = (0..25u64)
        .map(|i| {
            let x = i as f64;
            let mut g = Grasp::new(
                i,
                Isometry3::new(
                    Vector3::new(0.01 * x, -0.3 / (x + 1.0), 0.1),
                    Vector3::new(0.1 * x, 1.0 - x, 0.4),
                ),
            );
            g.score = Some(1.0 / (x + 3.0));
            g.label = Some(i % 3 == 0);
            g.width_m = Some(0.003 * (x + 1.0));
            g
        })
        .collect();
    GraspFile {
        path: path.to_owned(),
        format,
        gripper: None,
        object: ObjectReference {
            mesh: Some("meshes/Mug/a.obj".into()),
            scale: Some(0.00123),
            ..ObjectReference::default()
        },
        grasps,
        reorthonormalised: 0,
    }
}

#[test]
fn every_writable_format_round_trips_and_is_recognised_by_content() {
    let dir = tempfile::tempdir().unwrap();
    for (name, format) in GraspFormat::NAMES {
        if format == GraspFormat::AcronymH5 {
            continue;
        }
        // The name tells nothing: the content must.
        let path = dir.path().join(format!("{name}.dat"));
        let written = sample(format, &path);
        write_grasps(&written).unwrap();
        let read = read_grasps(&path, &ReadOptions::default()).unwrap();
        assert_eq!(read.format, format);
        assert_eq!(read.reorthonormalised, 0, "{name}");
        let carries_object = !matches!(format, GraspFormat::Csv | GraspFormat::Npz);
        if carries_object {
            assert_eq!(read.object, written.object, "{name}");
        }
        let is_json = matches!(format, GraspFormat::AcronymJson | GraspFormat::GraspGenJson);
        for (a, b) in read.grasps.iter().zip(&written.grasps) {
            let off = a.object_from_hand.to_homogeneous() - b.object_from_hand.to_homogeneous();
            assert!(off.amax() < 1e-12, "{name}: {off}");
            assert_eq!((a.index, a.score), (b.index, b.score), "{name}");
            if format != GraspFormat::IsaacYaml {
                assert_eq!(a.label, b.label, "{name}");
            }
            if !is_json {
                assert!(
                    (a.width_m.unwrap() - b.width_m.unwrap()).abs() < 1e-15,
                    "{name}"
                );
            }
        }
        assert_eq!(read.grasps.len(), written.grasps.len());
    }
}

#[test]
fn a_pose_list_without_a_frame_is_refused_until_one_is_given() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("poses.csv");
    fs::write(&path, "x_m,y_m,z_m,qx,qy,qz,qw\n0.1,0,0,0,0,0,1\n").unwrap();
    let e = read_grasps(&path, &ReadOptions::default())
        .unwrap_err()
        .to_string();
    assert!(e.contains("--frame"), "{e}");
    let tcp = ReadOptions {
        frame: Some(HandFrame::Tcp),
        ..ReadOptions::default()
    };
    let file = read_grasps(&path, &tcp).unwrap();
    let t = file.grasps[0].object_from_hand.translation.vector;
    assert!((t - Vector3::new(0.1, 0.0, -0.1034)).norm() < 1e-15);
}

#[test]
fn bad_rows_name_their_line() {
    let dir = tempfile::tempdir().unwrap();
    for (body, needle) in [
        ("0,0,0,0,0,0,2,acronym", "norm"),
        ("0,0,x,0,0,0,1,acronym", "line 3, column `z_m`"),
        ("0,0,0,0,0,0,1,panda_hand", "one frame"),
        ("0,0,0,0,0,1", "line 3"),
        ("0,0,nan,0,0,0,1,acronym", "finite"),
    ] {
        let path = dir.path().join("poses.csv");
        let header = "x_m,y_m,z_m,qx,qy,qz,qw,frame\n0,0,0,0,0,0,1,acronym\n";
        fs::write(&path, format!("{header}{body}\n")).unwrap();
        let e = read_grasps(&path, &ReadOptions::default())
            .unwrap_err()
            .to_string();
        assert!(
            e.contains(needle) && e.contains("poses.csv"),
            "{needle}: {e}"
        );
    }
}

#[test]
fn broken_files_of_every_format_are_errors_not_panics() {
    let dir = tempfile::tempdir().unwrap();
    for (name, format) in GraspFormat::NAMES {
        let path = dir.path().join(format!("{name}.dat"));
        if format == GraspFormat::AcronymH5 {
            fs::write(&path, b"\x89HDF\r\n\x1a\n and then nothing").unwrap();
        } else {
            write_grasps(&sample(format, &path)).unwrap();
            let bytes = fs::read(&path).unwrap();
            fs::write(&path, &bytes[..bytes.len() * 2 / 3]).unwrap();
        }
        let options = ReadOptions {
            format: Some(format),
            ..ReadOptions::default()
        };
        // Cutting a text list may leave a shorter valid one; anything else must be refused.
        match read_grasps(&path, &options) {
            Ok(file) => assert!(file.grasps.len() < 25, "{name}"),
            Err(e) => assert!(e.to_string().contains(&format!("{name}.dat")), "{e}"),
        }
        fs::write(&path, b"").unwrap();
        assert!(read_grasps(&path, &ReadOptions::default()).is_err());
    }
}

#[test]
fn what_is_no_plain_file_is_refused_before_it_is_read() {
    let directory = tempfile::tempdir().unwrap();
    let error = read_grasps(directory.path(), &ReadOptions::default()).unwrap_err();
    assert!(error.to_string().contains("no plain file"), "{error}");
}

/// An archive with one array that is nothing but its header.
fn archive_of(header: &str) -> Vec<u8> {
    let mut array = b"\x93NUMPY\x01\x00".to_vec();
    array.extend((header.len() as u16).to_le_bytes());
    array.extend(header.as_bytes());
    let crc = !array.iter().fold(!0u32, |crc, b| {
        (0..8).fold(crc ^ u32::from(*b), |c, _| {
            (c >> 1) ^ (0xedb8_8320 & (c & 1).wrapping_neg())
        })
    });
    let name = b"transforms.npy";
    let mut fields = [20u16, 0, 0, 0, 0].map(u16::to_le_bytes).concat();
    for number in [crc, array.len() as u32, array.len() as u32] {
        fields.extend(number.to_le_bytes());
    }
    fields.extend((name.len() as u16).to_le_bytes());
    fields.extend([0; 2]);
    let mut file = [b"PK\x03\x04", &fields[..], name, &array[..]].concat();
    let start = file.len() as u32;
    file.extend([b"PK\x01\x02\x14\x00", &fields[..], &[0; 14], name].concat());
    let size = file.len() as u32 - start;
    file.extend(b"PK\x05\x06\0\0\0\0\x01\0\x01\0");
    file.extend([size, start].map(u32::to_le_bytes).concat());
    file.extend([0; 2]);
    file
}

#[test]
fn an_archive_that_would_be_parsed_for_ever_or_fill_the_memory_is_an_error() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("grasps.npz");
    let complaint = |header: &str| {
        fs::write(&path, archive_of(header)).unwrap();
        let options = ReadOptions {
            frame: Some(HandFrame::Acronym),
            ..ReadOptions::default()
        };
        read_grasps(&path, &options).unwrap_err().to_string()
    };
    let header =
        |shape: &str| format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
    let error = complaint(&header("(0, 4, 4)"));
    assert!(
        error.contains("none"),
        "a sound archive without grasps: {error}"
    );
    // Found by fuzzing: the parser tries every way to read each bracket.
    let nested = "{0:".repeat(60);
    let error = complaint(&nested);
    assert!(error.contains("grasps.npz"), "{error}");
    let error = complaint(&header("(1000000000, 4, 4)"));
    assert!(error.contains("numbers"), "{error}");
}
