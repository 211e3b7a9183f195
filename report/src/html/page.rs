//! The page: numbers first, then the objects, then the 3-D view, then every constant.

use shakedown_metrics::Summary;
use shakedown_metrics::distribution::DISTANCES;
use shakedown_metrics::rate::success_at_k;

use super::chart::{bar, escaped, lines, marked_bar, table};
use super::collect::Collected;
use crate::manifest::Manifest;
use crate::table::{percent, percent_interval, three};

const STYLE: &str = include_str!("style.css");
pub(super) const VIEWER: &str = include_str!("viewer.html");
const SCRIPT: &str = include_str!("../../viewer/viewer.bundle.js");

/// Largest number of candidates of the success-over-k chart.
const K_MAX: u64 = 20;

/// Sorts a table by a column, numbers by value.
const SORT: &str = "\
for(const t of document.querySelectorAll('table.sortable')){\
const heads=[...t.tHead.rows[0].cells];\
heads.forEach((h,i)=>{const b=document.createElement('button');b.textContent=h.textContent;\
h.replaceChildren(b);let up=false;b.onclick=()=>{up=!up;const n=x=>parseFloat(x);\
const rows=[...t.tBodies[0].rows];const v=r=>r.cells[i].textContent.trim();\
rows.sort((a,b)=>{const d=n(v(a))-n(v(b));\
return(isNaN(d)||i===0?v(a).localeCompare(v(b)):d)*(up?1:-1)});\
t.tBodies[0].append(...rows);\
heads.forEach(x=>x.removeAttribute('aria-sort'));\
h.setAttribute('aria-sort',up?'ascending':'descending')}})}";

/// The page of a run.
pub fn page(manifest: &Manifest, summary: &Summary, collected: &Collected) -> String {
    let mut body = header(manifest, summary);
    body += &rates(summary);
    body += &over_k(summary);
    body += &outcomes(summary, collected);
    body += &agreement(summary, collected);
    body += &distribution(summary);
    body += &objects(summary);
    for note in &collected.notes {
        body += &format!("<p class='note'>{}</p>\n", escaped(note));
    }
    body += VIEWER;
    let manifest_text = serde_json::to_string_pretty(manifest).expect("a manifest is plain data");
    body += &format!(
        "<h2>Manifest</h2><details><summary>every constant of this run</summary><pre>{}</pre></details>\n",
        escaped(&manifest_text)
    );
    document("Shakedown report", &body, &collected.view)
}

/// The whole document: style, body, the data of the 3-D view, scripts.
pub(super) fn document(title: &str, body: &str, view: &serde_json::Value) -> String {
    // In a script element only "</" and "<!--" could end the data: no "<" is left in it.
    let data = view.to_string().replace('<', "\\u003c");
    format!(
        "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'>\
         <meta name='viewport' content='width=device-width,initial-scale=1'>\
         <meta http-equiv='Content-Security-Policy' content=\"default-src 'none'; script-src \
         'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:\">\
         <title>{title}</title><style>{STYLE}</style></head><body>\n{body}\
         <script type='application/json' id='shakedown-data'>{data}</script>\n\
         <script>{SORT}</script>\n<script>{SCRIPT}</script>\n</body></html>\n"
    )
}

fn header(manifest: &Manifest, summary: &Summary) -> String {
    let name = |key: &str| escaped(manifest.protocol[key].as_str().unwrap_or("?"));
    let mut out = format!(
        "<h1>{} grasps on {} object{}</h1>\n<p class='sub'>protocol {} ({}), gripper <bdi>{}</bdi>, {}, run {}</p>\n",
        summary.n,
        summary.objects.len(),
        if summary.objects.len() == 1 { "" } else { "s" },
        name("name"),
        name("version"),
        escaped(manifest.gripper["name"].as_str().unwrap_or("?")),
        escaped(&manifest.engine),
        escaped(&manifest.run_id),
    );
    out += "<div class='cards'>";
    let mut card = |title: &str, rate: f64, small: &str| {
        out += &format!(
            "<div class='card'>{title}<b>{}</b><small>{small}</small></div>",
            percent(rate)
        );
    };
    if let Some(p) = &summary.physics {
        let ci = percent_interval(p.ci95);
        card("held in physics", p.held, &format!("95 % {ci}"));
    }
    if let Some(g) = &summary.geometry {
        card(
            "optimal by geometry",
            g.optimal,
            "no collision, within reach",
        );
    }
    if let Some(Some(rate)) = summary.success_at.physics.get("10") {
        card(
            "at least one of 10 held",
            *rate,
            "unbiased over all subsets",
        );
    }
    if let Some(a) = summary
        .agreement
        .as_ref()
        .and_then(|a| a.trial.balanced_accuracy)
    {
        card("agreement with labels", a, "balanced accuracy");
    }
    out + "</div>\n"
}

