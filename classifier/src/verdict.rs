//! The verdict: two independent flags, three finer ones, and the class that leads.

use std::cell::RefCell;
use std::ops::ControlFlow;

use fearless_simd::Simd;
use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};
use shakedown_objects::Surface;
use shakedown_objects::penetration::{Depth, inside_m};
use shakedown_objects::surface::{Lanes, Near, Visitor, bits};

use crate::closing::{Closing, Sweep};
use crate::hand::{HandModel, STRIP_LEFT};

/// When a flag is set; `docs/formats.md` defines the flags.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thresholds {
    /// Penetration up to this depth is no collision, metres. Default 0.
    pub collision_tolerance_m: f64,
    /// The pads must keep at least this distance when closed, metres. Default 1 mm.
    pub width_min_m: f64,
    /// Largest offset of the middle of both contacts, metres. Default 5 mm.
    pub centre_offset_max_m: f64,
    /// Largest angle between contact normal and closing axis, radians. Default atan(1) = 45 deg,
    /// the friction cone at mu = 1.
    pub contact_angle_max_rad: f64,
}

impl Default for Thresholds {
    fn default() -> Self {
        Self {
            collision_tolerance_m: 0.0,
            width_min_m: 0.001,
            centre_offset_max_m: 0.005,
            contact_angle_max_rad: std::f64::consts::FRAC_PI_4,
        }
    }
}

/// The leading label of RFMGrasp: `Optimal` is neither of the other two.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    /// Neither collides nor misses.
    Optimal,
    /// A part of the hand meets the object.
    Collision,
    /// Nothing of the object lies between the pads.
    OutOfReach,
}

impl Class {
    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Optimal => "optimal",
            Self::Collision => "collision",
            Self::OutOfReach => "out_of_reach",
        }
    }
}

/// What geometry says of one grasp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// A part of the hand, fingers open, meets the object deeper than the tolerance.
    pub collides: bool,
    /// Some surface lies between the pads.
    pub reachable: bool,
    /// Both pads would touch and stay more than the least width apart.
    pub closes: bool,
    /// The contacts lie evenly about the hand's axis.
    pub centred: bool,
    /// Both contact normals lie in the cone about the closing axis.
    pub aligned: bool,
    /// How deep the object reaches into the worst part of the hand, metres; 0 if free. For a hand
    /// that is wholly inside the object: the distance of its part from the surface.
    pub penetration_m: f64,
    /// The contacts, when reachable.
    pub closing: Option<Closing>,
}

impl Verdict {
    /// Collision leads, then out of reach.
    pub fn class(&self) -> Class {
        if self.collides {
            Class::Collision
        } else if self.reachable {
            Class::Optimal
        } else {
            Class::OutOfReach
        }
    }

    /// Optimal, and closes, centred and aligned.
    pub fn is_strictly_optimal(&self) -> bool {
        self.class() == Class::Optimal && self.closes && self.centred && self.aligned
    }
}

struct Scratch {
    depths: Vec<Depth>,
    sweep: Sweep,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = const {
        RefCell::new(Scratch { depths: Vec::new(), sweep: Sweep::NEW })
    };
}

/// The hand as it is held against blocks of triangles.
struct Held<'a> {
    hand: &'a HandModel,
    scratch: &'a mut Scratch,
}

impl Visitor for Held<'_> {
    #[inline(always)]
    fn visit<S: Simd>(&mut self, lanes: &mut Lanes, near: &Near<'_, S>) -> ControlFlow<()> {
        let bodies = self.hand.bodies.bodies();
        // Most blocks are near the strips alone.
        if near.meets_first(STRIP_LEFT) {
            for (lane, members) in self.hand.members.iter().enumerate() {
                for i in bits(near.of_lane(lane)) {
                    let triangle = near.triangle(i);
                    for &body in members {
                        self.scratch.depths[body].add(near.simd(), &bodies[body], &triangle);
                    }
                }
            }
        }
        self.scratch.sweep.add(self.hand, near, lanes);
        ControlFlow::Continue(())
    }
}

/// The verdict on one pose of a hand on an object.
///
/// Exact up to f32 rounding (1e-7 m at hand size). Costs a few microseconds and, after the first
/// call of a thread, allocates nothing.
pub fn classify(
    hand: &HandModel,
    surface: &Surface,
    object_from_hand: &Isometry3<f64>,
    thresholds: &Thresholds,
) -> Verdict {
    SCRATCH.with_borrow_mut(|scratch| {
        let bodies = hand.bodies.bodies();
        scratch.depths.resize(bodies.len(), Depth::default());
        scratch.depths.iter_mut().for_each(Depth::clear);
        scratch.sweep.clear();
        let hand_from_object = object_from_hand.inverse();
        let mut lanes = hand.lanes;
        surface.visit_blocks(&hand_from_object, &mut lanes, &mut Held { hand, scratch });
        let mut penetration_m = 0.0f64;
        let mut touches = false;
        for (depth, body) in scratch.depths.iter().zip(bodies) {
            touches |= depth.touched();
            penetration_m = penetration_m.max(f64::from(depth.depth_m(body)));
        }
        // Parts that meet no surface are inside or outside as a whole; so is a hand of one piece.
        let outside = !touches && hand.bodies.is_outside(surface, object_from_hand);
        for (depth, body) in scratch.depths.iter().zip(bodies) {
            if outside || depth.touched() {
                continue;
            }
            if let Some(depth_m) = inside_m(surface, body, object_from_hand) {
                touches = true;
                penetration_m = penetration_m.max(depth_m);
            }
        }
        let tolerance = thresholds.collision_tolerance_m;
        let collides = touches && (tolerance == 0.0 || penetration_m > tolerance);
        let closing = scratch.sweep.closing(hand);
        let width_m = closing.map_or(0.0, |c| c.width_m());
        Verdict {
            collides,
            reachable: closing.is_some(),
            closes: width_m > thresholds.width_min_m && width_m <= hand.opening_m,
            centred: closing.is_some_and(|c| c.offset_m().abs() <= thresholds.centre_offset_max_m),
            aligned: closing.is_some_and(|c| {
                c.angle_rad
                    .iter()
                    .all(|a| *a <= thresholds.contact_angle_max_rad)
            }),
            penetration_m,
            closing,
        }
    })
}
