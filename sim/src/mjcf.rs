//! One trial as a MuJoCo model: object, hand and schedule, for a second opinion.
//!
//! The model stands in the hand's frame. A hand that shakes is, seen from itself, a resting hand
//! whose object feels fictitious forces; `tests/cross_engine/engine.py` plays a schedule that way.

use std::fmt::Write as _;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use serde_json::{Value, json};
use shakedown_gripper_assets::Gripper;
use shakedown_gripper_assets::gripper::Side;

use crate::approach::start_opening_m;
use crate::load::groups;
use crate::protocol::Protocol;
use crate::scene::{self, Scene};

/// Time step of the schedule, s.
const SCHEDULE_DT_S: f64 = 0.002;

/// A piece whose corners leave their plane by less than this, root mean square, metres, has no volume to
/// speak of and no hull in MuJoCo: coordinates are written to a tenth of a micrometre.
const FLAT_M: f64 = 5e-7;

fn is_flat(piece: &[Point3<f64>]) -> bool {
    let count = piece.len().max(1) as f64;
    let middle = piece.iter().map(|p| p.coords).sum::<Vector3<f64>>() / count;
    let spread: Matrix3<f64> = piece
        .iter()
        .map(|p| (p.coords - middle) * (p.coords - middle).transpose())
        .sum();
    let squares = spread.symmetric_eigenvalues();
    squares.min() <= FLAT_M * FLAT_M * count
}

/// MJCF text of the trial at its start. Geometry is that of `solver.object_contact = "pieces"`;
/// contact settings are MuJoCo's usual ones for gripping (elliptic cone, impratio 10, noslip).
pub fn model(scene: &Scene, gripper: &Gripper, grasp: &Isometry3<f64>) -> String {
    let p = &scene.protocol;
    let object_from_hand = start(p, grasp);
    let opening_m = start_opening_m(scene, &object_from_hand);
    let hand_from_body = object_from_hand.inverse() * scene.object_from_body();
    let mut assets = String::new();
    let mut object = String::new();
    let has_volume = |(_, piece): &(usize, &Vec<Point3<f64>>)| !is_flat(piece);
    for (i, piece) in scene.pieces_m.iter().enumerate().filter(has_volume) {
        let _ = writeln!(
            assets,
            r#"    <mesh name="piece{i}" vertex="{}"/>"#,
            list(piece)
        );
        let _ = writeln!(
            object,
            r#"      <geom type="mesh" mesh="piece{i}" class="object"/>"#
        );
    }
    let mut palm = String::new();
    for (i, part) in gripper.palm.iter().enumerate() {
        let _ = writeln!(
            assets,
            r#"    <mesh name="palm{i}" vertex="{}"/>"#,
            list(&part.corners())
        );
        let _ = writeln!(
            palm,
            r#"      <geom type="mesh" mesh="palm{i}" class="hand"/>"#
        );
    }
    let fingers: String = Side::BOTH
        .into_iter()
        .map(|side| finger(scene, gripper, side, opening_m))
        .collect();
    let (t, q) = (
        hand_from_body.translation.vector,
        hand_from_body.rotation.coords,
    );
    let i = scene.object_inertia_kg_m2;
    format!(
        r#"<mujoco model="shakedown trial">
  <!-- Seen from the hand. Forces, schedule and verdict: trial.json. -->
  <compiler angle="radian" inertiafromgeom="false" boundmass="0" boundinertia="0"/>
  <option timestep="{SCHEDULE_DT_S}" gravity="0 0 0" cone="elliptic" impratio="10" integrator="implicitfast" noslip_iterations="10"/>
  <default>
    <geom condim="{condim}" friction="{friction} {torsion} 0.0001" solref="0.004 1"/>
    <default class="hand"><geom contype="1" conaffinity="2" rgba="0.8 0.8 0.8 1"/></default>
    <default class="object"><geom contype="2" conaffinity="1" rgba="0.3 0.5 0.8 1"/></default>
  </default>
  <asset>
{assets}  </asset>
  <worldbody>
    <body name="hand">
{palm}    </body>
{fingers}    <body name="object" pos="{} {} {}" quat="{} {} {} {}">
      <freejoint/>
      <inertial pos="0 0 0" mass="{}" fullinertia="{:e} {:e} {:e} {:e} {:e} {:e}"/>
{object}    </body>
  </worldbody>
  <equality><joint joint1="left" joint2="right" solref="0.005 1"/></equality>
  <actuator><motor name="left" joint="left"/><motor name="right" joint="right"/></actuator>
</mujoco>
"#,
        t.x,
        t.y,
        t.z,
        q.w,
        q.x,
        q.y,
        q.z,
        scene.mass_kg,
        i[(0, 0)],
        i[(1, 1)],
        i[(2, 2)],
        i[(0, 1)],
        i[(0, 2)],
        i[(1, 2)],
        friction = scene.friction,
        torsion = p.friction_torsional_m,
        condim = if p.friction_torsional_m > 0.0 { 4 } else { 3 },
    )
}

