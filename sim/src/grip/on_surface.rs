//! Contacts with the true triangles within reach: boxes by our own search, hulls by parry's manifolds.

use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use shakedown_objects::surface::bits;

use super::box_triangle::{Cone, Meeting, meet};
use super::contact::{Finder, HandPart, PER_M, Spot, push};
use super::near::{Near, hand_from_part};
use super::separation::{EIGHT, Eight, Pairs};
use crate::convert;
use crate::rapier::math::{Pose, Real, Vector};
use crate::rapier::parry::query::{
    ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher,
};
use crate::rapier::parry::shape::{Triangle, TrianglePseudoNormals};
use crate::scene::Scene;

/// Where a part is; triangles are in the object's axes about the origin of its surface.
pub(super) struct Place {
    hand_from_part: Isometry3<f64>,
    /// Single precision.
    rotation: Matrix3<f32>,
    shift: Vector3<f32>,
    /// To the hand's axes.
    back: Matrix3<f32>,
}

impl Place {
    fn new(hand_from_part: Isometry3<f64>, hand_from_surface: &Isometry3<f64>) -> Self {
        let part_from_surface = hand_from_part.inv_mul(hand_from_surface);
        Self {
            rotation: single(&part_from_surface.rotation),
            shift: part_from_surface.translation.vector.map(|x| x as f32),
            back: single(&hand_from_part.rotation),
            hand_from_part,
        }
    }
}

fn single(rotation: &UnitQuaternion<f64>) -> Matrix3<f32> {
    rotation.to_rotation_matrix().into_inner().map(|x| x as f32)
}

/// Pairs of a box of the hand and a triangle near it that wait until there are enough of them.
#[derive(Default)]
pub(super) struct Waiting {
    pairs: Pairs,
    parts: [usize; EIGHT],
    faces: [usize; EIGHT],
    count: usize,
}

/// One look at the surface.
struct Search<'a> {
    parts: &'a [HandPart],
    places: &'a [Place],
    cones: &'a [Option<Cone>],
    prediction_m: f64,
    waiting: &'a mut Waiting,
    meeting: &'a mut Meeting,
    manifold: &'a mut ContactManifold<(), ()>,
    spots: &'a mut Vec<Spot>,
}

impl Finder {
    /// Appends the spots of the fingers on the object's surface, part by part in the order of triangles.
    pub(super) fn find_on_surface(
        &mut self,
        scene: &Scene,
        cones: &[Option<Cone>],
        hand_from_body: &Isometry3<f64>,
        shifts: &[f64; 3],
    ) {
        self.nearby
            .follow(scene, &self.parts, hand_from_body, shifts);
        if self.nearby.is_empty() {
            return;
        }
        let object_from_surface = Translation3::from(scene.surface.origin().coords);
        let hand_from_surface =
            hand_from_body * scene.object_from_body().inverse() * object_from_surface;
        let fingers = &self.parts[..self.nearby.parts.len()];
        self.places.clear();
        self.places.extend(
            fingers
                .iter()
                .map(|part| Place::new(hand_from_part(part, shifts), &hand_from_surface)),
        );
        let mut search = Search {
            parts: fingers,
            places: &self.places,
            cones,
            prediction_m: scene.protocol.solver.prediction_m,
            waiting: &mut self.waiting,
            meeting: &mut self.meeting,
            manifold: &mut self.manifold,
            spots: &mut self.spots,
        };
        let near = &self.nearby.parts;
        dispatch!(Level::new(), simd => search.run(simd, near));
    }
}

impl Search<'_> {
    /// In the widest registers that the machine has: the same bits in all of them.
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, near: &[Near]) {
        for (part, near) in near.iter().enumerate() {
            self.visit(simd, part, near);
        }
        self.meet_waiting(simd);
    }

    #[inline(always)]
    fn visit<S: Simd>(&mut self, simd: S, part: usize, near: &Near) {
        let (place, prediction) = (&self.places[part], self.prediction_m as f32);
        for (eight, faces) in near.eights() {
            let moved = eight.moved(simd, &place.rotation, &place.shift);
            let Some(half) = &self.parts[part].half else {
                self.meet_waiting(simd);
                self.meet_hull(part, &moved, faces);
                continue;
            };
            for lane in bits(moved.near(simd, faces.len(), half, prediction)) {
                let waiting = &mut *self.waiting;
                waiting.pairs.set(waiting.count, half, &moved, lane);
                waiting.parts[waiting.count] = part;
                waiting.faces[waiting.count] = faces[lane] as usize;
                waiting.count += 1;
                if waiting.count == EIGHT {
                    self.meet_waiting(simd);
                }
            }
        }
    }

    #[inline(always)]
    fn meet_waiting<S: Simd>(&mut self, simd: S) {
        let waiting = &mut *self.waiting;
        let prediction = self.prediction_m as f32;
        let axes = waiting.pairs.axes(simd, waiting.count, prediction);
        waiting.count = 0;
        for lane in bits(axes.near) {
            let (part, place) = (
                &self.parts[waiting.parts[lane]],
                &self.places[waiting.parts[lane]],
            );
            let (Some(half), Some(cone)) = (&part.half, &self.cones[waiting.faces[lane]]) else {
                continue;
            };
            let (gap, axis) = axes.of(lane);
            let Some(normal) = cone.allowed(&axis, &place.rotation) else {
                continue;
            };
            let triangle = waiting.pairs.triangle(lane);
            meet(half, &triangle, normal, gap, prediction, self.meeting);
            let normal = (place.back * normal).map(f64::from);
            let middle = place.hand_from_part.translation.vector;
            for (point, gap) in self.meeting.points() {
                self.spots.push(Spot {
                    solid: part.solid,
                    at: (place.back * point).map(f64::from) + middle,
                    normal,
                    depth_m: -f64::from(*gap),
                });
            }
        }
    }

    fn meet_hull(&mut self, part: usize, moved: &Eight, faces: &[u32]) {
        let (part, place) = (&self.parts[part], &self.places[part]);
        let vector = |v: Vector3<f32>| Vector::new(v.x as _, v.y as _, v.z as _);
        let hand_from_part = convert::pose(&place.hand_from_part);
        let (low, high) = (part.local.mins, part.local.maxs);
        let margin = Vector::splat(self.prediction_m as _);
        for (lane, face) in faces.iter().enumerate() {
            let [a, b, c] = moved.triangle(lane).map(vector);
            let is_apart = (a.max(b).max(c) + margin).cmplt(low).any()
                || (a.min(b).min(c) - margin).cmpgt(high).any();
            let Some(cone) = self.cones[*face as usize].as_ref().filter(|_| !is_apart) else {
                continue;
            };
            let cone = TrianglePseudoNormals {
                face: vector(place.rotation * cone.face),
                edges: cone.edges.map(|e| vector(place.rotation * e)),
                two_sided: false,
            };
            let manifold = &mut *self.manifold;
            manifold.clear();
            let _ = DefaultQueryDispatcher.contact_manifold_convex_convex(
                &Pose::IDENTITY,
                &*part.large,
                &Triangle::new(a * PER_M, b * PER_M, c * PER_M),
                None,
                Some(&cone),
                self.prediction_m as Real * PER_M,
                manifold,
            );
            for point in &mut manifold.points {
                point.local_p1 /= PER_M;
                point.dist /= PER_M;
            }
            push(
                self.spots,
                manifold,
                part.solid,
                &hand_from_part,
                self.prediction_m,
            );
        }
    }
}
