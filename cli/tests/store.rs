//! Nothing lost: killed, interrupted, damaged and sharded runs end with the bytes of a whole one.

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

const JOB: [&str; 12] = [
    "run",
    "--sampler",
    "antipodal",
    "--filter",
    "ring_0|box_1",
    "--candidates",
    "150",
    "--set",
    "shake_angular_rad=0",
    "--threads",
    "2",
    "-q",
];

fn command(directory: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_shakedown"));
    command
        .args(args)
        .current_dir(directory)
        .env("SHAKEDOWN_CACHE", directory.join("cache"))
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    command
}

fn run(directory: &Path, args: &[&str]) -> Output {
    command(directory, args).output().unwrap()
}

fn ok(directory: &Path, args: &[&str]) {
    let out = run(directory, args);
    let message = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{args:?}: {message}");
}

fn job<'a>(more: &[&'a str]) -> Vec<&'a str> {
    JOB.iter().chain(more).copied().collect()
}

/// Every file of a run directory but `summary.json`, which also says what the run cost.
fn files(run: &Path) -> Vec<(String, Vec<u8>)> {
    let mut found: Vec<(String, Vec<u8>)> = fs::read_dir(run)
        .unwrap()
        .map(|e| e.unwrap())
        .filter(|e| e.file_name() != "summary.json" && e.path().is_file())
        .map(|e| {
            (
                e.file_name().into_string().unwrap(),
                fs::read(e.path()).unwrap(),
            )
        })
        .collect();
    found.sort();
    let names: Vec<&str> = found.iter().map(|(n, _)| n.as_str()).collect();
    assert_eq!(
        names,
        ["manifest.json", "report.html", "summary.md", "trials.csv"]
    );
    assert!(
        !run.join(".journal").exists(),
        "a complete run has no journal"
    );
    found
}

/// Kills without mercy after some milliseconds; true if it was still running.
fn killed(mut child: Child, after_ms: u64) -> bool {
    std::thread::sleep(Duration::from_millis(after_ms));
    let running = child.try_wait().unwrap().is_none();
    child.kill().unwrap();
    child.wait().unwrap();
    running
}

#[test]
fn a_run_killed_at_fifty_instants_resumes_to_the_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    ok(d, &job(&["--out", "whole"]));
    let whole = files(&d.join("whole"));
    let mut kills = 0;
    let mut number = 12345u64;
    // Instants from a linear congruence: from before the first file to well into the trials.
    let mut instant_ms = || {
        number = number
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        5 + (number >> 33) % 400
    };
    let mut runs = 0;
    while kills < 50 {
        let out = format!("killed{runs}");
        runs += 1;
        let fresh = job(&["--out", &out]);
        let mut alive = killed(command(d, &fresh).spawn().unwrap(), instant_ms());
        kills += u32::from(alive);
        while alive && kills < 50 {
            let again: Vec<&str> = if d.join(&out).join(".journal/start.json").exists() {
                vec!["resume", &out]
            } else {
                fresh.clone()
            };
            alive = killed(command(d, &again).spawn().unwrap(), instant_ms());
            kills += u32::from(alive);
        }
        let out_dir = d.join(&out);
        if out_dir.join(".journal/start.json").exists() {
            ok(d, &["resume", &out]);
        } else {
            ok(d, &fresh);
        }
        assert!(files(&out_dir) == whole, "{out} after {kills} kills");
    }
}

#[test]
fn shards_join_to_the_bytes_of_the_whole_and_wrong_ones_are_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    ok(d, &job(&["--out", "whole", "--record", "failures"]));
    let whole = files(&d.join("whole"));
    for n in [1, 3, 7] {
        let names: Vec<String> = (0..n).map(|i| format!("part{i}of{n}")).collect();
        for (i, name) in names.iter().enumerate() {
            let shard = format!("{i}/{n}");
            ok(
                d,
                &job(&["--out", name, "--shard", &shard, "--record", "failures"]),
            );
        }
        let out = format!("joined{n}");
        let mut args = vec!["merge", &out];
        args.extend(names.iter().rev().map(String::as_str));
        ok(d, &args);
        assert!(files(&d.join(&out)) == whole, "{n} shards");
        let replays = |run: &str| {
            let mut names: Vec<_> = fs::read_dir(d.join(run).join("replays"))
                .unwrap()
                .map(|e| e.unwrap().file_name())
                .collect();
            names.sort();
            names
        };
        assert_eq!(replays(&out), replays("whole"));
    }
    let refused = |args: &[&str], needles: &[&str]| {
        let out = run(d, args);
        let message = String::from_utf8_lossy(&out.stderr).into_owned();
        assert_eq!(out.status.code(), Some(3), "{message}");
        for needle in needles {
            assert!(message.contains(needle), "{needle} is not in {message}");
        }
    };
    refused(&["merge", "x", "part0of3", "part2of3"], &["missing", "1/3"]);
    refused(
        &["merge", "x", "part0of3", "part0of3", "part1of3"],
        &["0/3", "twice"],
    );
    refused(
        &["merge", "x", "part0of3", "part1of7"],
        &["part1of7", "1/7"],
    );
    refused(&["merge", "x", "whole", "part1of3"], &["whole", "no shard"]);
    ok(
        d,
        &job(&["--out", "other", "--shard", "0/3", "--seed", "9"]),
    );
    refused(
        &["merge", "x", "other", "part1of3", "part2of3"],
        &["another run"],
    );
}

#[test]
fn a_damaged_tail_is_done_again() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    ok(d, &job(&["--out", "whole"]));
    let mut child = command(d, &job(&["--out", "hurt"])).spawn().unwrap();
    let log = d.join("hurt/.journal/rows.jsonl");
    // Wait for two portions, then kill.
    while fs::read_to_string(&log).map_or(0, |t| t.lines().count()) < 2 {
        assert!(
            child.try_wait().unwrap().is_none(),
            "the job is too short for this test"
        );
        std::thread::yield_now();
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let csv = d.join("hurt/trials.csv");
    let mut bytes = fs::read(&csv).unwrap();
    let place = bytes.len() - 20;
    bytes[place] ^= 1;
    fs::write(&csv, &bytes).unwrap();
    let mut tail = fs::OpenOptions::new().append(true).open(&log).unwrap();
    tail.write_all(b"{\"object\":\"ring_0\",\"ro").unwrap();
    ok(d, &["resume", "hurt"]);
    assert!(files(&d.join("hurt")) == files(&d.join("whole")));
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_cleanly_and_a_second_process_is_kept_out() {
    let dir = tempfile::tempdir().unwrap();
    let d = dir.path();
    let mut child = command(d, &job(&["--out", "stopped"])).spawn().unwrap();
    while !d.join("stopped/trials.csv").exists() {
        assert!(child.try_wait().unwrap().is_none());
        std::thread::yield_now();
    }
    let second = run(d, &job(&["--out", "stopped"]));
    let message = String::from_utf8_lossy(&second.stderr).into_owned();
    assert_eq!(second.status.code(), Some(3), "{message}");
    assert!(message.contains("another process"), "{message}");
    let status = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(status.success());
    let out = child.wait_with_output().unwrap();
    let message = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(out.status.code(), Some(5), "{message}");
    assert!(message.contains("shakedown resume stopped"), "{message}");
    ok(d, &["resume", "stopped"]);
    let nothing = run(d, &["resume", "stopped"]);
    assert_eq!(nothing.status.code(), Some(3));
    ok(d, &job(&["--out", "whole"]));
    assert!(files(&d.join("stopped")) == files(&d.join("whole")));
}
