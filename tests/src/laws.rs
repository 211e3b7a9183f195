//! The laws of physics that a grip must obey, each as a measurement beside its analytic value.
//!
//! `cargo run --release -p shakedown_tests --bin validation` writes them into `docs/validation.md`;
//! `tests/laws.rs` holds them to their tolerances.

use nalgebra::Vector3;
use shakedown_objects::Object;

use crate::measure::{
    creep_mm_s, delivered_n, free_fall_m, incline_onset_deg, momentum_drift, slip_onset,
    symmetry_m, twist_lever_mm,
};
use crate::rig::{self, ball, block, cylinder};

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

/// Mean distance from its middle of a rectangle's points: the lever arm of uniform pressure.
pub fn uniform_lever_m(a: f64, b: f64) -> f64 {
    let n = 200;
    let at = |i: i32, size: f64| ((f64::from(i) + 0.5) / f64::from(n) - 0.5) * size;
    let sum: f64 = (0..n)
        .flat_map(|i| (0..n).map(move |j| at(i, a).hypot(at(j, b))))
        .sum();
    sum / f64::from(n * n)
}

/// Every law of the page, as an engine keeps it: `grip` or `rapier`.
pub fn all(engine: &str) -> Vec<Law> {
    let set_engine = format!("solver.engine={engine}");
    let gripped = |object: &Object, mu: f64, force_n: f64, more: &[&str]| {
        rig::gripped(
            object,
            mu,
            force_n,
            &[&[set_engine.as_str()], more].concat(),
        )
    };
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
        add(
            "force delivered",
            case,
            &format!("force_{force}"),
            force,
            delivered_n(&scene),
            0.005 * force,
            "N",
        );
    }
    for (mass, mu, force) in SLIP_CASES {
        let scene = gripped(&cube(mass), mu, force, &[]);
        for (name, axis) in [
            ("sideways", Vector3::y()),
            ("along the approach", Vector3::z()),
        ] {
            let case = format!("cube {mass} kg, mu {mu}, {force} N, {name}");
            let key = format!("slip_{mass}_{mu}_{force}");
            add(
                "slip onset",
                case,
                &key,
                1.0,
                slip_onset(&scene, &axis),
                0.01,
                "of 2 mu F",
            );
        }
    }
    for (mass, mu, force) in [(0.1, 0.5, 10.0), (0.5, 1.0, 40.0)] {
        let scene = gripped(&cylinder(0.025, 0.06, mass), mu, force, &[]);
        let case = format!("cylinder {mass} kg, mu {mu}, {force} N, along its axis");
        add(
            "slip onset",
            case,
            "",
            1.0,
            slip_onset(&scene, &Vector3::y()),
            0.01,
            "of 2 mu F",
        );
    }
    for (mass, mu, force) in [(0.2, 0.5, 10.0), (0.2, 0.5, 40.0)] {
        let scene = gripped(&cube(mass), mu, force, &[]);
        for share in [0.5, 0.9] {
            let case = format!(
                "cube {mass} kg, mu {mu}, {force} N, {:.0} % of the limit",
                share * 100.0
            );
            let key = format!("creep_{force}_{share}");
            add(
                "creep",
                case,
                &key,
                0.0,
                creep_mm_s(&scene, share),
                0.003,
                "mm/s",
            );
        }
    }
    let flat = uniform_lever_m(0.0175, 0.0178) * 1e3;
    let scene = gripped(&cube(0.1), 0.5, 20.0, &[]);
    add(
        "twist",
        "flat face, uniform pressure".into(),
        "twist_flat",
        flat,
        twist_lever_mm(&scene, 25.0),
        0.15 * flat,
        "mm",
    );
    let scene = gripped(&cylinder(0.025, 0.06, 0.1), 0.5, 20.0, &[]);
    let line = 17.5 / 4.0;
    add(
        "twist",
        "line contact across the pad".into(),
        "twist_line",
        line,
        twist_lever_mm(&scene, 25.0),
        0.15 * line,
        "mm",
    );
    let scene = gripped(&ball(0.02, 0.05), 0.5, 20.0, &[]);
    add(
        "twist",
        "ball, no torsion stated".into(),
        "twist_ball",
        0.0,
        twist_lever_mm(&scene, 25.0),
        1.0,
        "mm",
    );
    for lever in [2.0, 4.0] {
        let set = format!("friction_torsional_m={}", lever * 1e-3);
        let scene = gripped(&ball(0.02, 0.05), 0.5, 20.0, &[&set]);
        let case = format!("ball, torsion {lever} mm stated");
        add(
            "twist",
            case,
            &format!("ball_{lever}"),
            lever,
            twist_lever_mm(&scene, 25.0),
            0.75,
            "mm",
        );
    }
    for mu in [0.2, 0.5, 1.0] {
        let case = format!("plate on the palm, mu {mu}");
        let angle = f64::to_degrees(f64::atan(mu));
        add(
            "incline",
            case,
            "",
            angle,
            incline_onset_deg(mu, &set_engine),
            0.02 * angle,
            "degrees",
        );
    }
    let (fall, expected) = free_fall_m(&set_engine);
    add(
        "free fall",
        "0.2 s in the open hand".into(),
        "",
        expected,
        fall,
        0.002 * expected,
        "m",
    );
    let (linear, angular) = momentum_drift(&set_engine);
    add(
        "momentum",
        "2 s without contact, momentum".into(),
        "",
        0.0,
        linear,
        1e-5,
        "relative",
    );
    add(
        "momentum",
        "2 s without contact, angular momentum of a spinning block".into(),
        "",
        0.0,
        angular,
        0.01,
        "relative",
    );
    add(
        "symmetry",
        "hand turned by 180 degrees: difference of the closing motion".into(),
        "",
        0.0,
        symmetry_m(&set_engine),
        1e-3,
        "m",
    );
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
