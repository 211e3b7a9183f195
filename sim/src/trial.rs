//! One trial from start to verdict: close, load, verdict.

use nalgebra::{Isometry3, Translation3, Vector3};
use shakedown_objects::penetration::penetration_m;

use crate::approach::start_opening_m;
use crate::load::{Phase, groups};
use crate::outcome::{Label, Outcome, Stage};
use crate::protocol::{SlipReference, SuccessRule};
use crate::scene::Scene;
use crate::trace::{Frame, TRACE_HZ, Trace};
use crate::world::{Drive, ObjectLoad, World, world};

/// The fingers rest when both are slower than this, m/s.
const REST_SPEED_M_S: f64 = 0.001;
/// They must rest this long before closing ends early, s.
const REST_S: f64 = 0.02;

/// Tries one grasp. Deterministic: the same scene and pose give the same bits on any thread.
pub fn run_trial(scene: &Scene, object_from_hand: &Isometry3<f64>) -> Outcome {
    Trial::new(scene, object_from_hand, false).run().0
}

/// Like [`run_trial`], with the recorded motion. Recording changes no bit of the outcome.
pub fn run_trial_traced(scene: &Scene, object_from_hand: &Isometry3<f64>) -> (Outcome, Trace) {
    Trial::new(scene, object_from_hand, true).run()
}

struct Trial<'a> {
    scene: &'a Scene,
    object_from_hand: Isometry3<f64>,
    world: Box<dyn World>,
    drive: Drive,
    outcome: Outcome,
    last_touch_s: f64,
    trace: Option<Trace>,
}

impl<'a> Trial<'a> {
    fn new(scene: &'a Scene, grasp: &Isometry3<f64>, traced: bool) -> Self {
        let standoff = Translation3::new(0.0, 0.0, -scene.protocol.standoff_m);
        let object_from_hand = grasp * standoff;
        Self {
            scene,
            object_from_hand,
            world: fresh_world(scene, &object_from_hand),
            drive: Drive {
                force_n: scene.grip_force_n,
                hold: None,
            },
            outcome: Outcome {
                label: Label::Held,
                stage: Stage::Start,
                closing_linear_m: None,
                closing_angular_rad: None,
                closed_object_from_hand: None,
                slip_linear_m: None,
                slip_angular_rad: None,
                width_m: None,
                grip_force_n: None,
                margin_g: None,
                sim_s: 0.0,
                steps: 0,
            },
            last_touch_s: 0.0,
            trace: traced.then(Trace::default),
        }
    }

    fn run(mut self) -> (Outcome, Trace) {
        self.outcome.label = self.judge();
        self.record(true);
        (self.outcome, self.trace.unwrap_or_default())
    }

    fn judge(&mut self) -> Label {
        let p = &self.scene.protocol;
        self.record(false);
        let depth = penetration_m(
            &self.scene.surface,
            &self.scene.hand,
            &self.object_from_hand,
        );
        if depth.is_some_and(|d| d > p.initial_penetration_max_m) {
            return Label::InitialCollision;
        }
        let groups = groups(p, self.scene.mass_kg, &self.object_from_hand);
        for (k, phases) in groups.iter().enumerate() {
            if k > 0 {
                self.world = fresh_world(self.scene, &self.object_from_hand);
            }
            let label = self.judge_group(phases);
            if label != Label::Held {
                return label;
            }
        }
        Label::Held
    }

    /// Closes and loads once.
    fn judge_group(&mut self, phases: &[Phase]) -> Label {
        let Some(start) = self.world.hand_from_body() else {
            return Label::Diverged;
        };
        self.outcome.stage = Stage::Closing;
        let closing = self.close();
        let Some(closed) = self.measure_closing(&start) else {
            return Label::Diverged;
        };
        if let Err(label) = closing {
            return label;
        }
        let reference = match self.scene.protocol.slip_reference {
            SlipReference::Closed => closed,
            SlipReference::Start => start,
        };
        let label = self.load(phases, &reference);
        let Some(end) = self.world.hand_from_body() else {
            return Label::Diverged;
        };
        let (linear, angular) = motion(&reference, &end);
        self.outcome.slip_linear_m = Some(linear);
        self.outcome.slip_angular_rad = Some(angular);
        match label {
            Label::Held => self.verdict(linear, angular),
            label => label,
        }
    }

