//! `shakedown compare`: did this run get worse than that one?

use std::fs;
use std::path::Path;

use shakedown_metrics::compare::{Pairing, Verdict};
use shakedown_metrics::power::{Assumptions, objects_needed};
use shakedown_metrics::{Gate, compare};
use shakedown_report::Manifest;
use shakedown_report::comparison::{ComparisonReport, differences};
use shakedown_report::html::collect::collect_pair;
use shakedown_report::html::compare_page::compare_page;
use shakedown_report::results::Results;
use shakedown_report::table::aligned;

use crate::args::{Format, Global};
use crate::args_judging::{CompareArgs, FailOn, PairBy};
use crate::failure::{Exit, Failure};

pub fn run(global: &Global, args: &CompareArgs) -> Result<Exit, Failure> {
    let gate = Gate {
        alpha: args.alpha,
        min_effect: args.min_effect,
    };
    let is_level = gate.alpha > 0.0 && gate.alpha < 1.0;
    if !is_level || !(0.0..1.0).contains(&gate.min_effect) {
        return Err(Failure::usage(
            "--alpha lies between 0 and 1, --min-effect from 0 to 1 (0.02 is two points)",
        ));
    }
    if args.plan {
        print!("{}", plan(args, &gate)?);
        return Ok(Exit::Success);
    }
    let (Some(base), Some(new)) = (&args.base, &args.new) else {
        return Err(Failure::usage("give BASE and NEW, or --plan"));
    };
    let (base, new) = (Results::open(base)?, Results::open(new)?);
    let mut caveats = differences(&base, &new);
    if !caveats.is_empty() && !args.allow_protocol_change {
        return Err(Failure::input(format!(
            "{} and {} are not the same experiment: {}. Run both alike, or say \
             --allow-protocol-change",
            base.name,
            new.name,
            caveats.join("; ")
        )));
    }
    for run in [&base, &new] {
        if run.manifest.is_none() {
            caveats.push(format!(
                "{} has no manifest, its protocol is unknown",
                run.name
            ));
        }
    }
    let metric = args.metric.into();
    let tries = |run: &Results| {
        run.tries(metric).ok_or_else(|| {
            Failure::input(format!(
                "{}: `{}` was not measured in it; run the {} stage, or choose another --metric",
                run.name,
                metric.name(),
                if metric.name() == "held" {
                    "physics"
                } else {
                    "geometry"
                },
            ))
        })
    };
    let forced = match args.pair_by {
        PairBy::Auto => None,
        PairBy::Grasp => Some(Pairing::Grasps),
        PairBy::Object => Some(Pairing::Objects),
    };
    let comparison = compare(&tries(&base)?, &tries(&new)?, gate, forced).ok_or_else(|| {
        let first = |r: &Results| r.objects.keys().next().cloned().unwrap_or_default();
        Failure::input(format!(
            "{} and {} have no grasps of a common object: the first speaks of {:?} ..., the other \
             of {:?} ...",
            base.name,
            new.name,
            first(&base),
            first(&new)
        ))
    })?;
    let report = ComparisonReport {
        contract: 1,
        base_run: base.name.clone(),
        new_run: new.name.clone(),
        metric,
        caveats,
        comparison,
    };
    write_files(args, &report)?;
    if let Some(path) = &args.html {
        write(path, &page(&report, new.manifest.as_ref())?)?;
    }
    match global.format {
        Format::Json => println!(
            "{}",
            serde_json::to_string_pretty(&report).expect("plain data")
        ),
        Format::Text | Format::Md => print!("{}", report.markdown()),
    }
    let failed = match args.fail_on {
        FailOn::Regression => report.comparison.verdict == Verdict::Regression,
        FailOn::Never => false,
    };
    Ok(if failed {
        Exit::Regression
    } else {
        Exit::Success
    })
}

fn write_files(args: &CompareArgs, report: &ComparisonReport) -> Result<(), Failure> {
    if let Some(path) = &args.junit {
        let xml = report
            .junit()
            .map_err(|e| Failure::internal(format!("JUnit: {e}")))?;
        write(path, &xml)?;
    }
    if let Some(path) = &args.summary {
        write(path, &report.markdown())?;
    }
    if let Some(path) = &args.tracker {
        let text = serde_json::to_string_pretty(&report.tracker()).expect("plain data");
        write(path, &text)?;
    }
    Ok(())
}

/// The page; poses and meshes are known where both runs are directories and tried the same grasps.
fn page(report: &ComparisonReport, manifest: Option<&Manifest>) -> Result<String, Failure> {
    let (base, new) = (Path::new(&report.base_run), Path::new(&report.new_run));
    let is_run = |p: &Path| p.join("trials.csv").is_file();
    let paired = report.comparison.pairing == Pairing::Grasps;
    let collected = match manifest {
        Some(manifest) if paired && is_run(base) && is_run(new) => {
            Some(collect_pair(new, base, manifest)?)
        }
        _ => None,
    };
    Ok(compare_page(report, collected))
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    if path == Path::new("-") {
        print!("{text}");
        return Ok(());
    }
    fs::write(path, text)
        .map_err(|e| Failure::input(format!("cannot write {}: {e}", path.display())))
}

/// How many objects and grasps a comparison needs.
fn plan(args: &CompareArgs, gate: &Gate) -> Result<String, Failure> {
    let defaults = Assumptions::default();
    let assumptions = Assumptions {
        drop: args.drop.unwrap_or(defaults.drop),
        power: args.power.unwrap_or(defaults.power),
        discordance: args.discordance.unwrap_or(defaults.discordance),
        object_sd: args.object_sd.unwrap_or(defaults.object_sd),
    };
    if !(assumptions.power > 0.0 && assumptions.power < 1.0) {
        return Err(Failure::usage("--power lies between 0 and 1"));
    }
    if assumptions.drop <= gate.min_effect {
        return Err(Failure::usage(format!(
            "a drop of {} cannot be found by a gate that asks for more than {}: lower --min-effect",
            assumptions.drop, gate.min_effect
        )));
    }
    let rows: Vec<Vec<String>> = [10u64, 20, 50, 70, 100, 200, 500, 1000]
        .into_iter()
        .filter_map(|g| {
            let objects = objects_needed(&assumptions, gate, g)?;
            Some(vec![
                g.to_string(),
                objects.to_string(),
                (g * objects).to_string(),
            ])
        })
        .collect();
    Ok(format!(
        "To find a drop of {:.1} points with a power of {:.0} % (alpha {}, smallest effect {:.1} \
         points),\nif {:.1} % of the grasps change sides by themselves and objects move by {:.1} \
         points (standard deviation):\n\n{}",
        100.0 * assumptions.drop,
        100.0 * assumptions.power,
        gate.alpha,
        100.0 * gate.min_effect,
        100.0 * assumptions.discordance,
        100.0 * assumptions.object_sd,
        aligned(&["grasps per object", "objects", "grasps"], &rows)
    ))
}