fn rates(summary: &Summary) -> String {
    let mut rows = Vec::new();
    if let Some(g) = &summary.geometry {
        for (name, rate) in [
            ("graspable (geometry)", g.graspable),
            ("collision-free (geometry)", g.collision_free),
            ("optimal (geometry)", g.optimal),
            ("optimal, closes, centred, aligned", g.optimal_strict),
        ] {
            rows.push(vec![
                name.to_owned(),
                percent(rate),
                String::new(),
                bar(rate, None),
            ]);
        }
    }
    if let Some(p) = &summary.physics {
        rows.push(vec![
            "held (physics)".into(),
            percent(p.held),
            percent_interval(p.ci95),
            bar(p.held, p.ci95),
        ]);
    }
    format!(
        "<h2>Rates</h2>\n{}",
        table(&["rate", "value", "95 % (by object)", ""], &rows)
    )
}

/// Success over k, averaged over the objects that have so many candidates.
fn over_k(summary: &Summary) -> String {
    let curve = |counts: &dyn Fn(usize) -> Option<(u64, u64)>| -> Vec<(f64, f64)> {
        (1..=K_MAX)
            .filter_map(|k| {
                let rates: Vec<f64> = (0..summary.objects.len())
                    .filter_map(counts)
                    .filter_map(|(hits, n)| success_at_k(hits, n, k))
                    .collect();
                (rates.len() == summary.objects.len() && !rates.is_empty())
                    .then(|| (k as f64, rates.iter().sum::<f64>() / rates.len() as f64))
            })
            .collect()
    };
    let count = |rate: f64, n: u64| ((rate * n as f64).round() as u64, n);
    let physics = curve(&|i| {
        let p = summary.objects[i].physics.as_ref()?;
        Some(count(p.held, p.n))
    });
    let geometry = curve(&|i| {
        let g = summary.objects[i].geometry.as_ref()?;
        Some(count(g.optimal, g.n))
    });
    let series: Vec<(&str, Vec<(f64, f64)>)> = [("held", physics), ("optimal", geometry)]
        .into_iter()
        .filter(|(_, points)| points.len() > 1)
        .collect();
    if series.is_empty() {
        return String::new();
    }
    let rows: Vec<Vec<String>> = [1usize, 2, 5, 10, 20]
        .into_iter()
        .filter(|k| series.iter().all(|(_, p)| p.len() >= *k))
        .map(|k| {
            let mut row = vec![k.to_string()];
            row.extend(series.iter().map(|(_, p)| percent(p[k - 1].1)));
            row
        })
        .collect();
    let mut names = vec!["candidates"];
    names.extend(series.iter().map(|(n, _)| *n));
    format!(
        "<h2>At least one of k candidates</h2>\n<div class='pair'>{}{}</div>\n",
        lines(
            "success over the number of candidates, percent",
            "k candidates",
            &series,
            false
        ),
        table(&names, &rows)
    )
}

fn outcomes(summary: &Summary, collected: &Collected) -> String {
    let Some(physics) = &summary.physics else {
        return String::new();
    };
    let rows: Vec<Vec<String>> = physics
        .outcomes
        .iter()
        .map(|(name, n)| {
            let share = *n as f64 / physics.n.max(1) as f64;
            vec![
                escaped(name),
                n.to_string(),
                percent(share),
                bar(share, None),
            ]
        })
        .collect();
    let mut out = format!(
        "<div class='pair'><div><h2>How trials ended</h2>\n{}</div>",
        table(&["outcome", "trials", "share", ""], &rows)
    );
    if !collected.held_by_class.is_empty() {
        let rows: Vec<Vec<String>> = collected
            .held_by_class
            .iter()
            .map(|(class, [lost, held])| {
                let rate = *held as f64 / (lost + held).max(1) as f64;
                vec![
                    escaped(class),
                    held.to_string(),
                    lost.to_string(),
                    percent(rate),
                ]
            })
            .collect();
        out += &format!(
            "<div><h2>Geometry against physics</h2>\n{}</div>",
            table(&["geometry says", "held", "lost", "held of these"], &rows)
        );
    }
    out + "</div>\n"
}

