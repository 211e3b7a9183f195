//! Does a grasp resist any small wrench, and how well? Analytic quality without simulation.
//!
//! Wrenches that the contacts can exert with normal forces that sum to one: the convex hull of the
//! edges of their friction cones (C. Ferrari and J. Canny, "Planning optimal grasps", ICRA 1992).
//! Contacts are soft fingers: a torque about the normal, too (M. Cutkosky, 1989). Torques are taken
//! about the centre of mass and divided by the object's size, so that they compare with forces.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};
use shakedown_classifier::profile::{COLUMNS, Profile, ROWS};

use crate::polytope::{Point6, Polytope};

/// Edges of a discretised friction cone.
const EDGES: usize = 8;

/// A contact patch is what lies within this of the first contact, metres: the rubber gives.
const PATCH_M: f64 = 0.001;

/// A place where a pad presses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Place, hand frame, metres.
    pub position_m: Point3<f64>,
    /// Unit vector along which the pad presses on the object, hand frame.
    pub inward: Vector3<f64>,
}

/// What a contact can do beside pressing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// Coulomb's coefficient.
    pub coefficient: f64,
    /// Lever arm of the soft finger: torque about the normal at most coefficient x force x this,
    /// metres.
    pub torsional_m: f64,
}

impl Default for Friction {
    /// The friction of preset `acronym` (`friction` x `friction_scale`) and the mean arm of a patch
    /// of rubber 1 cm wide.
    fn default() -> Self {
        Self {
            coefficient: 0.25,
            torsional_m: 0.004,
        }
    }
}

/// Analytic quality of a grasp.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WrenchQuality {
    /// Ferrari-Canny epsilon: the smallest wrench that breaks the grasp, per newton of summed
    /// normal force; 0 without force closure.
    pub epsilon: f64,
    /// Volume of the wrench space, same units to the sixth power.
    pub volume: f64,
}

impl WrenchQuality {
    /// Is every small wrench resisted?
    pub fn force_closure(&self) -> bool {
        self.epsilon > 0.0
    }
}

/// The quality of some contacts on an object whose centre of mass lies at `com_m` (hand frame) and
/// whose size is `extent_m`.
pub fn quality(
    contacts: &[Contact],
    friction: Friction,
    com_m: &Point3<f64>,
    extent_m: f64,
) -> WrenchQuality {
    let mut wrenches: Vec<Point6> = Vec::with_capacity(contacts.len() * (EDGES + 2));
    for contact in contacts {
        let n = contact.inward;
        let helper = if n.x.abs() < 0.9 {
            Vector3::x()
        } else {
            Vector3::y()
        };
        let (s, t) = {
            let s = n.cross(&helper).normalize();
            (s, n.cross(&s))
        };
        let arm = contact.position_m - com_m;
        let mut push = |force: Vector3<f64>, twist: f64| {
            let torque = (arm.cross(&force) + n * twist) / extent_m;
            wrenches.push([force.x, force.y, force.z, torque.x, torque.y, torque.z]);
        };
        for k in 0..EDGES {
            let (sin, cos) = (TAU * k as f64 / EDGES as f64).sin_cos();
            push(n + (s * cos + t * sin) * friction.coefficient, 0.0);
        }
        let twist = friction.coefficient * friction.torsional_m;
        push(n, twist);
        push(n, -twist);
    }
    let Some(hull) = Polytope::hull(&wrenches) else {
        return WrenchQuality::default();
    };
    WrenchQuality {
        epsilon: hull.ball().max(0.0),
        volume: hull.volume(),
    }
}

