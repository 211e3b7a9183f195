//! How is a grasp tried? All constants of a trial, from a preset or a file, each with a name.

mod check;
mod parse;

use serde::{Deserialize, Serialize};

pub use parse::ProtocolError;

/// Where an object's mass comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObjectMass {
    /// What the object brings along, else the protocol's density.
    Object,
    /// Always the protocol's density.
    Density,
    /// Always the protocol's mass.
    Fixed,
}

/// Where the grip force comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GripForceRule {
    /// The same for all objects.
    Fixed,
    /// In proportion to the object's mass, between the least and the largest force.
    PerMass,
    /// A multiple of the least force that carries the load by friction, m (g + a) / (2 mu) with the
    /// peak acceleration a of the linear shake, between the least and the largest force.
    Coulomb,
}

/// What is done to the object in the closed hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LoadKind {
    /// The hand shakes along its approach direction, then about its closing axis.
    Shake,
    /// The object is pulled in one direction after the other.
    Tugs,
    /// The hand goes up.
    Lift,
    /// The hand shakes harder and harder until the object is gone.
    Hardness,
}

/// The axes in which tugs are given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TugFrame {
    /// The hand's.
    Hand,
    /// The object's at the start, as everywhere where a protocol says world.
    World,
}

/// When is a grasp called held?
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SuccessRule {
    /// Both fingers touch the object at the end, and it moved less than the limits.
    BothFingersTouch,
    /// The object moved less than the limits at any time of the load, touched or not.
    MovedLess,
    /// The object's origin is near the hand's at the end; touch does not count.
    OriginNear,
}

/// The pose from which motion in the hand is counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SlipReference {
    /// Where the fingers left it when they had closed.
    Closed,
    /// Where it was before they closed.
    Start,
}

/// What the fingers touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObjectContact {
    /// Convex pieces of the solid: fast; they round and thicken thin walls.
    Pieces,
    /// The triangles of the surface themselves: true, and several times dearer.
    Surface,
}

/// Who computes the motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Engine {
    /// Our own, made for a gripped object: eight coordinates, soft pads, one exact solve a step.
    Grip,
    /// rapier3d, general and ten times dearer: the second opinion.
    Rapier,
}

/// Who finds the contacts of boxes with triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BoxContacts {
    /// Our own search.
    Own,
    /// parry's, in centimetres, half as fast: to compare.
    Parry,
}

/// Every constant of a trial; `docs/protocols.md` explains each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Protocol {
    /// Name of the preset.
    pub name: String,
    /// Version of its meaning; changes whenever outcomes may.
    pub version: String,
    /// One line.
    pub description: String,
    /// Where the constants come from.
    pub source: String,

    /// Where an object's mass comes from.
    pub object_mass: ObjectMass,
    /// Density for objects without a mass, kg/m3.
    pub object_density_kg_m3: f64,
    /// Mass under `object_mass = "fixed"`, kg.
    pub object_mass_kg: f64,
    /// Lighter objects count as this heavy, kg.
    pub object_mass_min_kg: f64,

    /// Time step, s.
    pub dt_s: f64,
    /// Friction coefficient of the pair of hand and object; a value of the object wins over it.
    pub friction: f64,
    /// The trial's friction as a share of the stated one, be it `friction` or the object's own: for
    /// labels of an engine whose pads hold less than it says.
    pub friction_scale: f64,
    /// Friction while the fingers close, as a multiple of `friction`.
    pub closing_friction_scale: f64,
    /// Least torsional friction of a pad as a lever arm, m: however small the contact, the pad
    /// resists a twist about its normal up to friction x force x this length.
    pub friction_torsional_m: f64,

    /// How far the hand stands back along the approach direction, m, seen from the grasp's pose.
    pub standoff_m: f64,
    /// Radius lost to rounding at the edges of a finger, m: its flat faces end so far from them.
    pub finger_edge_m: f64,

    /// Where the grip force comes from.
    pub grip_force_rule: GripForceRule,
    /// Grip force per finger under the rule `fixed`, N.
    pub grip_force_n: f64,
    /// Grip force per finger and kilogram of the object under the rule `per_mass`, N/kg.
    pub grip_force_per_kg_n: f64,
    /// Multiple of the least force that friction needs, under the rule `coulomb`.
    pub grip_force_safety: f64,
    /// Least force under the rules `per_mass` and `coulomb`, N.
    pub grip_force_min_n: f64,
    /// Largest force under the rules `per_mass` and `coulomb`, N.
    pub grip_force_max_n: f64,
    /// Force while closing, N; 0: the grip force.
    pub closing_force_n: f64,
    /// Time over which the force grows from `closing_force_n` to the grip force, s.
    pub grip_ramp_s: f64,
    /// Stiffness that holds each finger where it closed, on top of the force, N/m.
    pub hold_stiffness_n_m: f64,
    /// Damping that goes with it, N s/m.
    pub hold_damping_n_s_m: f64,

    /// Speed of each finger while closing, m/s.
    pub closing_speed_m_s: f64,
    /// Longest time of closing, s.
    pub closing_time_s: f64,
    /// Closing ends when both fingers touch and rest; else it lasts its full time.
    pub closing_ends_at_rest: bool,
    /// The object cannot move while the fingers close.
    pub closing_object_frozen: bool,
    /// Linear and angular damping of the object while closing, 1/s.
    pub object_damping_1_s: f64,
    /// Gravity from the end of closing on, m/s2, along -z of the object frame.
    pub gravity_m_s2: f64,

    /// What is done to the object in the closed hand.
    pub load: LoadKind,
    /// Rest between closing and load, s.
    pub settle_s: f64,
    /// Amplitude of the shake along the approach direction, m.
    pub shake_linear_m: f64,
    /// Its frequency, Hz.
    pub shake_linear_hz: f64,
    /// Its number of cycles.
    pub shake_linear_cycles: f64,
    /// Amplitude of the shake about the closing axis, rad.
    pub shake_angular_rad: f64,
    /// Its frequency, Hz.
    pub shake_angular_hz: f64,
    /// Its number of cycles.
    pub shake_angular_cycles: f64,
    /// Distance of its axis from the hand's origin along the approach direction, m.
    pub shake_axis_z_m: f64,
    /// Directions of the tugs.
    pub tug_directions: Vec<[f64; 3]>,
    /// The axes of these directions.
    pub tug_frame: TugFrame,
    /// Force of a tug, N.
    pub tug_force_n: f64,
    /// Acceleration that a tug adds in proportion to the mass, m/s2.
    pub tug_acceleration_m_s2: f64,
    /// Duration of each tug, s.
    pub tug_time_s: f64,
    /// Each tug starts from a fresh grasp.
    pub tug_fresh_start: bool,
    /// Way up, m.
    pub lift_height_m: f64,
    /// Largest speed of the hand on its way up, m/s.
    pub lift_speed_m_s: f64,
    /// Share of the way left that the hand covers, 1/s; 0: at constant speed.
    pub lift_rate_1_s: f64,
    /// Time of the lift, s.
    pub lift_time_s: f64,
    /// First level of `hardness`, multiples of 9.81 m/s2.
    pub hardness_start_g: f64,
    /// Each level is so many times the one before.
    pub hardness_growth: f64,
    /// Last level.
    pub hardness_max_g: f64,
    /// Rest before the verdict, s.
    pub hold_s: f64,

    /// When is it held?
    pub success: SuccessRule,
    /// The pose from which motion is counted.
    pub slip_reference: SlipReference,
    /// Largest motion of the object's centre of mass in the hand, m.
    pub max_slip_m: f64,
    /// Largest rotation of the object in the hand, rad.
    pub max_slip_rad: f64,
    /// Largest distance of the origins under `origin_near`, m.
    pub origin_distance_max_m: f64,
    /// Least opening of the pads at the end, m.
    pub opening_min_m: f64,
    /// Dropped when no finger has touched the object for this long, s.
    pub lost_contact_s: f64,
    /// Deepest overlap of hand and object at the start that is not an `initial_collision`, m.
    pub initial_penetration_max_m: f64,
    /// Settings of the solver.
    pub solver: Solver,
}

