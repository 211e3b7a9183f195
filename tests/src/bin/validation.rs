//! Writes `docs/validation.md` and its plots from measurements made here and now:
//! `cargo run --release -p shakedown_tests --bin validation`.
//!
//! What other commands measured (MuJoCo's laws, cross-engine verdicts, agreement with labels) is
//! read from the JSON files beside it and left out where there is none.

use std::fmt::Write as _;
use std::path::Path;
use std::{fs, io};

use plotters::prelude::*;
use serde_json::Value;
use shakedown_tests::laws::{self, Law};
use shakedown_tests::measure;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let data = docs.join("validation");
    fs::create_dir_all(&data)?;
    let mujoco = read(&data.join("mujoco_laws.json"))?;
    let (measured, rapier) = (laws::all("grip"), laws::all("rapier"));
    let both = measured.iter().chain(&rapier);
    let broken = both.filter(|l| !l.holds()).count();
    plot_slip(&data.join("slip.svg"), &measured, &mujoco)?;
    plot_twist(&data.join("twist.svg"), &measured, &mujoco)?;
    plot_creep(&data.join("creep.svg"))?;
    let page = fs::read_to_string(data.join("page.md"))?
        .replace("{{laws}}", &table(&measured, &rapier, &mujoco))
        .replace("{{broken}}", &broken.to_string())
        .replace("{{laws_total}}", &measured.len().to_string())
        .replace("{{cross_engine}}", &cross_engine(&data)?)
        .replace("{{agreement}}", &agreement(&data)?)
        .replace("{{calibration}}", &tried(&data.join("calibration.json"))?)
        .replace("{{hypotheses}}", &tried(&data.join("hypotheses.json"))?)
        .replace("{{signature}}", &signature(&data)?)
        .replace("{{steps}}", &steps(&data)?);
    fs::write(docs.join("validation.md"), page)?;
    println!(
        "{} laws, {broken} broken: docs/validation.md",
        measured.len()
    );
    Ok(())
}

fn read(path: &Path) -> io::Result<Value> {
    match fs::read(path) {
        Ok(bytes) => Ok(serde_json::from_slice(&bytes)?),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(Value::Null),
        Err(e) => Err(e),
    }
}

fn mujoco_value(mujoco: &Value, key: &str) -> Option<f64> {
    mujoco["values"][key].as_f64()
}

fn table(laws: &[Law], rapier: &[Law], mujoco: &Value) -> String {
    let mut out = String::from(
        "| law | case | theory | this trial | tolerance | unit | rapier | MuJoCo | |\n|---|---|---:|---:|---:|---|---:|---:|---|\n",
    );
    for (law, second) in laws.iter().zip(rapier) {
        let theirs = mujoco_value(mujoco, &law.key).map_or(String::new(), short);
        let mark = if law.holds() && second.holds() {
            ""
        } else {
            "**broken**"
        };
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {} | {} | {} | {theirs} | {mark} |",
            law.law,
            law.case,
            short(law.analytic),
            short(law.measured),
            short(law.tolerance),
            law.unit,
            short(second.measured),
        );
    }
    out
}

fn short(x: f64) -> String {
    if x == 0.0 {
        "0".into()
    } else if x.abs() < 1e-3 {
        format!("{x:.1e}")
    } else if x.abs() < 10.0 {
        format!("{x:.4}")
    } else {
        format!("{x:.2}")
    }
}

fn cross_engine(data: &Path) -> io::Result<String> {
    let mut out = String::from(
        "| protocol | grasps | same verdict | 95 % | both held | both failed | only this trial held | only MuJoCo held |\n|---|---:|---:|---|---:|---:|---:|---:|\n",
    );
    for name in ["acronym-stated", "acronym"] {
        let report = read(&data.join(format!("cross_engine_{name}.json")))?;
        if report.is_null() {
            continue;
        }
        let (mut both, mut none, mut ours, mut theirs) = (0, 0, 0, 0);
        for pair in report["pairs"].as_array().into_iter().flatten() {
            let n = pair["n"].as_u64().unwrap_or(0);
            match (pair["shakedown"] == "held", pair["mujoco"] == "held") {
                (true, true) => both += n,
                (false, false) => none += n,
                (true, false) => ours += n,
                (false, true) => theirs += n,
            }
        }
        let percent = |v: &Value| format!("{:.1} %", v.as_f64().unwrap_or(f64::NAN) * 100.0);
        let _ = writeln!(
            out,
            "| `{name}` | {} | {} | [{}, {}] | {both} | {none} | {ours} | {theirs} |",
            report["n"],
            percent(&report["same_verdict"]),
            percent(&report["ci95"][0]),
            percent(&report["ci95"][1]),
        );
    }
    Ok(out)
}

