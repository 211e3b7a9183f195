//! The built binary as other people's scripts see it: files, columns, exit codes, identical bytes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use shakedown_tests::{SAMPLE_MUG, shared};

fn shakedown(directory: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_shakedown"))
        .args(args)
        .current_dir(directory)
        .env("SHAKEDOWN_CACHE", directory.join("cache"))
        .env_remove("ORT_DYLIB_PATH")
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Runs and expects success.
fn ok(directory: &Path, args: &[&str]) -> String {
    let out = shakedown(directory, args);
    assert!(out.status.success(), "{args:?}: {}", text(&out.stderr));
    text(&out.stdout)
}

/// Runs and expects an exit code and words in one message on stderr.
fn fails(directory: &Path, args: &[&str], code: i32, needles: &[&str]) {
    let out = shakedown(directory, args);
    let message = text(&out.stderr);
    assert_eq!(out.status.code(), Some(code), "{args:?}: {message}");
    for needle in needles {
        assert!(
            message.contains(needle),
            "{args:?}: {needle:?} is not in: {message}"
        );
    }
    assert!(!message.contains("panicked"), "{message}");
}

const CUBE_OBJ: &str = "v 0 0 0\nv .05 0 0\nv .05 .05 0\nv 0 .05 0\nv 0 0 .05\nv .05 0 .05\n\
    v .05 .05 .05\nv 0 .05 .05\nf 1 3 2\nf 1 4 3\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5\nf 2 3 7\n\
    f 2 7 6\nf 3 4 8\nf 3 8 7\nf 4 1 5\nf 4 5 8\n";

fn cube(directory: &Path) -> PathBuf {
    let path = directory.join("cube.obj");
    fs::write(&path, CUBE_OBJ).unwrap();
    path
}

#[test]
fn a_run_writes_every_file_of_the_contract_and_repeats_its_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let args = |out: &'static str, threads: &'static str| {
        [
            "run",
            "--filter",
            "^(can_0|ring_0)$",
            "--candidates",
            "6",
            "--threads",
            threads,
            "--out",
            out,
            "-q",
        ]
    };
    ok(d, &args("one", "1"));
    ok(d, &args("two", "2"));
    for name in [
        "manifest.json",
        "trials.csv",
        "summary.json",
        "summary.md",
        "report.html",
        "replays",
    ] {
        assert!(d.join("one").join(name).exists(), "{name}");
    }
    for name in ["trials.csv", "summary.md", "report.html"] {
        let read = |run: &str| fs::read_to_string(d.join(run).join(name)).unwrap();
        let (a, b) = (read("one"), read("two"));
        // The report quotes the command line, which names threads and directory.
        let plain = |s: &str| {
            s.lines()
                .filter(|l| !l.contains("&quot;"))
                .map(str::to_owned)
                .collect::<Vec<_>>()
        };
        assert_eq!(plain(&a), plain(&b), "{name}");
    }
    let json = |run: &str| -> serde_json::Value {
        serde_json::from_slice(&fs::read(d.join(run).join("summary.json")).unwrap()).unwrap()
    };
    let (mut a, mut b) = (json("one"), json("two"));
    assert_eq!(a["contract"], 1);
    assert_eq!(a["physics"]["n"], 12);
    assert_eq!(a["throughput"]["trials"], 12);
    for s in [&mut a, &mut b] {
        s.as_object_mut().unwrap().remove("throughput");
    }
    assert_eq!(a, b);
    let manifest: serde_json::Value =
        serde_json::from_slice(&fs::read(d.join("one/manifest.json")).unwrap()).unwrap();
    assert_eq!(manifest["protocol"]["friction"], 1.0);
    assert_eq!(manifest["protocol"]["solver.iterations"], 8);
    // Sorted by object and grasp, one row per grasp; 28 columns of the contract, then ours.
    let mut reader = csv::Reader::from_path(d.join("one/trials.csv")).unwrap();
    let headers: Vec<String> = reader
        .headers()
        .unwrap()
        .iter()
        .map(str::to_owned)
        .collect();
    assert_eq!(
        headers[27..],
        [
            "p_hold",
            "stage",
            "margin_g",
            "closing_width_m",
            "epsilon",
            "wrench_volume"
        ]
    );
    let keys: Vec<(String, u64)> = reader
        .records()
        .map(|r| r.unwrap())
        .map(|r| (r[0].to_owned(), r[1].parse().unwrap()))
        .collect();
    assert_eq!(keys.len(), 12);
    assert!(keys.windows(2).all(|w| w[0] < w[1]), "{keys:?}");
}

