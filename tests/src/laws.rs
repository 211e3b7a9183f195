//! The laws of physics that a grip must obey, each as a measurement beside its analytic value.
//!
//! `cargo run --release -p shakedown_tests --bin validation` writes them into `docs/validation.md`;
//! `tests/laws.rs` holds them to their tolerances.

use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use shakedown_gripper_assets::Gripper;
use shakedown_objects::mesh::RawMesh;
use shakedown_objects::shapes::loft;
use shakedown_objects::{Object, ObjectSpec, TriMesh};
use shakedown_sim::probe::Probe;
use shakedown_sim::{ObjectLoad, Protocol, Scene};

/// One measured law.
#[derive(Debug, Clone, PartialEq)]
pub struct Law {
    /// Group, as the page lists them.
    pub law: &'static str,
    /// The case.
    pub case: String,
    /// Key of MuJoCo's value for the same case, where it was taken.
    pub key: String,
    /// What theory says.
    pub analytic: f64,
    /// What the simulation says.
    pub measured: f64,
    /// Largest difference allowed: absolute, in the unit of the values.
    pub tolerance: f64,
    /// Unit of all three.
    pub unit: &'static str,
}

impl Law {
    /// Is the measured value within its tolerance?
    pub fn holds(&self) -> bool {
        (self.measured - self.analytic).abs() <= self.tolerance
    }
}

/// An object of one's own mesh and mass.
pub fn object(raw: RawMesh, mass_kg: f64) -> Object {
    let path = Path::new("law");
    let (mesh, report) = TriMesh::from_raw(raw, path).expect("a sound mesh");
    let spec = ObjectSpec {
        mesh: path.to_owned(),
        mass_kg: Some(mass_kg),
        ..ObjectSpec::default()
    };
    Object::from_mesh(&spec, mesh, report).expect("a sound object")
}

/// A box.
pub fn block(size_m: Vector3<f64>, mass_kg: f64) -> Object {
    object(loft::cuboid(size_m), mass_kg)
}

/// A cylinder about y, so that its contact with a pad is a line.
pub fn cylinder(radius_m: f64, length_m: f64, mass_kg: f64) -> Object {
    let rings = [-0.5, 0.5].map(|z| loft::circle(radius_m, z * length_m, 180));
    let mut raw = loft::capped(&rings);
    for v in &mut raw.vertices {
        *v = [v[0], -v[2], v[1]];
    }
    object(raw, mass_kg)
}

/// A ball.
pub fn ball(radius_m: f64, mass_kg: f64) -> Object {
    let rings: Vec<_> = (1..64)
        .map(|i| {
            let angle = std::f64::consts::PI * f64::from(i) / 64.0;
            loft::circle(radius_m * angle.sin(), -radius_m * angle.cos(), 128)
        })
        .collect();
    object(loft::capped(&rings), mass_kg)
}

/// A scene of the preset `acronym-stated` with constants set.
pub fn scene(object: &Object, sets: &[String]) -> Scene {
    let protocol = Protocol::load("acronym-stated", sets).expect("known constants");
    let gripper = Gripper::load("franka_panda").expect("built in");
    Scene::new(object, &gripper, &protocol, None, None).expect("a sound scene")
}

/// The hand centred on the object's origin, approaching along +z.
pub fn centred() -> Isometry3<f64> {
    Isometry3::from(Translation3::new(0.0, 0.0, -0.1034))
}

/// A scene gripped with friction and force.
pub fn gripped(object: &Object, friction: f64, force_n: f64, more: &[&str]) -> Scene {
    let mut sets = vec![
        format!("friction={friction}"),
        format!("grip_force_n={force_n}"),
    ];
    sets.extend(more.iter().map(|s| (*s).to_owned()));
    scene(object, &sets)
}

/// Closes and holds a load that grows over 0.2 s and stays until `duration_s`; motion at the end
/// and half-way, metres and radians.
fn under_load(scene: &Scene, load: &ObjectLoad, duration_s: f64) -> [(Vector3<f64>, Vector3<f64>); 2] {
    let mut probe = Probe::new(scene, &centred(), 0.08);
    probe.close(0.6, &Vector3::zeros());
    let dt_s = scene.protocol.dt_s;
    let steps = (duration_s / dt_s).round() as u32;
    let mut half = probe.motion();
    for k in 1..=steps {
        let share = (f64::from(k) * dt_s / 0.2).min(1.0);
        let now = ObjectLoad {
            force_n: load.force_n * share,
            torque_n_m: load.torque_n_m * share,
        };
        probe.step(&Isometry3::identity(), &now);
        if k == steps / 2 {
            half = probe.motion();
        }
    }
    [half, probe.motion()]
}

