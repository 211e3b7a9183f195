//! Our own engine for one question: what does a gripped object do in a parallel-jaw hand?
//!
//! Eight coordinates: six of the object, in the frame of the hand, and two of the fingers. The hand
//! moves as told, so its shake enters as the change of the object's velocity seen from the hand.
//! Contact is between the parts of the hand and the object's true triangles; it is found anew only
//! when hand and object have moved against each other. Each substep is one implicit Euler step whose
//! equations are solved to the end (`solve`).

mod box_triangle;
mod contact;
mod mass;
mod near;
mod on_surface;
mod patch;
mod separation;
mod solve;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use crate::scene::Scene;
use crate::world::{Drive, FingerContact, FingerState, ObjectLoad, World};
pub(crate) use box_triangle::Cone;
use contact::Finder;
use mass::{Drag, Masses};
use patch::Patches;
use solve::{Pads, Solver, Vector8, dot};

/// Patches follow their centre of pressure when it has moved so far, metres.
const FOLLOW_M: f64 = 1e-5;

/// Size of a patch of contact, metres.
const PATCH_M: f64 = 0.01;

/// How the hand moves, in its own axes.
#[derive(Debug, Clone, Copy, Default)]
struct Carrier {
    m_s: Vector3<f64>,
    rad_s: Vector3<f64>,
}

/// The changing state of one trial.
pub(crate) struct GripWorld {
    world_from_hand: Isometry3<f64>,
    carrier: Carrier,
    /// Pose of the object's centre of mass.
    hand_from_body: Isometry3<f64>,
    /// Absolute velocity and angular momentum of the object, axes of the hand.
    velocity_m_s: Vector3<f64>,
    spin_kg_m2_s: Vector3<f64>,
    finger_m: [f64; 2],
    finger_m_s: [f64; 2],
    opening_max_m: f64,
    pads: Pads,
    gravity_m_s2: Vector3<f64>,
    drag: Drag,
    has_hand: bool,
    finder: Finder,
    contacts: Patches,
    solver: Solver,
    /// The last solution, where the next search starts.
    relative: Vector8,
    /// Object and fingers when contacts were last found.
    found: Option<(Isometry3<f64>, [f64; 2])>,
    masses: Masses,
    touch: [FingerContact; 2],
    body_from_object: Isometry3<f64>,
}

impl GripWorld {
    pub(crate) fn new(scene: &Scene, object_from_hand: &Isometry3<f64>, opening_m: f64) -> Self {
        let p = &scene.protocol;
        let object_from_body = scene.object_from_body();
        let hand_from_body = object_from_hand.inverse() * object_from_body;
        Self {
            world_from_hand: Isometry3::identity(),
            carrier: Carrier::default(),
            hand_from_body,
            velocity_m_s: Vector3::zeros(),
            spin_kg_m2_s: Vector3::zeros(),
            finger_m: [opening_m / 2.0; 2],
            finger_m_s: [-p.closing_speed_m_s; 2],
            opening_max_m: scene.opening_max_m,
            pads: Pads {
                stiffness_n_m: p.solver.pad_stiffness_n_m,
                shear_stiffness_n_m: p.solver.pad_shear_stiffness_n_m,
                relaxation_s: p.solver.pad_relaxation_s,
                friction: scene.friction * p.closing_friction_scale,
            },
            gravity_m_s2: Vector3::zeros(),
            drag: Drag {
                object_1_s: p.object_damping_1_s,
                finger_1_s: 0.0,
                hold: (0.0, 0.0),
                is_frozen: false,
            },
            has_hand: true,
            finder: Finder::new(scene),
            contacts: Patches::new(),
            solver: Solver::new(),
            relative: Vector8::zeros(),
            found: None,
            masses: Masses::new(scene, &hand_from_body.rotation),
            touch: [FingerContact::NONE; 2],
            body_from_object: object_from_body.inverse(),
        }
    }