#[test]
fn rows_are_the_same_in_a_run_cut_by_limit_and_filter() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let base = ["run", "-q", "--candidates", "8", "--threads", "2"];
    let run = |more: &[&str]| ok(d, &[&base[..], more].concat());
    run(&["--filter", "^(box_0|knife_0)$", "--out", "all"]);
    run(&["--filter", "^knife_0$", "--out", "cut"]);
    run(&[
        "--filter",
        "^(box_0|knife_0)$",
        "--limit",
        "3",
        "--out",
        "few",
    ]);
    let rows = |run: &str| -> Vec<String> {
        fs::read_to_string(d.join(run).join("trials.csv"))
            .unwrap()
            .lines()
            .skip(1)
            .map(str::to_owned)
            .collect()
    };
    let all = rows("all");
    assert_eq!(
        (all.len(), rows("cut").len(), rows("few").len()),
        (16, 8, 6)
    );
    for row in rows("cut").iter().chain(&rows("few")) {
        assert!(all.contains(row), "{row}");
    }
}

#[test]
fn sample_classify_and_run_pass_grasps_on_in_every_format() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    cube(d);
    for name in ["g.json", "g.yaml", "g.npz", "g.csv"] {
        ok(
            d,
            &[
                "sample",
                "--sampler",
                "antipodal",
                "--objects",
                "cube.obj",
                "--candidates",
                "5",
                "--out",
                name,
                "-q",
            ],
        );
        let out = format!("geo_{name}");
        ok(
            d,
            &[
                "classify", "--grasps", name, "--mesh", "cube.obj", "--out", &out, "-q",
            ],
        );
        let rows = fs::read_to_string(d.join(&out).join("trials.csv")).unwrap();
        assert_eq!(rows.lines().count(), 6, "{name}");
        assert!(
            rows.lines().skip(1).all(|r| r.contains(",optimal,")),
            "{name}: {rows}"
        );
    }
    ok(
        d,
        &[
            "run",
            "--grasps",
            "g.csv",
            "--mesh",
            "cube.obj",
            "--mass-kg",
            "0.1",
            "--record",
            "all",
            "--out",
            "tried",
            "-q",
        ],
    );
    assert_eq!(fs::read_dir(d.join("tried/replays")).unwrap().count(), 5);
}

#[test]
fn the_wrench_space_is_measured_where_it_is_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let cells = |out: &str, more: &[&str]| -> Vec<(String, String)> {
        let mut args = vec!["run", "--filter", "box_0", "--sampler", "antipodal"];
        args.extend(["--candidates", "12", "--out", out, "-q"]);
        args.extend(more);
        ok(d, &args);
        let mut reader = csv::Reader::from_path(d.join(out).join("trials.csv")).unwrap();
        let rows = reader.records().map(Result::unwrap);
        rows.map(|r| (r[31].to_owned(), r[32].to_owned())).collect()
    };
    assert!(
        cells("plain", &[])
            .iter()
            .all(|c| c.0.is_empty() && c.1.is_empty())
    );
    let measured = cells("wrench", &["--wrench"]);
    // The trial turns a box until its faces lie flat on the pads: force closure.
    let closed: Vec<_> = measured
        .iter()
        .filter(|c| c.0.parse::<f64>().unwrap() > 0.0)
        .collect();
    assert!(closed.len() > 6, "{measured:?}");
    assert!(closed.iter().all(|c| c.1.parse::<f64>().unwrap() > 0.0));
}