/// Pooled, by category, and the baselines without simulation.
fn agreement(data: &Path) -> io::Result<String> {
    let report = read(&data.join("agreement_unseen.json"))?;
    let mut out = String::from(
        "| predictor | grasps | balanced accuracy | 95 %, by object | mean of objects | MCC | TP | FP | FN | TN |\n|---|---:|---:|---|---:|---:|---:|---:|---:|---:|\n",
    );
    let number = |v: &Value| v.as_f64().map_or("-".into(), |x| format!("{x:.3}"));
    let interval = |v: &Value| format!("[{}, {}]", number(&v[0]), number(&v[1]));
    let block = |name: &str, b: &Value| {
        format!(
            "| {name} | {} | {} | {} | {} | {} | {} | {} | {} | {} |\n",
            b["n"],
            number(&b["balanced_accuracy"]),
            interval(&b["ci95"]),
            number(&b["mean_object_balanced_accuracy"]),
            number(&b["mcc"]),
            b["tp"],
            b["fp"],
            b["fn"],
            b["tn"]
        )
    };
    let agreement = &report["agreement"];
    out += &block("**this trial**", agreement);
    for (name, baseline) in agreement["baselines"].as_object().into_iter().flatten() {
        out += &block(&format!("{name}, no simulation"), baseline);
    }
    out += "\n| category | objects | balanced accuracy | 95 %, by object |\n|---|---:|---:|---|\n";
    for row in report["categories"].as_array().into_iter().flatten() {
        let name = row["category"].as_str().unwrap_or("?");
        let (value, range) = (number(&row["balanced_accuracy"]), interval(&row["ci95"]));
        let _ = writeln!(out, "| {name} | {} | {value} | {range} |", row["objects"]);
    }
    Ok(out)
}

/// Every setting that `calibrate.py` tried, best first.
fn tried(file: &Path) -> io::Result<String> {
    let tried = read(file)?;
    let mut out = String::from(
        "| settings | balanced accuracy | mean of objects | MCC | TP | FP | FN | TN |\n|---|---:|---:|---:|---:|---:|---:|---:|\n",
    );
    for row in tried.as_array().into_iter().flatten() {
        let settings: Vec<String> = row["settings"]
            .as_object()
            .into_iter()
            .flatten()
            .map(|(k, v)| format!("{k} {v}"))
            .collect();
        let number = |k: &str| row[k].as_f64().map_or("-".into(), |x| format!("{x:.3}"));
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {} | {} | {} | {} |",
            settings.join(", ").replace('"', ""),
            number("balanced_accuracy"),
            number("mean_object_balanced_accuracy"),
            number("mcc"),
            row["tp"],
            row["fp"],
            row["fn"],
            row["tn"]
        );
    }
    Ok(out)
}

/// What a change of the engine's settings does to verdicts.
fn steps(data: &Path) -> io::Result<String> {
    let lines = read(&data.join("steps.json"))?;
    let mut out = String::new();
    for line in lines.as_array().into_iter().flatten() {
        let (n, same) = (&line["n"], &line["same"]);
        let share = same.as_f64().unwrap_or(f64::NAN) / n.as_f64().unwrap_or(f64::NAN);
        let change = line["change"].as_str().unwrap_or("?");
        let _ = writeln!(out, "| {change} | {n} | {:.2} % |", share * 100.0);
    }
    Ok(out)
}

/// FleX / trial success by width and wedge.
fn signature(data: &Path) -> io::Result<String> {
    let table = read(&data.join("signature.json"))?;
    let edges = |key: &str| -> Vec<i64> {
        let list = table[key].as_array().into_iter().flatten();
        list.filter_map(Value::as_i64).collect()
    };
    let (widths, wedges) = (edges("width_mm"), edges("wedge_deg"));
    let mut out = String::from("| width, mm |");
    for pair in wedges.windows(2) {
        let _ = write!(out, " {}-{} deg |", pair[0], pair[1]);
    }
    out.push_str("\n|---|");
    out.push_str(&"---:|".repeat(wedges.len().saturating_sub(1)));
    out.push('\n');
    for (i, pair) in widths.windows(2).enumerate() {
        let _ = write!(out, "| {}-{} |", pair[0], pair[1]);
        for j in 0..wedges.len() - 1 {
            let cell = &table["cells"][i][j];
            let count = |k: usize| cell[k].as_f64().unwrap_or(0.0);
            let n = count(0);
            if n >= 10.0 {
                let _ = write!(out, " {:.2} / {:.2} |", count(1) / n, count(2) / n);
            } else {
                out.push_str(" |");
            }
        }
        out.push('\n');
    }
    Ok(out)
}

const OURS: RGBColor = RGBColor(0, 114, 178);
const THEIRS: RGBColor = RGBColor(230, 159, 0);

