//! Which frame of the hand does a pose speak of?

use std::f64::consts::FRAC_PI_2;
use std::fmt;
use std::str::FromStr;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// The frames in which hands are posed by others. `docs/frames.md` draws them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum HandFrame {
    /// The frame of ACRONYM and of this project (`hand`): origin at the gripper base, z approach,
    /// x closing.
    #[default]
    Acronym,
    /// URDF and MuJoCo `panda_hand`: same origin and z, closing along y.
    PandaHand,
    /// Between the pads, axes as `hand`.
    Tcp,
}

impl HandFrame {
    /// Name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Acronym => "acronym",
            Self::PandaHand => "panda_hand",
            Self::Tcp => "tcp",
        }
    }

    /// The pose of this frame in `hand`, for a hand whose tcp is `tcp_z_m` along z.
    ///
    /// `p_acronym = Rz(+90 deg) p_panda_hand` (measured on the vertices of both meshes, 8e-9 m).
    pub fn hand_from_this(self, tcp_z_m: f64) -> Isometry3<f64> {
        match self {
            Self::Acronym => Isometry3::identity(),
            Self::PandaHand => Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), FRAC_PI_2),
            ),
            Self::Tcp => Isometry3::translation(0.0, 0.0, tcp_z_m),
        }
    }

    /// `object_from_hand` of a pose `object_from_this`.
    pub fn to_hand(self, object_from_this: &Isometry3<f64>, tcp_z_m: f64) -> Isometry3<f64> {
        object_from_this * self.hand_from_this(tcp_z_m).inverse()
    }
}

impl fmt::Display for HandFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for HandFrame {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        [Self::Acronym, Self::PandaHand, Self::Tcp]
            .into_iter()
            .find(|f| f.name() == s)
            .ok_or_else(|| format!("no frame {s:?}: acronym, panda_hand or tcp"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    #[test]
    fn a_point_on_the_closing_axis_of_panda_hand_lies_on_x_of_hand() {
        let hand_from_panda = HandFrame::PandaHand.hand_from_this(0.1034);
        // panda_hand closes along y; Rz(+90 deg) maps +y to -x.
        let p = hand_from_panda * Point3::new(0.0, 0.04, 0.1);
        assert!((p - Point3::new(-0.04, 0.0, 0.1)).norm() < 1e-15);
    }

    #[test]
    fn the_tcp_pose_of_a_hand_comes_back_as_the_hand() {
        let object_from_hand =
            Isometry3::new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.4, -0.2, 0.9));
        for frame in [HandFrame::Acronym, HandFrame::PandaHand, HandFrame::Tcp] {
            let object_from_this = object_from_hand * frame.hand_from_this(0.1034);
            let back = frame.to_hand(&object_from_this, 0.1034);
            assert!((back.to_homogeneous() - object_from_hand.to_homogeneous()).norm() < 1e-14);
        }
    }
}
