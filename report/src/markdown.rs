//! The summary that one would paste into a paper.

use shakedown_metrics::Summary;
use shakedown_metrics::distribution::{DISTANCES, Distribution};
use shakedown_metrics::summary::AgreementBlock;

use crate::manifest::Manifest;
use crate::table::{aligned, percent, percent_interval, three};

/// Objects listed one by one in the printed summary before it points to the files.
const LISTED: usize = 40;

/// `summary.md`; also what `run` prints.
pub fn summary(manifest: &Manifest, summary: &Summary) -> String {
    let mut out = String::new();
    let name = |key: &str| manifest.protocol[key].as_str().unwrap_or("?").to_owned();
    out.push_str(&format!(
        "# {} grasps on {} object{}, protocol {} ({}), gripper {}\n\n",
        summary.n,
        summary.objects.len(),
        if summary.objects.len() == 1 { "" } else { "s" },
        name("name"),
        name("version"),
        manifest.gripper["name"].as_str().unwrap_or("?"),
    ));
    out.push_str(&headline(summary));
    if let Some(physics) = &summary.physics {
        let parts: Vec<String> = physics
            .outcomes
            .iter()
            .filter(|(_, n)| **n > 0)
            .map(|(name, n)| format!("{name} {n}"))
            .collect();
        out.push_str(&format!("\nOutcomes: {}\n", parts.join(", ")));
    }
    if let Some(block) = &summary.agreement {
        out.push_str(
            "\nAgreement with the labels of the input, beside predictors without simulation\n\n",
        );
        out.push_str(&agreement(block));
    }
    if let Some(d) = &summary.distribution {
        out.push_str("\nDistance from the successful grasps of the input (earth mover's), beside that of two halves of them\n\n");
        out.push_str(&distribution(d));
    }
    out.push_str("\nPer object\n\n");
    out.push_str(&objects(summary));
    out
}

/// What the trials cost, for people only: it differs from run to run, so it stands in no file but
/// `summary.json`.
pub fn throughput(summary: &Summary) -> Option<String> {
    let t = &summary.throughput;
    (t.trials > 0).then(|| {
        format!(
            "{} trials, {} steps, {:.1} CPU-s: {:.1} trials per CPU-second, {:.0} us a step; {:.1} s in all",
            t.trials,
            t.steps,
            t.cpu_s,
            t.trials_per_cpu_s,
            1e6 * t.cpu_s / (t.steps.max(1) as f64),
            t.wall_s
        )
    })
}

/// The main rates and the objects as bars, for a terminal that shows block characters.
pub fn bars(summary: &Summary) -> String {
    let mut lines: Vec<(String, f64)> = Vec::new();
    if let Some(g) = &summary.geometry {
        lines.push(("optimal (geometry)".into(), g.optimal));
    }
    if let Some(p) = &summary.physics {
        lines.push(("held (physics)".into(), p.held));
        for (name, n) in p
            .outcomes
            .iter()
            .filter(|(name, n)| *name != "held" && **n > 0)
        {
            lines.push((format!("  {name}"), *n as f64 / p.n.max(1) as f64));
        }
        if (2..=LISTED).contains(&summary.objects.len()) {
            lines.extend(summary.objects.iter().filter_map(|o| {
                let name: String = o
                    .object
                    .chars()
                    .filter(|c| !c.is_control())
                    .take(30)
                    .collect();
                Some((name, o.physics.as_ref()?.held))
            }));
        }
    }
    let width = lines
        .iter()
        .map(|(name, _)| name.chars().count())
        .max()
        .unwrap_or(0);
    lines
        .into_iter()
        .map(|(name, rate)| {
            let pad = " ".repeat(width - name.chars().count());
            format!("{name}{pad} {} {}\n", bar(rate), percent(rate))
        })
        .collect()
}

/// Thirty cells, in eighths.
fn bar(rate: f64) -> String {
    const PARTS: [&str; 8] = ["", "▏", "▎", "▍", "▌", "▋", "▊", "▉"];
    let eighths = (rate.clamp(0.0, 1.0) * 240.0).round() as usize;
    let text = "█".repeat(eighths / 8) + PARTS[eighths % 8];
    let rest = 30 - text.chars().count();
    text + &"·".repeat(rest)
}

