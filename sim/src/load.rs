//! What is done to the object in the closed hand: the phases of a trial's load, in order.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::outcome::Stage;
use crate::protocol::{LoadKind, Protocol, TugFrame};
use crate::shake::Shake;

const GRAVITY_M_S2: f64 = 9.81;

/// How the hand moves in a phase; poses are relative to where the phase began.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Motion {
    Still,
    /// Along a direction of the hand.
    Linear(Shake, Vector3<f64>),
    /// About the closing axis through the point (0, 0, z) of the hand.
    Angular(Shake, f64),
    /// Along a direction, `speed` at most: `rate` of the way left per second, or at full speed.
    Lift {
        direction: Vector3<f64>,
        height_m: f64,
        speed_m_s: f64,
        rate_1_s: f64,
    },
}

impl Motion {
    /// `start_from_hand` after `t` seconds.
    pub(crate) fn at(&self, t: f64) -> Isometry3<f64> {
        let shift = |v: Vector3<f64>| Isometry3::from(Translation3::from(v));
        match *self {
            Self::Still => Isometry3::identity(),
            Self::Linear(shake, direction) => shift(direction * shake.offset(t)),
            Self::Angular(shake, z) => {
                let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), shake.offset(t));
                Isometry3::rotation_wrt_point(turn, Point3::new(0.0, 0.0, z))
            }
            Self::Lift {
                direction,
                height_m,
                speed_m_s,
                rate_1_s,
            } => shift(direction * lifted(t, height_m, speed_m_s, rate_1_s)),
        }
    }
}

/// Height after `t` seconds: full speed until the share `rate` of the way left is slower.
fn lifted(t: f64, height: f64, speed: f64, rate: f64) -> f64 {
    if rate == 0.0 {
        return height.min(speed * t);
    }
    let coast = (height - speed / rate).max(0.0);
    let coast_s = coast / speed;
    if t <= coast_s {
        speed * t
    } else {
        height - (height - coast) * (-rate * (t - coast_s)).exp()
    }
}

/// One phase of the load.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Phase {
    pub stage: Stage,
    pub duration_s: f64,
    pub motion: Motion,
    /// Force on the object's centre of mass, N, axes of the hand at the start of the trial.
    pub object_force_n: Vector3<f64>,
    /// For `hardness`: survived when this phase ends, in g.
    pub level_g: Option<f64>,
}

impl Phase {
    fn still(stage: Stage, duration_s: f64) -> Self {
        Self {
            stage,
            duration_s,
            motion: Motion::Still,
            object_force_n: Vector3::zeros(),
            level_g: None,
        }
    }
}

/// The load as groups of phases; each group starts from a fresh grasp.
pub(crate) fn groups(
    p: &Protocol,
    mass_kg: f64,
    object_from_hand: &Isometry3<f64>,
) -> Vec<Vec<Phase>> {
    let mut groups = match p.load {
        LoadKind::Shake => vec![shakes(p)],
        LoadKind::Lift => vec![vec![Phase {
            motion: Motion::Lift {
                direction: object_from_hand.inverse_transform_vector(&Vector3::z()),
                height_m: p.lift_height_m,
                speed_m_s: p.lift_speed_m_s,
                rate_1_s: p.lift_rate_1_s,
            },
            ..Phase::still(Stage::Lift, p.lift_time_s)
        }]],
        LoadKind::Hardness => vec![levels(p)],
        LoadKind::Tugs => {
            let tugs: Vec<Phase> = tugs(p, mass_kg, object_from_hand);
            if p.tug_fresh_start {
                tugs.into_iter().map(|tug| vec![tug]).collect()
            } else {
                vec![tugs]
            }
        }
    };
    for group in &mut groups {
        if p.settle_s > 0.0 {
            group.insert(0, Phase::still(Stage::Settle, p.settle_s));
        }
        group.push(Phase::still(Stage::Hold, p.hold_s));
    }
    groups
}

