//! `report.html`: one file that opens from disk, offline. The tables of the summary, a bar per
//! object, and the manifest.

use shakedown_metrics::Summary;

use crate::manifest::Manifest;
use crate::table::{percent, percent_interval, three};

const STYLE: &str = "
:root{color-scheme:light dark;--bar:#0072b2;--rule:#8884}
body{font:15px/1.5 system-ui,sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem}
table{border-collapse:collapse;margin:1rem 0}
th,td{padding:.2rem .7rem;border-bottom:1px solid var(--rule);text-align:right;overflow-wrap:anywhere}
th:first-child,td:first-child{text-align:left}
pre{overflow:auto;border:1px solid var(--rule);padding:1rem}
svg{vertical-align:middle}
@media print{details{display:none}}";

/// Text as text: nothing in it can become markup.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
        .replace('\'', "&#39;")
}

fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let cells = |tag: &str, row: &[String]| {
        let inner: String = row.iter().map(|c| format!("<{tag}>{c}</{tag}>")).collect();
        format!("<tr>{inner}</tr>\n")
    };
    let head: Vec<String> = header.iter().map(|h| escaped(h)).collect();
    let body: String = rows.iter().map(|r| cells("td", r)).collect();
    format!(
        "<table><thead>{}</thead><tbody>\n{body}</tbody></table>\n",
        cells("th", &head)
    )
}

/// A bar from 0 to 1 with its interval as a whisker.
fn bar(rate: f64, ci: Option<[f64; 2]>) -> String {
    let whisker = ci.map_or_else(String::new, |[a, b]| {
        format!(
            "<line x1='{:.1}' x2='{:.1}' y1='7' y2='7' stroke='currentColor'/>",
            160.0 * a,
            160.0 * b
        )
    });
    format!(
        "<svg width='160' height='14' role='img' aria-label='{}'><rect width='{:.1}' height='14' \
         fill='var(--bar)' fill-opacity='.7'/>{whisker}</svg>",
        percent(rate),
        160.0 * rate
    )
}

/// The page.
pub fn page(manifest: &Manifest, summary: &Summary) -> String {
    let mut headline = Vec::new();
    if let Some(g) = &summary.geometry {
        for (name, rate) in [
            ("graspable (geometry)", g.graspable),
            ("collision-free (geometry)", g.collision_free),
            ("optimal (geometry)", g.optimal),
            ("optimal, closes, centred, aligned", g.optimal_strict),
        ] {
            headline.push(vec![
                name.to_owned(),
                percent(rate),
                String::new(),
                bar(rate, None),
            ]);
        }
    }
    if let Some(p) = &summary.physics {
        headline.push(vec![
            "held (physics)".into(),
            percent(p.held),
            percent_interval(p.ci95),
            bar(p.held, p.ci95),
        ]);
    }
    let mut body = table(&["rate", "value", "95 % (by object)", ""], &headline);
    if let Some(p) = &summary.physics {
        let rows: Vec<Vec<String>> = p
            .outcomes
            .iter()
            .map(|(name, n)| {
                let share = *n as f64 / p.n.max(1) as f64;
                vec![
                    escaped(name),
                    n.to_string(),
                    percent(share),
                    bar(share, None),
                ]
            })
            .collect();
        body.push_str("<h2>How trials ended</h2>\n");
        body.push_str(&table(&["outcome", "trials", "share", ""], &rows));
    }
    if let Some(block) = &summary.agreement {
        let rows: Vec<Vec<String>> = std::iter::once(("this trial", &block.trial))
            .chain(block.baselines.iter().map(|(n, a)| (n.as_str(), a)))
            .map(|(name, a)| {
                vec![
                    escaped(name),
                    three(a.balanced_accuracy),
                    a.ci95
                        .map_or_else(String::new, |[lo, hi]| format!("[{lo:.3}, {hi:.3}]")),
                    three(a.mcc),
                    three(a.auroc),
                    format!("{} / {} / {} / {}", a.tp, a.fp, a.fn_, a.tn),
                ]
            })
            .collect();
        body.push_str("<h2>Agreement with labels, beside predictors without simulation</h2>\n");
        let header = [
            "predictor",
            "balanced accuracy",
            "95 %",
            "MCC",
            "AUROC",
            "TP / FP / FN / TN",
        ];
        body.push_str(&table(&header, &rows));
    }
    let rows: Vec<Vec<String>> = summary
        .objects
        .iter()
        .map(|o| {
            let held = o.physics.as_ref();
            vec![
                escaped(&o.object),
                o.n.to_string(),
                o.geometry
                    .as_ref()
                    .map_or_else(String::new, |g| percent(g.optimal)),
                held.map_or_else(String::new, |p| percent(p.held)),
                held.map_or_else(String::new, |p| percent_interval(p.ci95)),
                held.map_or_else(String::new, |p| bar(p.held, p.ci95)),
            ]
        })
        .collect();
    body.push_str("<h2>Per object</h2>\n");
    body.push_str(&table(
        &["object", "grasps", "optimal", "held", "95 %", ""],
        &rows,
    ));
    let manifest_text = serde_json::to_string_pretty(manifest).expect("a manifest is plain data");
    format!(
        "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'>\
         <meta name='viewport' content='width=device-width,initial-scale=1'>\
         <title>Shakedown report</title><style>{STYLE}</style></head><body>\n\
         <h1>{} grasps on {} objects</h1>\n<p>protocol {}, gripper {}, {}, run {}</p>\n{body}\
         <h2>Manifest</h2><details><summary>every constant of this run</summary><pre>{}</pre>\
         </details>\n</body></html>\n",
        summary.n,
        summary.objects.len(),
        escaped(manifest.protocol["name"].as_str().unwrap_or("?")),
        escaped(manifest.gripper["name"].as_str().unwrap_or("?")),
        escaped(&manifest.engine),
        escaped(&manifest.run_id),
        escaped(&manifest_text),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hostile_text_stays_text() {
        let e = escaped("<script>alert('x')</script> & \"quotes\"");
        assert!(!e.contains('<') && !e.contains('>') && !e.contains('"') && !e.contains('\''));
    }
}
