//! The numbers of a run: `summary.json` of the contract, from one compact row per grasp.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::agreement::{Agreement, Confusion};
use crate::bootstrap::cluster_95;
use crate::calibration::expected_calibration_error;
use crate::distribution::{self, Distribution};
use crate::interval::wilson_95;
use crate::rate::success_at_k;

/// Numbers of candidates of success@k.
pub const KS: [u64; 3] = [1, 5, 10];

/// Width below which the no-simulation rule says "holds", metres: fitted on ACRONYM's `seen` half
/// (width < 29 mm: balanced accuracy 0.818 on `unseen`).
pub const WIDTH_RULE_M: f64 = 0.029;

/// What the statistics need to know of one grasp.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Row {
    /// Geometry, if that stage ran.
    pub geometry: Option<GeometryRow>,
    /// Outcome, if physics ran: index into [`Summary`]'s outcome names, and whether it held.
    pub outcome: Option<(&'static str, bool)>,
    /// Label of the input.
    pub label: Option<bool>,
    /// Calibrated probability to hold.
    pub p_hold: Option<f32>,
}

/// The geometric part of a [`Row`].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct GeometryRow {
    /// A part of the hand meets the object.
    pub collides: bool,
    /// Something lies between the pads.
    pub reachable: bool,
    /// Neither of both faults.
    pub optimal: bool,
    /// Optimal, closes, centred and aligned.
    pub optimal_strict: bool,
    /// Distance of the contacts, metres, f32 to keep a million rows small.
    pub width_m: Option<f32>,
}

/// Fractions of RFMGrasp's Table I.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Geometry {
    /// Grasps classified.
    pub n: u64,
    /// Not out of reach.
    pub graspable: f64,
    /// Not in collision.
    pub collision_free: f64,
    /// Neither.
    pub optimal: f64,
    /// Optimal, and closes, centred and aligned.
    pub optimal_strict: f64,
}

/// How trials ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Physics {
    /// Trials.
    pub n: u64,
    /// Fraction held.
    pub held: f64,
    /// 95 % interval: objects resampled; Wilson's for a single object.
    pub ci95: Option<[f64; 2]>,
    /// Count of each outcome.
    pub outcomes: BTreeMap<String, u64>,
}

/// success@k by geometry (optimal) and by physics (held).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SuccessAt {
    /// By geometry.
    pub geometry: BTreeMap<String, Option<f64>>,
    /// By physics.
    pub physics: BTreeMap<String, Option<f64>>,
}

/// Agreement of the trials with labels, with predictors that use no simulation beside it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AgreementBlock {
    /// Held against label.
    #[serde(flatten)]
    pub trial: Agreement,
    /// The same figures of predictors without simulation, by name.
    pub baselines: BTreeMap<String, Agreement>,
}

/// What it cost; left out of every promise of identical bytes.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Throughput {
    /// Trials.
    pub trials: u64,
    /// Simulation steps.
    pub steps: u64,
    /// CPU time of the trials, s.
    pub cpu_s: f64,
    /// Time of the run, s.
    pub wall_s: f64,
    /// Trials per second of CPU time.
    pub trials_per_cpu_s: f64,
}

/// The blocks of one object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectSummary {
    /// Its identity.
    pub object: String,
    /// Grasps.
    pub n: u64,
    /// As for the run.
    pub geometry: Option<Geometry>,
    /// As for the run; the interval is Wilson's.
    pub physics: Option<Physics>,
    /// As for the run.
    pub success_at: SuccessAt,
    /// As for the run.
    pub agreement: Option<AgreementBlock>,
    /// As for the run.
    pub distribution: Option<Distribution>,
}

/// `summary.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Version of the contract.
    pub contract: u32,
    /// Grasps.
    pub n: u64,
    /// Geometric fractions.
    pub geometry: Option<Geometry>,
    /// Physical outcomes.
    pub physics: Option<Physics>,
    /// Success over several candidates.
    pub success_at: SuccessAt,
    /// Agreement with labels.
    pub agreement: Option<AgreementBlock>,
    /// Distances of the drawn grasps from the reference, where objects bring one; mean over them.
    pub distribution: Option<Distribution>,
    /// Cost.
    pub throughput: Throughput,
    /// The same blocks per object.
    pub objects: Vec<ObjectSummary>,
}

