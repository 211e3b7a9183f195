//! `shakedown rank`: which candidate should the robot try first?

use std::sync::Mutex;

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use rayon::prelude::*;
use serde::Serialize;
use shakedown_classifier::{HandModel, Thresholds, Verdict, classify};
use shakedown_gripper_assets::{Grasp, GraspFile, Gripper, write_grasps};
use shakedown_metrics::hold_model::HoldJudge;
use shakedown_metrics::ranking::{Standing, race};
use shakedown_objects::Object;
use shakedown_report::table::aligned;
use shakedown_sampler::seed;
use shakedown_sim::{Outcome, Protocol, Scene, run_trial};

use super::sample::{by_extension, reference_of};
use crate::args::{Format, Global};
use crate::args_judging::RankArgs;
use crate::failure::{Exit, Failure};
use crate::plan::Plan;
use crate::settings::Source;
use crate::{grasps, progress};

/// Candidates that are tried for each one that is listed, and at least.
const TRIED_PER_LISTED: usize = 4;
const TRIED_MIN: usize = 100;

/// One line of the result.
#[derive(Serialize)]
struct Ranked {
    rank: usize,
    grasp: u64,
    p_hold: f64,
    /// 95 % interval of the share of disturbed trials that held.
    ci95: Option<[f64; 2]>,
    trials: u32,
    held: u32,
    class: &'static str,
    outcome: Option<&'static str>,
    closing_width_m: Option<f64>,
    slip_linear_m: Option<f64>,
    slip_angular_rad: Option<f64>,
    why: String,
}

/// One candidate on its way.
struct Candidate {
    grasp: Grasp,
    verdict: Verdict,
    outcome: Option<Outcome>,
    p_hold: f64,
}

pub fn run(global: &Global, args: &RankArgs) -> Result<Exit, Failure> {
    let gripper = Gripper::load(&args.source.gripper)?;
    let protocol = args.protocol.load()?;
    let source = Source::resolve(&args.source)?;
    let plan = Plan::new(&args.source, &args.object)?;
    let options = args.source.read_options(&gripper);
    let [item] = &plan.items[..] else {
        return Err(Failure::usage(format!(
            "rank orders the grasps of one object, and {} are selected: choose one with --filter",
            plan.items.len()
        )));
    };
    let object = item.load(&args.object, &options)?;
    let drawn = grasps::of_item(
        item,
        &object,
        &gripper,
        &source,
        &args.source,
        &options,
        global.seed,
    )?;
    if drawn.grasps.is_empty() {
        return Err(Failure::nothing("there is no candidate to rank"));
    }
    let table = Table {
        global,
        args,
        gripper: &gripper,
        hand: HandModel::new(&gripper, gripper.opening_max_m)?,
        protocol: &protocol,
        object: &object,
    };
    let candidates = table.judged(drawn.grasps)?;
    let standings = table.raced(&candidates)?;
    let top: Vec<Ranked> = standings
        .iter()
        .take(args.top)
        .enumerate()
        .map(|(i, s)| ranked(i + 1, s, &candidates[s.candidate]))
        .collect();
    match global.format {
        Format::Json => println!(
            "{}",
            serde_json::to_string_pretty(&top).expect("plain data")
        ),
        Format::Text | Format::Md => print!("{}", listing(&top)),
    }
    if let Some(path) = &args.out {
        let chosen = standings.iter().take(args.top).map(|s| Grasp {
            score: Some(estimate(s, &candidates[s.candidate])),
            ..candidates[s.candidate].grasp
        });
        write_grasps(&GraspFile {
            path: path.clone(),
            format: args.out_format.unwrap_or_else(|| by_extension(path)),
            gripper: Some(gripper.name.clone()),
            object: reference_of(item, &args.object, &options)?,
            grasps: chosen.collect(),
            reorthonormalised: 0,
        })?;
    }
    Ok(Exit::Success)
}

struct Table<'a> {
    global: &'a Global,
    args: &'a RankArgs,
    gripper: &'a Gripper,
    hand: HandModel,
    protocol: &'a Protocol,
    object: &'a Object,
}

