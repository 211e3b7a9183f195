//! Where do the parts of the hand meet the object? Against the true triangles within reach, boxes by
//! `box_triangle`, hulls by parry's contact manifolds; against convex pieces by parry's.

use std::f64::consts::PI;
use std::ops::ControlFlow;

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use shakedown_gripper_assets::gripper::Side;
use shakedown_objects::surface::{LANES, Lanes};

use super::box_triangle::{Cone, Meeting, meet};
use crate::convert;
use crate::protocol::BoxContacts;
use crate::rapier::math::{Pose, Real, Vector};
use crate::rapier::parry::bounding_volume::{Aabb, BoundingVolume};
use crate::rapier::parry::query::{
    ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher,
};
use crate::rapier::parry::shape::{SharedShape, Triangle, TrianglePseudoNormals};
use crate::scene::Scene;

/// Index of the palm among the solids of the hand; 0 and 1 are the left and the right finger.
pub(super) const PALM: usize = 2;

/// A point at which hand and object touch or nearly do; hand frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    pub solid: usize,
    pub at: Vector3<f64>,
    /// From the hand into the object, unit length.
    pub normal: Vector3<f64>,
    /// Negative: a gap.
    pub depth_m: f64,
}

/// Parry meets triangles in centimetres: it leaves out edges by an absolute length, 0.35 mm were they
/// metres.
const PER_M: Real = 100.0;

/// A convex part of the hand.
struct HandPart {
    solid: usize,
    /// Half size of a box that our own search meets.
    half: Option<Vector3<f32>>,
    /// With closed fingers.
    hand_from_part: Isometry3<f64>,
    shape: SharedShape,
    /// The same in centimetres, if parry holds it against triangles.
    large: SharedShape,
    /// Its box, own frame.
    local: Aabb,
    /// Of its box around, hand frame, with closed fingers.
    min: Vector3<f32>,
    max: Vector3<f32>,
}

/// Where a part is, single precision.
#[derive(Clone, Copy)]
struct Place {
    at: Vector3<f32>,
    turn: Matrix3<f32>,
    part_from_object: Matrix3<f32>,
    part_from_hand: Pose,
}

impl Place {
    const NONE: Self = Self {
        at: Vector3::new(0.0, 0.0, 0.0),
        turn: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        part_from_object: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        part_from_hand: Pose::IDENTITY,
    };

    fn new(hand_from_part: &Isometry3<f64>, hand_from_object: &Isometry3<f64>) -> Self {
        let matrix = |q: UnitQuaternion<f64>| q.to_rotation_matrix().into_inner().map(|x| x as f32);
        let turn = hand_from_part.rotation.inverse();
        Self {
            at: hand_from_part.translation.vector.map(|x| x as f32),
            turn: matrix(turn),
            part_from_object: matrix(turn * hand_from_object.rotation),
            part_from_hand: convert::pose(&hand_from_part.inverse()),
        }
    }
}

/// Finds spots; keeps its buffers.
pub(super) struct Finder {
    parts: Vec<HandPart>,
    manifold: ContactManifold<(), ()>,
    /// What was found, solid by solid in the order of triangles and pieces.
    pub spots: Vec<Spot>,
}

