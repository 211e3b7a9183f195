//! No bytes in a run directory make the readers of runs, journals and baselines panic.
#![no_main]

use std::fs::{self, File};

use shakedown_report::journal::{self, Journal};
use shakedown_report::results::Results;
use shakedown_report::rows;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((kind, rest)) = bytes.split_first() else {
        return;
    };
    let (first, second) = shakedown_fuzz::two(rest);
    shakedown_fuzz::in_directory(|directory| {
        let run = directory.join("run");
        let journal = run.join(journal::DIRECTORY);
        fs::create_dir_all(&journal).expect("a directory");
        let write = |name: &str, bytes: &[u8]| {
            fs::write(run.join(name), bytes).expect("a temporary file");
        };
        let name = run.to_string_lossy().into_owned();
        write("trials.csv", first);
        match kind % 3 {
            0 => {
                write("manifest.json", second);
                let _ = rows::read(&run.join("trials.csv"), &["held", "dropped"]);
                let _ = Results::open(&name);
                fs::remove_file(run.join("manifest.json")).expect("it was written");
            }
            1 => {
                write(".journal/rows.jsonl", second);
                write(".journal/start.json", second);
                let _ = journal::start_of(&run);
                let path = run.join("trials.csv");
                let mut trials = File::options().read(true).write(true).open(path).expect("a file");
                let _ = Journal::resume(&run, &mut trials, 0);
            }
            _ => {
                write("baseline.json", first);
                let _ = Results::open(&format!("{name}/baseline.json"));
            }
        }
    });
});