/// Settings of the physics engine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Solver {
    /// Who computes the motion.
    pub engine: Engine,
    /// What the fingers touch.
    pub object_contact: ObjectContact,
    /// `grip`: parts of a step at most.
    pub substeps: u32,
    /// `grip`: a step has one more part for each multiple of this speed, m/s, of hand and object against
    /// each other where they touch.
    pub fine_speed_m_s: f64,
    /// `grip`: stiffness of a pad at one point of contact, N/m.
    pub pad_stiffness_n_m: f64,
    /// `grip`: stiffness of a patch of contact against sliding, N/m.
    pub pad_shear_stiffness_n_m: f64,
    /// `grip`: relaxation time of the pads, damping over stiffness, s.
    pub pad_relaxation_s: f64,
    /// `grip`: contacts are found anew when hand and object have moved so far against each other, m.
    pub contact_reuse_m: f64,
    /// `grip`: who finds the contacts of the fingers' boxes.
    pub box_contacts: BoxContacts,
    /// `rapier`: solver iterations (substeps) per step.
    pub iterations: usize,
    /// Stiffness of contacts as a frequency, Hz.
    pub contact_hz: f64,
    /// Damping ratio of contacts.
    pub contact_damping_ratio: f64,
    /// Solve friction in the biased pass too.
    pub friction_in_bias_pass: bool,
    /// Size of a contact patch for the solver, as a share of its outline; 0.54: the lever arm of
    /// uniform pressure, 1: all force in the corners.
    pub patch_scale: f64,
    /// Distance at which contacts are prepared, m.
    pub prediction_m: f64,
    /// Largest speed at which penetration is corrected, m/s.
    pub corrective_speed_m_s: f64,
    /// Mass of a finger in the simulation, kg.
    pub finger_mass_kg: f64,
    /// Frequency of the spring that couples the fingers, Hz.
    pub coupling_hz: f64,
    /// Voxels along the longest edge for convex pieces.
    pub piece_resolution: u32,
    /// Concavity left in a piece.
    pub piece_concavity: f64,
    /// Most pieces.
    pub piece_max: u32,
}

impl Protocol {
    /// Name and version of the engine that computes the trials, part of every manifest.
    pub fn engine(&self) -> &'static str {
        match self.solver.engine {
            Engine::Grip => crate::GRIP,
            Engine::Rapier => crate::RAPIER,
        }
    }

    /// Force of each finger on an object of this mass, N.
    pub fn grip_force_on(&self, mass_kg: f64, friction: f64) -> f64 {
        let clamped = |force: f64| force.clamp(self.grip_force_min_n, self.grip_force_max_n);
        match self.grip_force_rule {
            GripForceRule::Fixed => self.grip_force_n,
            GripForceRule::PerMass => clamped(self.grip_force_per_kg_n * mass_kg),
            GripForceRule::Coulomb => {
                let omega = std::f64::consts::TAU * self.shake_linear_hz;
                let peak = self.gravity_m_s2 + self.shake_linear_m * omega * omega;
                clamped(self.grip_force_safety * mass_kg * peak / (2.0 * friction))
            }
        }
    }
}