impl Finder {
    pub fn new(scene: &Scene) -> Self {
        let own = scene.protocol.solver.box_contacts == BoxContacts::Own;
        let mut parts = Vec::new();
        let mut add = |solid: usize, turn: &Isometry3<f64>, shapes: &[(Pose, SharedShape)]| {
            for (pose, shape) in shapes {
                let hand_from_part = turn * convert::from_pose(pose);
                let aabb = shape.compute_aabb(&convert::pose(&hand_from_part));
                let corner = |v: Vector| convert::from_vector(v).map(|x| x as f32);
                let cuboid = shape.as_cuboid().filter(|_| own);
                let half = cuboid.map(|c| corner(c.half_extents));
                let meets_triangles = solid != PALM && half.is_none();
                let large = meets_triangles.then(|| {
                    let large = shape.scale_dyn(Vector::splat(PER_M), 1);
                    SharedShape(large.expect("a convex shape can be scaled").into())
                });
                parts.push(HandPart {
                    solid,
                    half,
                    hand_from_part,
                    shape: shape.clone(),
                    large: large.unwrap_or_else(|| shape.clone()),
                    local: shape.compute_local_aabb(),
                    min: corner(aabb.mins),
                    max: corner(aabb.maxs),
                });
            }
        };
        for (solid, side) in Side::BOTH.into_iter().enumerate() {
            let angle = if side == Side::Left { 0.0 } else { PI };
            add(
                solid,
                &Isometry3::rotation(Vector3::z() * angle),
                &scene.finger_shapes,
            );
        }
        add(PALM, &Isometry3::identity(), &scene.palm_shapes);
        Self {
            parts,
            manifold: ContactManifold::new(),
            spots: Vec::with_capacity(256),
        }
    }

    /// All spots within the prediction distance, fingers open by `finger_m` each.
    pub fn find(&mut self, scene: &Scene, hand_from_body: &Isometry3<f64>, finger_m: &[f64; 2]) {
        self.spots.clear();
        let shifts = [finger_m[0], -finger_m[1], 0.0];
        if let Some(normals) = &scene.pseudo_normals {
            self.find_on_surface(scene, normals, hand_from_body, &shifts);
            self.find_on_pieces(scene, hand_from_body, &shifts, |solid| solid == PALM);
        } else {
            self.find_on_pieces(scene, hand_from_body, &shifts, |_| true);
        }
    }

    fn find_on_surface(
        &mut self,
        scene: &Scene,
        normals: &[Option<Cone>],
        hand_from_body: &Isometry3<f64>,
        shifts: &[f64; 3],
    ) {
        let prediction = scene.protocol.solver.prediction_m;
        let hand_from_object = hand_from_body * scene.object_from_body().inverse();
        let turn = convert::rotation(&hand_from_object.rotation);
        let (manifold, spots) = (&mut self.manifold, &mut self.spots);
        let fingers = self.parts.iter().filter(|p| p.solid != PALM).count();
        for group in self.parts[..fingers].chunks(LANES) {
            let mut lanes = lanes(group, shifts, prediction);
            let mut places = [Place::NONE; LANES];
            for (lane, part) in group.iter().enumerate() {
                let shift = Vector3::new(shifts[part.solid], 0.0, 0.0);
                let hand_from_part = Translation3::from(shift) * part.hand_from_part;
                places[lane] = Place::new(&hand_from_part, &hand_from_object);
            }
            let visit = |_: &mut Lanes, face: usize, corners: [Vector3<f32>; 3], mask: u32| {
                for (lane, part) in group.iter().enumerate() {
                    if mask >> lane & 1 == 0 {
                        continue;
                    }
                    let Some(normals) = &normals[face] else {
                        continue;
                    };
                    let place = &places[lane];
                    if let Some(half) = &part.half {
                        let rotation = &place.part_from_object;
                        let cone = Cone {
                            face: rotation * normals.face,
                            edges: normals.edges.map(|e| rotation * e),
                        };
                        let triangle = corners.map(|v| place.turn * (v - place.at));
                        if let Some(meeting) = meet(half, &triangle, &cone, prediction as f32) {
                            push_meeting(spots, &meeting, part.solid, place);
                        }
                        continue;
                    }
                    let [a, b, c] = corners.map(|v| {
                        let at = Vector::new(v.x as _, v.y as _, v.z as _);
                        place.part_from_hand.transform_point(at) * PER_M
                    });
                    let turn = place.part_from_hand.rotation * turn;
                    let vector = |v: &Vector3<f32>| Vector::new(v.x as _, v.y as _, v.z as _);
                    let cone = TrianglePseudoNormals {
                        face: turn * vector(&normals.face),
                        edges: normals.edges.map(|e| turn * vector(&e)),
                        two_sided: false,
                    };
                    manifold.clear();
                    let _ = DefaultQueryDispatcher.contact_manifold_convex_convex(
                        &Pose::IDENTITY,
                        &*part.large,
                        &Triangle::new(a, b, c),
                        None,
                        Some(&cone),
                        prediction as Real * PER_M,
                        manifold,
                    );
                    let hand_from_part = place.part_from_hand.inverse();
                    for point in &mut manifold.points {
                        point.local_p1 /= PER_M;
                        point.dist /= PER_M;
                    }
                    push(spots, manifold, part.solid, &hand_from_part, prediction);
                }
                ControlFlow::Continue(())
            };
            scene
                .surface
                .visit_near(&hand_from_object, &mut lanes, visit);
        }
    }