    /// Closes until both fingers touch and rest, or the time is over; then squeezes.
    fn close(&mut self) -> Result<(), Label> {
        let p = &self.scene.protocol;
        let still = Isometry3::identity();
        let full_n = self.scene.grip_force_n;
        let soft_n = if p.closing_force_n > 0.0 {
            p.closing_force_n
        } else {
            full_n
        };
        self.drive = Drive {
            force_n: soft_n,
            hold: None,
        };
        self.world.freeze(p.closing_object_frozen);
        self.world
            .limit_speed(self.scene, soft_n, p.closing_speed_m_s);
        let mut rest_s = 0.0;
        let steps = (p.closing_time_s / p.dt_s).round() as u32;
        let mut touching = [false; 2];
        for _ in 0..steps {
            self.advance(&still, &Vector3::zeros());
            if self.world.hand_from_body().is_none() {
                return Err(Label::Diverged);
            }
            touching = self.world.contacts().map(|c| c.touches);
            let speeds = self.world.fingers().speed_m_s;
            let at_rest = speeds.iter().all(|v| v.abs() < REST_SPEED_M_S);
            rest_s = if at_rest && touching == [true; 2] {
                rest_s + p.dt_s
            } else {
                0.0
            };
            if p.closing_ends_at_rest && rest_s >= REST_S {
                break;
            }
        }
        let ramp = (p.grip_ramp_s / p.dt_s).round() as u32;
        if ramp > 0 {
            self.outcome.stage = Stage::Squeeze;
        }
        for k in 1..=ramp {
            self.drive.force_n = soft_n + (full_n - soft_n) * f64::from(k) / f64::from(ramp);
            self.world
                .limit_speed(self.scene, self.drive.force_n, p.closing_speed_m_s);
            self.advance(&still, &Vector3::zeros());
            touching = self.world.contacts().map(|c| c.touches);
        }
        self.drive.force_n = full_n;
        let forces = self.world.contacts().map(|c| c.force_n.norm());
        let fingers = self.world.fingers();
        self.outcome.grip_force_n = Some((forces[0] + forces[1]) / 2.0);
        self.outcome.width_m = Some(fingers.width_m());
        if p.hold_stiffness_n_m > 0.0 {
            self.drive.hold = Some((
                fingers.position_m,
                p.hold_stiffness_n_m,
                p.hold_damping_n_s_m,
            ));
        }
        if touching == [true; 2] || p.success == SuccessRule::OriginNear {
            Ok(())
        } else {
            Err(Label::NoContact)
        }
    }

    fn measure_closing(&mut self, start: &Isometry3<f64>) -> Option<Isometry3<f64>> {
        let closed = self.world.hand_from_body()?;
        let (linear, angular) = motion(start, &closed);
        self.outcome.closing_linear_m.get_or_insert(linear);
        self.outcome.closing_angular_rad.get_or_insert(angular);
        self.outcome
            .closed_object_from_hand
            .get_or_insert(self.scene.object_from_body() * closed.inverse());
        Some(closed)
    }

    /// All phases; `Held` if nothing ended them early.
    fn load(&mut self, phases: &[Phase], reference: &Isometry3<f64>) -> Label {
        let p = &self.scene.protocol;
        self.world.limit_speed(self.scene, 0.0, 1.0);
        self.world.freeze(false);
        let down = self
            .object_from_hand
            .inverse_transform_vector(&Vector3::new(0.0, 0.0, -1.0));
        self.world
            .release(&(down * p.gravity_m_s2), self.scene.friction);
        self.last_touch_s = self.outcome.sim_s;
        let mut base = Isometry3::identity();
        for phase in phases {
            self.outcome.stage = phase.stage;
            let steps = (phase.duration_s / p.dt_s).round() as u32;
            for k in 1..=steps {
                let hand = base * phase.motion.at(f64::from(k) * p.dt_s);
                self.advance(&hand, &phase.object_force_n);
                if let Err(label) = self.check(reference) {
                    // A level of hardness that was survived makes the grasp one that held.
                    let survived = self.outcome.margin_g.is_some() && label != Label::Diverged;
                    return if survived { Label::Held } else { label };
                }
            }
            base *= phase.motion.at(phase.duration_s);
            self.outcome.margin_g = phase.level_g.or(self.outcome.margin_g);
        }
        if p.success != SuccessRule::BothFingersTouch {
            return Label::Held;
        }
        // Impulses may skip a step between two that press, so the end is the last 20 ms.
        let mut touched = [false; 2];
        let force = phases.last().map_or(Vector3::zeros(), |l| l.object_force_n);
        for _ in 0..(REST_S / p.dt_s).round() as u32 {
            self.advance(&base, &force);
            for (seen, contact) in touched.iter_mut().zip(self.world.contacts()) {
                *seen |= contact.touches;
            }
        }
        if touched == [true; 2] && self.world.fingers().width_m() >= p.opening_min_m {
            Label::Held
        } else {
            Label::Dropped
        }
    }

