//! A comparison as text: for people, for CI jobs, for benchmark trackers.

use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};
use serde::{Deserialize, Serialize};
use shakedown_metrics::Comparison;
use shakedown_metrics::compare::{ObjectChange, Pairing, Verdict};

use crate::results::{Metric, Results};
use crate::table::{aligned, percent};

/// A comparison with what it compared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ComparisonReport {
    /// Version of the contract.
    pub contract: u32,
    /// Name of the base run as given.
    pub base_run: String,
    /// Name of the new run as given.
    pub new_run: String,
    /// What counted as a success.
    pub metric: Metric,
    /// Differences of protocol, version or objects that were allowed; and what could not be checked.
    pub caveats: Vec<String>,
    /// The numbers.
    pub comparison: Comparison,
}

/// Objects listed one by one in text.
const LISTED: usize = 10;
/// Flipped grasps listed per object in text.
const FLIPS: usize = 12;

pub(crate) fn points(difference: f64) -> String {
    format!("{:+.1}", 100.0 * difference)
}

/// How two runs differ in what must be equal for a fair comparison: protocol, versions, hand,
/// common objects.
pub fn differences(base: &Results, new: &Results) -> Vec<String> {
    let (Some(a), Some(b)) = (&base.manifest, &new.manifest) else {
        return Vec::new();
    };
    let mut found = Vec::new();
    let mut same = |what: &str, a: &str, b: &str| {
        if a != b {
            found.push(format!("{what}: {a} against {b}"));
        }
    };
    same("shakedown version", &a.version, &b.version);
    same("physics engine", &a.engine, &b.engine);
    let name = |v: &serde_json::Value, key: &str| v[key].as_str().unwrap_or("?").to_owned();
    same(
        "protocol",
        &name(&a.protocol, "version"),
        &name(&b.protocol, "version"),
    );
    same(
        "gripper",
        &name(&a.gripper, "name"),
        &name(&b.gripper, "name"),
    );
    let keys = |v: &serde_json::Value| -> Vec<String> {
        v.as_object()
            .map(|m| m.keys().cloned().collect())
            .unwrap_or_default()
    };
    for (what, a, b) in [
        ("protocol", &a.protocol, &b.protocol),
        ("classifier", &a.classifier, &b.classifier),
        ("gripper", &a.gripper, &b.gripper),
    ] {
        let mut names = keys(a);
        names.extend(keys(b));
        names.sort();
        names.dedup();
        for key in names {
            if a[&key] != b[&key] && key != "name" && key != "version" {
                found.push(format!("{what} {key}: {} against {}", a[&key], b[&key]));
            }
        }
    }
    for object in &a.objects {
        if let Some(other) = b.objects.iter().find(|o| o.id == object.id) {
            if object.mesh_hash != other.mesh_hash {
                found.push(format!("object {}: another mesh", object.id));
            } else if object.properties != other.properties {
                found.push(format!(
                    "object {}: other scale, mass or friction",
                    object.id
                ));
            }
        }
    }
    found
}

impl ComparisonReport {
    /// The verdict as one sentence.
    pub fn verdict(&self) -> String {
        let c = &self.comparison;
        let metric = self.metric.name();
        let change = format!(
            "{metric} {} -> {} ({} points, 95 % [{}, {}], p = {})",
            percent(c.base),
            percent(c.new),
            points(c.difference),
            points(c.ci95[0]),
            points(c.ci95[1]),
            p_text(c.p)
        );
        let mut text = match c.verdict {
            Verdict::Identical => {
                format!("IDENTICAL: all {} grasps have the same {metric}", c.n_base)
            }
            Verdict::Regression => format!("REGRESSION: {change}"),
            Verdict::Improvement => format!("IMPROVEMENT: {change}"),
            Verdict::NoChange => {
                let why = if c.p >= c.gate.alpha || (c.ci95[0] <= 0.0 && c.ci95[1] >= 0.0) {
                    "within what chance does".to_owned()
                } else {
                    format!(
                        "significant, but no more than the {} points that matter",
                        100.0 * c.gate.min_effect
                    )
                };
                format!("NO CHANGE: {change}, {why}")
            }
        };
        if !self.caveats.is_empty() {
            text.push_str(&format!("; but note: {}", self.caveats.join("; ")));
        }
        text
    }

