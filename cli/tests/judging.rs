//! Judging: the gate, ranking and labels as other people's scripts see them.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use shakedown_gripper_assets::{ReadOptions, read_grasps};

fn shakedown(directory: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_shakedown"))
        .args(args)
        .current_dir(directory)
        .env("SHAKEDOWN_CACHE", directory.join("cache"))
        .output()
        .unwrap()
}

/// Exit code, stdout and stderr.
fn said(directory: &Path, args: &[&str]) -> (i32, String, String) {
    let out = shakedown(directory, args);
    let text = |b: &[u8]| String::from_utf8_lossy(b).into_owned();
    let message = text(&out.stderr);
    assert!(!message.contains("panicked"), "{args:?}: {message}");
    (out.status.code().unwrap(), text(&out.stdout), message)
}

fn ok(directory: &Path, args: &[&str]) -> String {
    let (code, out, message) = said(directory, args);
    assert_eq!(code, 0, "{args:?}: {message}");
    out
}

const RUN: [&str; 9] = [
    "run",
    "--protocol",
    "acronym-stated",
    "--sampler",
    "antipodal",
    "--candidates",
    "40",
    "--filter",
    "box_|ring_|knife_",
];

fn run<'a>(more: &[&'a str]) -> Vec<&'a str> {
    RUN.iter().chain(more).copied().chain(["-q"]).collect()
}

#[test]
fn the_same_run_is_identical_and_a_weaker_hand_is_a_regression() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    ok(d, &run(&["--out", "base", "--save-baseline", "main"]));
    ok(d, &run(&["--out", "same"]));
    for base in ["main", "base", "base/trials.csv", "baselines/main.json"] {
        let text = ok(d, &["compare", base, "same"]);
        assert!(text.contains("IDENTICAL"), "{text}");
    }
    // A tenth of the force: a true regression.
    ok(d, &run(&["--out", "weak", "--set", "grip_force_n=2"]));
    let (code, _, message) = said(d, &["compare", "main", "weak"]);
    assert_eq!(code, 3);
    assert!(
        message.contains("grip_force_n: 20.0 against 2.0"),
        "{message}"
    );
    let args = [
        "compare",
        "main",
        "weak",
        "--allow-protocol-change",
        "--junit",
        "gate.xml",
        "--summary",
        "gate.md",
        "--tracker",
        "gate.json",
    ];
    let (code, text, _) = said(d, &args);
    assert_eq!(code, 100, "{text}");
    assert!(
        text.contains("REGRESSION") && text.contains("but note"),
        "{text}"
    );
    assert!(
        fs::read_to_string(d.join("gate.xml"))
            .unwrap()
            .contains("<failure")
    );
    assert_eq!(fs::read_to_string(d.join("gate.md")).unwrap(), text);
    let list: serde_json::Value =
        serde_json::from_slice(&fs::read(d.join("gate.json")).unwrap()).unwrap();
    assert_eq!(list[0]["name"], "held");
    let calm = [&args[..4], &["--fail-on", "never"]].concat();
    assert_eq!(said(d, &calm).0, 0);
    let (code, text, _) = said(d, &["compare", "weak", "main", "--allow-protocol-change"]);
    assert!(code == 0 && text.contains("IMPROVEMENT"), "{text}");
}

#[test]
fn grasps_that_moved_are_compared_by_object() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let sample = |out: &str| {
        ok(
            d,
            &[
                "sample",
                "--sampler",
                "antipodal",
                "--filter",
                "box_0",
                "--candidates",
                "300",
                "--out",
                out,
                "-q",
            ],
        )
    };
    sample("a.csv");
    ok(d, &["objects", "--export", "meshes"]);
    // Three millimetres back along the approach, as a wrong tcp would do it.
    let text = fs::read_to_string(d.join("a.csv")).unwrap();
    let mut lines = text.lines();
    let header = lines.next().unwrap();
    let at = |name: &str| header.split(',').position(|h| h == name).unwrap();
    let (x, q) = (at("x_m"), at("qx"));
    let mut moved = format!("{header}\n");
    for line in lines {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        let numbers: Vec<f64> = cells.iter().map(|c| c.parse().unwrap_or(0.0)).collect();
        let number = |i: usize| numbers[i];
        let turn = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(
            number(q + 3),
            number(q),
            number(q + 1),
            number(q + 2),
        ));
        let back = turn * nalgebra::Vector3::new(0.0, 0.0, -0.003);
        for k in 0..3 {
            cells[x + k] = (number(x + k) + back[k]).to_string();
        }
        moved += &(cells.join(",") + "\n");
    }
    fs::write(d.join("b.csv"), moved).unwrap();
    for (file, out) in [("a.csv", "a"), ("b.csv", "b")] {
        // One object: the files differ in name, so the object gets its own.
        fs::create_dir_all(d.join(out)).unwrap();
        fs::rename(d.join(file), d.join(out).join("box.csv")).unwrap();
        let grasps = format!("{out}/box.csv");
        let run = format!("run_{out}");
        ok(
            d,
            &[
                "run",
                "--grasps",
                &grasps,
                "--mesh",
                "meshes/box_0.obj",
                "--out",
                &run,
                "-q",
            ],
        );
    }
    let (code, text, message) = said(d, &["compare", "run_a", "run_b"]);
    assert_eq!(code, 100, "{text}{message}");
    assert!(text.contains("the grasps differ"), "{text}");
}

