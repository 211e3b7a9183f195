//! How good are a flow model's grasps after how many steps? Draws the rates of some runs of one model.
//!
//! `for n in 2 4 6 10 20 40; do shakedown run --model NAME --steps $n --objects ... --out steps-$n; done`,
//! then `cargo run --release -p shakedown_tests --bin sampler_steps -- OUT.svg steps-*`

use std::fs;
use std::path::Path;

use plotters::prelude::*;
use serde_json::Value;

/// Where in the summary the drawn rates stand, what the legend calls them, and their colours.
const RATES: [(&str, &str, RGBColor); 3] = [
    (
        "/geometry/collision_free",
        "collision-free",
        RGBColor(0, 158, 115),
    ),
    ("/geometry/optimal", "optimal", RGBColor(0, 114, 178)),
    ("/physics/held", "held in physics", RGBColor(213, 94, 0)),
];

struct Run {
    steps: f64,
    rates: [f64; RATES.len()],
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let out = arguments.next().ok_or("give OUT.svg RUN...")?;
    let mut runs = arguments
        .map(|run| read(Path::new(&run)))
        .collect::<Result<Vec<_>, _>>()?;
    runs.sort_by(|a, b| a.steps.total_cmp(&b.steps));
    println!("| steps | collision-free | optimal | held |\n|---:|---:|---:|---:|");
    for run in &runs {
        let [free, optimal, held] = run.rates.map(|r| 100.0 * r);
        println!(
            "| {} | {free:.1} % | {optimal:.1} % | {held:.1} % |",
            run.steps
        );
    }
    draw(Path::new(&out), &runs)
}

fn read(run: &Path) -> Result<Run, Box<dyn std::error::Error>> {
    let json = |name: &str| -> Result<Value, Box<dyn std::error::Error>> {
        let path = run.join(name);
        let text = fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(serde_json::from_str(&text)?)
    };
    let (manifest, summary) = (json("manifest.json")?, json("summary.json")?);
    let grasps = &manifest["grasps"];
    let steps = grasps["steps"]
        .as_f64()
        .or(grasps["card"]["steps"].as_f64());
    let mut rates = [0.0; RATES.len()];
    for (rate, (name, ..)) in rates.iter_mut().zip(RATES) {
        let found = summary.pointer(name).and_then(Value::as_f64);
        *rate = found.ok_or_else(|| format!("{}: no rate {name:?}", run.display()))?;
    }
    Ok(Run {
        steps: steps.ok_or_else(|| format!("{}: not drawn by a model", run.display()))?,
        rates,
    })
}

fn draw(path: &Path, runs: &[Run]) -> Result<(), Box<dyn std::error::Error>> {
    let (Some(first), Some(last)) = (runs.first(), runs.last()) else {
        return Err("give at least one run".into());
    };
    let root = SVGBackend::new(path, (720, 320)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(
            "Grasps that are good after so many steps, %",
            ("sans-serif", 16),
        )
        .margin(10)
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(
            (first.steps * 0.9..last.steps * 1.1).log_scale(),
            0.0..100.0,
        )?;
    chart
        .configure_mesh()
        .x_desc("steps of the sampler")
        .x_label_formatter(&|x| format!("{x:.0}"))
        .draw()?;
    for (i, (_, label, colour)) in RATES.into_iter().enumerate() {
        let points = || runs.iter().map(move |r| (r.steps, 100.0 * r.rates[i]));
        chart
            .draw_series(LineSeries::new(points(), colour.stroke_width(2)))?
            .label(label)
            .legend(move |(x, y)| {
                PathElement::new(vec![(x, y), (x + 16, y)], colour.stroke_width(2))
            });
        chart.draw_series(points().map(|p| Circle::new(p, 3, colour.filled())))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .border_style(BLACK.mix(0.2))
        .background_style(WHITE)
        .draw()?;
    root.present()?;
    Ok(())
}
