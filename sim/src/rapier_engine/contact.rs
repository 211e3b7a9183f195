//! Who touches whom, where, and how hard?

use crate::rapier::parry::query::TrackedContact;
use crate::rapier::prelude::{ColliderHandle, ContactData, ContactManifold, PhysicsWorld};
use nalgebra::{Point3, Vector3};

use crate::convert;
use crate::world::FingerContact;

/// The engine's mark of a contact that is new in this step, in the id of a solver contact.
const NEW_CONTACT: u32 = 1 << 31;

/// Reads the contact between a finger's colliders and the object. Impulses are those of the solver,
/// so the manifolds it saw count, not the raw ones.
pub(crate) fn of_finger(
    world: &PhysicsWorld,
    finger: &[ColliderHandle],
    object: ColliderHandle,
    dt_s: f64,
) -> FingerContact {
    let mut force_n = Vector3::zeros();
    let (mut total, mut moment) = (0.0, Vector3::zeros());
    for_each(world, finger, object, |point, normal, impulse| {
        force_n += normal * (impulse / dt_s);
        moment += point.coords * impulse;
        total += impulse;
    });
    let centre_m = Point3::from(moment / f64::max(total, 1e-12));
    FingerContact {
        force_n,
        touches: total > 0.0,
        centre_m,
    }
}

/// Mean distance of the pressing points of a finger from a centre, weighted by force, metres.
pub(crate) fn reach_m(
    world: &PhysicsWorld,
    finger: &[ColliderHandle],
    object: ColliderHandle,
    centre_m: &Point3<f64>,
) -> f64 {
    let (mut total, mut spread) = (0.0, 0.0);
    for_each(world, finger, object, |point, _, impulse| {
        spread += (point - centre_m).norm() * impulse;
        total += impulse;
    });
    spread / f64::max(total, 1e-12)
}

/// Calls `visit(point, normal towards the object, impulse)` for every pressing point.
fn for_each(
    world: &PhysicsWorld,
    finger: &[ColliderHandle],
    object: ColliderHandle,
    mut visit: impl FnMut(Point3<f64>, Vector3<f64>, f64),
) {
    for part in finger {
        let Some(pair) = world.narrow_phase.contact_pair(*part, object) else {
            continue;
        };
        let is_first = pair.collider1 == *part;
        let world_from_part = world.colliders[*part].position();
        for manifold in pair.solver_manifolds() {
            let towards = if is_first { 1.0 } else { -1.0 };
            let normal = convert::from_vector(manifold.data.normal) * towards;
            for point in active(manifold) {
                let impulse = f64::from(point.data.impulse);
                if impulse > 0.0 {
                    let local = if is_first {
                        point.local_p1
                    } else {
                        point.local_p2
                    };
                    let at = convert::from_vector(world_from_part.transform_point(local));
                    visit(Point3::from(at), normal, impulse);
                }
            }
        }
    }
}

/// The points that the solver saw. Others keep the impulse of the step that saw them last.
fn active(manifold: &ContactManifold) -> impl Iterator<Item = &TrackedContact<ContactData>> {
    let seen = manifold.data.solver_contacts.iter();
    // As wide as a real number: u32 or, with the feature `f64`, u64.
    #[allow(clippy::unnecessary_cast)]
    seen.map(|c| &manifold.points[(c.contact_id[0] as u32 & !NEW_CONTACT) as usize])
}
