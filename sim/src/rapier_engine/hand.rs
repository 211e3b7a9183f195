//! How do the fingers press? Equal forces on both, a speed limit while closing, and a spring that
//! keeps them symmetric about the palm, as the rack and pinion of the real hand does.

use crate::rapier::prelude::{PhysicsWorld, RigidBodyHandle};
use nalgebra::Vector3;

use crate::convert;
use crate::protocol::Solver;
use crate::world::{Drive, FingerState};

/// Largest frequency of the coupling in cycles a step: 30 Hz at 2 ms.
const COUPLING_STEPS: f64 = 0.06;

/// Reads the fingers relative to the palm.
pub(crate) fn read(
    world: &PhysicsWorld,
    palm: RigidBodyHandle,
    fingers: [RigidBodyHandle; 2],
) -> FingerState {
    let palm = &world.bodies[palm];
    let world_from_hand = convert::from_pose(palm.position());
    let closing_axis = world_from_hand.rotation * Vector3::x();
    let mut state = FingerState {
        position_m: [0.0; 2],
        speed_m_s: [0.0; 2],
    };
    for (i, sign) in [1.0, -1.0].into_iter().enumerate() {
        let body = &world.bodies[fingers[i]];
        let origin = convert::from_vector(body.position().translation);
        let arm = origin - world_from_hand.translation.vector;
        let carried =
            convert::from_vector(palm.linvel()) + convert::from_vector(palm.angvel()).cross(&arm);
        let relative = convert::from_vector(body.linvel()) - carried;
        state.position_m[i] = sign * closing_axis.dot(&arm);
        state.speed_m_s[i] = sign * closing_axis.dot(&relative);
    }
    state
}

/// Sets the forces of the next step: inwards on each finger, plus the coupling.
pub(crate) fn press(
    world: &mut PhysicsWorld,
    palm: RigidBodyHandle,
    fingers: [RigidBodyHandle; 2],
    drive: &Drive,
    solver: &Solver,
    dt_s: f64,
) {
    let state = read(world, palm, fingers);
    let closing_axis = convert::from_pose(world.bodies[palm].position()).rotation * Vector3::x();
    // Common mode: how far the pair has wandered along the closing axis, and how fast.
    let shift = (state.position_m[0] - state.position_m[1]) / 2.0;
    let rate = (state.speed_m_s[0] - state.speed_m_s[1]) / 2.0;
    // An explicit spring: stiffer than this it would swing up.
    let hz = solver.coupling_hz.min(COUPLING_STEPS / dt_s);
    let omega = std::f64::consts::TAU * hz;
    let restoring = -solver.finger_mass_kg * (omega * omega * shift + 2.0 * omega * rate);
    for (i, sign) in [1.0, -1.0].into_iter().enumerate() {
        let spring = drive.hold.map_or(0.0, |(rest_m, stiffness, damping)| {
            stiffness * (rest_m[i] - state.position_m[i]) - damping * state.speed_m_s[i]
        });
        let along = restoring - sign * (drive.force_n - spring);
        let body = &mut world.bodies[fingers[i]];
        body.reset_forces(true);
        body.add_force(convert::vector(&(closing_axis * along)), true);
    }
}