    /// Finds contacts anew if hand and object have moved against each other.
    fn look(&mut self, scene: &Scene) {
        if !self.has_hand {
            self.contacts.points.clear();
            self.contacts.patches.clear();
            return;
        }
        if self.is_still_good(scene) {
            return;
        }
        self.finder
            .find(scene, &self.hand_from_body, &self.finger_m);
        let com = self.hand_from_body.translation.vector;
        self.contacts.group(&self.finder.spots, &com);
        self.found = Some((self.hand_from_body, self.finger_m));
        self.solver.forget();
    }

    /// Have hand and object hardly moved against each other where they touch, and nowhere so far
    /// that something else could touch?
    fn is_still_good(&self, scene: &Scene) -> bool {
        let Some((pose, finger_m)) = &self.found else {
            return false;
        };
        let s = &scene.protocol.solver;
        let way = self.hand_from_body.translation.vector - pose.translation.vector;
        let turn = (self.hand_from_body.rotation * pose.rotation.inverse()).scaled_axis();
        let slide = [
            self.finger_m[0] - finger_m[0],
            finger_m[1] - self.finger_m[1],
            0.0,
        ];
        let farthest_m = slide[0].abs().max(slide[1].abs());
        let anywhere_m = way.norm() + turn.norm() * scene.radius_m + farthest_m;
        if anywhere_m <= s.contact_reuse_m {
            return true;
        }
        let first = pose.translation.vector;
        anywhere_m <= s.prediction_m / 2.0
            && self.contacts.patches.iter().all(|patch| {
                let finger = Vector3::x() * slide[patch.solid];
                let here = way + turn.cross(&(patch.centre - first)) - finger;
                here.norm() + turn.norm() * PATCH_M <= s.contact_reuse_m
            })
    }

    /// Into how many parts a step is cut: the faster hand and object move against each other where they
    /// touch, or are about to, the more. What rests in the hand needs one.
    fn parts(&self, scene: &Scene) -> u32 {
        let s = &scene.protocol.solver;
        let v = self.relative.fixed_rows::<3>(0).into_owned();
        let w = self.relative.fixed_rows::<3>(3).into_owned();
        let com = self.hand_from_body.translation.vector;
        let fastest_m_s = self
            .contacts
            .points
            .iter()
            .map(|point| {
                let finger_m_s = match point.row[6..] {
                    [left, _] if left != 0.0 => self.relative[6],
                    [_, right] if right != 0.0 => -self.relative[7],
                    _ => 0.0,
                };
                (v + w.cross(&(point.at - com)) - Vector3::x() * finger_m_s).norm()
            })
            .fold(0.0, f64::max);
        let parts = (fastest_m_s / s.fine_speed_m_s).ceil();
        parts.clamp(1.0, f64::from(s.substeps)) as u32
    }

    /// Patches move to their centres of pressure.
    fn follow_patches(&mut self, scene: &Scene) {
        let com = self.hand_from_body.translation.vector;
        let p = &scene.protocol;
        let (scale, least_lever_m) = (p.solver.patch_scale, p.friction_torsional_m);
        if self.contacts.follow(&com, scale, least_lever_m, FOLLOW_M) {
            self.solver.forget();
        }
    }