fn agreement(summary: &Summary, collected: &Collected) -> String {
    let mut out = String::new();
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
                    three(a.ece),
                    format!("{} / {} / {} / {}", a.tp, a.fp, a.fn_, a.tn),
                ]
            })
            .collect();
        let header = [
            "predictor",
            "balanced accuracy",
            "95 %",
            "MCC",
            "AUROC of p_hold",
            "calibration error",
            "TP / FP / FN / TN",
        ];
        out += "<h2>Agreement with labels, beside predictors without simulation</h2>\n";
        out += &table(&header, &rows);
    }
    let bins: Vec<(f64, f64, u64)> = collected
        .reliability
        .iter()
        .filter(|(n, _, _)| *n > 0)
        .map(|(n, p, hits)| (p / *n as f64, *hits as f64 / *n as f64, *n))
        .collect();
    if bins.len() > 1 {
        let points = bins.iter().map(|(p, rate, _)| (*p, *rate)).collect();
        let rows: Vec<Vec<String>> = bins
            .iter()
            .map(|(p, rate, n)| vec![format!("{p:.2}"), percent(*rate), n.to_string()])
            .collect();
        out += &format!(
            "<h2>Does p_hold mean what it says?</h2>\n<div class='pair'>{}{}</div>\n",
            lines(
                "share that held over p_hold, percent",
                "mean p_hold",
                &[("held", points)],
                true
            ),
            table(&["p_hold", "held", "grasps"], &rows)
        );
    }
    out
}

/// Distances from the good grasps, beside the distance of two halves of those.
fn distribution(summary: &Summary) -> String {
    let Some(d) = &summary.distribution else {
        return String::new();
    };
    let longest = DISTANCES
        .iter()
        .map(|(_, of)| of(&d.drawn) / of(&d.floor))
        .fold(2.0, f64::max);
    let rows: Vec<Vec<String>> = DISTANCES
        .iter()
        .map(|(name, of)| {
            let (drawn, floor) = (of(&d.drawn), of(&d.floor));
            let ratio = drawn / floor;
            vec![
                escaped(name),
                format!("{drawn:.4}"),
                format!("{floor:.4}"),
                format!("{ratio:.2}"),
                marked_bar(
                    ratio / longest,
                    1.0 / longest,
                    &format!("{ratio:.2} times the floor"),
                ),
            ]
        })
        .collect();
    let header = [
        "distance from the good grasps",
        "drawn",
        "data against data",
        "ratio",
        "ratio, 1 marked",
    ];
    let mut out = format!(
        "<h2>Are they spread as the good grasps are?</h2>\n{}",
        table(&header, &rows)
    );
    if let Some(auc) = d.coverage_auc {
        out += &format!(
            "<p class='note'>Area under coverage over candidates: {auc:.3} (a good grasp counts as covered within 2 cm).</p>\n"
        );
    }
    out
}

fn objects(summary: &Summary) -> String {
    let rows: Vec<Vec<String>> = summary
        .objects
        .iter()
        .map(|o| {
            let held = o.physics.as_ref();
            let text = |x: Option<String>| x.unwrap_or_default();
            vec![
                format!("<bdi>{}</bdi>", escaped(&o.object)),
                o.n.to_string(),
                text(o.geometry.as_ref().map(|g| percent(g.optimal))),
                text(held.map(|p| percent(p.held))),
                text(held.map(|p| percent_interval(p.ci95))),
                text(held.map(|p| bar(p.held, p.ci95))),
            ]
        })
        .collect();
    let header = ["object", "grasps", "optimal", "held", "95 %", "held, bar"];
    let table = table(&header, &rows).replacen("<table>", "<table class='sortable'>", 1);
    format!("<h2>Per object</h2>\n{table}")
}
