//! Runs one object: classify, try, and turn both into rows.

use std::sync::Mutex;

use cpu_time::ThreadTime;
use rayon::prelude::*;
use shakedown_classifier::profile::profile;
use shakedown_classifier::{Verdict, classify};
use shakedown_gripper_assets::Grasp;
use shakedown_metrics::hold_model::HoldJudge;
use shakedown_metrics::wrench_space::{Friction, predicted_quality};
use shakedown_objects::Object;
use shakedown_report::TrialRow;
use shakedown_report::replay::Replay;
use shakedown_report::trials::{GeometryCells, PhysicsCells};
use shakedown_report::view::ViewMesh;
use shakedown_sim::{Outcome, Scene, Trace, run_trial, run_trial_traced};

use crate::args::Record;
use crate::failure::Failure;
use crate::interrupt;
use crate::settings::Settings;

/// What trials cost.
#[derive(Debug, Clone, Copy, Default)]
pub struct Cost {
    pub trials: u64,
    pub steps: u64,
    pub cpu_s: f64,
}

/// An object ready for its grasps.
pub struct Bench {
    pub object: Object,
    scene: Option<Scene>,
    judge: Option<HoldJudge>,
}

impl Bench {
    /// # Errors
    /// An object without a usable collision shape.
    pub fn new(object: Object, settings: &Settings) -> Result<Self, Failure> {
        let scene = if settings.physics {
            let cache = settings.cache.as_deref();
            Some(Scene::new(
                &object,
                &settings.gripper,
                &settings.protocol,
                None,
                cache,
            )?)
        } else {
            None
        };
        let judge = scene
            .as_ref()
            .filter(|_| settings.geometry && HoldJudge::reads(&settings.protocol))
            .map(|s| HoldJudge::new(&object, s.mass_kg, true));
        Ok(Self {
            object,
            scene,
            judge,
        })
    }

    /// Known where both stages ran and the model was fitted to trials of this protocol.
    fn p_hold(
        &self,
        settings: &Settings,
        grasp: &Grasp,
        verdict: Option<&Verdict>,
        outcome: Option<&Outcome>,
    ) -> Option<f64> {
        let judge = self.judge.as_ref()?;
        let pose = &grasp.object_from_hand;
        Some(judge.p_hold(
            &settings.hand,
            &self.object.surface,
            pose,
            verdict?,
            Some(outcome?),
        ))
    }

    /// Epsilon and volume of the wrench space, at the friction of the trial.
    fn wrench(
        &self,
        settings: &Settings,
        grasp: &Grasp,
        outcome: Option<&Outcome>,
    ) -> Option<[f64; 2]> {
        if !settings.wrench {
            return None;
        }
        let closed = outcome.and_then(|o| o.closed_object_from_hand);
        let pose = closed.unwrap_or(grasp.object_from_hand);
        let protocol = &settings.protocol;
        let stated = self.object.friction.unwrap_or(protocol.friction) * protocol.friction_scale;
        let friction = Friction {
            coefficient: self.scene.as_ref().map_or(stated, |s| s.friction),
            ..Friction::default()
        };
        let surface = &self.object.surface;
        let quality = predicted_quality(
            &profile(&settings.hand, surface, &pose),
            friction,
            &pose.inverse_transform_point(&self.object.mass.com_m),
            surface.mesh().extents().max(),
        );
        Some([quality.epsilon, quality.volume])
    }

    /// The object as the report shows it.
    pub fn view(&self) -> ViewMesh {
        let mesh = self.object.surface.mesh();
        let vertices: Vec<[f64; 3]> = mesh.vertices().iter().map(|v| v.coords.into()).collect();
        let view = ViewMesh::new(&self.object.id, &vertices, mesh.faces());
        let pieces: Vec<Vec<[f64; 3]>> = self
            .scene
            .iter()
            .flat_map(Scene::pieces)
            .map(|piece| piece.iter().map(|c| c.coords.into()).collect())
            .collect();
        view.with_pieces(&pieces)
    }