    /// Is it lost already?
    fn check(&mut self, reference: &Isometry3<f64>) -> Result<(), Label> {
        let p = &self.scene.protocol;
        let now = self.world.hand_from_body().ok_or(Label::Diverged)?;
        let touches = self.world.contacts().map(|c| c.touches);
        if touches != [false; 2] {
            self.last_touch_s = self.outcome.sim_s;
        }
        match p.success {
            SuccessRule::OriginNear => Ok(()),
            SuccessRule::MovedLess => {
                let (linear, angular) = motion(reference, &now);
                if linear <= p.max_slip_m && angular <= p.max_slip_rad {
                    Ok(())
                } else if touches == [false; 2] {
                    Err(Label::Dropped)
                } else {
                    Err(Label::Slipped)
                }
            }
            SuccessRule::BothFingersTouch => {
                if self.outcome.sim_s - self.last_touch_s > p.lost_contact_s {
                    Err(Label::Dropped)
                } else {
                    Ok(())
                }
            }
        }
    }

    /// The success rule, for a load that came to its end.
    fn verdict(&self, linear_m: f64, angular_rad: f64) -> Label {
        let p = &self.scene.protocol;
        if p.success == SuccessRule::OriginNear {
            let hand = self.world.world_from_hand();
            let apart = self.world.world_from_object().translation.vector - hand.translation.vector;
            return if apart.norm() < p.origin_distance_max_m {
                Label::Held
            } else {
                Label::Dropped
            };
        }
        let within = linear_m <= p.max_slip_m && angular_rad <= p.max_slip_rad;
        if within || self.outcome.margin_g.is_some() {
            Label::Held
        } else {
            Label::Slipped
        }
    }

    fn advance(&mut self, world_from_hand: &Isometry3<f64>, object_force_n: &Vector3<f64>) {
        let load = ObjectLoad {
            force_n: *object_force_n,
            torque_n_m: Vector3::zeros(),
        };
        self.world
            .step(self.scene, world_from_hand, &self.drive, &load);
        self.outcome.steps += 1;
        self.outcome.sim_s = f64::from(self.outcome.steps) * self.scene.protocol.dt_s;
        self.record(false);
    }

    fn record(&mut self, is_last: bool) {
        let Some(trace) = &mut self.trace else {
            return;
        };
        let t_s = self.outcome.sim_s;
        let due = trace.frames.len() as f64 / TRACE_HZ;
        let is_new = trace.frames.last().is_none_or(|f| f.t_s < t_s);
        if t_s + 1e-9 >= due || (is_last && is_new) {
            trace.frames.push(Frame {
                t_s,
                world_from_hand: self.world.world_from_hand(),
                finger_m: self.world.fingers().position_m,
                world_from_object: self.world.world_from_object(),
                contact_m: self.world.contacts().map(|c| c.centre_m),
                contact_force_n: self.world.contacts().map(|c| c.force_n),
            });
        }
    }
}

fn fresh_world(scene: &Scene, object_from_hand: &Isometry3<f64>) -> Box<dyn World> {
    let opening_m = start_opening_m(scene, object_from_hand);
    world(scene, object_from_hand, opening_m)
}

/// Distance and angle between two poses.
fn motion(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    let linear = (b.translation.vector - a.translation.vector).norm();
    (linear, a.rotation.angle_to(&b.rotation))
}
