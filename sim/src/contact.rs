//! Who touches whom, and how hard?

use nalgebra::Vector3;
use rapier3d::prelude::{ColliderHandle, PhysicsWorld};

/// Contact of one finger with the object in the last step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FingerContact {
    /// Sum of the normal forces, N, as a vector on the object in world axes.
    pub force_n: Vector3<f64>,
    /// Does any point press?
    pub touches: bool,
}

/// The contact of a finger from those of its parts.
pub(crate) fn sum(parts: impl Iterator<Item = FingerContact>) -> FingerContact {
    parts.fold(FingerContact::default(), |a, b| FingerContact {
        force_n: a.force_n + b.force_n,
        touches: a.touches || b.touches,
    })
}

/// Reads the contact between a finger and the object. Impulses are those of the solver, so the
/// clustered manifolds count, not the raw ones.
pub(crate) fn between(
    world: &PhysicsWorld,
    finger: ColliderHandle,
    object: ColliderHandle,
    dt_s: f64,
) -> FingerContact {
    let mut contact = FingerContact::default();
    let Some(pair) = world.narrow_phase.contact_pair(finger, object) else {
        return contact;
    };
    let towards_object = if pair.collider1 == finger { 1.0 } else { -1.0 };
    for manifold in pair.solver_manifolds() {
        let impulse: f64 = manifold
            .points
            .iter()
            .map(|p| f64::from(p.data.impulse))
            .sum();
        if impulse > 0.0 {
            contact.touches = true;
            let normal = crate::convert::from_vector(manifold.data.normal);
            contact.force_n += normal * (towards_object * impulse / dt_s);
        }
    }
    contact
}