    /// One implicit step under outer forces.
    fn substep(&mut self, scene: &Scene, drive: &Drive, outer: &ObjectLoad, h: f64) {
        let s = &scene.protocol.solver;
        let carrier = self.carrier;
        self.drag.hold = drive.hold.map_or((0.0, 0.0), |(_, k, c)| (k, c));
        let turn = &self.hand_from_body.rotation;
        if self.masses.follow(scene, turn, &self.drag, h) {
            self.solver.forget();
        }
        let com = self.hand_from_body.translation.vector;
        let carried = carrier.m_s + carrier.rad_s.cross(&com);
        let v = self.velocity_m_s - carried;
        let w = self.masses.inverse_inertia * self.spin_kg_m2_s - carrier.rad_s;
        let mut push = Vector8::zeros();
        let linear = v * scene.mass_kg + outer.force_n * h;
        let angular = self.masses.inertia_kg_m2 * w + outer.torque_n_m * h;
        push.fixed_rows_mut::<3>(0).copy_from(&linear);
        push.fixed_rows_mut::<3>(3).copy_from(&angular);
        let omega = std::f64::consts::TAU * s.coupling_hz;
        let shift_m = (self.finger_m[0] - self.finger_m[1]) / 2.0;
        let centring = h * s.finger_mass_kg * omega * omega * shift_m;
        for (i, sign) in [1.0, -1.0].into_iter().enumerate() {
            let spring = drive
                .hold
                .map_or(0.0, |(rest_m, k, _)| k * (rest_m[i] - self.finger_m[i]));
            push[6 + i] = s.finger_mass_kg * self.finger_m_s[i] + h * (spring - drive.force_n)
                - sign * centring;
        }
        if self.drag.is_frozen {
            push.fixed_rows_mut::<6>(0).fill(0.0);
        }
        let mut u = self.relative;
        let matrix = &self.masses.matrix;
        self.solver
            .solve(matrix, &push, &mut self.contacts, &self.pads, h, &mut u);
        self.relative = u;
        let pressed = self.contacts.points.iter().any(|p| p.force_n > 0.0);
        let (v_end, w_end) = (
            u.fixed_rows::<3>(0).into_owned(),
            u.fixed_rows::<3>(3).into_owned(),
        );
        // Nothing presses: the forces are constant and the fall is exact.
        let v_way = if pressed { v_end } else { (v + v_end) / 2.0 };
        self.hand_from_body.translation.vector += v_way * h;
        self.hand_from_body.rotation =
            UnitQuaternion::from_scaled_axis(w_end * h) * self.hand_from_body.rotation;
        for i in 0..2 {
            self.finger_m[i] += u[6 + i] * h;
            self.finger_m_s[i] = u[6 + i];
            let limited = self.finger_m[i].clamp(0.0, self.opening_max_m / 2.0);
            if limited != self.finger_m[i] {
                self.finger_m[i] = limited;
                self.finger_m_s[i] = 0.0;
            }
        }
        self.velocity_m_s = v_end + carried;
        self.spin_kg_m2_s = self.masses.inertia_kg_m2 * (w_end + carrier.rad_s);
        for point in &mut self.contacts.points {
            point.depth_m -= h * dot(&point.row, &u);
        }
        for patch in &mut self.contacts.patches {
            let limit_m = patch.limit_n / self.pads.shear_stiffness_n_m;
            for a in 0..3 {
                patch.bent_m[a] += h * dot(&patch.rows[a], &u);
            }
            let size = patch.bent_m.iter().map(|x| x * x).sum::<f64>().sqrt();
            if size > limit_m {
                patch.bent_m = patch.bent_m.map(|x| x * limit_m / size);
            }
        }
    }

    /// Sums up what each finger does to the object.
    fn feel(&mut self) {
        for (i, touch) in self.touch.iter_mut().enumerate() {
            let (mut force_n, mut moment, mut total) = (Vector3::zeros(), Vector3::zeros(), 0.0);
            for patch in self.contacts.patches.iter().filter(|p| p.solid == i) {
                for point in &self.contacts.points[patch.first..patch.last] {
                    force_n += point.normal * point.force_n;
                    moment += point.at * point.force_n;
                    total += point.force_n;
                }
            }
            let centre = Point3::from(moment / f64::max(total, 1e-12));
            *touch = FingerContact {
                force_n: self.world_from_hand.rotation * force_n,
                touches: total > 0.0,
                centre_m: self.world_from_hand * centre,
            };
        }
    }
}

impl World for GripWorld {
    fn freeze(&mut self, is_frozen: bool) {
        self.drag.is_frozen = is_frozen;
    }

