//! What hand is this? A parallel-jaw gripper as data: shapes, pads, limits.

use std::fs;
use std::path::Path;

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::error::GraspError;

const BUILT_IN: [(&str, &str); 2] = [
    ("franka_panda", include_str!("../franka_panda/gripper.toml")),
    (
        "robotiq_2f_85",
        include_str!("../robotiq_2f_85/gripper.toml"),
    ),
];

/// A parallel-jaw hand in its own frame (`hand`: origin at the base, z approach, x closing).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gripper {
    /// Name in results.
    pub name: String,
    /// One line.
    pub description: String,
    /// Licence of the shapes.
    pub licence: String,
    /// Where shapes and numbers come from.
    pub source: String,
    /// Largest opening between the pads, metres.
    pub opening_max_m: f64,
    /// Height of the tcp above the hand origin along z, metres.
    pub tcp_z_m: f64,
    /// Limits of force and speed.
    pub drive: Drive,
    /// The face that touches.
    pub pad: Pad,
    /// Convex parts that do not move.
    pub palm: Vec<Part>,
    /// Convex parts of the finger on the +x side at opening 0; the other finger is turned by 180
    /// degrees about z.
    pub finger: Vec<Part>,
}

/// What the fingers can do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drive {
    /// Largest grip force, newtons per finger.
    pub force_max_n: f64,
    /// Largest force that can be kept up, newtons per finger.
    pub force_continuous_n: f64,
    /// Largest speed of one finger, m/s.
    pub speed_max_m_s: f64,
    /// Mass of one finger, kg.
    pub finger_mass_kg: f64,
}

/// The contact face of a finger: a rectangle in the plane x = 0 at opening 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pad {
    /// Size along y, metres.
    pub width_m: f64,
    /// Near end along z, metres.
    pub z_min_m: f64,
    /// Far end along z, metres.
    pub z_max_m: f64,
}

/// A convex part: either `hull_m` or `box`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Name in messages.
    pub name: String,
    /// Points whose hull is the part, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hull_m: Option<Vec<[f64; 3]>>,
    /// A box.
    #[serde(default, rename = "box", skip_serializing_if = "Option::is_none")]
    pub cuboid: Option<Cuboid>,
}

/// A turned box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cuboid {
    /// Full edge lengths, metres.
    pub size_m: [f64; 3],
    /// Centre, metres.
    pub centre_m: [f64; 3],
    /// Roll, pitch, yaw, radians.
    #[serde(default)]
    pub rpy_rad: [f64; 3],
}

impl Cuboid {
    /// `finger_from_box` or `hand_from_box`: pose of the box in the frame of its part.
    pub fn pose(&self) -> Isometry3<f64> {
        let [roll, pitch, yaw] = self.rpy_rad;
        Isometry3::from_parts(
            Translation3::from(Vector3::from(self.centre_m)),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        )
    }
}

impl Part {
    /// Corners of the part, metres; their hull is the part.
    pub fn corners(&self) -> Vec<Point3<f64>> {
        if let Some(points) = &self.hull_m {
            return points.iter().map(|p| Point3::from(*p)).collect();
        }
        let Some(cuboid) = &self.cuboid else {
            return Vec::new();
        };
        let pose = cuboid.pose();
        let half = Vector3::from(cuboid.size_m) / 2.0;
        (0..8)
            .map(|i| {
                let sign = |bit: usize| if i & bit == 0 { -1.0 } else { 1.0 };
                pose * Point3::new(sign(1) * half.x, sign(2) * half.y, sign(4) * half.z)
            })
            .collect()
    }
}

/// Left is the finger on the +x side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// On +x; closes towards -x.
    Left,
    /// On -x; closes towards +x.
    Right,
}

impl Side {
    /// Both fingers.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// +1 for the finger on +x, -1 for the other.
    pub fn sign(self) -> f64 {
        match self {
            Self::Left => 1.0,
            Self::Right => -1.0,
        }
    }
}