/// Sums up objects, each with its rows; names of `outcomes` are listed even when they are zero.
pub fn summarise(
    objects: &[(String, Vec<Row>)],
    outcomes: &[&str],
    throughput: Throughput,
) -> Summary {
    let tallies: Vec<Tally> = objects.iter().map(|(_, rows)| Tally::of(rows)).collect();
    let refs: Vec<&Tally> = tallies.iter().collect();
    let per_object = objects
        .iter()
        .zip(&tallies)
        .map(|((id, _), tally)| ObjectSummary {
            object: id.clone(),
            n: tally.n,
            geometry: geometry(&[tally]),
            physics: physics(&[tally], outcomes),
            success_at: success_at(&[tally]),
            agreement: agreement(&[tally]),
            distribution: None,
        })
        .collect();
    Summary {
        contract: 1,
        n: tallies.iter().map(|t| t.n).sum(),
        geometry: geometry(&refs),
        physics: physics(&refs, outcomes),
        success_at: success_at(&refs),
        agreement: agreement(&refs),
        distribution: None,
        throughput,
        objects: per_object,
    }
}

impl Summary {
    /// Adds the distances from the reference, by object.
    pub fn add_distribution(&mut self, by_object: &BTreeMap<String, Distribution>) {
        for object in &mut self.objects {
            object.distribution = by_object.get(&object.object).copied();
        }
        let all: Vec<Distribution> = by_object.values().copied().collect();
        self.distribution = distribution::mean(&all);
    }
}

/// Counts of one object.
#[derive(Default)]
struct Tally {
    n: u64,
    geometry_n: u64,
    graspable: u64,
    collision_free: u64,
    optimal: u64,
    optimal_strict: u64,
    physics_n: u64,
    held: u64,
    outcomes: BTreeMap<&'static str, u64>,
    labelled: [u64; 2],
    trial: Confusion,
    width_rule: Confusion,
    width_scores: Vec<(f64, bool)>,
    p_hold: Vec<(f64, bool)>,
}

impl Tally {
    fn of(rows: &[Row]) -> Self {
        let mut t = Self::default();
        for row in rows {
            t.n += 1;
            if let Some(g) = row.geometry {
                t.geometry_n += 1;
                t.graspable += u64::from(g.reachable);
                t.collision_free += u64::from(!g.collides);
                t.optimal += u64::from(g.optimal);
                t.optimal_strict += u64::from(g.optimal_strict);
            }
            if let Some((name, held)) = row.outcome {
                t.physics_n += 1;
                t.held += u64::from(held);
                *t.outcomes.entry(name).or_default() += 1;
            }
            let (Some(label), Some((_, held))) = (row.label, row.outcome) else {
                continue;
            };
            t.labelled[usize::from(label)] += 1;
            t.trial.add(held, label);
            t.p_hold.extend(row.p_hold.map(|p| (f64::from(p), label)));
            if let Some(g) = row.geometry {
                // Nothing between the pads is as wide as can be: it cannot hold.
                let width = g.width_m.map_or(f64::INFINITY, f64::from);
                t.width_rule.add(width < WIDTH_RULE_M, label);
                t.width_scores.push((-width, label));
            }
        }
        t
    }
}

fn sum(tallies: &[&Tally], f: impl Fn(&Tally) -> u64) -> u64 {
    tallies.iter().map(|t| f(t)).sum()
}

fn geometry(tallies: &[&Tally]) -> Option<Geometry> {
    let n = sum(tallies, |t| t.geometry_n);
    let fraction = |f: fn(&Tally) -> u64| sum(tallies, f) as f64 / n as f64;
    (n > 0).then(|| Geometry {
        n,
        graspable: fraction(|t| t.graspable),
        collision_free: fraction(|t| t.collision_free),
        optimal: fraction(|t| t.optimal),
        optimal_strict: fraction(|t| t.optimal_strict),
    })
}

fn physics(tallies: &[&Tally], names: &[&str]) -> Option<Physics> {
    let (n, held) = (sum(tallies, |t| t.physics_n), sum(tallies, |t| t.held));
    if n == 0 {
        return None;
    }
    let counts = |name: &str| sum(tallies, |t| t.outcomes.get(name).copied().unwrap_or(0));
    let ci95 = if tallies.len() == 1 {
        Some(wilson_95(held, n))
    } else {
        cluster_95(tallies, |picked| {
            let (k, n) = picked.fold((0, 0), |s, t| (s.0 + t.held, s.1 + t.physics_n));
            (n > 0).then(|| k as f64 / n as f64)
        })
    };
    Some(Physics {
        n,
        held: held as f64 / n as f64,
        ci95,
        outcomes: names.iter().map(|o| ((*o).to_owned(), counts(o))).collect(),
    })
}