impl Table<'_> {
    fn scene(&self, friction: Option<f64>) -> Result<Scene, Failure> {
        let cache = shakedown_objects::pieces::default_cache_directory();
        let cache = cache.as_deref();
        Ok(Scene::new(
            self.object,
            self.gripper,
            self.protocol,
            friction,
            cache,
        )?)
    }

    /// Geometry for all, one trial for those that geometry likes best.
    fn judged(&self, grasps: Vec<Grasp>) -> Result<Vec<Candidate>, Failure> {
        let scene = self.scene(None)?;
        let surface = &self.object.surface;
        let by_geometry = HoldJudge::new(self.object, scene.mass_kg, false);
        let mut candidates: Vec<Candidate> = grasps
            .into_par_iter()
            .map(|grasp| {
                let pose = &grasp.object_from_hand;
                let verdict = classify(&self.hand, surface, pose, &Thresholds::default());
                let p_hold = by_geometry.p_hold(&self.hand, surface, pose, &verdict, None);
                Candidate {
                    // A hand that meets the object cannot get there at all.
                    p_hold: if verdict.collides || !verdict.reachable {
                        p_hold * 1e-3
                    } else {
                        p_hold
                    },
                    grasp,
                    verdict,
                    outcome: None,
                }
            })
            .collect();
        candidates.sort_by(|a, b| b.p_hold.total_cmp(&a.p_hold));
        let usual = (TRIED_PER_LISTED * self.args.top).max(TRIED_MIN);
        let tried = self.args.try_best.unwrap_or(usual).min(candidates.len());
        let by_trial = HoldJudge::reads(self.protocol)
            .then(|| HoldJudge::new(self.object, scene.mass_kg, true));
        let bar = progress::bar(self.global, tried as u64);
        bar.set_message("trials");
        candidates[..tried].par_iter_mut().for_each(|c| {
            let pose = &c.grasp.object_from_hand;
            let outcome = run_trial(&scene, pose);
            let possible = !c.verdict.collides && c.verdict.reachable;
            match &by_trial {
                Some(judge) if possible => {
                    c.p_hold = judge.p_hold(&self.hand, surface, pose, &c.verdict, Some(&outcome));
                }
                // Another protocol: its bit counts, geometry orders what it leaves equal.
                None if !outcome.is_held() => c.p_hold *= 0.1,
                _ => {}
            }
            c.outcome = Some(outcome);
            bar.inc(1);
        });
        bar.finish_and_clear();
        candidates[..tried].sort_by(|a, b| b.p_hold.total_cmp(&a.p_hold));
        Ok(candidates)
    }

    /// The race under pose and friction noise, among the candidates that were tried.
    fn raced(&self, candidates: &[Candidate]) -> Result<Vec<Standing>, Failure> {
        let priors: Vec<f64> = candidates.iter().map(|c| c.p_hold).collect();
        let runners = candidates.iter().filter(|c| c.outcome.is_some()).count();
        if self.args.perturb == 0 {
            return Ok(race(&priors, self.args.top, 0, |_, _| Vec::new()));
        }
        let rounds = self.args.perturb;
        let bar = progress::bar(self.global, u64::from(rounds));
        bar.set_message("race");
        let failed: Mutex<Option<Failure>> = Mutex::new(None);
        let mut standings = race(&priors[..runners], self.args.top, rounds, |round, who| {
            let (noise, friction) = self.disturbance(round);
            let scene = match self.scene(Some(friction)) {
                Ok(scene) => scene,
                Err(e) => {
                    *failed.lock().expect("nobody panics while holding it") = Some(e);
                    return vec![false; who.len()];
                }
            };
            bar.inc(1);
            who.par_iter()
                .map(|&i| {
                    let pose = candidates[i].grasp.object_from_hand * noise;
                    let verdict = classify(
                        &self.hand,
                        &self.object.surface,
                        &pose,
                        &Thresholds::default(),
                    );
                    !verdict.collides && run_trial(&scene, &pose).is_held()
                })
                .collect()
        });
        bar.finish_and_clear();
        if let Some(e) = failed.into_inner().expect("nobody panics while holding it") {
            return Err(e);
        }
        standings.extend((runners..candidates.len()).map(|candidate| Standing {
            candidate,
            prior: priors[candidate],
            trials: 0,
            held: 0,
        }));
        Ok(standings)
    }

    /// Disturbance number `round`, the same for every candidate: noise of the pose at the tcp, and
    /// the friction coefficient.
    fn disturbance(&self, round: u32) -> (Isometry3<f64>, f64) {
        let mut rng = seed::stream(
            self.global.seed,
            "perturb-v1",
            &self.object.id,
            &self.gripper.name,
            u64::from(round),
        );
        let shift = seed::normal_vector(&mut rng) * self.args.noise_m;
        let turn = seed::normal_vector(&mut rng) * self.args.noise_rad;
        let (friction, _) = seed::normal_pair(&mut rng);
        let tcp = Translation3::new(0.0, 0.0, self.gripper.tcp_z_m);
        let noise = Isometry3::from_parts(shift.into(), UnitQuaternion::new(turn));
        let stated = self.object.friction.unwrap_or(self.protocol.friction);
        (
            tcp * noise * tcp.inverse(),
            stated * (friction * self.args.noise_friction).exp(),
        )
    }
}