    fn find_on_pieces(
        &mut self,
        scene: &Scene,
        hand_from_body: &Isometry3<f64>,
        shifts: &[f64; 3],
        takes: impl Fn(usize) -> bool,
    ) {
        let prediction = scene.protocol.solver.prediction_m;
        let hand_from_body = convert::pose(hand_from_body);
        let reach = scene.radius_m + prediction;
        let centre = convert::from_vector(hand_from_body.translation).map(|x| x as f32);
        for part in self.parts.iter().filter(|p| takes(p.solid)) {
            let shift = Vector3::new(shifts[part.solid], 0.0, 0.0);
            let by = shift.map(|x| x as f32);
            let outside = (part.min + by - centre)
                .sup(&(centre - part.max - by))
                .sup(&Vector3::zeros());
            if f64::from(outside.norm()) > reach {
                continue;
            }
            let hand_from_part = Translation3::from(shift) * part.hand_from_part;
            let hand_from_part = convert::pose(&hand_from_part);
            let part_from_body = hand_from_part.inverse() * hand_from_body;
            let body_from_part = part_from_body.inverse();
            let own = part.local.loosened(prediction as _);
            let near = own.transform_by(&body_from_part);
            for (aabb, piece) in &scene.piece_shapes {
                let apart =
                    !near.intersects(aabb) || !own.intersects(&aabb.transform_by(&part_from_body));
                if apart {
                    continue;
                }
                self.manifold.clear();
                let _ = DefaultQueryDispatcher.contact_manifold_convex_convex(
                    &part_from_body,
                    &*part.shape,
                    &**piece,
                    None,
                    None,
                    prediction as _,
                    &mut self.manifold,
                );
                let spots = &mut self.spots;
                push(
                    spots,
                    &self.manifold,
                    part.solid,
                    &hand_from_part,
                    prediction,
                );
            }
        }
    }
}

/// The boxes of some parts, larger by `margin_m`.
fn lanes(group: &[HandPart], shifts: &[f64; 3], margin_m: f64) -> Lanes {
    let mut lanes = Lanes::default();
    let margin = Vector3::repeat(margin_m as f32);
    for (lane, part) in group.iter().enumerate() {
        let by = Vector3::new(shifts[part.solid] as f32, 0.0, 0.0);
        lanes.set(lane, part.min + by - margin, part.max + by + margin);
    }
    lanes
}

fn push(
    spots: &mut Vec<Spot>,
    manifold: &ContactManifold<(), ()>,
    solid: usize,
    hand_from_part: &Pose,
    prediction_m: f64,
) {
    let normal = convert::from_vector(hand_from_part.rotation * manifold.local_n1);
    for point in &manifold.points {
        let depth_m = -f64::from(point.dist);
        if depth_m < -prediction_m {
            continue;
        }
        spots.push(Spot {
            solid,
            at: convert::from_vector(hand_from_part.transform_point(point.local_p1)),
            normal,
            depth_m,
        });
    }
}

fn push_meeting(spots: &mut Vec<Spot>, meeting: &Meeting, solid: usize, place: &Place) {
    let back = place.turn.transpose();
    let normal = (back * meeting.normal).map(f64::from);
    for (point, gap) in &meeting.points[..meeting.len] {
        spots.push(Spot {
            solid,
            at: (back * point + place.at).map(f64::from),
            normal,
            depth_m: -f64::from(*gap),
        });
    }
}