/// Onset of slip by case, theory at 1.
fn plot_slip(path: &Path, laws: &[Law], mujoco: &Value) -> Result<(), Box<dyn std::error::Error>> {
    let cases: Vec<&Law> = laws.iter().filter(|l| l.law == "slip onset").collect();
    let root = SVGBackend::new(path, (720, 300)).into_drawing_area();
    root.fill(&WHITE)?;
    let n = cases.len() as f64;
    let mut chart = ChartBuilder::on(&root)
        .caption(
            "Load at which a gripped object slips, share of 2 mu F",
            ("sans-serif", 16),
        )
        .margin(10)
        .x_label_area_size(24)
        .y_label_area_size(48)
        .build_cartesian_2d(-0.5..n - 0.5, 0.97..1.03)?;
    chart
        .configure_mesh()
        .x_labels(0)
        .x_desc("case, in the order of the table")
        .draw()?;
    let band = |y: f64| PathElement::new(vec![(-0.5, y), (n - 0.5, y)], BLACK.mix(0.4));
    chart.draw_series([band(0.99), band(1.01)])?;
    let at = |i: usize, y: f64| (i as f64, y);
    chart
        .draw_series(
            cases
                .iter()
                .enumerate()
                .map(|(i, l)| Circle::new(at(i, l.measured), 5, OURS.filled())),
        )?
        .label("Shakedown")
        .legend(|(x, y)| Circle::new((x + 8, y), 5, OURS.filled()));
    let theirs = cases
        .iter()
        .enumerate()
        .filter_map(|(i, l)| Some((i, mujoco_value(mujoco, &l.key)?)));
    chart
        .draw_series(theirs.map(|(i, y)| TriangleMarker::new(at(i, y), 5, THEIRS.filled())))?
        .label("MuJoCo")
        .legend(|(x, y)| TriangleMarker::new((x + 8, y), 5, THEIRS.filled()));
    chart
        .configure_series_labels()
        .border_style(BLACK.mix(0.2))
        .background_style(WHITE)
        .draw()?;
    root.present()?;
    Ok(())
}

/// Torsional lever arm against theory.
fn plot_twist(path: &Path, laws: &[Law], mujoco: &Value) -> Result<(), Box<dyn std::error::Error>> {
    let cases: Vec<&Law> = laws.iter().filter(|l| l.law == "twist").collect();
    let root = SVGBackend::new(path, (720, 300)).into_drawing_area();
    root.fill(&WHITE)?;
    let n = cases.len() as f64;
    let mut chart = ChartBuilder::on(&root)
        .caption(
            "Lever arm of the friction that resists a twist, mm",
            ("sans-serif", 16),
        )
        .margin(10)
        .x_label_area_size(24)
        .y_label_area_size(48)
        .build_cartesian_2d(-0.5..n - 0.5, 0.0..14.0)?;
    chart
        .configure_mesh()
        .x_labels(0)
        .x_desc("flat, line, ball, ball with 2 mm, ball with 4 mm")
        .draw()?;
    let bar = |i: usize, shift: f64, y: f64, colour: RGBColor| {
        let x = i as f64 + shift;
        Rectangle::new([(x - 0.12, 0.0), (x + 0.12, y)], colour.filled())
    };
    let entries: [(&str, RGBColor, f64); 3] = [
        ("theory", RGBColor(120, 120, 120), -0.26),
        ("Shakedown", OURS, 0.0),
        ("MuJoCo", THEIRS, 0.26),
    ];
    for (k, (name, colour, shift)) in entries.into_iter().enumerate() {
        let bars = cases.iter().enumerate().filter_map(|(i, l)| {
            let y = match k {
                0 => l.analytic,
                1 => l.measured,
                _ => mujoco_value(mujoco, &l.key)?,
            };
            Some(bar(i, shift, y, colour))
        });
        chart.draw_series(bars)?.label(name).legend(move |(x, y)| {
            Rectangle::new([(x + 3, y - 5), (x + 13, y + 5)], colour.filled())
        });
    }
    chart
        .configure_series_labels()
        .border_style(BLACK.mix(0.2))
        .background_style(WHITE)
        .draw()?;
    root.present()?;
    Ok(())
}

/// Motion over time under constant loads around the limit.
fn plot_creep(path: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::new(path, (720, 300)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(
            "Motion of a gripped cube under a constant load, mm",
            ("sans-serif", 16),
        )
        .margin(10)
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(0.0..2.0, 0.0..2.0)?;
    chart.configure_mesh().x_desc("time, s").draw()?;
    for (share, colour) in [
        (0.5, RGBColor(0, 158, 115)),
        (0.9, OURS),
        (0.99, THEIRS),
        (1.01, RGBColor(213, 94, 0)),
    ] {
        chart
            .draw_series(LineSeries::new(
                measure::motion_mm(share, 2.0),
                colour.stroke_width(2),
            ))?
            .label(format!("{:.0} % of 2 mu F", share * 100.0))
            .legend(move |(x, y)| {
                PathElement::new(vec![(x, y), (x + 16, y)], colour.stroke_width(2))
            });
    }
    chart
        .configure_series_labels()
        .border_style(BLACK.mix(0.2))
        .background_style(WHITE)
        .draw()?;
    root.present()?;
    Ok(())
}