fn force_along(direction: Vector3<f64>, force_n: f64) -> ObjectLoad {
    ObjectLoad {
        force_n: direction * force_n,
        torque_n_m: Vector3::zeros(),
    }
}

fn torque_about_closing_axis(torque_n_m: f64) -> ObjectLoad {
    ObjectLoad {
        force_n: Vector3::zeros(),
        torque_n_m: Vector3::x() * torque_n_m,
    }
}

/// Largest share in `[low, high]` for which `moves` is false, by bisection to 0.1 %.
fn largest_held(low: f64, high: f64, moves: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (low, high);
    while high - low > 0.001 * high {
        let middle = (low + high) / 2.0;
        if moves(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    (low + high) / 2.0
}

/// Load, as a share of 2 mu F, above which the object moves by 1 mm within a second.
pub fn slip_onset(scene: &Scene, direction: &Vector3<f64>) -> f64 {
    let limit_n = 2.0 * scene.friction * scene.grip_force_n;
    largest_held(0.9, 1.1, |share| {
        let end = under_load(scene, &force_along(*direction, share * limit_n), 1.2)[1];
        // The negation counts a diverged object as moved.
        !(end.0.norm() < 1e-3)
    })
}

/// Speed under a share of the limit, mm/s, over the second half of four seconds.
pub fn creep_mm_s(scene: &Scene, share: f64) -> f64 {
    let limit_n = 2.0 * scene.friction * scene.grip_force_n;
    let [half, end] = under_load(scene, &force_along(Vector3::y(), share * limit_n), 4.0);
    (end.0 - half.0).norm() / 2.0 * 1e3
}

/// Largest torque about the closing axis that turns the object less than 0.1 rad in a second, as a
/// lever arm, mm: torque / (2 mu F).
pub fn twist_lever_mm(scene: &Scene, largest_mm: f64) -> f64 {
    let limit_n = 2.0 * scene.friction * scene.grip_force_n;
    largest_held(0.0, largest_mm, |lever_mm| {
        let load = torque_about_closing_axis(lever_mm * 1e-3 * limit_n);
        let end = under_load(scene, &load, 1.2)[1];
        !(end.1.norm() < 0.1)
    })
}

/// Mean distance from its middle of a rectangle's points: the lever arm of uniform pressure.
pub fn uniform_lever_m(a: f64, b: f64) -> f64 {
    let n = 200;
    let at = |i: i32, size: f64| ((f64::from(i) + 0.5) / f64::from(n) - 0.5) * size;
    let sum: f64 = (0..n)
        .flat_map(|i| (0..n).map(move |j| at(i, a).hypot(at(j, b))))
        .sum();
    sum / f64::from(n * n)
}

/// Every law of the page.
pub fn all() -> Vec<Law> {
    let mut laws = Vec::new();
    let mut add = |law, case: String, key: &str, analytic, measured, tolerance, unit| {
        laws.push(Law {
            law,
            case,
            key: key.to_owned(),
            analytic,
            measured,
            tolerance,
            unit,
        });
    };
    let cube = |mass_kg| block(Vector3::repeat(0.05), mass_kg);
    for force in [5.0, 10.0, 20.0, 40.0, 70.0] {
        let scene = gripped(&cube(0.1), 0.5, force, &[]);
        let case = format!("{force} N on a cube of 0.1 kg");
        add("force delivered", case, &format!("force_{force}"), force, delivered_n(&scene), 0.005 * force, "N");
    }
    for (mass, mu, force) in SLIP_CASES {
        let scene = gripped(&cube(mass), mu, force, &[]);
        for (name, axis) in [("sideways", Vector3::y()), ("along the approach", Vector3::z())] {
            let case = format!("cube {mass} kg, mu {mu}, {force} N, {name}");
            let key = format!("slip_{mass}_{mu}_{force}");
            add("slip onset", case, &key, 1.0, slip_onset(&scene, &axis), 0.01, "of 2 mu F");
        }
    }
    for (mass, mu, force) in [(0.1, 0.5, 10.0), (0.5, 1.0, 40.0)] {
        let scene = gripped(&cylinder(0.025, 0.06, mass), mu, force, &[]);
        let case = format!("cylinder {mass} kg, mu {mu}, {force} N, along its axis");
        add("slip onset", case, "", 1.0, slip_onset(&scene, &Vector3::y()), 0.01, "of 2 mu F");
    }
    for (mass, mu, force) in [(0.2, 0.5, 10.0), (0.2, 0.5, 40.0)] {
        let scene = gripped(&cube(mass), mu, force, &[]);
        for share in [0.5, 0.9] {
            let case = format!("cube {mass} kg, mu {mu}, {force} N, {:.0} % of the limit", share * 100.0);
            let key = format!("creep_{force}_{share}");
            add("creep", case, &key, 0.0, creep_mm_s(&scene, share), 0.003, "mm/s");
        }
    }
    let flat = uniform_lever_m(0.0175, 0.0178) * 1e3;
    let scene = gripped(&cube(0.1), 0.5, 20.0, &[]);
    add("twist", "flat face, uniform pressure".into(), "twist_flat", flat, twist_lever_mm(&scene, 25.0), 0.15 * flat, "mm");
    let scene = gripped(&cylinder(0.025, 0.06, 0.1), 0.5, 20.0, &[]);
    let line = 17.5 / 4.0;
    add("twist", "line contact across the pad".into(), "twist_line", line, twist_lever_mm(&scene, 25.0), 0.15 * line, "mm");
    let scene = gripped(&ball(0.02, 0.05), 0.5, 20.0, &[]);
    add("twist", "ball, no torsion stated".into(), "twist_ball", 0.0, twist_lever_mm(&scene, 25.0), 1.0, "mm");
    for lever in [2.0, 4.0] {
        let set = format!("friction_torsional_m={}", lever * 1e-3);
        let scene = gripped(&ball(0.02, 0.05), 0.5, 20.0, &[&set]);
        let case = format!("ball, torsion {lever} mm stated");
        add("twist", case, &format!("ball_{lever}"), lever, twist_lever_mm(&scene, 25.0), 0.75, "mm");
    }
    for mu in [0.2, 0.5, 1.0] {
        let case = format!("plate on the palm, mu {mu}");
        let angle = f64::to_degrees(f64::atan(mu));
        add("incline", case, "", angle, incline_onset_deg(mu), 0.02 * angle, "degrees");
    }
    let (fall, expected) = free_fall_m();
    add("free fall", "0.2 s in the open hand".into(), "", expected, fall, 0.002 * expected, "m");
    let (linear, angular) = momentum_drift();
    add("momentum", "2 s without contact, momentum".into(), "", 0.0, linear, 1e-5, "relative");
    add("momentum", "2 s without contact, angular momentum of a spinning block".into(), "", 0.0, angular, 0.01, "relative");
    add("symmetry", "hand turned by 180 degrees: difference of the closing motion".into(), "", 0.0, symmetry_m(), 1e-3, "m");
    laws
}

/// Masses, friction coefficients and forces of the slip cases.
pub const SLIP_CASES: [(f64, f64, f64); 6] = [
    (0.013, 0.2, 5.0),
    (0.013, 1.0, 10.0),
    (0.1, 0.5, 20.0),
    (0.2, 0.5, 10.0),
    (0.2, 0.5, 40.0),
    (0.5, 1.0, 70.0),
];

/// Mean force of both fingers, averaged over 0.1 s after closing.
pub fn delivered_n(scene: &Scene) -> f64 {
    let mut probe = Probe::new(scene, &centred(), 0.08);
    probe.close(0.6, &Vector3::zeros());
    let n = 50;
    let sum: f64 = (0..n)
        .map(|_| {
            probe.step(&Isometry3::identity(), &ObjectLoad::default());
            probe.contacts().iter().map(|c| c.force_n.norm()).sum::<f64>()
        })
        .sum();
    sum / f64::from(2 * n)
}

/// Tilt at which a plate slides on the palm, which lies flat under it.
pub fn incline_onset_deg(mu: f64) -> f64 {
    let scene = gripped(&block(Vector3::new(0.03, 0.02, 0.008), 0.2), mu, 1e-6, &[]);
    let palm_z_m = 0.0658;
    let object_from_hand = Isometry3::from(Translation3::new(0.0, 0.0, -palm_z_m - 0.004));
    let slides = |degrees: f64| {
        let tilt = degrees.to_radians();
        let gravity = Vector3::new(tilt.sin(), 0.0, -tilt.cos()) * 9.81;
        let mut probe = Probe::new(&scene, &object_from_hand, 0.08);
        probe.close(0.002, &Vector3::new(0.0, 0.0, -9.81));
        for _ in 0..50 {
            probe.step(&Isometry3::identity(), &ObjectLoad::default());
        }
        let start = probe.motion().0;
        let lean_n = (gravity + Vector3::new(0.0, 0.0, 9.81)) * scene.mass_kg;
        for k in 1..=350 {
            let share = (f64::from(k) / 100.0).min(1.0);
            let lean = ObjectLoad {
                force_n: lean_n * share,
                torque_n_m: Vector3::zeros(),
            };
            probe.step(&Isometry3::identity(), &lean);
        }
        !((probe.motion().0 - start).norm() < 1e-3)
    };
    largest_held(1.0, 80.0, slides)
}

/// Fall in 0.2 s between the open fingers, and what the law says, metres.
pub fn free_fall_m() -> (f64, f64) {
    let scene = gripped(&block(Vector3::repeat(0.02), 0.1), 0.5, 0.001, &[]);
    let mut probe = Probe::new(&scene, &centred(), 0.08);
    probe.close(0.002, &Vector3::new(0.0, 0.0, 9.81));
    let steps = 100;
    for _ in 0..steps {
        probe.step(&Isometry3::identity(), &ObjectLoad::default());
    }
    let t = f64::from(steps) * scene.protocol.dt_s;
    (probe.motion().0.z, 9.81 * t * t / 2.0)
}

/// Relative change of momentum and angular momentum of a free block over two seconds.
pub fn momentum_drift() -> (f64, f64) {
    let scene = gripped(&block(Vector3::new(0.02, 0.04, 0.07), 0.1), 0.5, 20.0, &[]);
    let mut probe = Probe::new(&scene, &centred(), 0.08);
    probe.remove_hand();
    probe.close(0.002, &Vector3::zeros());
    let push = ObjectLoad {
        force_n: Vector3::new(0.3, -0.2, 0.1),
        torque_n_m: Vector3::new(2e-3, 1e-3, -1.5e-3),
    };
    for _ in 0..50 {
        probe.step(&Isometry3::identity(), &push);
    }
    let before = probe.momentum();
    for _ in 0..1000 {
        probe.step(&Isometry3::identity(), &ObjectLoad::default());
    }
    let after = probe.momentum();
    (
        (after.0 - before.0).norm() / before.0.norm(),
        (after.1 - before.1).norm() / before.1.norm(),
    )
}

/// Difference in the closing motion of an off-centre block between a hand and the same hand turned
/// by half a turn about its approach direction, metres.
pub fn symmetry_m() -> f64 {
    let scene = gripped(&block(Vector3::new(0.03, 0.03, 0.05), 0.1), 0.5, 20.0, &[]);
    let off = Translation3::new(0.006, 0.0, 0.0);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
    let closing = |pose: &Isometry3<f64>| {
        let mut probe = Probe::new(&scene, pose, 0.08);
        for _ in 0..300 {
            probe.step(&Isometry3::identity(), &ObjectLoad::default());
        }
        pose.rotation * probe.motion().0
    };
    let a = closing(&(centred() * off));
    let b = closing(&(off * centred() * turn));
    (a - b).norm()
}

/// Motion over time of a cube under a share of the limit, (s, mm), cut at 2 mm.
pub fn motion_mm(share: f64, duration_s: f64) -> Vec<(f64, f64)> {
    let scene = gripped(&block(Vector3::repeat(0.05), 0.2), 0.5, 20.0, &[]);
    let mut probe = Probe::new(&scene, &centred(), 0.08);
    probe.close(0.6, &Vector3::zeros());
    let (dt_s, limit_n) = (scene.protocol.dt_s, 2.0 * scene.friction * scene.grip_force_n);
    let mut line = Vec::new();
    for k in 1..=(duration_s / dt_s).round() as u32 {
        let t_s = f64::from(k) * dt_s;
        let force = share * limit_n * (t_s / 0.2).min(1.0);
        probe.step(&Isometry3::identity(), &force_along(Vector3::y(), force));
        let moved_mm = probe.motion().0.norm() * 1e3;
        if moved_mm > 2.0 {
            break;
        }
        if k % 5 == 0 {
            line.push((t_s, moved_mm));
        }
    }
    line
}
