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

fn moved(sample: &FlowSample, omega: &Vector3<f64>, v: &Vector3<f64>, dt: f64) -> FlowSample {
    FlowSample {
        rotation: sample.rotation * UnitQuaternion::new(omega * dt),
        translation: sample.translation + v * dt,
    }
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
    assert!(steps > 0, "at least one step");
    for k in 0..steps {
        step(field, samples, k, steps, integrator, batch)?;
    }
    Ok(())
}

/// Step number `k` of the `steps` equal steps from time 0 to 1.
///
/// # Errors
/// Those of the field.
pub fn step(
    field: &mut impl VelocityField,
    samples: &mut [FlowSample],
    k: usize,
    steps: usize,
    integrator: Integrator,
    batch: usize,
) -> Result<(), ModelError> {
    let dt = 1.0 / steps as f64;
    let time = k as f64 * dt;
    for chunk in samples.chunks_mut(batch.max(1)) {
        let here = field.velocities(chunk, time)?;
        match integrator {
            Integrator::Euler => {
                for (s, v) in chunk.iter_mut().zip(&here) {
                    *s = moved(s, &angular_velocity(&v.rotation), &v.translation, dt);
                }
            }
            Integrator::Heun => {
                let ahead: Vec<FlowSample> = chunk
                    .iter()
                    .zip(&here)
                    .map(|(s, v)| moved(s, &angular_velocity(&v.rotation), &v.translation, dt))
                    .collect();
                let there = field.velocities(&ahead, time + dt)?;
                for ((s, a), b) in chunk.iter_mut().zip(&here).zip(&there) {
                    let omega =
                        (angular_velocity(&a.rotation) + angular_velocity(&b.rotation)) * 0.5;
                    let v = (a.translation + b.translation) * 0.5;
                    *s = moved(s, &omega, &v, dt);
                }
            }
        }
    }
    Ok(())
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
    fn the_end_pose_is_the_closed_form_and_heun_converges_faster() {
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
        assert!((euler[0] / euler[1] - 2.0).abs() < 0.1, "{euler:?}");
        assert!((heun[0] / heun[1] - 4.0).abs() < 0.3, "{heun:?}");
        // Euler has its own closed form: (1 - dt)^n.
        let mut samples = [s];
        integrate(&mut field, &mut samples, 20, Integrator::Euler, 64).unwrap();
        let discrete = field.target + (s.translation - field.target) * 0.95f64.powi(20);
        assert!((samples[0].translation - discrete).norm() < 1e-12);
    }
}