#[test]
fn listings_name_what_is_built_in() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    assert_eq!(ok(d, &["objects"]).lines().count(), 2 + 36);
    assert!(ok(d, &["grippers"]).contains("robotiq_2f_85"));
    assert!(ok(d, &["protocols", "acronym"]).contains("shake_linear_m"));
    assert!(ok(d, &["models"]).contains("--model DIR"));
    assert!(ok(d, &["completions", "bash"]).contains("shakedown"));
    // What is printed can be used as a file again.
    fs::write(d.join("hand.toml"), ok(d, &["grippers", "franka_panda"])).unwrap();
    fs::write(d.join("trial.toml"), ok(d, &["protocols", "hold"])).unwrap();
    let out = ok(
        d,
        &[
            "run",
            "--gripper",
            "hand.toml",
            "--protocol",
            "trial.toml",
            "--filter",
            "can_0",
            "--candidates",
            "2",
            "--out",
            "r",
            "-q",
        ],
    );
    assert!(out.contains("protocol hold"), "{out}");
    for command in [
        "run",
        "sample",
        "classify",
        "objects",
        "grippers",
        "protocols",
        "models",
        "bench",
        "completions",
    ] {
        assert!(ok(d, &[command, "--help"]).contains("Example"), "{command}");
    }
    let dry = ok(
        d,
        &["run", "--dry-run", "--filter", "mug", "--candidates", "7"],
    );
    assert!(
        dry.contains("3 objects, 21 grasps") && !d.join("runs").exists(),
        "{dry}"
    );
}

#[test]
fn bad_input_ends_with_code_3_and_one_message_that_names_file_and_mend() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    cube(d);
    let put = |name: &str, content: &str| fs::write(d.join(name), content).unwrap();
    put("empty.obj", "");
    put("text.obj", "this is\nno mesh\n");
    put(
        "nan.obj",
        &CUBE_OBJ.replace("v .05 .05 .05", "v .05 nan .05"),
    );
    put("cut.obj", &CUBE_OBJ.replace("v 0 .05 .05\n", "v 0 .05\n"));
    put("range.obj", &CUBE_OBJ.replace("f 4 5 8", "f 4 5 99"));
    put(
        "flat.off",
        "OFF\n3 2 0\n0 0 0\n.1 0 0\n0 .1 0\n3 0 1 2\n3 0 2 1\n",
    );
    put("points.off", "OFF\n1 0 0\n0 0 0\n");
    put("open.obj", &CUBE_OBJ.replace("f 4 5 8\n", ""));
    put("short.stl", &format!("{:80}\u{10}\0\0\0", "binary"));
    put("note.txt", "hello");
    let run = |mesh: &str, needles: &[&str]| {
        fails(
            d,
            &["run", "--objects", mesh, "--out", "x", "-q"],
            3,
            &[needles, &[mesh]].concat(),
        );
    };
    run("missing.obj", &["cannot read"]);
    run("empty.obj", &["empty"]);
    run("text.obj", &["0 faces"]);
    run("nan.obj", &["nan.obj:7", "NaN"]);
    run("cut.obj", &["cut.obj:8"]);
    run("range.obj", &["range.obj:20", "99"]);
    run("flat.off", &[]);
    run("points.off", &["0 faces"]);
    run("open.obj", &["not closed", "--mass-kg"]);
    run("short.stl", &["byte 84"]);
    run("note.txt", &["OBJ, STL, PLY"]);
    for (scale, hint) in [("10000", "--scale"), ("0.0001", "--scale")] {
        let args = [
            "run",
            "--objects",
            "cube.obj",
            "--scale",
            scale,
            "--out",
            "x",
            "-q",
        ];
        fails(d, &args, 3, &[hint, "cube.obj"]);
    }
    fails(
        d,
        &["run", "--objects", "embeded", "-q"],
        3,
        &["\"embedded\""],
    );
    fails(
        d,
        &["run", "--gripper", "franca_panda", "-q"],
        3,
        &["did you mean \"franka_panda\""],
    );
    fails(
        d,
        &["run", "--protocol", "acronim", "-q"],
        3,
        &["did you mean \"acronym\""],
    );
    fails(
        d,
        &["run", "--set", "frction=1", "-q"],
        3,
        &["did you mean \"friction\""],
    );
    fails(d, &["run", "--model", "best", "-q"], 3, &["model.toml"]);
    fs::create_dir(d.join("model")).unwrap();
    fails(d, &["run", "--model", "model", "-q"], 3, &["model.toml"]);
    fails(
        d,
        &["run", "--filter", "nothing_like_this", "-q"],
        4,
        &["--filter"],
    );
    fails(
        d,
        &[
            "run",
            "--candidates",
            "0",
            "--filter",
            "can_0",
            "--out",
            "none",
            "-q",
        ],
        4,
        &["no grasp"],
    );
    fails(d, &["run", "--no-such-flag"], 2, &["--no-such-flag"]);
    // Grasp files.
    put("poses.csv", "x_m,y_m,z_m,qx,qy,qz,qw\n0,0,0,0,0,0,1\n");
    put(
        "skew.csv",
        "x_m,y_m,z_m,qx,qy,qz,qw,frame\n0,0,0,0,0,0,1.5,tcp\n",
    );
    put("none.csv", "x_m,y_m,z_m,qx,qy,qz,qw,frame\n");
    put(
        "mesh.json",
        r#"{"object":{"file":"gone.obj","scale":1.0},"grasps":{"transforms":[[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]]}}"#,
    );
    let grasps = |file: &str, needles: &[&str]| {
        let args = [
            "run",
            "--grasps",
            file,
            "--mesh",
            "cube.obj",
            "--mass-kg",
            "0.1",
            "--out",
            "x",
            "-q",
        ];
        fails(d, &args, 3, &[needles, &[file]].concat());
    };
    grasps("poses.csv", &["--frame"]);
    grasps("skew.csv", &["line 2", "not a rotation"]);
    grasps("none.csv", &["none"]);
    fails(
        d,
        &["run", "--grasps", "mesh.json", "--out", "x", "-q"],
        3,
        &["gone.obj", "--mesh-root"],
    );
    put("bad.h5", "\u{89}HDF");
    grasps("bad.h5", &[]);
}