/// Mean over objects with at least k candidates.
fn success_at(tallies: &[&Tally]) -> SuccessAt {
    let mean = |k: u64, f: fn(&Tally) -> (u64, u64)| {
        let each: Vec<f64> = tallies
            .iter()
            .filter_map(|t| {
                let (c, n) = f(t);
                success_at_k(c, n, k)
            })
            .collect();
        (!each.is_empty()).then(|| each.iter().sum::<f64>() / each.len() as f64)
    };
    let all =
        |f: fn(&Tally) -> (u64, u64)| KS.iter().map(|&k| (k.to_string(), mean(k, f))).collect();
    SuccessAt {
        geometry: all(|t| (t.optimal, t.geometry_n)),
        physics: all(|t| (t.held, t.physics_n)),
    }
}

fn agreement(tallies: &[&Tally]) -> Option<AgreementBlock> {
    let labelled: Vec<&&Tally> = tallies.iter().filter(|t| t.trial.n() > 0).collect();
    if labelled.is_empty() {
        return None;
    }
    let tables: Vec<Confusion> = labelled.iter().map(|t| t.trial).collect();
    let positives: u64 = labelled.iter().map(|t| t.labelled[1]).sum();
    let negatives: u64 = labelled.iter().map(|t| t.labelled[0]).sum();
    let majority: Vec<Confusion> = labelled
        .iter()
        .map(|t| {
            let [negative, positive] = t.labelled;
            if positives >= negatives {
                Confusion {
                    tp: positive,
                    fp: negative,
                    ..Confusion::default()
                }
            } else {
                Confusion {
                    fn_: positive,
                    tn: negative,
                    ..Confusion::default()
                }
            }
        })
        .collect();
    let mut baselines = BTreeMap::new();
    baselines.insert("majority".to_owned(), Agreement::of(&majority, None));
    let scores: Vec<(f64, bool)> = labelled
        .iter()
        .flat_map(|t| t.width_scores.clone())
        .collect();
    if !scores.is_empty() {
        let widths: Vec<Confusion> = labelled.iter().map(|t| t.width_rule).collect();
        baselines.insert(
            "width_below_29_mm".to_owned(),
            Agreement::of(&widths, Some(&scores)),
        );
    }
    let p_hold: Vec<(f64, bool)> = labelled.iter().flat_map(|t| t.p_hold.clone()).collect();
    let mut trial = Agreement::of(&tables, (!p_hold.is_empty()).then_some(&p_hold[..]));
    trial.ece = expected_calibration_error(&p_hold);
    Some(AgreementBlock { trial, baselines })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(held: bool, label: Option<bool>, width: f32) -> Row {
        Row {
            geometry: Some(GeometryRow {
                collides: false,
                reachable: true,
                optimal: true,
                optimal_strict: held,
                width_m: Some(width),
            }),
            outcome: Some((if held { "held" } else { "dropped" }, held)),
            label,
            p_hold: None,
        }
    }

    #[test]
    fn a_run_is_the_sum_of_its_objects_and_lists_every_outcome() {
        let objects = vec![
            (
                "a".to_owned(),
                (0..10).map(|i| row(i < 5, Some(i < 6), 0.01)).collect(),
            ),
            (
                "b".to_owned(),
                (0..10)
                    .map(|i| row(i < 9, Some(i % 2 == 0), 0.05))
                    .collect(),
            ),
        ];
        let s = summarise(
            &objects,
            &["held", "dropped", "diverged"],
            Throughput::default(),
        );
        let p = s.physics.unwrap();
        assert_eq!((p.n, p.held), (20, 0.7));
        assert_eq!(p.outcomes["diverged"], 0);
        assert_eq!(p.outcomes.values().sum::<u64>(), 20);
        let block = s.agreement.unwrap();
        assert_eq!(block.trial.n, 20);
        assert_eq!(block.baselines["majority"].balanced_accuracy, Some(0.5));
        // The rule says yes to all of a and no to all of b.
        let width = &block.baselines["width_below_29_mm"];
        assert_eq!((width.tp, width.fp, width.fn_, width.tn), (6, 4, 5, 5));
        let at = &s.success_at.physics;
        assert!((at["1"].unwrap() - 0.7).abs() < 1e-12 && at["10"] == Some(1.0));
    }

    #[test]
    fn an_unlabelled_run_has_no_agreement() {
        let objects = vec![("a".to_owned(), vec![row(true, None, 0.01)])];
        let s = summarise(&objects, &["held"], Throughput::default());
        assert!(s.agreement.is_none());
        assert_eq!(s.success_at.physics["5"], None);
    }
}
