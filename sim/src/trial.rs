//! One trial from start to verdict: close, shake, shake, hold.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use shakedown_objects::penetration::penetration_m;

use crate::approach::start_opening_m;
use crate::outcome::{Label, Outcome, Stage};
use crate::scene::Scene;
use crate::shake::Shake;
use crate::trace::{Frame, TRACE_HZ, Trace};
use crate::world::World;

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
    world: World,
    outcome: Outcome,
    last_touch_s: f64,
    trace: Option<Trace>,
}

impl<'a> Trial<'a> {
    fn new(scene: &'a Scene, object_from_hand: &Isometry3<f64>, traced: bool) -> Self {
        let standoff = Translation3::new(0.0, 0.0, -scene.protocol.standoff_m);
        let object_from_hand = &(object_from_hand * standoff);
        Self {
            scene,
            object_from_hand: *object_from_hand,
            world: World::new(
                scene,
                object_from_hand,
                start_opening_m(scene, object_from_hand),
            ),
            outcome: Outcome {
                label: Label::Held,
                stage: Stage::Start,
                closing_linear_m: None,
                closing_angular_rad: None,
                slip_linear_m: None,
                slip_angular_rad: None,
                width_m: None,
                grip_force_n: None,
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
        let Some(start) = self.world.hand_from_body() else {
            return Label::Diverged;
        };
        self.outcome.stage = Stage::Closing;
        if let Err(label) = self.close() {
            self.measure_closing(&start);
            return label;
        }
        let Some(closed) = self.measure_closing(&start) else {
            return Label::Diverged;
        };
        let label = self.load();
        let Some(end) = self.world.hand_from_body() else {
            return Label::Diverged;
        };
        let (linear, angular) = motion(&closed, &end);
        self.outcome.slip_linear_m = Some(linear);
        self.outcome.slip_angular_rad = Some(angular);
        match label {
            Label::Held if linear > p.max_slip_m || angular > p.max_slip_rad => Label::Slipped,
            label => label,
        }
    }

    /// Closes until both fingers touch and rest, or the time is over.
    fn close(&mut self) -> Result<(), Label> {
        let p = &self.scene.protocol;
        let still = Isometry3::identity();
        self.world.limit_speed(self.scene, p.closing_speed_m_s);
        let mut rest_s = 0.0;
        let steps = (p.closing_time_s / p.dt_s).round() as u32;
        let mut touching = [false; 2];
        for _ in 0..steps {
            self.advance(&still);
            if self.world.hand_from_body().is_none() {
                return Err(Label::Diverged);
            }
            let contacts = self.world.contacts(p.dt_s);
            touching = contacts.map(|c| c.touches);
            let speeds = self.world.fingers().speed_m_s;
            let at_rest = speeds.iter().all(|v| v.abs() < REST_SPEED_M_S);
            rest_s = if at_rest && touching == [true; 2] {
                rest_s + p.dt_s
            } else {
                0.0
            };
            if rest_s >= REST_S {
                break;
            }
        }
        let forces = self.world.contacts(p.dt_s).map(|c| c.force_n.norm());
        self.outcome.grip_force_n = Some((forces[0] + forces[1]) / 2.0);
        self.outcome.width_m = Some(self.world.fingers().width_m());
        if touching == [true; 2] {
            Ok(())
        } else {
            Err(Label::NoContact)
        }
    }

    fn measure_closing(&mut self, start: &Isometry3<f64>) -> Option<Isometry3<f64>> {
        let closed = self.world.hand_from_body()?;
        let (linear, angular) = motion(start, &closed);
        self.outcome.closing_linear_m = Some(linear);
        self.outcome.closing_angular_rad = Some(angular);
        Some(closed)
    }

    /// Both shakes and the hold; `Held` if the fingers never let go.
    fn load(&mut self) -> Label {
        let p = &self.scene.protocol;
        self.world.limit_speed(self.scene, f64::INFINITY);
        let down = self
            .object_from_hand
            .inverse_transform_vector(&Vector3::new(0.0, 0.0, -1.0));
        self.world.release(&(down * p.gravity_m_s2), self.scene.friction);
        self.last_touch_s = self.outcome.sim_s;
        let linear = Shake {
            amplitude: p.shake_linear_m,
            hz: p.shake_linear_hz,
            cycles: p.shake_linear_cycles,
        };
        let angular = Shake {
            amplitude: p.shake_angular_rad,
            hz: p.shake_angular_hz,
            cycles: p.shake_angular_cycles,
        };
        let stages: [(Stage, f64); 3] = [
            (Stage::ShakeLinear, linear.duration_s()),
            (Stage::ShakeAngular, angular.duration_s()),
            (Stage::Hold, p.hold_s),
        ];
        for (stage, duration_s) in stages {
            self.outcome.stage = stage;
            let steps = (duration_s / p.dt_s).round() as u32;
            for k in 1..=steps {
                let t = f64::from(k) * p.dt_s;
                let hand = match stage {
                    Stage::ShakeLinear => {
                        Isometry3::from(Translation3::new(0.0, 0.0, linear.offset(t)))
                    }
                    Stage::ShakeAngular => Isometry3::from_parts(
                        Translation3::identity(),
                        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), angular.offset(t)),
                    ),
                    _ => Isometry3::identity(),
                };
                self.advance(&hand);
                if self.world.hand_from_body().is_none() {
                    return Label::Diverged;
                }
                let touches = self.world.contacts(p.dt_s).map(|c| c.touches);
                if touches != [false; 2] {
                    self.last_touch_s = self.outcome.sim_s;
                } else if self.outcome.sim_s - self.last_touch_s > p.lost_contact_s {
                    return Label::Dropped;
                }
            }
        }
        // Impulses may skip a step between two that press, so the end is the last 20 ms.
        let mut touched = [false; 2];
        let steps = (REST_S / p.dt_s).round() as u32;
        for _ in 0..steps {
            self.advance(&Isometry3::identity());
            for (seen, contact) in touched.iter_mut().zip(self.world.contacts(p.dt_s)) {
                *seen |= contact.touches;
            }
        }
        if touched == [true; 2] {
            Label::Held
        } else {
            Label::Dropped
        }
    }

    fn advance(&mut self, world_from_hand: &Isometry3<f64>) {
        self.world.step(self.scene, world_from_hand);
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
            });
        }
    }
}

/// Distance and angle between two poses.
fn motion(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    let linear = (b.translation.vector - a.translation.vector).norm();
    (linear, a.rotation.angle_to(&b.rotation))
}
