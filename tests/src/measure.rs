//! What a grip does under a load: one measurement a function.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use shakedown_sim::probe::Probe;
use shakedown_sim::{ObjectLoad, Scene};

use crate::rig::{block, centred, gripped};

/// Closes and holds a load that grows over 0.2 s and stays until `duration_s`; motion at the end
/// and half-way, metres and radians.
fn under_load(
    scene: &Scene,
    load: &ObjectLoad,
    duration_s: f64,
) -> [(Vector3<f64>, Vector3<f64>); 2] {
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

/// Did it move so far? A diverged object did.
fn moved(distance: f64, limit: f64) -> bool {
    distance.is_nan() || distance >= limit
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
        moved(end.0.norm(), 1e-3)
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
        moved(end.1.norm(), 0.1)
    })
}

/// Mean force of both fingers, averaged over 0.1 s after closing.
pub fn delivered_n(scene: &Scene) -> f64 {
    let mut probe = Probe::new(scene, &centred(), 0.08);
    probe.close(0.6, &Vector3::zeros());
    let n = 50;
    let sum: f64 = (0..n)
        .map(|_| {
            probe.step(&Isometry3::identity(), &ObjectLoad::default());
            probe
                .contacts()
                .iter()
                .map(|c| c.force_n.norm())
                .sum::<f64>()
        })
        .sum();
    sum / f64::from(2 * n)
}

/// Tilt at which a plate slides on the palm, which lies flat under it.
pub fn incline_onset_deg(mu: f64, set_engine: &str) -> f64 {
    let scene = gripped(
        &block(Vector3::new(0.03, 0.02, 0.008), 0.2),
        mu,
        1e-6,
        &[set_engine],
    );
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
        moved((probe.motion().0 - start).norm(), 1e-3)
    };
    largest_held(1.0, 80.0, slides)
}

/// Fall in 0.2 s between the open fingers, and what the law says, metres.
pub fn free_fall_m(set_engine: &str) -> (f64, f64) {
    let scene = gripped(
        &block(Vector3::repeat(0.02), 0.1),
        0.5,
        0.001,
        &[set_engine],
    );
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
pub fn momentum_drift(set_engine: &str) -> (f64, f64) {
    let scene = gripped(
        &block(Vector3::new(0.02, 0.04, 0.07), 0.1),
        0.5,
        20.0,
        &[set_engine],
    );
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
pub fn symmetry_m(set_engine: &str) -> f64 {
    let scene = gripped(
        &block(Vector3::new(0.03, 0.03, 0.05), 0.1),
        0.5,
        20.0,
        &[set_engine],
    );
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
    let (dt_s, limit_n) = (
        scene.protocol.dt_s,
        2.0 * scene.friction * scene.grip_force_n,
    );
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