    /// Rows of a chunk of grasps in their order, the same for any number of threads; `None` for
    /// those that an interrupt kept from starting.
    pub fn rows(
        &self,
        settings: &Settings,
        grasps: &[Grasp],
        record: Record,
        cost: &Mutex<Cost>,
        done: impl Fn() + Sync,
    ) -> Vec<Option<(TrialRow, Option<Replay>)>> {
        grasps
            .par_iter()
            .map(|grasp| {
                if interrupt::requested() {
                    return None;
                }
                let verdict = settings.geometry.then(|| {
                    let pose = &grasp.object_from_hand;
                    classify(
                        &settings.hand,
                        &self.object.surface,
                        pose,
                        &settings.thresholds,
                    )
                });
                let trial = self
                    .scene
                    .as_ref()
                    .map(|scene| try_grasp(scene, grasp, record, cost));
                done();
                let (outcome, trace) = trial.unzip();
                let replay = trace
                    .flatten()
                    .and_then(|t| outcome.map(|o| replay(&self.object.id, grasp.index, &o, &t)));
                let p_hold = self.p_hold(settings, grasp, verdict.as_ref(), outcome.as_ref());
                let row = TrialRow {
                    p_hold,
                    wrench: self.wrench(settings, grasp, outcome.as_ref()),
                    ..trial_row(grasp, verdict.as_ref(), outcome.as_ref())
                };
                Some((row, replay))
            })
            .collect()
    }
}

fn try_grasp(
    scene: &Scene,
    grasp: &Grasp,
    record: Record,
    cost: &Mutex<Cost>,
) -> (Outcome, Option<Trace>) {
    let start = ThreadTime::now();
    let (outcome, trace) = if record == Record::None {
        (run_trial(scene, &grasp.object_from_hand), None)
    } else {
        let (outcome, trace) = run_trial_traced(scene, &grasp.object_from_hand);
        let wanted = record == Record::All || !outcome.is_held();
        (outcome, wanted.then_some(trace))
    };
    let cpu_s = start.elapsed().as_secs_f64();
    let mut cost = cost.lock().expect("nobody panics while holding it");
    cost.trials += 1;
    cost.steps += u64::from(outcome.steps);
    cost.cpu_s += cpu_s;
    (outcome, trace)
}

fn trial_row(grasp: &Grasp, verdict: Option<&Verdict>, outcome: Option<&Outcome>) -> TrialRow {
    TrialRow {
        p_hold: None,
        wrench: None,
        grasp: grasp.index,
        score: grasp.score,
        label: grasp.label,
        pose: numbers(&grasp.object_from_hand),
        width_m: grasp.width_m,
        geometry: verdict.map(|v| GeometryCells {
            class: v.class().name(),
            flags: [v.collides, v.reachable, v.closes, v.centred, v.aligned],
            penetration_m: v.penetration_m,
            closing_width_m: v.closing.map(|c| c.width_m()),
        }),
        physics: outcome.map(|o| PhysicsCells {
            outcome: o.label.name(),
            held: o.is_held(),
            measurements: [
                o.slip_linear_m,
                o.slip_angular_rad,
                o.closing_linear_m,
                o.closing_angular_rad,
                o.grip_force_n,
            ],
            sim_s: o.sim_s,
            stage: o.stage.name(),
            margin_g: o.margin_g,
        }),
    }
}

fn numbers(pose: &nalgebra::Isometry3<f64>) -> [f64; 7] {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
}

fn replay(object: &str, grasp: u64, outcome: &Outcome, trace: &Trace) -> Replay {
    let frames = trace.frames.iter().map(|f| {
        let mut numbers = vec![f.t_s];
        numbers.extend(self::numbers(&f.world_from_hand));
        numbers.extend(self::numbers(&f.world_from_object));
        numbers.extend(f.finger_m);
        for (point, force) in f.contact_m.iter().zip(&f.contact_force_n) {
            numbers.extend(point.iter().chain(force.iter()));
        }
        std::array::from_fn(|i| numbers[i] as f32)
    });
    Replay::new(object, grasp, outcome.label.name(), frames)
}
