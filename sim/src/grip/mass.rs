//! What resists a change of the eight speeds: masses, and everything that pulls back in proportion to
//! a speed.

use nalgebra::{Matrix3, UnitQuaternion};

use super::solve::Matrix8;
use crate::scene::Scene;

/// Moments of inertia follow the object when it has turned so far, radians.
const TURN_RAD: f64 = 1e-3;
/// Mass of an object that is held where it is, in multiples of its own.
const FROZEN: f64 = 1e9;

/// What pulls back besides the masses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Drag {
    /// Of the object, linear and angular, against rest in the world: only while the hand rests.
    pub object_1_s: f64,
    /// Of each finger.
    pub finger_1_s: f64,
    /// Spring and damper that hold each finger, N/m and N s/m.
    pub hold: (f64, f64),
    /// The object cannot move.
    pub is_frozen: bool,
}

/// The matrix, which changes seldom.
#[derive(Debug)]
pub(super) struct Masses {
    pub matrix: Matrix8,
    /// About the centre of mass, axes of the hand.
    pub inertia_kg_m2: Matrix3<f64>,
    pub inverse_inertia: Matrix3<f64>,
    turn: UnitQuaternion<f64>,
    /// For which the matrix was made, with the length of the substep.
    made_for: Option<(Drag, f64)>,
}

impl Masses {
    pub fn new(scene: &Scene, hand_from_body: &UnitQuaternion<f64>) -> Self {
        let mut masses = Self {
            matrix: Matrix8::zeros(),
            inertia_kg_m2: Matrix3::zeros(),
            inverse_inertia: Matrix3::zeros(),
            turn: *hand_from_body,
            made_for: None,
        };
        masses.set_inertia(scene);
        masses
    }

    /// Takes a new orientation and drag for substeps of `h`; says whether the matrix changed.
    pub fn follow(
        &mut self,
        scene: &Scene,
        hand_from_body: &UnitQuaternion<f64>,
        drag: &Drag,
        h: f64,
    ) -> bool {
        let turned = hand_from_body.angle_to(&self.turn) > TURN_RAD;
        if !turned && self.made_for == Some((*drag, h)) {
            return false;
        }
        if turned {
            self.turn = *hand_from_body;
            self.set_inertia(scene);
        }
        self.made_for = Some((*drag, h));
        let solver = &scene.protocol.solver;
        let frozen = if drag.is_frozen { FROZEN } else { 1.0 };
        let slowed = (1.0 + h * drag.object_1_s) * frozen;
        let mut matrix = Matrix8::zeros();
        for i in 0..3 {
            matrix[(i, i)] = scene.mass_kg * slowed;
        }
        let inertia = self.inertia_kg_m2 * slowed;
        matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&inertia);
        let coupling = coupling_n_s_m(scene, h);
        let (stiffness, damping) = drag.hold;
        let finger = solver.finger_mass_kg * (1.0 + h * drag.finger_1_s)
            + h * (stiffness * h + damping)
            + coupling;
        matrix[(6, 6)] = finger;
        matrix[(7, 7)] = finger;
        matrix[(6, 7)] = -coupling;
        matrix[(7, 6)] = -coupling;
        self.matrix = matrix;
        true
    }

    fn set_inertia(&mut self, scene: &Scene) {
        let turn = self.turn.to_rotation_matrix();
        self.inertia_kg_m2 = turn * scene.object_inertia_kg_m2 * turn.inverse();
        let inverse = self.inertia_kg_m2.try_inverse();
        // Not a number: the trial has diverged, which its pose will tell.
        self.inverse_inertia = inverse.unwrap_or(Matrix3::repeat(f64::NAN));
    }
}

/// What the critically damped spring that centres the fingers adds to each, times `h`.
fn coupling_n_s_m(scene: &Scene, h: f64) -> f64 {
    let solver = &scene.protocol.solver;
    let omega = std::f64::consts::TAU * solver.coupling_hz;
    h * solver.finger_mass_kg * (omega * omega * h + 2.0 * omega) / 2.0
}
