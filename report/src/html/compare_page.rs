//! Two runs side by side as one page: the verdict, the objects that moved, the grasps that changed
//! sides to click and to watch in both.

use serde_json::json;
use shakedown_metrics::compare::{ObjectChange, Verdict};

use super::chart::{change, escaped, table};
use super::collect::Collected;
use super::page::{VIEWER, document};
use crate::comparison::{ComparisonReport, NUMBERS, numbers, p_text, points};
use crate::table::percent;

/// Grasps that changed sides listed per object.
const FLIPS: usize = 40;

/// The page of a comparison; with the 3-D view where both runs are at hand as directories.
pub fn compare_page(report: &ComparisonReport, collected: Option<Collected>) -> String {
    let mut body = header(report);
    body += &pairs(report);
    body += &objects(report, collected.is_some());
    let mut view = json!({"objects": [], "replays": []});
    match collected {
        Some(collected) => {
            for note in &collected.notes {
                body += &format!("<p class='note'>{}</p>\n", escaped(note));
            }
            view = collected.view;
        }
        None => {
            body += "<p class='note'>The 3-D view needs both runs as directories that tried the same grasps.</p>\n";
        }
    }
    let flips: serde_json::Map<String, serde_json::Value> = report
        .comparison
        .objects
        .iter()
        .map(|o| (o.object.clone(), json!({"lost": o.lost, "won": o.won})))
        .collect();
    view["comparison"] = json!({
        "base": report.base_run,
        "new": report.new_run,
        "metric": report.metric.name(),
        "flips": flips,
    });
    body += VIEWER;
    let all = serde_json::to_string_pretty(report).expect("a comparison is plain data");
    body += &format!(
        "<h2>All numbers</h2><details><summary>this comparison as JSON</summary><pre>{}</pre></details>\n",
        escaped(&all)
    );
    document("Shakedown comparison", &body, &view)
}

fn header(report: &ComparisonReport) -> String {
    let c = &report.comparison;
    let kind = match c.verdict {
        Verdict::Regression => " regression",
        Verdict::Improvement => " improvement",
        Verdict::Identical | Verdict::NoChange => "",
    };
    let mut out = format!(
        "<h1>{} of <bdi>{}</bdi> against <bdi>{}</bdi></h1>\n<p class='verdict{kind}'>{}</p>\n<div class='cards'>",
        report.metric.name(),
        escaped(&report.new_run),
        escaped(&report.base_run),
        escaped(&report.verdict())
    );
    let mut card = |title: &str, value: String, small: String| {
        out += &format!("<div class='card'>{title}<b>{value}</b><small>{small}</small></div>");
    };
    card("base", percent(c.base), format!("{} grasps", c.n_base));
    card("new", percent(c.new), format!("{} grasps", c.n_new));
    let interval = format!("95 % [{}, {}]", points(c.ci95[0]), points(c.ci95[1]));
    card("change, points", points(c.difference), interval);
    let gate = format!(
        "alarm below alpha {} and beyond {} points",
        c.gate.alpha,
        100.0 * c.gate.min_effect
    );
    card("p of no change", p_text(c.p), gate);
    out + "</div>\n"
}

fn pairs(report: &ComparisonReport) -> String {
    let Some(p) = &report.comparison.pairs else {
        return "<p>The runs tried different grasps, so their objects are compared.</p>\n".into();
    };
    let row = |name: &str, a: u64, b: u64| vec![name.into(), a.to_string(), b.to_string()];
    format!(
        "<h2>The same grasps in both runs</h2>\n{}",
        table(
            &["", "new: success", "new: failure"],
            &[
                row("base: success", p.both, p.lost),
                row("base: failure", p.won, p.neither),
            ]
        )
    )
}

/// Numbers of grasps; buttons where a view can show them.
fn flips(o: &ObjectChange, grasps: &[u64], has_view: bool) -> String {
    let object = escaped(&o.object);
    let mut text: Vec<String> = grasps
        .iter()
        .take(FLIPS)
        .map(|g| {
            if has_view {
                format!("<button class='flip' data-object='{object}' data-grasp='{g}'>{g}</button>")
            } else {
                g.to_string()
            }
        })
        .collect();
    if grasps.len() > FLIPS {
        text.push(format!("... {} in all", grasps.len()));
    }
    text.join(" ")
}

fn objects(report: &ComparisonReport, has_view: bool) -> String {
    let rows: Vec<Vec<String>> = report
        .comparison
        .objects
        .iter()
        .map(|o| {
            let mut row = vec![format!("<bdi>{}</bdi>", escaped(&o.object))];
            row.extend(numbers(o));
            row.push(change(o.base, o.new));
            for grasps in [&o.lost, &o.won] {
                let flips = flips(o, grasps, has_view);
                row.push(format!("<div class='flips'>{flips}</div>"));
            }
            row
        })
        .collect();
    let header = [&["object"], &NUMBERS[..], &["from o to dot", "lost", "won"]].concat();
    let table = table(&header, &rows).replacen("<table>", "<table class='sortable'>", 1);
    format!("<h2>Per object, the biggest movers first</h2>\n{table}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::Metric;
    use shakedown_metrics::Gate;
    use shakedown_metrics::compare::{Tried, Tries, compare};

    #[test]
    fn the_page_names_each_grasp_that_changed_sides_and_no_name_becomes_markup() {
        let tries = |lost: u64| -> Tries {
            let grasps = (0..50).map(|grasp| Tried {
                grasp,
                pose: 7,
                success: grasp >= lost,
            });
            [("<script>mug".to_owned(), grasps.collect())].into()
        };
        let report = ComparisonReport {
            contract: 1,
            base_run: "a<b".into(),
            new_run: "b".into(),
            metric: Metric::Held,
            caveats: Vec::new(),
            comparison: compare(&tries(0), &tries(20), Gate::default(), None).unwrap(),
        };
        let page = compare_page(&report, None);
        assert!(page.contains("REGRESSION") && page.contains("verdict regression"));
        assert!(page.contains("0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19"));
        assert!(!page.contains("<script>mug") && !page.contains("a<b"));
    }
}
