//! What a trial asks of a physics engine, whichever it is.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::grip::GripWorld;
use crate::protocol::Engine;
use crate::rapier_engine::RapierWorld;
use crate::scene::Scene;

/// A force and a torque on the object, at its centre of mass.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ObjectLoad {
    /// Force, N, axes of the hand at the start of the trial.
    pub force_n: Vector3<f64>,
    /// Torque, N m, same axes.
    pub torque_n_m: Vector3<f64>,
}

/// Contact of one finger with the object in the last step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FingerContact {
    /// Sum of the normal forces, N, as a vector on the object in world axes.
    pub force_n: Vector3<f64>,
    /// Does any point press?
    pub touches: bool,
    /// Centre of pressure in the world, metres; only meaningful where it touches.
    pub centre_m: Point3<f64>,
}

impl FingerContact {
    /// No contact.
    pub(crate) const NONE: Self = Self {
        force_n: Vector3::new(0.0, 0.0, 0.0),
        touches: false,
        centre_m: Point3::new(0.0, 0.0, 0.0),
    };
}

/// State of the fingers seen from the palm: distance of each pad from the axis, and its rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FingerState {
    /// Left (+x) and right (-x), metres.
    pub position_m: [f64; 2],
    /// Outward speeds, m/s.
    pub speed_m_s: [f64; 2],
}

impl FingerState {
    /// Distance between the pads, metres.
    pub fn width_m(&self) -> f64 {
        self.position_m[0] + self.position_m[1]
    }
}

/// What the fingers are told to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Drive {
    /// Force of each finger inwards, N.
    pub force_n: f64,
    /// Positions of the pads that a spring holds, and its stiffness and damping.
    pub hold: Option<([f64; 2], f64, f64)>,
}

/// One trial's world: a palm that moves as told, two fingers on sliders, one object. World frame =
/// the hand's frame at the start, so that a rigid motion of the whole scene cannot change a bit.
pub(crate) trait World {
    /// Holds the object where it is, or lets it go.
    fn freeze(&mut self, is_frozen: bool);

    /// Limits the speed of fingers that press with `force_n` by damping.
    fn limit_speed(&mut self, scene: &Scene, force_n: f64, speed_m_s: f64);

    /// Ends the closing: no damping of the object any more, gravity as the protocol has it.
    fn release(&mut self, gravity_m_s2: &Vector3<f64>, friction: f64);

    /// One time step with the palm moving to `world_from_hand`.
    fn step(
        &mut self,
        scene: &Scene,
        world_from_hand: &Isometry3<f64>,
        drive: &Drive,
        load: &ObjectLoad,
    );

    /// Contact of the left and of the right finger in the last step.
    fn contacts(&self) -> [FingerContact; 2];

    /// Takes the hand out of the world.
    fn remove_hand(&mut self);

    /// Momentum and angular momentum of the object about its centre of mass, world axes.
    fn momentum(&self, scene: &Scene) -> (Vector3<f64>, Vector3<f64>);

    /// Where the fingers are.
    fn fingers(&self) -> FingerState;

    /// Pose of the hand.
    fn world_from_hand(&self) -> Isometry3<f64>;

    /// Pose of the object's centre of mass in the hand, or `None` if it has diverged.
    fn hand_from_body(&self) -> Option<Isometry3<f64>>;

    /// Pose of the object's mesh frame.
    fn world_from_object(&self) -> Isometry3<f64>;
}

/// Hand at the origin, fingers on their way at `opening_m`, object where the grasp puts it.
pub(crate) fn world(
    scene: &Scene,
    object_from_hand: &Isometry3<f64>,
    opening_m: f64,
) -> Box<dyn World> {
    match scene.protocol.solver.engine {
        Engine::Grip => Box::new(GripWorld::new(scene, object_from_hand, opening_m)),
        Engine::Rapier => Box::new(RapierWorld::new(scene, object_from_hand, opening_m)),
    }
}