fn estimate(s: &Standing, c: &Candidate) -> f64 {
    if s.trials > 0 { s.p_hold() } else { c.p_hold }
}

fn ranked(rank: usize, s: &Standing, c: &Candidate) -> Ranked {
    let o = c.outcome.as_ref();
    Ranked {
        rank,
        grasp: c.grasp.index,
        p_hold: estimate(s, c),
        ci95: (s.trials > 0).then(|| s.interval()),
        trials: s.trials,
        held: s.held,
        class: c.verdict.class().name(),
        outcome: o.map(|o| o.label.name()),
        closing_width_m: c.verdict.closing.map(|w| w.width_m()),
        slip_linear_m: o.and_then(|o| o.slip_linear_m),
        slip_angular_rad: o.and_then(|o| o.slip_angular_rad),
        why: why(c),
    }
}

/// The reasons in words: what geometry objects to, what the trial saw.
fn why(c: &Candidate) -> String {
    let v = &c.verdict;
    let mut reasons = Vec::new();
    if v.collides {
        reasons.push(format!(
            "hand meets the object, {:.1} mm deep",
            1e3 * v.penetration_m
        ));
    }
    if !v.reachable {
        reasons.push("nothing between the pads".to_owned());
    }
    if let Some(w) = v.closing {
        reasons.push(format!("{:.0} mm wide", 1e3 * w.width_m()));
        if !v.centred {
            reasons.push(format!("{:.0} mm off centre", 1e3 * w.offset_m().abs()));
        }
        if !v.aligned {
            let worst = w.angle_rad[0].max(w.angle_rad[1]).to_degrees();
            reasons.push(format!("contact {worst:.0} deg off the closing axis"));
        }
    }
    match &c.outcome {
        None => reasons.push("not tried".to_owned()),
        Some(o) => {
            reasons.push(o.label.name().to_owned());
            if let (Some(m), Some(rad)) = (o.slip_linear_m, o.slip_angular_rad) {
                reasons.push(format!(
                    "slip {:.1} mm, {:.1} deg",
                    1e3 * m,
                    rad.to_degrees()
                ));
            }
        }
    }
    reasons.join(", ")
}

fn listing(top: &[Ranked]) -> String {
    let rows: Vec<Vec<String>> = top
        .iter()
        .map(|r| {
            let raced = if r.trials > 0 {
                format!("{}/{}", r.held, r.trials)
            } else {
                "-".to_owned()
            };
            vec![
                r.rank.to_string(),
                r.grasp.to_string(),
                format!("{:.3}", r.p_hold),
                raced,
                r.class.to_owned(),
                r.why.clone(),
            ]
        })
        .collect();
    aligned(
        &[
            "rank",
            "grasp",
            "p_hold",
            "held under noise",
            "class",
            "why",
        ],
        &rows,
    )
}
