//! What a trained model makes of noise, and what it should have made: the second stage of a training.

use std::sync::Mutex;

use nalgebra::Isometry3;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use shakedown_classifier::{Class, HandModel, Thresholds, Verdict, classify};
use shakedown_gripper_assets::Gripper;
use shakedown_metrics::hold_model::HoldJudge;
use shakedown_objects::{Object, Surface};
use shakedown_sampler::{FlowModel, seed};
use shakedown_sim::{Scene, run_trial};
use shakedown_trainer::TaughtPath;

use crate::args_judging::TrainArgs;
use crate::failure::Failure;

/// The search for a good grasp close to a bad one: rings, tries in each, and the standard
/// deviations of the largest along and about each axis of the hand at its tcp.
const RINGS: u32 = 6;
const TRIES_PER_RING: u32 = 10;
const RING_M: f64 = 0.012;
const RING_RAD: f64 = 0.25;

/// No path that is taught begins within this many steps of the end.
const LATEST_STEPS: usize = 2;

/// What is approved of on one object: by geometry, and, with a scene, by the trial as well.
pub struct Approval<'a> {
    hand: HandModel,
    judge: HoldJudge,
    surface: &'a Surface,
    least_p_hold: f64,
    scene: Option<Scene>,
}

impl<'a> Approval<'a> {
    /// # Errors
    /// A hand with a flat part.
    pub fn new(object: &'a Object, gripper: &Gripper, least_p_hold: f64) -> Result<Self, Failure> {
        Ok(Self {
            hand: HandModel::new(gripper, gripper.opening_max_m)?,
            judge: HoldJudge::new(object, object.mass.mass_kg, false),
            surface: &object.surface,
            least_p_hold,
            scene: None,
        })
    }

    /// Approves only of what also holds in a trial.
    pub fn with_trial(self, scene: Scene) -> Self {
        Self {
            scene: Some(scene),
            ..self
        }
    }

    fn verdict(&self, pose: &Isometry3<f64>) -> Verdict {
        classify(&self.hand, self.surface, pose, &Thresholds::default())
    }

    fn likely(&self, pose: &Isometry3<f64>, verdict: &Verdict) -> bool {
        let p = self
            .judge
            .p_hold(&self.hand, self.surface, pose, verdict, None);
        p >= self.least_p_hold
    }

    /// Is it as likely to hold as is asked?
    pub fn is_likely(&self, pose: &Isometry3<f64>) -> bool {
        self.likely(pose, &self.verdict(pose))
    }

    /// No collision, within reach, as likely to hold as is asked, and held if it is tried.
    pub fn is_good(&self, pose: &Isometry3<f64>) -> bool {
        let verdict = self.verdict(pose);
        let held = |scene| run_trial(scene, pose).is_held();
        verdict.class() == Class::Optimal
            && self.likely(pose, &verdict)
            && self.scene.as_ref().is_none_or(held)
    }
}

/// The model of the first stage.
pub struct Teacher {
    model: Mutex<FlowModel>,
    paths: u64,
    from_time: f64,
}

impl Teacher {
    /// The model of `--rectify`, if that is asked for.
    ///
    /// # Errors
    /// A directory without a model, a time out of range.
    pub fn load(args: &TrainArgs) -> Result<Option<Self>, Failure> {
        if !(0.0..1.0).contains(&args.rectify_from) {
            return Err(Failure::usage("--rectify-from is a time from 0 to below 1"));
        }
        let Some(directory) = &args.rectify else {
            return Ok(None);
        };
        let model = FlowModel::load(directory, args.ort.as_deref())?;
        let at = args.rectify_from * model.card.steps as f64;
        if (at - at.round()).abs() > 1e-9 {
            return Err(Failure::usage(format!(
                "--rectify-from {} lies between two of the {} steps of {}",
                args.rectify_from,
                model.card.steps,
                directory.display()
            )));
        }
        Ok(Some(Self {
            model: Mutex::new(model),
            paths: args.paths,
            from_time: args.rectify_from,
        }))
    }

    /// Paths on an object, each judged, and where it ended badly with a good grasp close by.
    ///
    /// # Errors
    /// A network that fails.
    pub fn paths(
        &self,
        object: &Object,
        gripper: &Gripper,
        approval: &Approval<'_>,
        run_seed: u64,
    ) -> Result<Vec<TaughtPath>, Failure> {
        let mut model = self.model.lock().expect("nobody panics while holding it");
        let steps = model.card.steps;
        let paths = model.paths(object, gripper, self.paths, run_seed, None)?;
        drop(model);
        let first = (self.from_time * steps as f64).round() as usize;
        // From noise on there is one beginning. On the way there are several, so that the student
        // sees where the teacher is late, too; not the last steps, which leave no time.
        let beginnings = if first == 0 {
            1
        } else {
            steps.saturating_sub(LATEST_STEPS + first).max(1)
        };
        Ok(paths
            .into_par_iter()
            .enumerate()
            .map(|(i, path)| {
                let pose = &path.object_from_hand;
                let is_good = approval.is_good(pose);
                let mut rng = seed::stream(run_seed, "close-by-v1", &object.id, "", i as u64);
                let begin = first + i % beginnings;
                TaughtPath {
                    time: begin as f32 / steps as f32,
                    from: path.states[begin],
                    end: path.states[steps],
                    is_good,
                    close_by: if is_good {
                        None
                    } else {
                        close_by(pose, gripper.tcp_z_m, approval, &mut rng)
                    },
                }
            })
            .collect())
    }
}

/// A good grasp close to a bad one: the first found within rings of growing size.
fn close_by(
    pose: &Isometry3<f64>,
    tcp_z_m: f64,
    approval: &Approval<'_>,
    rng: &mut ChaCha8Rng,
) -> Option<Isometry3<f64>> {
    let tcp = Isometry3::translation(0.0, 0.0, tcp_z_m);
    (1..=RINGS * TRIES_PER_RING).find_map(|i| {
        let share = f64::from(i.div_ceil(TRIES_PER_RING)) / f64::from(RINGS);
        let shift = seed::normal_vector(rng) * (share * RING_M);
        let turn = seed::normal_vector(rng) * (share * RING_RAD);
        let tried = pose * tcp * Isometry3::new(shift, turn) * tcp.inverse();
        approval.is_good(&tried).then_some(tried)
    })
}
