//! How large is the patch in which a pad touches?
//!
//! An engine puts a flat contact's force into its corners, where it resists a twist about the normal
//! twice as much as the even pressure of a rubber pad does. The points that the solver sees are
//! drawn towards the finger's centre of pressure, so that their mean distance from it is that of
//! uniform pressure: for a square of side a 0.383 a instead of 0.707 a, for a line of length l
//! 0.25 l instead of 0.5 l. The centre of pressure follows the load, so the face still tips only
//! over its true edge.

use crate::rapier::math::{Real, Vector};
use crate::rapier::prelude::{
    ActiveHooks, ContactModificationContext, PhysicsHooks, RigidBodyHandle,
};
use nalgebra::{Isometry3, Point3};

use crate::convert;
use crate::world::FingerContact;

/// Share of the way to the measured centre that the patch's centre goes in a step: the measured
/// one overshoots by 1 / scale, as forces at drawn-in points must give the same moment.
const FOLLOW: f64 = 0.3;

/// The contact model of the pads.
pub(crate) struct Patch {
    scale: Real,
    fingers: [RigidBodyHandle; 2],
    /// Centre of pressure of each finger in the hand, metres.
    hand_centre_m: [Option<Point3<f64>>; 2],
    /// The same in the world, for the step to come.
    centre_m: [Option<Vector>; 2],
}

impl Patch {
    pub(crate) fn new(scale: f64) -> Self {
        Self {
            scale: scale as Real,
            fingers: [RigidBodyHandle::invalid(); 2],
            hand_centre_m: [None; 2],
            centre_m: [None; 2],
        }
    }

    pub(crate) fn set_fingers(&mut self, fingers: [RigidBodyHandle; 2]) {
        self.fingers = fingers;
    }

    /// The hooks a finger's collider needs.
    pub(crate) fn hooks(&self) -> ActiveHooks {
        if self.scale < 1.0 {
            ActiveHooks::MODIFY_SOLVER_CONTACTS
        } else {
            ActiveHooks::empty()
        }
    }

    /// Follows the contacts of the last step, which the hand ended at `world_from_hand`.
    pub(crate) fn follow(
        &mut self,
        contacts: &[FingerContact; 2],
        world_from_hand: &Isometry3<f64>,
    ) {
        for (i, contact) in contacts.iter().enumerate() {
            let centre = contact.touches.then(|| {
                let now = world_from_hand.inverse_transform_point(&contact.centre_m);
                match self.hand_centre_m[i] {
                    Some(before) => before + (now - before) * FOLLOW,
                    None => now,
                }
            });
            self.hand_centre_m[i] = centre;
            self.centre_m[i] = centre.map(|c| convert::point(&(world_from_hand * c)));
        }
    }
}

impl PhysicsHooks for Patch {
    fn modify_solver_contacts(&self, context: &mut ContactModificationContext) {
        let bodies = [context.rigid_body1, context.rigid_body2];
        let side = self.fingers.iter().position(|f| bodies.contains(&Some(*f)));
        let (Some(side), Some(rigid)) = (side, context.rigid_mut()) else {
            return;
        };
        let Some(centre) = self.centre_m[side] else {
            return;
        };
        let normal = *rigid.normal;
        for contact in rigid.solver_contacts.iter_mut() {
            // Both anchors by the same way in the tangent plane: the gap stays what it was.
            let arm = contact.anchor1 - centre;
            let in_plane = arm - normal * arm.dot(normal);
            let shift = in_plane * (self.scale - 1.0);
            contact.anchor1 += shift;
            contact.anchor2 += shift;
        }
    }
}