fn shakes(p: &Protocol) -> Vec<Phase> {
    let linear = Shake {
        amplitude: p.shake_linear_m,
        hz: p.shake_linear_hz,
        cycles: p.shake_linear_cycles,
    };
    let angular = Shake {
        amplitude: p.shake_angular_rad,
        hz: p.shake_angular_hz,
        cycles: p.shake_angular_cycles,
    };
    vec![
        Phase {
            motion: Motion::Linear(linear, Vector3::z()),
            ..Phase::still(Stage::ShakeLinear, linear.duration_s())
        },
        Phase {
            motion: Motion::Angular(angular, p.shake_axis_z_m),
            ..Phase::still(Stage::ShakeAngular, angular.duration_s())
        },
    ]
}

fn tugs(p: &Protocol, mass_kg: f64, object_from_hand: &Isometry3<f64>) -> Vec<Phase> {
    let force = p.tug_force_n + p.tug_acceleration_m_s2 * mass_kg;
    let one = |d: &[f64; 3]| {
        let direction = Vector3::from(*d).normalize();
        let in_hand = match p.tug_frame {
            TugFrame::Hand => direction,
            TugFrame::World => object_from_hand.inverse_transform_vector(&direction),
        };
        Phase {
            object_force_n: in_hand * force,
            ..Phase::still(Stage::Tug, p.tug_time_s)
        }
    };
    p.tug_directions.iter().map(one).collect()
}

/// Shakes along approach and sideways, level by level. Along the closing axis the coupling of the
/// fingers would be tried, not the grasp.
fn levels(p: &Protocol) -> Vec<Phase> {
    let unit = Shake {
        amplitude: 1.0,
        hz: p.shake_linear_hz,
        cycles: p.shake_linear_cycles,
    };
    let per_metre_m_s2 = unit.peak_acceleration();
    let mut phases = Vec::new();
    let mut level_g = p.hardness_start_g;
    while level_g <= p.hardness_max_g {
        let shake = Shake {
            amplitude: level_g * GRAVITY_M_S2 / per_metre_m_s2,
            ..unit
        };
        for axis in [Vector3::z(), Vector3::y()] {
            phases.push(Phase {
                motion: Motion::Linear(shake, axis),
                ..Phase::still(Stage::Hardness, shake.duration_s())
            });
        }
        phases.last_mut().expect("two axes").level_g = Some(level_g);
        level_g *= p.hardness_growth;
    }
    phases
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lift_ends_at_its_height_and_never_exceeds_its_speed() {
        for rate in [0.0, 12.8] {
            let at = |t: f64| lifted(t, 1.1, 2.0, rate);
            assert!((at(10.0) - 1.1).abs() < 1e-6);
            let fastest = (0..2000)
                .map(|i| (at(f64::from(i + 1) * 1e-3) - at(f64::from(i) * 1e-3)) * 1e3)
                .fold(0.0, f64::max);
            assert!(fastest < 2.0 + 1e-6, "{fastest}");
        }
    }

    #[test]
    fn a_tug_in_the_world_pulls_where_the_object_says() {
        let p = Protocol::load("mgg-gravity", &[]).unwrap();
        let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let object_from_hand = Isometry3::from_parts(Translation3::identity(), turn);
        let force = groups(&p, 0.5, &object_from_hand)[0][0].object_force_n;
        assert!(
            (force - Vector3::new(0.0, 0.0, 9.81 * 0.5)).norm() < 1e-9,
            "{force}"
        );
    }

    #[test]
    fn each_level_of_hardness_peaks_at_its_acceleration() {
        let p = Protocol::load("hardness", &[]).unwrap();
        for phase in levels(&p).iter().filter(|l| l.level_g.is_some()) {
            let Motion::Linear(shake, _) = phase.motion else {
                panic!("hardness shakes along lines");
            };
            let g = shake.peak_acceleration() / GRAVITY_M_S2;
            assert!((g / phase.level_g.unwrap() - 1.0).abs() < 1e-9);
        }
    }
}
