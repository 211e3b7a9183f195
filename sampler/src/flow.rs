//! From noise to grasps: integrates a velocity field on R3 x SO(3).
//!
//! RFMGrasp: `omega = (xi - xi^T) / 2` (eq. 12), `R <- R exp(omega dt)` (eq. 16),
//! `t <- t + dt v` (eq. 15), from time 0 to 1. Angular velocities are in the body frame.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::card::{Integrator, ModelError};

/// One pose on its way, in the normalised frame of the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlowSample {
    /// Rotation.
    pub rotation: UnitQuaternion<f64>,
    /// Translation, normalised units.
    pub translation: Vector3<f64>,
}

/// What the network returns for one sample: the raw 3 x 3 matrix, not yet projected, and the
/// translation velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Velocity {
    /// Raw matrix `xi`.
    pub rotation: Matrix3<f64>,
    /// Normalised units per unit time.
    pub translation: Vector3<f64>,
}

/// A velocity field over poses: a network bound to one object, or a formula in a test.
pub trait VelocityField {
    /// Velocities of all samples at `time`, in their order.
    ///
    /// # Errors
    /// A network that fails or returns non-finite numbers.
    fn velocities(
        &mut self,
        samples: &[FlowSample],
        time: f64,
    ) -> Result<Vec<Velocity>, ModelError>;
}

/// The skew projection, as a body-frame angular velocity (eq. 12).
pub fn angular_velocity(xi: &Matrix3<f64>) -> Vector3<f64> {
    let w = (xi - xi.transpose()) * 0.5;
    Vector3::new(w[(2, 1)], w[(0, 2)], w[(1, 0)])
}

/// Carries all samples from time 0 to 1 in `steps` equal steps, batch by batch.
///
/// # Errors
/// Those of the field.
///
/// # Panics
/// If `steps` is 0.
pub fn integrate(
    field: &mut impl VelocityField,
    samples: &mut [FlowSample],
    steps: usize,
    integrator: Integrator,
    batch: usize,
) -> Result<(), ModelError> {
    let mut way = Way::new(steps, integrator, batch);
    for _ in 0..steps {
        way.step(field, samples)?;
    }
    Ok(())
}

/// Samples on their way from time 0 to 1, step by step.
pub struct Way {
    steps: usize,
    integrator: Integrator,
    batch: usize,
    /// Steps that are done.
    done: usize,
    /// Of the step before: angular velocities, and those of the translation.
    before: Vec<(Vector3<f64>, Vector3<f64>)>,
}

impl Way {
    /// A way of `steps` equal steps, `batch` samples at once.
    ///
    /// # Panics
    /// If `steps` is 0.
    pub fn new(steps: usize, integrator: Integrator, batch: usize) -> Self {
        assert!(steps > 0, "at least one step");
        Self {
            steps,
            integrator,
            batch: batch.max(1),
            done: 0,
            before: Vec::new(),
        }
    }

    /// The next step of all samples, which are the same in every step.
    ///
    /// # Errors
    /// Those of the field.
    pub fn step(
        &mut self,
        field: &mut impl VelocityField,
        samples: &mut [FlowSample],
    ) -> Result<(), ModelError> {
        let dt = 1.0 / self.steps as f64;
        let time = self.done as f64 * dt;
        let mut now = Vec::with_capacity(samples.len());
        for chunk in samples.chunks_mut(self.batch) {
            let first = now.len();
            now.extend(field.velocities(chunk, time)?.iter().map(split));
            let here = &now[first..];
            match self.integrator {
                Integrator::Euler => advance(chunk, here.iter().copied(), dt),
                Integrator::Heun => {
                    let mut ahead = chunk.to_vec();
                    advance(&mut ahead, here.iter().copied(), dt);
                    let there = field.velocities(&ahead, time + dt)?;
                    let mean = here.iter().zip(there.iter().map(split));
                    let mean = mean.map(|(a, b)| ((a.0 + b.0) * 0.5, (a.1 + b.1) * 0.5));
                    advance(chunk, mean, dt);
                }
                Integrator::AdamsBashforth => {
                    let before = match self.done {
                        0 => here,
                        _ => &self.before[first..],
                    };
                    let next = here.iter().zip(before);
                    let next = next.map(|(a, b)| (a.0 * 1.5 - b.0 * 0.5, a.1 * 1.5 - b.1 * 0.5));
                    advance(chunk, next, dt);
                }
            }
        }
        self.before = now;
        self.done += 1;
        Ok(())
    }
}

/// Angular velocity and velocity of the translation.
fn split(v: &Velocity) -> (Vector3<f64>, Vector3<f64>) {
    (angular_velocity(&v.rotation), v.translation)
}

fn advance(
    samples: &mut [FlowSample],
    velocities: impl Iterator<Item = (Vector3<f64>, Vector3<f64>)>,
    dt: f64,
) {
    for (s, (omega, v)) in samples.iter_mut().zip(velocities) {
        s.rotation *= UnitQuaternion::new(omega * dt);
        s.translation += v * dt;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// v = a - t pulls the translation towards a; a fixed xi with a symmetric part spins.
    struct Spring {
        target: Vector3<f64>,
        spin: Vector3<f64>,
    }

    impl VelocityField for Spring {
        fn velocities(
            &mut self,
            samples: &[FlowSample],
            _: f64,
        ) -> Result<Vec<Velocity>, ModelError> {
            let rotation = self.spin.cross_matrix() + Matrix3::from_diagonal_element(3.0);
            Ok(samples
                .iter()
                .map(|s| Velocity {
                    rotation,
                    translation: self.target - s.translation,
                })
                .collect())
        }
    }

    fn start() -> FlowSample {
        FlowSample {
            rotation: UnitQuaternion::from_euler_angles(0.3, -0.4, 2.0),
            translation: Vector3::new(1.0, -2.0, 0.5),
        }
    }

    #[test]
    fn the_end_pose_is_the_closed_form_and_the_second_orders_converge_faster() {
        let mut field = Spring {
            target: Vector3::new(0.2, 0.1, -0.3),
            spin: Vector3::new(0.5, -1.0, 0.7),
        };
        let s = start();
        let exact_t = field.target + (s.translation - field.target) * (-1.0f64).exp();
        let exact_r = s.rotation * UnitQuaternion::new(field.spin);
        let mut error = |steps, integrator| {
            let mut samples = [s; 3];
            integrate(&mut field, &mut samples, steps, integrator, 2).unwrap();
            assert!(samples.iter().all(|x| *x == samples[0]));
            assert!(samples[0].rotation.angle_to(&exact_r) < 1e-12);
            (samples[0].translation - exact_t).norm()
        };
        let euler = [error(20, Integrator::Euler), error(40, Integrator::Euler)];
        let heun = [error(20, Integrator::Heun), error(40, Integrator::Heun)];
        let adams = [20, 40].map(|n| error(n, Integrator::AdamsBashforth));
        assert!((euler[0] / euler[1] - 2.0).abs() < 0.1, "{euler:?}");
        assert!((heun[0] / heun[1] - 4.0).abs() < 0.3, "{heun:?}");
        assert!((adams[0] / adams[1] - 4.0).abs() < 0.3, "{adams:?}");
        // Euler has its own closed form: (1 - dt)^n.
        let mut samples = [s];
        integrate(&mut field, &mut samples, 20, Integrator::Euler, 64).unwrap();
        let discrete = field.target + (s.translation - field.target) * 0.95f64.powi(20);
        assert!((samples[0].translation - discrete).norm() < 1e-12);
    }
}