    fn limit_speed(&mut self, scene: &Scene, force_n: f64, speed_m_s: f64) {
        self.drag.finger_1_s = force_n / (scene.protocol.solver.finger_mass_kg * speed_m_s);
    }

    fn release(&mut self, gravity_m_s2: &Vector3<f64>, friction: f64) {
        self.pads.friction = friction;
        self.drag.object_1_s = 0.0;
        self.gravity_m_s2 = *gravity_m_s2;
    }

    fn step(
        &mut self,
        scene: &Scene,
        world_from_hand: &Isometry3<f64>,
        drive: &Drive,
        load: &ObjectLoad,
    ) {
        let dt_s = scene.protocol.dt_s;
        self.look(scene);
        let turn = self.world_from_hand.rotation.inverse() * world_from_hand.rotation;
        let rad_s = turn.scaled_axis() / dt_s;
        let way = world_from_hand.translation.vector - self.world_from_hand.translation.vector;
        let half = UnitQuaternion::from_scaled_axis(rad_s * (dt_s / 2.0));
        let middle = self.world_from_hand.rotation * half;
        let before = self.carrier;
        let jump = Carrier {
            m_s: middle.inverse_transform_vector(&(way / dt_s)) - before.m_s,
            rad_s: rad_s - before.rad_s,
        };
        let force_n = load.force_n + self.gravity_m_s2 * scene.mass_kg;
        let outer = ObjectLoad {
            force_n: middle.inverse_transform_vector(&force_n),
            torque_n_m: middle.inverse_transform_vector(&load.torque_n_m),
        };
        let parts = self.parts(scene);
        let h = dt_s / f64::from(parts);
        for part in 1..=parts {
            if part > 1 {
                self.follow_patches(scene);
                self.look(scene);
            }
            // The hand's speed changes evenly, part by part, and it drags its fingers along.
            let share = f64::from(part) / f64::from(parts);
            self.finger_m_s[0] -= jump.m_s.x / f64::from(parts);
            self.finger_m_s[1] += jump.m_s.x / f64::from(parts);
            self.carrier = Carrier {
                m_s: before.m_s + jump.m_s * share,
                rad_s: before.rad_s + jump.rad_s * share,
            };
            // Absolute velocities keep their direction while the hand's axes turn.
            let back = UnitQuaternion::from_scaled_axis(-self.carrier.rad_s * h);
            self.velocity_m_s = back * self.velocity_m_s;
            self.spin_kg_m2_s = back * self.spin_kg_m2_s;
            self.substep(scene, drive, &outer, h);
        }
        self.follow_patches(scene);
        self.world_from_hand = *world_from_hand;
        self.feel();
    }

    fn contacts(&self) -> [FingerContact; 2] {
        self.touch
    }

    fn remove_hand(&mut self) {
        self.has_hand = false;
    }

    fn momentum(&self, scene: &Scene) -> (Vector3<f64>, Vector3<f64>) {
        let turn = self.world_from_hand.rotation;
        (
            turn * self.velocity_m_s * scene.mass_kg,
            turn * self.spin_kg_m2_s,
        )
    }

    fn fingers(&self) -> FingerState {
        FingerState {
            position_m: self.finger_m,
            speed_m_s: self.finger_m_s,
        }
    }

    fn world_from_hand(&self) -> Isometry3<f64> {
        self.world_from_hand
    }

    fn hand_from_body(&self) -> Option<Isometry3<f64>> {
        let pose = &self.hand_from_body;
        let t = pose.translation.vector;
        let is_finite =
            t.iter().all(|x| x.is_finite()) && pose.rotation.coords.iter().all(|x| x.is_finite());
        (is_finite && t.norm() <= 10.0).then_some(*pose)
    }

    fn world_from_object(&self) -> Isometry3<f64> {
        self.world_from_hand * self.hand_from_body * self.body_from_object
    }
}