#[test]
fn an_output_directory_of_another_run_is_refused_and_the_same_run_may_be_repeated() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let run = [
        "run",
        "-q",
        "--filter",
        "can_0",
        "--candidates",
        "2",
        "--out",
        "r",
    ];
    ok(d, &run);
    ok(d, &run);
    let other = [&run[..], &["--seed", "1"]].concat();
    fails(d, &other, 3, &["another run", "--out"]);
    fs::create_dir(d.join("full")).unwrap();
    fs::write(d.join("full/thesis.txt"), "precious").unwrap();
    let foreign = [
        "run",
        "-q",
        "--filter",
        "can_0",
        "--candidates",
        "2",
        "--out",
        "full",
    ];
    fails(d, &foreign, 3, &["not empty"]);
    assert_eq!(
        fs::read_to_string(d.join("full/thesis.txt")).unwrap(),
        "precious"
    );
    // A path below a file cannot be a directory.
    let below = [
        "run",
        "-q",
        "--filter",
        "can_0",
        "--candidates",
        "2",
        "--out",
        "full/thesis.txt/x",
    ];
    fails(d, &below, 3, &["cannot write"]);
}

#[test]
fn what_was_computed_before_an_unreadable_object_stays_and_keep_going_ends_with_5() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    cube(d);
    // Readable when the run is planned, useless as a solid.
    fs::write(d.join("zz_open.obj"), CUBE_OBJ.replace("f 4 5 8\n", "")).unwrap();
    let args = [
        "run",
        "-q",
        "--objects",
        "cube.obj",
        "zz_open.obj",
        "--density-kg-m3",
        "150",
        "--candidates",
        "3",
        "--out",
        "r",
    ];
    fails(d, &args, 3, &["zz_open.obj", "not closed"]);
    let rows = |run: &str| {
        fs::read_to_string(d.join(run).join("trials.csv"))
            .unwrap()
            .lines()
            .count()
    };
    assert_eq!(rows("r"), 4);
    let mut going = args.to_vec();
    going[10] = "k";
    going.push("--keep-going");
    fails(d, &going, 5, &["skipped", "zz_open.obj"]);
    assert_eq!(rows("k"), 4);
    assert!(d.join("k/summary.json").exists());
}

