//! A trial's world in rapier: a kinematic palm, two dynamic fingers on sliders, one object. Built
//! fresh, dropped at the end.

mod contact;
mod hand;
mod patch;
mod torsion;

use crate::rapier::math::{Pose, Real, Vector};
use crate::rapier::prelude::*;
use nalgebra::{Isometry3, Vector3};
use shakedown_gripper_assets::gripper::Side;

use crate::convert;
use crate::scene::Scene;
use crate::world::{Drive, FingerContact, FingerState, ObjectLoad, World};
use patch::Patch;
use torsion::Torsion;

const PALM: Group = Group::GROUP_1;
const FINGER: Group = Group::GROUP_2;
const OBJECT_FOR_PALM: Group = Group::GROUP_3;
const OBJECT_FOR_FINGERS: Group = Group::GROUP_4;

/// Radius of gyration of a simulated finger, metres.
const FINGER_GYRATION_M: f64 = 0.1;

/// The changing state of one trial.
pub(crate) struct RapierWorld {
    physics: PhysicsWorld,
    palm: RigidBodyHandle,
    fingers: [RigidBodyHandle; 2],
    finger_colliders: [Vec<ColliderHandle>; 2],
    object: RigidBodyHandle,
    object_collider: ColliderHandle,
    body_from_object: Isometry3<f64>,
    torsion: Torsion,
    patch: Patch,
    touch: [FingerContact; 2],
}

impl RapierWorld {
    /// Hand at the origin, fingers on their way at `opening_m`, object where the grasp puts it.
    pub(crate) fn new(scene: &Scene, object_from_hand: &Isometry3<f64>, opening_m: f64) -> Self {
        let mut physics = PhysicsWorld {
            gravity: Vector::ZERO,
            integration_parameters: parameters(scene),
            ..PhysicsWorld::default()
        };
        let friction = (scene.friction * scene.protocol.closing_friction_scale) as Real;
        let mut patch = Patch::new(scene.protocol.solver.patch_scale);
        let hooks = patch.hooks();
        let meets =
            |own: Group, other: Group| InteractionGroups::new(own, other, InteractionTestMode::And);
        let surface = |shape: &SharedShape, groups: InteractionGroups| {
            ColliderBuilder::new(shape.clone())
                .density(0.0)
                .friction(friction)
                .friction_combine_rule(CoefficientCombineRule::Min)
                .restitution(0.0)
                .collision_groups(groups)
                .active_hooks(hooks)
        };
        let palm = physics.insert_body(RigidBodyBuilder::kinematic_position_based());
        for (pose, shape) in &scene.palm_shapes {
            let collider = surface(shape, meets(PALM, OBJECT_FOR_PALM)).position(*pose);
            physics.insert_collider(collider, Some(palm));
        }
        let solver = &scene.protocol.solver;
        let half_opening = (scene.opening_max_m / 2.0) as Real;
        let mut fingers = [RigidBodyHandle::invalid(); 2];
        let mut finger_colliders = [const { Vec::new() }; 2];
        for (i, side) in Side::BOTH.into_iter().enumerate() {
            let turn = match side {
                Side::Left => Rotation::IDENTITY,
                Side::Right => Rotation::from_xyzw(0.0, 0.0, 1.0, 0.0),
            };
            let outwards = side.sign() as Real;
            let shift = Vector::new(outwards * (opening_m / 2.0) as Real, 0.0, 0.0);
            let speed = scene.protocol.closing_speed_m_s as Real;
            let mass = solver.finger_mass_kg;
            // A finger only slides. With its mass behind the pad and a large moment of inertia the
            // contact sees that mass alone, and the slider has no torque to balance: with the mass
            // at the palm, 0.1 m away, grip force and friction chatter.
            let inertia =
                nalgebra::Matrix3::from_diagonal_element(mass * FINGER_GYRATION_M.powi(2));
            let body = RigidBodyBuilder::dynamic()
                .pose(Pose::from_parts(shift, turn))
                .linvel(Vector::new(-outwards * speed, 0.0, 0.0))
                .additional_mass_properties(convert::mass_properties(
                    &scene.pad_centre_m,
                    mass,
                    &inertia,
                ))
                .can_sleep(false);
            fingers[i] = physics.insert_body(body);
            for (pose, shape) in &scene.finger_shapes {
                let collider = surface(shape, meets(FINGER, OBJECT_FOR_FINGERS)).position(*pose);
                finger_colliders[i].push(physics.insert_collider(collider, Some(fingers[i])));
            }
            let slider = GenericJointBuilder::new(JointAxesMask::LOCKED_PRISMATIC_AXES)
                .local_frame1(Pose::from_parts(Vector::ZERO, turn))
                .local_frame2(Pose::IDENTITY)
                .limits(JointAxis::LinX, [0.0, half_opening])
                .contacts_enabled(false)
                .build();
            physics.insert_impulse_joint(palm, fingers[i], slider);
        }
        patch.set_fingers(fingers);
        let object_from_body = scene.object_from_body();
        let world_from_body = object_from_hand.inverse() * object_from_body;
        let damping = scene.protocol.object_damping_1_s as Real;
        let object = physics.insert_body(
            RigidBodyBuilder::dynamic()
                .pose(convert::pose(&world_from_body))
                .additional_mass_properties(scene.object_mass)
                .linear_damping(damping)
                .angular_damping(damping)
                .can_sleep(false),
        );
        let for_fingers = surface(&scene.object_shape, meets(OBJECT_FOR_FINGERS, FINGER));
        let object_collider = physics.insert_collider(for_fingers, Some(object));
        if !scene.palm_shapes.is_empty() {
            let for_palm = surface(&scene.object_pieces, meets(OBJECT_FOR_PALM, PALM));
            physics.insert_collider(for_palm, Some(object));
        }
        Self {
            physics,
            palm,
            fingers,
            finger_colliders,
            object,
            object_collider,
            body_from_object: object_from_body.inverse(),
            touch: [FingerContact::NONE; 2],
            patch,
            torsion: Torsion::new(scene.protocol.friction_torsional_m),
        }
    }