    /// What people read, as Markdown; fit for a CI job summary.
    pub fn markdown(&self) -> String {
        let c = &self.comparison;
        let mut out = format!(
            "# {} against {}\n\n**{}**\n\n",
            self.new_run,
            self.base_run,
            self.verdict()
        );
        out.push_str(&match (c.pairing, &c.pairs) {
            (Pairing::Grasps, Some(p)) => format!(
                "{} grasps of {} objects, pair by pair: {} lost, {} won, {} held both times, {} neither (exact McNemar).\n",
                p.n(),
                c.objects.len(),
                p.lost,
                p.won,
                p.both,
                p.neither
            )
            .replace("held both times", &format!("{} both times", self.metric.name())),
            _ => format!(
                "{} and {} grasps of {} objects; the grasps differ, so objects are compared (cluster bootstrap).\n",
                c.n_base,
                c.n_new,
                c.objects.len()
            ),
        });
        if c.unmatched > 0 {
            out.push_str(&format!(
                "{} grasps have no partner and were left out.\n",
                c.unmatched
            ));
        }
        for (run, missing) in [(&self.base_run, &c.only_base), (&self.new_run, &c.only_new)] {
            if !missing.is_empty() {
                out.push_str(&format!("Only in {run}: {}.\n", missing.join(", ")));
            }
        }
        let moved: Vec<_> = c
            .objects
            .iter()
            .filter(|o| o.difference != 0.0 || !o.lost.is_empty() || !o.won.is_empty())
            .take(LISTED)
            .collect();
        if !moved.is_empty() {
            out.push_str("\nThe biggest movers\n\n");
            let rows: Vec<Vec<String>> = moved
                .iter()
                .map(|o| {
                    let mut row = vec![o.object.clone()];
                    row.extend(numbers(o));
                    row.extend([flips(&o.lost), flips(&o.won)]);
                    row
                })
                .collect();
            let header = [&["object"], &NUMBERS[..], &["lost", "won"]].concat();
            out.push_str(&aligned(&header, &rows));
        }
        out
    }

    /// JUnit XML: the gate as one case, each object as another.
    ///
    /// # Errors
    /// Never for plain data.
    pub fn junit(&self) -> Result<String, quick_junit::SerializeError> {
        let c = &self.comparison;
        let mut report = Report::new("shakedown compare");
        let mut suite = TestSuite::new(self.metric.name());
        suite.add_test_case(case(
            "gate",
            c.verdict == Verdict::Regression,
            &self.verdict(),
        ));
        for o in &c.objects {
            let worse =
                o.difference < -c.gate.min_effect && o.p_holm.is_some_and(|p| p < c.gate.alpha);
            let text = format!(
                "{} -> {} ({} points); lost {}; won {}",
                percent(o.base),
                percent(o.new),
                points(o.difference),
                flips(&o.lost),
                flips(&o.won)
            );
            suite.add_test_case(case(&o.object, worse, &text));
        }
        report.add_test_suite(suite);
        report.to_string()
    }

    /// The list that benchmark trackers read; bigger is better.
    pub fn tracker(&self) -> serde_json::Value {
        let c = &self.comparison;
        let entry = |name: String, rate: f64, n: u64, extra: String| {
            serde_json::json!({
                "name": name,
                "unit": "percent",
                "value": 100.0 * rate,
                "range": format!("{n} grasps"),
                "extra": extra,
            })
        };
        let metric = self.metric.name();
        let mut list = vec![entry(metric.to_owned(), c.new, c.n_new, self.verdict())];
        let mut objects: Vec<_> = c.objects.iter().collect();
        objects.sort_by(|a, b| a.object.cmp(&b.object));
        list.extend(objects.into_iter().map(|o| {
            let name = format!("{metric}/{}", o.object);
            entry(
                name,
                o.new,
                o.n_new,
                format!("{} points", points(o.difference)),
            )
        }));
        list.into()
    }
}

fn case(name: &str, failed: bool, text: &str) -> TestCase {
    let mut case = if failed {
        let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
        status.set_message(text);
        TestCase::new(name, status)
    } else {
        TestCase::new(name, TestCaseStatus::success())
    };
    case.set_system_out(text);
    case
}

/// Names of [`numbers`].
pub(crate) const NUMBERS: [&str; 6] = ["n", "base", "new", "points", "95 %", "p (Holm)"];

/// The numbers of one object as cells of a table.
pub(crate) fn numbers(o: &ObjectChange) -> [String; 6] {
    [
        o.n_new.to_string(),
        percent(o.base),
        percent(o.new),
        points(o.difference),
        format!("[{}, {}]", points(o.ci95[0]), points(o.ci95[1])),
        o.p_holm.map_or_else(|| "-".into(), p_text),
    ]
}

fn flips(grasps: &[u64]) -> String {
    let mut text: Vec<String> = grasps.iter().take(FLIPS).map(u64::to_string).collect();
    if grasps.len() > FLIPS {
        text.push(format!("... {} in all", grasps.len()));
    }
    text.join(" ")
}

pub(crate) fn p_text(p: f64) -> String {
    if p < 0.0001 {
        format!("{p:.0e}")
    } else {
        format!("{p:.4}")
    }
}
