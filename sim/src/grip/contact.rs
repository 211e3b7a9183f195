//! Where do the parts of the hand meet the object? Fingers against the true triangles (`on_surface`),
//! the palm, or in coarse mode everything, against convex pieces by parry's manifolds.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Vector3};
use shakedown_gripper_assets::gripper::Side;

use super::box_triangle::Meeting;
use super::near::{Nearby, hand_from_part};
use super::on_surface::{Place, Waiting};
use crate::convert;
use crate::protocol::BoxContacts;
use crate::rapier::math::{Pose, Real, Vector};
use crate::rapier::parry::bounding_volume::{Aabb, BoundingVolume};
use crate::rapier::parry::query::{
    ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher,
};
use crate::rapier::parry::shape::SharedShape;
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
pub(super) const PER_M: Real = 100.0;

/// A convex part of the hand.
pub(super) struct HandPart {
    pub solid: usize,
    /// Half size of a box that our own search meets.
    pub half: Option<Vector3<f32>>,
    /// With closed fingers.
    pub hand_from_part: Isometry3<f64>,
    shape: SharedShape,
    /// The same in centimetres, if parry holds it against triangles.
    pub large: SharedShape,
    /// Its box, own frame.
    pub local: Aabb,
    /// Of its box around, hand frame, with closed fingers.
    pub min: Vector3<f32>,
    pub max: Vector3<f32>,
}

/// Finds spots; keeps its buffers.
pub(super) struct Finder {
    pub(super) parts: Vec<HandPart>,
    pub(super) manifold: ContactManifold<(), ()>,
    pub(super) meeting: Meeting,
    pub(super) nearby: Nearby,
    pub(super) places: Vec<Place>,
    pub(super) waiting: Waiting,
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
            nearby: Nearby::new(&parts),
            places: Vec::with_capacity(parts.len()),
            waiting: Waiting::default(),
            parts,
            manifold: ContactManifold::new(),
            meeting: Meeting::default(),
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
            let hand_from_part = convert::pose(&hand_from_part(part, shifts));
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

pub(super) fn push(
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