    fn torsion_n_m(&mut self, scene: &Scene) -> Vector3<f64> {
        let dt_s = scene.protocol.dt_s;
        let contacts = self.touch;
        let palm = &self.physics.bodies[self.palm];
        let closing_axis = convert::from_pose(palm.position()).rotation * Vector3::x();
        let object = &self.physics.bodies[self.object];
        let spin = convert::from_vector(object.angvel() - palm.angvel());
        let axis = convert::from_pose(object.position())
            .rotation
            .inverse_transform_vector(&closing_axis);
        let inertia = axis.dot(&(scene.object_inertia_kg_m2 * axis));
        let own_lever_m = [0, 1].map(|i| {
            let parts = &self.finger_colliders[i];
            let centre_m = &contacts[i].centre_m;
            let reach_m = contact::reach_m(&self.physics, parts, self.object_collider, centre_m);
            scene.protocol.solver.patch_scale * reach_m
        });
        self.torsion.torque_n_m(
            &contacts,
            &own_lever_m,
            scene.friction,
            inertia,
            &spin,
            dt_s,
        )
    }
}

impl World for RapierWorld {
    fn freeze(&mut self, is_frozen: bool) {
        let object = &mut self.physics.bodies[self.object];
        object.lock_translations(is_frozen, true);
        object.lock_rotations(is_frozen, true);
    }

    fn limit_speed(&mut self, scene: &Scene, force_n: f64, speed_m_s: f64) {
        let damping = force_n / (scene.protocol.solver.finger_mass_kg * speed_m_s);
        for finger in self.fingers {
            self.physics.bodies[finger].set_linear_damping(damping as Real);
        }
    }

    fn release(&mut self, gravity_m_s2: &Vector3<f64>, friction: f64) {
        for (_, collider) in self.physics.colliders.iter_mut() {
            collider.set_friction(friction as Real);
        }
        let object = &mut self.physics.bodies[self.object];
        object.set_linear_damping(0.0);
        object.set_angular_damping(0.0);
        self.physics.gravity = convert::vector(gravity_m_s2);
        for finger in self.fingers {
            // Gravity acts on the object; the hand carries its own fingers.
            self.physics.bodies[finger].set_gravity_scale(0.0, true);
        }
    }

