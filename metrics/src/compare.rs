//! Did this run get worse than that one?
//!
//! Where both tried the same grasps, each grasp is its own control: exact McNemar over the pairs.
//! Otherwise objects are the pairs, and are resampled. Either way an interval over objects stands
//! beside it, because grasps of one object succeed and fail together.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::bootstrap::{cluster_95, resampled};
use crate::paired::{Pairs, holm, independent_p, newcombe_independent_95};

/// One grasp of one run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tried {
    /// Number within the object.
    pub grasp: u64,
    /// 16 bits of the digest of the pose: grasps pair only if they agree.
    pub pose: u16,
    /// Did it succeed, by the metric of the comparison?
    pub success: bool,
}

/// Grasps of a run by object, sorted by their number.
pub type Tries = BTreeMap<String, Vec<Tried>>;

/// How the runs were matched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pairing {
    /// Grasp by grasp.
    Grasps,
    /// Object by object.
    Objects,
}

/// What the gate says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Every grasp ended the same way.
    Identical,
    /// No change that is both significant and large enough.
    NoChange,
    /// Worse: significant, and by more than the smallest effect of interest.
    Regression,
    /// Better, likewise.
    Improvement,
}

/// What counts as a change.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Gate {
    /// Significance level, two-sided.
    pub alpha: f64,
    /// Smallest change of the rate that matters.
    pub min_effect: f64,
}

impl Default for Gate {
    /// alpha 0.05, two points.
    fn default() -> Self {
        Self {
            alpha: 0.05,
            min_effect: 0.02,
        }
    }
}

/// One object of a comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectChange {
    /// Its identity.
    pub object: String,
    /// Grasps of the base run that count.
    pub n_base: u64,
    /// Grasps of the new run that count.
    pub n_new: u64,
    /// Success rate of the base run.
    pub base: f64,
    /// Success rate of the new run.
    pub new: f64,
    /// New less base.
    pub difference: f64,
    /// 95 % interval of it.
    pub ci95: [f64; 2],
    /// McNemar's p, where grasps pair.
    pub p: Option<f64>,
    /// The same after Holm's adjustment over all objects.
    pub p_holm: Option<f64>,
    /// Numbers of the grasps that succeed no more.
    pub lost: Vec<u64>,
    /// Numbers of the grasps that succeed now.
    pub won: Vec<u64>,
}

/// Two runs side by side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// How they were matched.
    pub pairing: Pairing,
    /// What counted as a change.
    pub gate: Gate,
    /// The verdict.
    pub verdict: Verdict,
    /// Grasps of the base run that count.
    pub n_base: u64,
    /// Grasps of the new run that count.
    pub n_new: u64,
    /// Success rate of the base run.
    pub base: f64,
    /// Success rate of the new run.
    pub new: f64,
    /// New less base.
    pub difference: f64,
    /// 95 % interval of the difference: objects resampled; for a single object over its grasps.
    pub ci95: [f64; 2],
    /// p of no change: exact McNemar over grasps, or bootstrap over objects.
    pub p: f64,
    /// McNemar's counts, where grasps pair.
    pub pairs: Option<Pairs>,
    /// Objects, the biggest movers first.
    pub objects: Vec<ObjectChange>,
    /// Objects that only the base run has.
    pub only_base: Vec<String>,
    /// Objects that only the new run has.
    pub only_new: Vec<String>,
    /// Grasps left out because the other run did not try them.
    pub unmatched: u64,
}

/// Compares two runs, paired as `forced` says or as the grasps allow. `None` if they have no
/// object, or under forced pairing no grasp, in common.
pub fn compare(
    base: &Tries,
    new: &Tries,
    gate: Gate,
    forced: Option<Pairing>,
) -> Option<Comparison> {
    let common: Vec<&String> = base.keys().filter(|k| new.contains_key(*k)).collect();
    if common.is_empty() {
        return None;
    }
    let mut tables: Vec<(String, Matched)> = common
        .iter()
        .map(|id| ((*id).clone(), matched(&base[*id], &new[*id])))
        .collect();
    let all: usize = common
        .iter()
        .map(|id| base[*id].len().max(new[*id].len()))
        .sum();
    let paired: u64 = tables.iter().map(|(_, m)| m.pairs.n()).sum();
    let pairing = forced.unwrap_or(if paired > 0 && 2 * paired as usize >= all {
        Pairing::Grasps
    } else {
        Pairing::Objects
    });
    let mut unmatched = 0;
    for (id, table) in &mut tables {
        let (b, n) = (&base[id.as_str()], &new[id.as_str()]);
        if pairing == Pairing::Grasps {
            unmatched += (b.len() + n.len()) as u64 - 2 * table.pairs.n();
            let p = &table.pairs;
            table.base = (p.both + p.lost, p.n());
            table.new = (p.both + p.won, p.n());
        } else {
            table.pairs = Pairs::default();
            (table.lost, table.won) = (Vec::new(), Vec::new());
            let count = |t: &[Tried]| {
                (
                    t.iter().filter(|x| x.success).count() as u64,
                    t.len() as u64,
                )
            };
            (table.base, table.new) = (count(b), count(n));
        }
    }
    tables.retain(|(_, t)| t.base.1 > 0 && t.new.1 > 0);
    if tables.is_empty() {
        return None;
    }
    let missing = |a: &Tries, b: &Tries| -> Vec<String> {
        a.keys().filter(|k| !b.contains_key(*k)).cloned().collect()
    };
    Some(Comparison {
        only_base: missing(base, new),
        only_new: missing(new, base),
        unmatched,
        ..judged(tables, pairing, gate)
    })
}