#[test]
fn a_full_disk_is_one_message_and_loses_no_earlier_file() {
    // /dev/full accepts every write into its buffer and fails to keep it.
    if !Path::new("/dev/full").exists() {
        eprintln!("SKIPPED a full disk: there is no /dev/full here");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let run = [
        "run",
        "-q",
        "--filter",
        "can_0",
        "--candidates",
        "2",
        "--out",
        "r",
    ];
    ok(d, &run);
    fs::remove_file(d.join("r/trials.csv")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("/dev/full", d.join("r/trials.csv")).unwrap();
    fails(
        d,
        &run,
        3,
        &["cannot write", "trials.csv", "free some space"],
    );
    assert!(d.join("r/manifest.json").exists());
}

#[test]
fn the_sample_mug_is_run_with_agreement_beside_the_baselines() {
    let Some(root) = shared("the sample mug from the command line") else {
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    let split = root.join("acronym/seen");
    let (grasps, root) = (split.join(SAMPLE_MUG), split.display().to_string());
    let args = [
        "run",
        "--grasps",
        grasps.to_str().unwrap(),
        "--mesh-root",
        &root,
        "--limit",
        "40",
        "--out",
        "mug",
        "--format",
        "json",
        "-q",
    ];
    let summary: serde_json::Value = serde_json::from_str(&ok(dir.path(), &args)).unwrap();
    let agreement = &summary["agreement"];
    assert_eq!(agreement["n"], 40);
    assert!(
        agreement["balanced_accuracy"].as_f64().unwrap() > 0.5,
        "{agreement}"
    );
    let baselines = agreement["baselines"].as_object().unwrap();
    assert!(baselines.contains_key("majority") && baselines.contains_key("width_below_29_mm"));
    assert_eq!(summary["geometry"]["optimal"], 1.0);
    assert_eq!(summary["distribution"], serde_json::Value::Null);
}

#[test]
fn a_hundred_thousand_poses_stream_through_a_small_memory() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    cube(d);
    let mut poses = String::from("x_m,y_m,z_m,qx,qy,qz,qw,frame\n");
    for i in 0..100_000 {
        poses.push_str(&format!(
            "0.025,{},-0.08,0,0,0,1,acronym\n",
            f64::from(i) * 1e-6
        ));
    }
    fs::write(d.join("many.csv"), poses).unwrap();
    ok(
        d,
        &[
            "classify", "--grasps", "many.csv", "--mesh", "cube.obj", "--out", "r", "-q",
        ],
    );
    let rows = fs::read_to_string(d.join("r/trials.csv")).unwrap();
    assert_eq!(rows.lines().count(), 100_001);
}

#[test]
fn a_trial_is_exported_to_mujoco_with_its_schedule() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    ok(
        d,
        &[
            "export-mjcf",
            "--objects",
            "embedded",
            "--filter",
            "^bottle_0$",
            "--candidates",
            "3",
            "--grasp",
            "1",
            "2",
            "--out",
            "mjcf",
        ],
    );
    for grasp in ["1", "2"] {
        let xml = fs::read_to_string(d.join("mjcf").join(grasp).join("trial.xml")).unwrap();
        for part in [
            "<body name=\"object\"",
            "<joint name=\"left\"",
            "mesh=\"piece0\"",
        ] {
            assert!(xml.contains(part), "{part} in {xml}");
        }
        let trial = fs::read(d.join("mjcf").join(grasp).join("trial.json")).unwrap();
        let trial: serde_json::Value = serde_json::from_slice(&trial).unwrap();
        // Two shakes of a second and a hold of 0.2 s, every 2 ms.
        assert_eq!(trial["schedule"][0].as_array().unwrap().len(), 1100);
    }
}