/// A finger on its slider: joint 0 is where it starts, positive is inwards.
fn finger(scene: &Scene, gripper: &Gripper, side: Side, opening_m: f64) -> String {
    let (name, quat) = match side {
        Side::Left => ("left", "1 0 0 0"),
        Side::Right => ("right", "0 0 0 1"),
    };
    let half_m = opening_m / 2.0;
    let mut out = format!(
        r#"    <body name="{name}" pos="{} 0 0" quat="{quat}">
      <joint name="{name}" type="slide" axis="-1 0 0" limited="true" range="{} {half_m}"/>
      <inertial pos="0 0 {}" mass="{}" diaginertia="0.001 0.001 0.001"/>
"#,
        side.sign() * half_m,
        half_m - scene.opening_max_m / 2.0,
        scene.pad_centre_m.z,
        scene.protocol.solver.finger_mass_kg,
    );
    let edge_m = scene.protocol.finger_edge_m;
    for part in &gripper.finger {
        let Some((pose, half)) = scene::trimmed_box(part, edge_m, scene::is_tip(part, gripper))
        else {
            continue;
        };
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        let _ = writeln!(
            out,
            r#"      <geom type="box" class="hand" size="{} {} {}" pos="{} {} {}" quat="{} {} {} {}"/>"#,
            half.x, half.y, half.z, t.x, t.y, t.z, q.w, q.x, q.y, q.z
        );
    }
    out.push_str("    </body>\n");
    out
}

/// Forces, schedule and verdict of the trial. Schedule: one list per group of the load, each row
/// `[t_s, x, y, z, qx, qy, qz, qw, fx, fy, fz]`, the pose of the hand in its frame at the start
/// and the force on the object's centre of mass in the same axes, from the end of closing on.
pub fn trial(scene: &Scene, grasp: &Isometry3<f64>) -> Value {
    let p = &scene.protocol;
    let object_from_hand = start(p, grasp);
    let down = object_from_hand.inverse_transform_vector(&-Vector3::z());
    let schedule: Vec<Value> = groups(p, scene.mass_kg, &object_from_hand)
        .iter()
        .map(|phases| {
            let mut rows = Vec::new();
            let mut base = Isometry3::identity();
            for phase in phases {
                let steps = (phase.duration_s / SCHEDULE_DT_S).round() as u32;
                for k in 1..=steps {
                    let pose = base * phase.motion.at(f64::from(k) * SCHEDULE_DT_S);
                    let (t, q) = (pose.translation.vector, pose.rotation.coords);
                    let f = phase.object_force_n;
                    let t_s = (rows.len() + 1) as f64 * SCHEDULE_DT_S;
                    rows.push(json!([
                        t_s, t.x, t.y, t.z, q.x, q.y, q.z, q.w, f.x, f.y, f.z
                    ]));
                }
                base *= phase.motion.at(phase.duration_s);
            }
            Value::Array(rows)
        })
        .collect();
    json!({
        "dt_s": SCHEDULE_DT_S,
        "grip_force_n": scene.grip_force_n,
        "mass_kg": scene.mass_kg,
        "friction": scene.friction,
        "gravity_in_hand_m_s2": (down * p.gravity_m_s2).as_slice(),
        "protocol": serde_json::to_value(p).expect("plain data"),
        "schedule": schedule,
    })
}

fn start(p: &Protocol, grasp: &Isometry3<f64>) -> Isometry3<f64> {
    grasp * nalgebra::Translation3::new(0.0, 0.0, -p.standoff_m)
}

fn list(points: &[Point3<f64>]) -> String {
    let numbers: Vec<String> = points
        .iter()
        .flat_map(|p| p.iter().map(|x| format!("{x:.7}")))
        .collect();
    numbers.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_piece_is_flat_where_its_corners_share_a_plane_however_it_stands() {
        let corner = |x: f64, y: f64, z: f64| {
            nalgebra::Rotation3::from_euler_angles(0.3, 1.0, -2.0) * Point3::new(x, y, 0.1 + z)
        };
        let flat = [(0.0, 0.0), (0.02, 0.0), (0.0, 0.03), (0.02, 0.03)];
        let piece = |height: f64| -> Vec<Point3<f64>> {
            let lifted = flat.iter().enumerate();
            let z = |i: usize| if i == 3 { height } else { 0.0 };
            lifted.map(|(i, (x, y))| corner(*x, *y, z(i))).collect()
        };
        assert!(is_flat(&piece(0.0)));
        assert!(!is_flat(&piece(1e-5)));
    }
}
