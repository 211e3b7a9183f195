//! Which triangles can each part of the fingers meet soon? Lists that outlast many searches.

use std::ops::ControlFlow;

use nalgebra::{Isometry3, Translation3, Vector3};
use shakedown_objects::surface::{LANES, Lanes};

use super::contact::{HandPart, PALM};
use super::separation::{EIGHT, Eight};
use crate::scene::Scene;

/// Lists hold what lies within the prediction distance and a margin; they last until something has
/// moved as far. Wide margins make long lists, narrow ones make lists often, so the margin follows the
/// motion, metres. What is found does not depend on it.
const MARGIN_MIN_M: f64 = 5e-5;
const MARGIN_MAX_M: f64 = 2e-3;

/// The margin doubles if a list served fewer searches, and halves if it served more.
const SEARCHES: [u32; 2] = [6, 24];

/// Triangles a part has room for at first.
const ROOM: usize = 16 * EIGHT;

/// The triangles near one part, in the order of the surface's tree.
#[derive(Debug, Default)]
pub(super) struct Near {
    eights: Vec<Eight>,
    faces: Vec<u32>,
}

impl Near {
    fn with_room() -> Self {
        Self {
            eights: Vec::with_capacity(ROOM / EIGHT),
            faces: Vec::with_capacity(ROOM),
        }
    }

    fn push(&mut self, face: u32, corners: &[Vector3<f32>; 3], normal: &Vector3<f32>) {
        let lane = self.faces.len() % EIGHT;
        if lane == 0 {
            self.eights.push(Eight::default());
        }
        self.faces.push(face);
        if let Some(last) = self.eights.last_mut() {
            last.set(lane, corners, normal);
        }
    }

    /// Up to eight triangles each, with the numbers of their faces.
    pub fn eights(&self) -> impl Iterator<Item = (&Eight, &[u32])> {
        self.eights.iter().zip(self.faces.chunks(EIGHT))
    }
}

/// The lists of all parts of the fingers, and where the hand was when they were made.
#[derive(Debug)]
pub(super) struct Nearby {
    pub parts: Vec<Near>,
    made_at: Option<(Isometry3<f64>, [f64; 3])>,
    margin_m: f64,
    searches: u32,
}

impl Nearby {
    pub fn new(parts: &[HandPart]) -> Self {
        let fingers = parts.iter().filter(|p| p.solid != PALM).count();
        Self {
            parts: (0..fingers).map(|_| Near::with_room()).collect(),
            made_at: None,
            margin_m: MARGIN_MIN_M,
            searches: 0,
        }
    }

    pub fn is_empty(&self) -> bool {
        self.parts.iter().all(|near| near.faces.is_empty())
    }

    /// Makes the lists anew if hand or object have moved so far that a triangle could be missing.
    pub fn follow(
        &mut self,
        scene: &Scene,
        parts: &[HandPart],
        hand_from_body: &Isometry3<f64>,
        shifts: &[f64; 3],
    ) {
        self.searches += 1;
        if self.is_good(scene, hand_from_body, shifts) {
            return;
        }
        if self.searches < SEARCHES[0] {
            self.margin_m = (2.0 * self.margin_m).min(MARGIN_MAX_M);
        } else if self.searches > SEARCHES[1] {
            self.margin_m = (0.5 * self.margin_m).max(MARGIN_MIN_M);
        }
        self.searches = 0;
        self.made_at = Some((*hand_from_body, *shifts));
        let Some(cones) = &scene.pseudo_normals else {
            return;
        };
        let margin_m = scene.protocol.solver.prediction_m + self.margin_m;
        let hand_from_object = hand_from_body * scene.object_from_body().inverse();
        let origin = scene.surface.origin();
        for (near, group) in self.parts.chunks_mut(LANES).zip(parts.chunks(LANES)) {
            for near in near.iter_mut() {
                near.eights.clear();
                near.faces.clear();
            }
            let mut lanes = Lanes::default();
            let margin = Vector3::repeat(margin_m as f32);
            for (lane, part) in group.iter().enumerate().take(near.len()) {
                let by = Vector3::x() * shifts[part.solid] as f32;
                lanes.set(lane, part.min + by - margin, part.max + by + margin);
            }
            let visit = |_: &mut Lanes, face: usize, _: [Vector3<f32>; 3], mask: u32| {
                if let Some(cone) = &cones[face] {
                    let corners = scene.surface.triangle(face as u32);
                    let corners = corners.map(|v| (v - origin).map(|x| x as f32));
                    for (lane, near) in near.iter_mut().enumerate() {
                        if mask >> lane & 1 == 1 {
                            near.push(face as u32, &corners, &cone.face);
                        }
                    }
                }
                ControlFlow::Continue(())
            };
            scene
                .surface
                .visit_near(&hand_from_object, &mut lanes, visit);
        }
    }

    fn is_good(&self, scene: &Scene, hand_from_body: &Isometry3<f64>, shifts: &[f64; 3]) -> bool {
        let Some((pose, at)) = &self.made_at else {
            return false;
        };
        let way = hand_from_body.translation.vector - pose.translation.vector;
        let turn = hand_from_body.rotation.angle_to(&pose.rotation);
        let slide = (shifts[0] - at[0]).abs().max((shifts[1] - at[1]).abs());
        way.norm() + turn * scene.radius_m + slide <= self.margin_m
    }
}

/// The frame of a part, moved with its finger.
pub(super) fn hand_from_part(part: &HandPart, shifts: &[f64; 3]) -> Isometry3<f64> {
    Translation3::from(Vector3::x() * shifts[part.solid]) * part.hand_from_part
}
