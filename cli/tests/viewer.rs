//! `report.html` in headless Chromium. Skipped, and said so, where node or the browser's packages
//! are missing (`npm ci --prefix tests/viewer` installs them).

use std::fs;
use std::path::Path;
use std::process::Command;

use shakedown_report::replay::Replay;

/// Exit code of the scripts when no browser starts.
const NO_BROWSER: i32 = 77;

fn run(directory: &Path, args: &[&str]) {
    let out = Command::new(env!("CARGO_BIN_EXE_shakedown"))
        .args(args)
        .current_dir(directory)
        .env("SHAKEDOWN_CACHE", directory.join("cache"))
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{args:?}: {message}");
}

/// Runs a script of `tests/viewer`; `None` where there is no browser.
fn script(name: &str, argument: &Path) -> Option<String> {
    let home = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/viewer");
    if !home.join("node_modules/puppeteer-core").is_dir() {
        eprintln!("skipped: npm ci --prefix tests/viewer was not run");
        return None;
    }
    let out = Command::new("node")
        .arg(home.join(name))
        .arg(argument)
        .output()
        .ok()?;
    let message = String::from_utf8_lossy(&out.stderr).into_owned();
    if out.status.code() == Some(NO_BROWSER) {
        eprintln!("skipped: {message}");
        return None;
    }
    assert!(out.status.success(), "{message}");
    Some(String::from_utf8_lossy(&out.stdout).into_owned())
}

#[test]
fn the_page_shows_what_the_files_say() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let args = [
        "run",
        "--filter",
        "ring_0|mug_0",
        "--candidates",
        "16",
        "--record",
        "failures",
        "--out",
        "run",
        "-q",
    ];
    run(d, &args);
    script("check.mjs", &d.join("run"));
}

#[test]
fn a_comparison_shows_the_grasps_that_changed_and_plays_both_trials() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let common = "--filter mug_0 --sampler antipodal --candidates 12 --record all -q";
    for (out, force) in [("strong", "300"), ("weak", "12")] {
        let force = format!("grip_force_per_kg_n={force}");
        let mut args = vec!["run", "--out", out, "--set", &force];
        args.extend(common.split(' '));
        run(d, &args);
    }
    let words = "compare strong weak --allow-protocol-change --fail-on never --html page.html";
    run(d, &words.split(' ').collect::<Vec<_>>());
    script("compare.mjs", &d.join("page.html"));
    // Bare tables have no poses to show.
    let words = "compare strong/trials.csv weak/trials.csv --allow-protocol-change --fail-on never --html bare.html";
    run(d, &words.split(' ').collect::<Vec<_>>());
    let bare = fs::read_to_string(d.join("bare.html")).unwrap();
    assert!(bare.contains("needs both runs as directories"));
}

#[test]
fn hostile_names_are_shown_as_text_and_run_nowhere() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let obj = "v 0 0 0\nv .04 0 0\nv 0 .04 0\nv 0 0 .04\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
    fs::write(d.join("a.obj"), obj).unwrap();
    let long = "x".repeat(300);
    let names = [
        "</script><script>window.hacked=1</script>",
        "<img src=x onerror=window.hacked=1>",
        "a\"b'c & d",
        "two\nlines",
        "\u{202e}right to left \u{5e9}\u{5dc}",
        long.as_str(),
    ];
    let mut set = String::new();
    for name in names {
        // A JSON string is a TOML string.
        let text = serde_json::to_string(name).unwrap();
        set += &format!("[[object]]\nid = {text}\nmesh = \"a.obj\"\nmass_kg = 0.05\n");
    }
    fs::write(d.join("set.toml"), set).unwrap();
    let args = [
        "run",
        "--objects",
        "set.toml",
        "--candidates",
        "4",
        "--out",
        "run",
        "-q",
        "--record",
        "all",
    ];
    run(d, &args);
    let replays = fs::read_dir(d.join("run/replays")).unwrap();
    for entry in replays.map(|e| e.unwrap().path()) {
        let replay: Replay = serde_json::from_slice(&fs::read(entry).unwrap()).unwrap();
        assert!(replay.numbers().is_some());
    }
    script("check.mjs", &d.join("run"));
}
