//! How does a pad resist a twist? A rubber pad touches in a patch, never in a point.
//!
//! rapier limits the twist of a contact by the spread of its points, so a ball between two pads
//! would spin freely. The missing part of the stated lever arm is added here, as the soft-finger
//! contact of Cutkosky and Howe ("Human grasp choice and robotic grasp analysis", 1990): a torque
//! about the pad's normal up to friction x force x lever arm. It sticks elastically (a bristle, as
//! in the LuGre model) so that a load below the limit does not creep.

use nalgebra::Vector3;

use crate::world::FingerContact;

/// State of the torsional bristles of both fingers.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Torsion {
    lever_m: f64,
    twist_rad: [f64; 2],
}

impl Torsion {
    pub(crate) fn new(lever_m: f64) -> Self {
        Self {
            lever_m,
            twist_rad: [0.0; 2],
        }
    }

    pub(crate) fn is_active(&self) -> bool {
        self.lever_m > 0.0
    }

    /// Torque on the object in the next step, N m, world axes. `own_lever_m` is the lever arm that
    /// the engine gives each finger's contact by itself; `inertia` is the object's moment
    /// of inertia about the closing axis, `spin` its angular velocity relative to the hand.
    pub(crate) fn torque_n_m(
        &mut self,
        contacts: &[FingerContact; 2],
        own_lever_m: &[f64; 2],
        friction: f64,
        inertia_kg_m2: f64,
        spin_rad_s: &Vector3<f64>,
        dt_s: f64,
    ) -> Vector3<f64> {
        // As stiff and damped as an explicit spring shared by two fingers stays stable.
        let stiffness = 0.4 * inertia_kg_m2 / (dt_s * dt_s);
        let damping = 0.4 * inertia_kg_m2 / dt_s;
        let mut total = Vector3::zeros();
        for ((twist, contact), own_lever_m) in
            self.twist_rad.iter_mut().zip(contacts).zip(own_lever_m)
        {
            let force = contact.force_n.norm();
            if force == 0.0 {
                *twist = 0.0;
                continue;
            }
            let normal = contact.force_n / force;
            let limit = friction * force * (self.lever_m - own_lever_m).max(0.0);
            let rate = spin_rad_s.dot(&normal);
            *twist += rate * dt_s;
            let wanted = stiffness * *twist + damping * rate;
            let torque = wanted.clamp(-limit, limit);
            if torque != wanted {
                // It slides: the bristle keeps what the limit can hold.
                *twist = twist.clamp(-limit / stiffness, limit / stiffness);
            }
            total -= normal * torque;
        }
        total
    }
}