impl Gripper {
    /// Names of the built-in hands.
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.iter().map(|(name, _)| *name)
    }

    /// TOML text of a built-in hand, to copy and change.
    pub fn source_text(name: &str) -> Option<&'static str> {
        BUILT_IN.iter().find(|(n, _)| *n == name).map(|(_, t)| *t)
    }

    /// A built-in hand, or the one of a TOML file if `name` ends with `.toml`.
    ///
    /// # Errors
    /// An unknown name (with the nearest one), an unreadable file, a wrong key or value.
    pub fn load(name: &str) -> Result<Self, GraspError> {
        let path = Path::new(name);
        if path.extension().is_some_and(|e| e == "toml") {
            let text = fs::read_to_string(path).map_err(|e| GraspError::io(path, e))?;
            return Self::parse(&text, path);
        }
        match Self::source_text(name) {
            Some(text) => Self::parse(text, path),
            None => {
                let near = Self::names()
                    .map(|n| (strsim::jaro_winkler(n, name), n))
                    .max_by(|a, b| a.0.total_cmp(&b.0))
                    .filter(|(score, _)| *score > 0.7);
                let hint = match near {
                    Some((_, n)) => format!("did you mean {n:?}?"),
                    None => format!(
                        "there are {}, or give a TOML file",
                        Self::names().collect::<Vec<_>>().join(", ")
                    ),
                };
                Err(GraspError::UnknownGripper {
                    name: name.to_owned(),
                    hint,
                })
            }
        }
    }

    /// The hand of a TOML text.
    ///
    /// # Errors
    /// As [`Gripper::load`].
    pub fn parse(text: &str, path: &Path) -> Result<Self, GraspError> {
        let gripper: Self = toml::from_str(text).map_err(|e| {
            let line = e
                .span()
                .map_or(1, |s| text[..s.start].matches('\n').count() + 1);
            GraspError::bad(
                path,
                format!("line {line}"),
                e.message(),
                "compare with `shakedown grippers franka_panda --format text`",
            )
        })?;
        gripper.check(path)?;
        Ok(gripper)
    }

    fn check(&self, path: &Path) -> Result<(), GraspError> {
        let positive = [
            ("opening_max_m", self.opening_max_m),
            ("drive.force_max_n", self.drive.force_max_n),
            ("drive.force_continuous_n", self.drive.force_continuous_n),
            ("drive.speed_max_m_s", self.drive.speed_max_m_s),
            ("drive.finger_mass_kg", self.drive.finger_mass_kg),
            ("pad.width_m", self.pad.width_m),
            (
                "pad.z_max_m - pad.z_min_m",
                self.pad.z_max_m - self.pad.z_min_m,
            ),
        ];
        for (key, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(GraspError::bad(
                    path,
                    key,
                    format!("{value} is not a positive number"),
                    "give a value in SI units",
                ));
            }
        }
        if self.finger.is_empty() {
            return Err(GraspError::bad(
                path,
                "finger",
                "there is none",
                "add a [[finger]] part",
            ));
        }
        for part in self.palm.iter().chain(&self.finger) {
            let corners = part.corners();
            let is_one = part.hull_m.is_some() != part.cuboid.is_some();
            if !is_one || corners.len() < 4 || corners.iter().any(|c| !c.coords.amax().is_finite())
            {
                return Err(GraspError::bad(
                    path,
                    format!("part {:?}", part.name),
                    "needs either hull_m with at least 4 finite points, or box",
                    "compare with `shakedown grippers franka_panda --format text`",
                ));
            }
        }
        Ok(())
    }

    /// `hand_from_tcp`: the frame between the pads, axes as the hand's.
    pub fn hand_from_tcp(&self) -> Isometry3<f64> {
        Isometry3::translation(0.0, 0.0, self.tcp_z_m)
    }

    /// The frame of a finger at an opening: at opening 0 both lie in the hand's origin.
    pub fn hand_from_finger(&self, side: Side, opening_m: f64) -> Isometry3<f64> {
        let turn = match side {
            Side::Left => Rotation3::identity(),
            Side::Right => Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI),
        };
        Isometry3::from_parts(
            Translation3::new(side.sign() * opening_m / 2.0, 0.0, 0.0),
            UnitQuaternion::from_rotation_matrix(&turn),
        )
    }

    /// All convex parts in the hand frame at an opening, as named corner lists.
    pub fn parts_at(&self, opening_m: f64) -> Vec<(String, Vec<Point3<f64>>)> {
        let mut parts: Vec<_> = self
            .palm
            .iter()
            .map(|p| (format!("palm {}", p.name), p.corners()))
            .collect();
        for side in Side::BOTH {
            let pose = self.hand_from_finger(side, opening_m);
            let name = if side == Side::Left { "left" } else { "right" };
            parts.extend(self.finger.iter().map(|p| {
                let corners = p.corners().iter().map(|c| pose * c).collect();
                (format!("{name} finger {}", p.name), corners)
            }));
        }
        parts
    }

    /// Closing region of an opening: `[min, max]` corners, hand frame, metres.
    pub fn closing_region(&self, opening_m: f64) -> [Vector3<f64>; 2] {
        let (x, y) = (opening_m / 2.0, self.pad.width_m / 2.0);
        [
            Vector3::new(-x, -y, self.pad.z_min_m),
            Vector3::new(x, y, self.pad.z_max_m),
        ]
    }

    /// Line segments that draw the hand: stem, bridge and fingers, hand frame, metres.
    pub fn glyph(&self) -> Vec<[Point3<f64>; 2]> {
        let (w, tip) = (self.opening_max_m / 2.0, self.pad.z_max_m);
        let knuckle = self.pad.z_min_m - (self.pad.z_max_m - self.pad.z_min_m) * 1.5;
        let p = |x: f64, z: f64| Point3::new(x, 0.0, z);
        vec![
            [p(0.0, 0.0), p(0.0, knuckle)],
            [p(-w, knuckle), p(w, knuckle)],
            [p(-w, knuckle), p(-w, tip)],
            [p(w, knuckle), p(w, tip)],
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_hand_loads_and_its_fingers_mirror() {
        for name in Gripper::names() {
            let g = Gripper::load(name).unwrap();
            assert_eq!(g.name, name);
            let parts = g.parts_at(g.opening_max_m);
            let n = g.finger.len();
            let (left, right) = (
                &parts[g.palm.len()..g.palm.len() + n],
                &parts[g.palm.len() + n..],
            );
            for ((_, l), (_, r)) in left.iter().zip(right) {
                for (a, b) in l.iter().zip(r) {
                    assert!((a.x + b.x).abs() < 1e-12 && (a.y + b.y).abs() < 1e-12 && a.z == b.z);
                    assert!(
                        a.x >= g.opening_max_m / 2.0 - 1e-12,
                        "a finger part reaches into the opening"
                    );
                }
            }
        }
    }

    #[test]
    fn a_misspelt_name_gets_the_nearest_one() {
        let e = Gripper::load("franka_pande").unwrap_err().to_string();
        assert!(e.contains("did you mean \"franka_panda\""), "{e}");
    }

    #[test]
    fn a_wrong_key_names_file_and_line() {
        let text = Gripper::source_text("franka_panda")
            .unwrap()
            .replace("tcp_z_m", "tcp_m");
        let e = Gripper::parse(&text, Path::new("my.toml"))
            .unwrap_err()
            .to_string();
        assert!(
            e.contains("my.toml") && e.contains("line") && e.contains("tcp_m"),
            "{e}"
        );
    }

    #[test]
    fn a_description_survives_a_round_trip() {
        let g = Gripper::load("robotiq_2f_85").unwrap();
        let text = toml::to_string(&g).unwrap();
        assert_eq!(Gripper::parse(&text, Path::new("copy.toml")).unwrap(), g);
    }
}
