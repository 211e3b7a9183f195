//! `shakedown train` on ACRONYM files: stages, stretched copies, held-out objects.

use std::fs;
use std::path::Path;
use std::process::Command;

use shakedown_tests::shared;

fn train(directory: &Path, args: &[&str]) -> (Option<i32>, String) {
    let out = Command::new(env!("CARGO_BIN_EXE_shakedown"))
        .arg("train")
        .args(args)
        .current_dir(directory)
        .env("SHAKEDOWN_CACHE", directory.join("cache"))
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&out.stderr).into_owned();
    (out.status.code(), message)
}

/// The preset `best`, made small and short.
fn small_preset(directory: &Path) {
    let mut preset: toml::Table = include_str!("../../trainer/presets/best.toml")
        .parse()
        .unwrap();
    for (table, key, value) in [
        ("network", "width", 16),
        ("flow", "resolution", 16),
        ("training", "objects_per_batch", 2),
        ("training", "grasps_per_object", 8),
        ("training", "steps", 50),
    ] {
        let old = preset[table]
            .as_table_mut()
            .unwrap()
            .insert(key.into(), value.into());
        assert!(old.is_some(), "{table}.{key} is no key of the preset");
    }
    let text = preset.to_string();
    fs::write(directory.join("small.toml"), text).unwrap();
}

#[test]
fn a_second_stage_from_half_way_gives_the_same_weights_on_any_number_of_threads() {
    let Some(root) = shared("training on ACRONYM files") else {
        return;
    };
    let seen = root.join("acronym/seen");
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    small_preset(d);
    let mut files: Vec<String> = fs::read_dir(seen.join("grasps"))
        .unwrap()
        .map(|e| e.unwrap().path().to_string_lossy().into_owned())
        .collect();
    files.sort();
    let root = seen.to_string_lossy();
    let stage = |more: &[&str]| {
        let mut args = vec!["--data"];
        args.extend(files[..3].iter().map(String::as_str));
        args.extend([
            "--mesh-root",
            &root,
            "--preset",
            "small.toml",
            "--hold-out",
            "1",
        ]);
        args.extend(["--stretched", "1"]);
        args.extend(more);
        let (code, message) = train(d, &args);
        assert_eq!(code, Some(0), "{message}");
        message
    };
    let message = stage(&["--out", "first"]);
    assert!(message.contains("2 ACRONYM files"), "{message}");
    assert!(message.contains("1 stretched copies"), "{message}");
    assert!(message.contains("held_out_objects_held"), "{message}");
    for (threads, out) in [("1", "one"), ("2", "two")] {
        stage(&[
            "--rectify",
            "first",
            "--rectify-from",
            "0.5",
            "--paths",
            "20",
            "--threads",
            threads,
            "--out",
            out,
        ]);
    }
    let weights = |out: &str| fs::read(d.join(out).join("velocity.onnx")).unwrap();
    assert_eq!(weights("one"), weights("two"));
    assert_ne!(weights("one"), weights("first"));
    let (code, message) = train(
        d,
        &[
            "--data",
            &files[0],
            "--mesh-root",
            &root,
            "--rectify",
            "first",
            "--rectify-from",
            "0.55",
            "--preset",
            "small.toml",
            "--out",
            "odd",
        ],
    );
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("between two of the 10 steps"), "{message}");
}