    fn step(
        &mut self,
        scene: &Scene,
        world_from_hand: &Isometry3<f64>,
        drive: &Drive,
        load: &ObjectLoad,
    ) {
        hand::press(
            &mut self.physics,
            self.palm,
            self.fingers,
            drive,
            &scene.protocol.solver,
            scene.protocol.dt_s,
        );
        let mut torque_n_m = load.torque_n_m;
        if self.torsion.is_active() {
            torque_n_m += self.torsion_n_m(scene);
        }
        let object = &mut self.physics.bodies[self.object];
        object.reset_forces(true);
        object.reset_torques(true);
        object.add_force(convert::vector(&load.force_n), true);
        object.add_torque(convert::vector(&torque_n_m), true);
        self.physics.bodies[self.palm].set_next_kinematic_position(convert::pose(world_from_hand));
        self.physics.step_with_events(&self.patch, &());
        let (physics, object) = (&self.physics, self.object_collider);
        self.touch = [0, 1].map(|i| {
            contact::of_finger(
                physics,
                &self.finger_colliders[i],
                object,
                scene.protocol.dt_s,
            )
        });
        self.patch.follow(&self.touch, &self.world_from_hand());
    }

    fn contacts(&self) -> [FingerContact; 2] {
        self.touch
    }

    fn remove_hand(&mut self) {
        for body in self.fingers.into_iter().chain([self.palm]) {
            for collider in self.physics.bodies[body].colliders().to_vec() {
                self.physics.colliders[collider].set_enabled(false);
            }
        }
    }

    fn momentum(&self, scene: &Scene) -> (Vector3<f64>, Vector3<f64>) {
        let object = &self.physics.bodies[self.object];
        let turn = convert::from_pose(object.position()).rotation;
        let spin = turn.inverse() * convert::from_vector(object.angvel());
        (
            convert::from_vector(object.linvel()) * scene.mass_kg,
            turn * (scene.object_inertia_kg_m2 * spin),
        )
    }

    fn fingers(&self) -> FingerState {
        hand::read(&self.physics, self.palm, self.fingers)
    }

    fn world_from_hand(&self) -> Isometry3<f64> {
        convert::from_pose(self.physics.bodies[self.palm].position())
    }

    fn hand_from_body(&self) -> Option<Isometry3<f64>> {
        let pose = self.physics.bodies[self.object].position();
        let t = pose.translation;
        let is_finite = t.is_finite() && pose.rotation.is_finite();
        if !is_finite || t.length() > 10.0 {
            return None;
        }
        Some(self.world_from_hand().inverse() * convert::from_pose(pose))
    }

    fn world_from_object(&self) -> Isometry3<f64> {
        convert::from_pose(self.physics.bodies[self.object].position()) * self.body_from_object
    }
}

/// Settings measured for gripping: stiff contacts (scaled by mass), no recycling, friction solved
/// in the relax pass; see docs/protocols.md for what each is worth.
fn parameters(scene: &Scene) -> IntegrationParameters {
    let p = &scene.protocol;
    let s = &p.solver;
    let softness = SpringCoefficients::new(s.contact_hz as Real, s.contact_damping_ratio as Real);
    let length_unit = 0.05;
    IntegrationParameters {
        dt: p.dt_s as Real,
        num_solver_iterations: s.iterations,
        contact_softness: softness,
        static_contact_softness: softness,
        contact_recycling: false,
        contact_clustering: false,
        friction_in_bias_pass: s.friction_in_bias_pass,
        friction_model: FrictionModel::Simplified,
        warmstart_joints: true,
        length_unit,
        normalized_allowed_linear_error: 0.0002 / length_unit,
        normalized_prediction_distance: s.prediction_m as Real / length_unit,
        normalized_max_corrective_velocity: s.corrective_speed_m_s as Real / length_unit,
        max_ccd_substeps: 0,
        ..IntegrationParameters::default()
    }
}