fn headline(summary: &Summary) -> String {
    let mut rows = Vec::new();
    let mut row = |name: &str, rate: f64, ci: String| {
        rows.push(vec![name.to_owned(), percent(rate), ci]);
    };
    if let Some(g) = &summary.geometry {
        row("graspable (geometry)", g.graspable, String::new());
        row("collision-free (geometry)", g.collision_free, String::new());
        row("optimal (geometry)", g.optimal, String::new());
        row(
            "optimal, closes, centred, aligned",
            g.optimal_strict,
            String::new(),
        );
    }
    if let Some(p) = &summary.physics {
        row("held (physics)", p.held, percent_interval(p.ci95));
    }
    for (stage, at) in [
        ("geometry", &summary.success_at.geometry),
        ("physics", &summary.success_at.physics),
    ] {
        for k in ["1", "5", "10"] {
            if let Some(Some(rate)) = at.get(k) {
                row(&format!("success@{k} ({stage})"), *rate, String::new());
            }
        }
    }
    aligned(&["rate", "value", "95 % (by object)"], &rows)
}

fn agreement(block: &AgreementBlock) -> String {
    let lines = std::iter::once(("this trial", &block.trial))
        .chain(block.baselines.iter().map(|(n, a)| (n.as_str(), a)));
    let rows: Vec<Vec<String>> = lines
        .map(|(name, a)| {
            vec![
                name.to_owned(),
                three(a.balanced_accuracy),
                a.ci95
                    .map_or_else(String::new, |[lo, hi]| format!("[{lo:.3}, {hi:.3}]")),
                three(a.mean_object_balanced_accuracy),
                three(a.mcc),
                three(a.auroc),
                a.tp.to_string(),
                a.fp.to_string(),
                a.fn_.to_string(),
                a.tn.to_string(),
            ]
        })
        .collect();
    aligned(
        &[
            "predictor",
            "bal. acc.",
            "95 %",
            "mean of objects",
            "MCC",
            "AUROC",
            "TP",
            "FP",
            "FN",
            "TN",
        ],
        &rows,
    )
}

fn distribution(d: &Distribution) -> String {
    let rows = DISTANCES.map(|(name, of)| {
        let (drawn, floor) = (of(&d.drawn), of(&d.floor));
        vec![
            name.to_owned(),
            format!("{drawn:.4}"),
            format!("{floor:.4}"),
            format!("{:.2}", drawn / floor),
        ]
    });
    aligned(
        &["distance at the tcp", "drawn", "data against data", "ratio"],
        &rows,
    )
}

fn objects(summary: &Summary) -> String {
    let rate = |x: Option<f64>| x.map_or_else(|| "-".into(), percent);
    let rows: Vec<Vec<String>> = summary
        .objects
        .iter()
        .take(LISTED)
        .map(|o| {
            let p = o.physics.as_ref();
            vec![
                o.object.clone(),
                o.n.to_string(),
                rate(o.geometry.as_ref().map(|g| g.optimal)),
                rate(p.map(|p| p.held)),
                percent_interval(p.and_then(|p| p.ci95)),
                rate(o.success_at.physics.get("10").copied().flatten()),
                o.agreement
                    .as_ref()
                    .map_or_else(|| "-".into(), |a| three(a.trial.balanced_accuracy)),
            ]
        })
        .collect();
    let mut out = aligned(
        &[
            "object",
            "grasps",
            "optimal",
            "held",
            "95 %",
            "success@10",
            "bal. acc.",
        ],
        &rows,
    );
    if summary.objects.len() > LISTED {
        out.push_str(&format!(
            "\n... and {} more in summary.json\n",
            summary.objects.len() - LISTED
        ));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_are_as_long_as_their_rates_and_all_of_one_width() {
        assert_eq!(bar(0.0), "·".repeat(30));
        assert_eq!(bar(1.0), "█".repeat(30));
        assert!(bar(0.5).starts_with(&"█".repeat(15)) && bar(0.5).contains('·'));
        assert!((0..=100).all(|k| bar(f64::from(k) / 100.0).chars().count() == 30));
    }
}