/// What two runs have of one object; (successes, grasps) of each.
#[derive(Debug, Clone, Default)]
struct Matched {
    pairs: Pairs,
    base: (u64, u64),
    new: (u64, u64),
    lost: Vec<u64>,
    won: Vec<u64>,
}

impl Matched {
    fn difference(&self) -> f64 {
        rate(self.new) - rate(self.base)
    }
}

fn rate((k, n): (u64, u64)) -> f64 {
    if n == 0 { 0.0 } else { k as f64 / n as f64 }
}

/// Walks two sorted lists and pairs what is the same grasp.
fn matched(base: &[Tried], new: &[Tried]) -> Matched {
    let mut m = Matched::default();
    let mut rest = new.iter().peekable();
    for b in base {
        while rest.peek().is_some_and(|n| n.grasp < b.grasp) {
            rest.next();
        }
        let Some(n) = rest
            .peek()
            .filter(|n| n.grasp == b.grasp && n.pose == b.pose)
        else {
            continue;
        };
        m.pairs.add(b.success, n.success);
        match (b.success, n.success) {
            (true, false) => m.lost.push(b.grasp),
            (false, true) => m.won.push(b.grasp),
            _ => {}
        }
    }
    m
}

fn judged(tables: Vec<(String, Matched)>, pairing: Pairing, gate: Gate) -> Comparison {
    let mut pairs = Pairs::default();
    let (mut base, mut new) = ((0, 0), (0, 0));
    for (_, t) in &tables {
        pairs.merge(&t.pairs);
        base = (base.0 + t.base.0, base.1 + t.base.1);
        new = (new.0 + t.new.0, new.1 + t.new.1);
    }
    let difference = rate(new) - rate(base);
    let over_objects = cluster_95(&tables, pooled_difference);
    let by_grasps = pairing == Pairing::Grasps;
    let over_grasps = if by_grasps {
        pairs.newcombe_95()
    } else {
        newcombe_independent_95(base, new)
    };
    let p = if by_grasps {
        pairs.mcnemar_exact()
    } else {
        bootstrap_p(&tables).unwrap_or_else(|| independent_p(base, new))
    };
    let ci95 = over_objects.unwrap_or(over_grasps);
    // Grasps of an object change together, so the pairs alone would cry wolf: with several objects
    // their interval must agree.
    let sure = p < gate.alpha && (ci95[0] > 0.0 || ci95[1] < 0.0);
    let verdict = if by_grasps && pairs.lost + pairs.won == 0 {
        Verdict::Identical
    } else if sure && difference < -gate.min_effect {
        Verdict::Regression
    } else if sure && difference > gate.min_effect {
        Verdict::Improvement
    } else {
        Verdict::NoChange
    };
    Comparison {
        pairing,
        gate,
        verdict,
        n_base: base.1,
        n_new: new.1,
        base: rate(base),
        new: rate(new),
        difference,
        ci95,
        p,
        pairs: by_grasps.then_some(pairs),
        objects: changes(tables, by_grasps),
        only_base: Vec::new(),
        only_new: Vec::new(),
        unmatched: 0,
    }
}

fn changes(tables: Vec<(String, Matched)>, by_grasps: bool) -> Vec<ObjectChange> {
    let p: Vec<f64> = tables
        .iter()
        .map(|(_, t)| t.pairs.mcnemar_exact())
        .collect();
    let adjusted = holm(&p);
    let mut objects: Vec<ObjectChange> = tables
        .into_iter()
        .enumerate()
        .map(|(i, (object, t))| ObjectChange {
            object,
            n_base: t.base.1,
            n_new: t.new.1,
            base: rate(t.base),
            new: rate(t.new),
            difference: t.difference(),
            ci95: if by_grasps {
                t.pairs.newcombe_95()
            } else {
                newcombe_independent_95(t.base, t.new)
            },
            p: by_grasps.then_some(p[i]),
            p_holm: by_grasps.then_some(adjusted[i]),
            lost: t.lost,
            won: t.won,
        })
        .collect();
    // A stable sort: equal movers stay in the order of their names.
    objects.sort_by(|a, b| b.difference.abs().total_cmp(&a.difference.abs()));
    objects
}

fn pooled_difference(tables: &mut dyn Iterator<Item = &(String, Matched)>) -> Option<f64> {
    let (mut base, mut new) = ((0, 0), (0, 0));
    for (_, t) in tables {
        base = (base.0 + t.base.0, base.1 + t.base.1);
        new = (new.0 + t.new.0, new.1 + t.new.1);
    }
    (base.1 > 0 && new.1 > 0).then(|| rate(new) - rate(base))
}

/// Two-sided p of no difference from resampled objects; `None` with fewer than two.
///
/// A. C. Davison and D. V. Hinkley, Bootstrap Methods and their Application, 1997, section 4.4.
fn bootstrap_p(tables: &[(String, Matched)]) -> Option<f64> {
    if tables.len() < 2 {
        return None;
    }
    let values = resampled(tables, pooled_difference)?;
    let share = |hit: usize| (hit as f64 + 1.0) / (values.len() as f64 + 1.0);
    let above = share(values.iter().filter(|v| **v >= 0.0).count());
    let below = share(values.iter().filter(|v| **v <= 0.0).count());
    Some((2.0 * above.min(below)).min(1.0))
}