#[test]
fn what_cannot_be_compared_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let bad = |args: &[&str], code: i32, needle: &str| {
        let (found, _, message) = said(d, args);
        assert_eq!(found, code, "{args:?}: {message}");
        assert!(message.contains(needle), "{needle} is not in {message}");
    };
    let header = "object,grasp,held\n";
    fs::write(d.join("a.csv"), format!("{header}a,0,1\na,1,0\n")).unwrap();
    fs::write(d.join("b.csv"), format!("{header}b,0,1\n")).unwrap();
    fs::write(d.join("two.csv"), format!("{header}a,0,2\n")).unwrap();
    fs::write(d.join("none.csv"), "object,grasp\na,0\n").unwrap();
    fs::write(d.join("no_grasp.csv"), "object,held\na,0\n").unwrap();
    bad(
        &["compare", "a.csv", "b.csv"],
        3,
        "no grasps of a common object",
    );
    bad(&["compare", "a.csv", "two.csv"], 3, "neither 0 nor 1");
    bad(&["compare", "a.csv", "none.csv"], 3, "was not measured");
    bad(
        &["compare", "a.csv", "no_grasp.csv"],
        3,
        "no column `grasp`",
    );
    bad(&["compare", "a.csv", "nowhere"], 3, "there is no run");
    bad(&["compare", "a.csv"], 2, "BASE and NEW");
    bad(&["compare", "a.csv", "a.csv", "--alpha", "2"], 2, "--alpha");
    bad(
        &[
            "run",
            "--save-baseline",
            "../x",
            "--filter",
            "box_0",
            "--candidates",
            "1",
        ],
        3,
        "called",
    );
    // Zero successes and one object: a wide interval, no NaN.
    fs::write(d.join("zero.csv"), format!("{header}a,0,0\na,1,0\n")).unwrap();
    let text = ok(d, &["compare", "zero.csv", "zero.csv", "--format", "json"]);
    assert!(!text.contains("null,") || !text.contains("NaN"), "{text}");
    let plan = ok(d, &["compare", "--plan", "--drop", "0.05"]);
    assert!(plan.contains("grasps per object"), "{plan}");
}

#[test]
fn ranking_puts_what_holds_first_and_writes_the_top() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let args = [
        "rank",
        "--sampler",
        "antipodal",
        "--filter",
        "mug_0",
        "--candidates",
        "30",
        "--top",
        "4",
        "--perturb",
        "3",
        "--out",
        "best.json",
        "--format",
        "json",
        "-q",
    ];
    let text = ok(d, &args);
    let list: serde_json::Value = serde_json::from_str(&text).unwrap();
    let list = list.as_array().unwrap();
    assert_eq!(list.len(), 4);
    let p: Vec<f64> = list.iter().map(|r| r["p_hold"].as_f64().unwrap()).collect();
    assert!(p.windows(2).all(|w| w[0] >= w[1]) && p[0] > 0.5, "{p:?}");
    assert!(list.iter().all(|r| r["outcome"] == "held"), "{text}");
    let file = read_grasps(&d.join("best.json"), &ReadOptions::default()).unwrap();
    assert_eq!(file.grasps.len(), 4);
    assert_eq!(ok(d, &args), text, "the same seed, the same race");
    let (code, _, message) = said(d, &["rank", "--sampler", "antipodal"]);
    assert!(code == 2 && message.contains("one object"), "{message}");
}

#[test]
fn labels_can_be_read_resumed_and_name_what_does_not_fit() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    ok(d, &["objects", "--export", "meshes"]);
    let huge = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
    let scaled: String = huge.replace(" 1 0 0", " .9 0 0");
    fs::write(d.join("huge.obj"), scaled).unwrap();
    let args = [
        "label",
        "--objects",
        "meshes/ring_0.obj",
        "meshes/box_0.obj",
        "--grasps-per-object",
        "20",
        "--json",
        "--out",
        "labels",
        "-q",
    ];
    let text = ok(d, &args);
    assert!(
        text.contains("ring_0") && text.contains("labels/grasps"),
        "{text}"
    );
    let h5: Vec<_> = fs::read_dir(d.join("labels/grasps"))
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.extension().is_some_and(|e| e == "h5"))
        .collect();
    assert_eq!(h5.len(), 2);
    for path in &h5 {
        let file = read_grasps(path, &ReadOptions::default()).unwrap();
        assert!(file.grasps.iter().all(|g| g.label.is_some()));
        let mesh = file.object.mesh.unwrap();
        assert!(d.join("labels").join(mesh).is_file());
        let json = read_grasps(&path.with_extension("json"), &ReadOptions::default()).unwrap();
        assert_eq!(json.grasps.len(), file.grasps.len());
    }
    let again = ok(d, &args);
    assert!(again.contains("labelled before"), "{again}");
    let (code, _, message) = said(d, &[&args[..], &["--seed", "5"]].concat());
    assert!(code == 3 && message.contains("other settings"), "{message}");
    // Its labels are the outcomes of a run on the same grasps.
    let path = h5
        .iter()
        .find(|p| p.to_string_lossy().contains("ring_0"))
        .unwrap();
    let grasps = path.display().to_string();
    ok(
        d,
        &[
            "run",
            "--grasps",
            &grasps,
            "--mesh-root",
            "labels",
            "--out",
            "again",
            "-q",
        ],
    );
    let summary: serde_json::Value =
        serde_json::from_slice(&fs::read(d.join("again/summary.json")).unwrap()).unwrap();
    let a = &summary["agreement"];
    assert!(
        a["fp"].as_u64().unwrap() + a["fn"].as_u64().unwrap() <= 1,
        "{a}"
    );
}