/// The contacts that geometry predicts: of each pad's patch the four outermost lines.
pub fn predicted_contacts(profile: &Profile) -> Vec<Contact> {
    let hits: Vec<_> = (0..ROWS * COLUMNS)
        .filter_map(|i| {
            let (row, column) = (i / COLUMNS, i % COLUMNS);
            let at = [profile.column_y_m[column], profile.row_z_m[row]];
            Some((at, profile.lines[row][column]?))
        })
        .collect();
    let mut contacts = Vec::new();
    for side in 0..2 {
        let outwards = if side == 0 { -1.0 } else { 1.0 };
        let reach = |x: f64| outwards * x;
        let first = hits
            .iter()
            .map(|h| reach(h.1.x_m[side]))
            .fold(f64::MIN, f64::max);
        let patch: Vec<_> = hits
            .iter()
            .filter(|h| reach(h.1.x_m[side]) >= first - PATCH_M)
            .collect();
        let mut chosen: Vec<usize> = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]]
            .iter()
            .filter_map(|corner| {
                let far = |i: usize| corner[0] * patch[i].0[0] + corner[1] * patch[i].0[1];
                (0..patch.len()).max_by(|a, b| far(*a).total_cmp(&far(*b)))
            })
            .collect();
        chosen.sort_unstable();
        chosen.dedup();
        contacts.extend(chosen.into_iter().map(|i| {
            let ([y, z], line) = patch[i];
            Contact {
                position_m: Point3::new(line.x_m[side], *y, *z),
                inward: -line.normal[side],
            }
        }));
    }
    contacts
}

/// The quality of the contacts that geometry predicts.
pub fn predicted_quality(
    profile: &Profile,
    friction: Friction,
    com_m: &Point3<f64>,
    extent_m: f64,
) -> WrenchQuality {
    quality(&predicted_contacts(profile), friction, com_m, extent_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(half_m: f64, tilt_rad: f64) -> Vec<Contact> {
        [-1.0, 1.0]
            .into_iter()
            .map(|side: f64| Contact {
                position_m: Point3::new(side * half_m, 0.0, 0.0),
                inward: Vector3::new(-side * tilt_rad.cos(), tilt_rad.sin(), 0.0),
            })
            .collect()
    }

    fn of(contacts: &[Contact], coefficient: f64, torsional_m: f64) -> WrenchQuality {
        let friction = Friction {
            coefficient,
            torsional_m,
        };
        quality(contacts, friction, &Point3::origin(), 0.05)
    }

    #[test]
    fn two_soft_fingers_close_on_parallel_faces_and_two_hard_ones_do_not() {
        let contacts = pair(0.02, 0.0);
        let soft = of(&contacts, 0.5, 0.005);
        assert!(soft.force_closure() && soft.epsilon > 0.0 && soft.volume > 0.0);
        // Without torsion nothing resists a turn about the line between the contacts.
        let hard = of(&contacts, 0.5, 0.0);
        assert!(!hard.force_closure() && hard.epsilon == 0.0);
    }

    #[test]
    fn epsilon_of_two_opposed_soft_fingers_is_the_torsion_that_breaks_them() {
        // About the closing axis each newton of summed force resists mu x lever / size.
        let soft = of(&pair(0.02, 0.0), 0.5, 0.005);
        let expected = 0.5 * 0.005 / 0.05;
        assert!((soft.epsilon / expected - 1.0).abs() < 0.05, "{soft:?}");
    }

    #[test]
    fn the_cone_decides_how_steep_faces_may_be() {
        // Nguyen's condition: the line between the contacts lies in both friction cones.
        let mu: f64 = 0.5;
        assert!(of(&pair(0.02, 0.8 * mu.atan()), mu, 0.005).force_closure());
        assert!(!of(&pair(0.02, 1.2 * mu.atan()), mu, 0.005).force_closure());
    }

    #[test]
    fn a_rigid_motion_of_hand_and_object_changes_nothing() {
        let contacts = pair(0.02, 0.1);
        let turn = nalgebra::UnitQuaternion::from_euler_angles(0.4, -1.0, 2.0);
        let turned: Vec<Contact> = contacts
            .iter()
            .map(|c| Contact {
                position_m: turn * c.position_m,
                inward: turn * c.inward,
            })
            .collect();
        let (a, b) = (of(&contacts, 0.5, 0.005), of(&turned, 0.5, 0.005));
        // The cone's edges turn with the hand; sixteen of them would turn less.
        assert!((a.epsilon / b.epsilon - 1.0).abs() < 0.02, "{a:?} {b:?}");
    }
}
