//! `shakedown train`: stages, stretched copies and held-out objects on ACRONYM files; evaluators.

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

/// Such a training ends with this exit code and a message that speaks of it.
fn refused(directory: &Path, args: &[&str], exit_code: i32, speaks_of: &str) {
    let (code, message) = train(directory, args);
    assert_eq!(code, Some(exit_code), "{message}");
    assert!(message.contains(speaks_of), "{message}");
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
    let between = ["--rectify", "first", "--rectify-from", "0.55"];
    let of_file = ["--data", &files[0], "--mesh-root", &root];
    let small = ["--preset", "small.toml", "--out", "odd"];
    let args = [of_file, between, small].concat();
    refused(d, &args, 2, "between two of the 10 steps");
}

/// On our own shapes: what an evaluator learned, what is kept of its trials, and what it does to a draw.
#[test]
fn an_evaluator_is_the_same_on_any_number_of_threads_and_scores_what_its_model_draws() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let judge = |threads: &str, out: &str| {
        let (code, message) = train(
            d,
            &[
                "--data",
                "embedded",
                "--variants",
                "1",
                "--hold-out",
                "3",
                "--evaluator-for",
                "rfm-embedded",
                "--draw-steps",
                "4",
                "--paths",
                "12",
                "--steps",
                "30",
                "--threads",
                threads,
                "--out",
                out,
            ],
        );
        assert_eq!(code, Some(0), "{message}");
        message
    };
    let message = judge("1", "one");
    assert!(
        message.contains("108 grasps of its own on 9 objects"),
        "{message}"
    );
    judge("2", "two");
    let bytes = |out: &str| fs::read(d.join(out).join("evaluator.onnx")).unwrap();
    assert_eq!(bytes("one"), bytes("two"));
    // Its trials lie on disk: none is made again, and the same comes out.
    let kept = fs::read_dir(d.join("one/data")).unwrap().count();
    assert_eq!(kept, 12);
    judge("2", "one");
    assert_eq!(bytes("one"), bytes("two"));
    let card = fs::read_to_string(d.join("one/model.toml")).unwrap();
    let card: toml::Table = card.parse().unwrap();
    assert_eq!(card["steps"].as_integer(), Some(4));
    assert_eq!(card["evaluator"]["redraws"].as_integer(), Some(15));
    // The built-in model came with an evaluator; of that one the card no longer speaks.
    let count = |key: &str, what: &str| card[key].as_str().unwrap().matches(what).count();
    assert_eq!(count("command", "--evaluator-for"), 1);
    assert_eq!(count("training_data", "its evaluator"), 1);
    assert_eq!(
        card["metrics"]
            .as_table()
            .unwrap()
            .keys()
            .filter(|k| k.ends_with("auroc"))
            .count(),
        1
    );

    let sampled = Command::new(env!("CARGO_BIN_EXE_shakedown"))
        .args([
            "sample",
            "--model",
            "one",
            "--filter",
            "mug_0",
            "--candidates",
            "20",
        ])
        .args(["--redraws", "0", "--out", "drawn.csv"])
        .current_dir(d)
        .output()
        .unwrap();
    assert!(sampled.status.success(), "{sampled:?}");
    let drawn = fs::read_to_string(d.join("drawn.csv")).unwrap();
    let mut rows = csv::Reader::from_reader(drawn.as_bytes());
    let at = rows.headers().unwrap().iter().position(|h| h == "score");
    let at = at.expect("a column of scores");
    let scores: Vec<f64> = rows
        .records()
        .map(|r| r.unwrap()[at].parse().unwrap())
        .collect();
    assert_eq!(scores.len(), 20);
    assert!(scores.iter().all(|s| (0.0..=1.0).contains(s)), "{scores:?}");

    let strange = [
        "--data",
        "embedded",
        "--variants",
        "1",
        "--candidates",
        "6",
        "--preset",
        "paper",
        "--steps",
        "1",
        "--out",
        "paper",
    ];
    let (code, message) = train(d, &strange);
    assert_eq!(code, Some(0), "{message}");
    let of_paper = ["--data", "embedded", "--evaluator-for", "paper"];
    let args = [&of_paper[..], &["--out", "none"]].concat();
    refused(d, &args, 3, "control points");
    for meaningless in [
        &["--minutes", "1"][..],
        &["--resume"],
        &["--min-p-hold", "0.5"],
    ] {
        let of_evaluator = ["--evaluator-for", "rfm-embedded", "--out", "none"];
        let args = [&of_evaluator[..], meaningless].concat();
        refused(d, &args, 2, "cannot be used with");
    }
}
