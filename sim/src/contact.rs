//! Who touches whom, and how hard?

use nalgebra::Vector3;
use rapier3d::math::Vector;
use rapier3d::prelude::{ColliderHandle, ContactManifold, PhysicsWorld};

/// Contact of one finger with the object in the last step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FingerContact {
    /// Sum of the normal forces, N, as a vector on the object in world axes.
    pub force_n: Vector3<f64>,
    /// Does any point press?
    pub touches: bool,
    /// Mean distance of the pressing points from their middle, weighted by force, metres: the
    /// lever arm of the torsional friction that the engine gives by itself.
    pub reach_m: f64,
}

/// The contact of a finger from those of its parts.
pub(crate) fn sum(parts: impl Iterator<Item = FingerContact>) -> FingerContact {
    parts.fold(FingerContact::default(), |a, b| FingerContact {
        force_n: a.force_n + b.force_n,
        touches: a.touches || b.touches,
        reach_m: {
            let (fa, fb) = (a.force_n.norm(), b.force_n.norm());
            (a.reach_m * fa + b.reach_m * fb) / (fa + fb).max(1e-12)
        },
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
    let mut reach = 0.0;
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
            reach += reach_of(manifold);
        }
    }
    contact.reach_m = reach / (contact.force_n.norm() * dt_s).max(1e-12);
    contact
}

/// Sum over the points of impulse x distance from the points' middle, N s m.
fn reach_of(manifold: &ContactManifold) -> f64 {
    let points = &manifold.points;
    let middle = points.iter().map(|p| p.local_p1).sum::<Vector>() / points.len() as f32;
    points
        .iter()
        .map(|p| f64::from(p.data.impulse * (p.local_p1 - middle).length()))
        .sum()
}
