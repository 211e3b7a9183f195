//! How is a grasp tried? All constants of a trial, from a preset or a file, each with a name.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

const BUILT_IN: [(&str, &str); 2] = [
    ("acronym", include_str!("../protocols/acronym.toml")),
    ("hold", include_str!("../protocols/hold.toml")),
];

/// Why a protocol cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProtocolError {
    /// No preset of this name.
    #[error("there is no protocol {name:?}; {hint}")]
    Unknown {
        /// What was asked for.
        name: String,
        /// The nearest name, or the list.
        hint: String,
    },
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file or a `--set` has a wrong key or value.
    #[error("protocol {origin}: {what}")]
    Bad {
        /// File, preset or `--set`.
        origin: String,
        /// What is wrong and what would mend it.
        what: String,
    },
}

/// Where an object's mass comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObjectMass {
    /// What the object brings along, else the protocol's density.
    Object,
    /// Always the protocol's density.
    Density,
}

/// Where the grip force comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GripForceRule {
    /// The same for all objects.
    Fixed,
    /// In proportion to the object's mass, between the least and the largest force.
    PerMass,
    /// A multiple of the least force that carries the load by friction, m (g + a) / (2 mu) with the
    /// peak acceleration a of the linear shake, between the least and the largest force.
    Coulomb,
}

/// What the fingers touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObjectContact {
    /// Convex pieces of the solid: fast; they round and thicken thin walls.
    Pieces,
    /// The triangles of the surface themselves: true, and several times dearer.
    Surface,
}

/// Every constant of a trial; `docs/protocols.md` explains each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Protocol {
    /// Name of the preset.
    pub name: String,
    /// Version of its meaning; changes whenever outcomes may.
    pub version: String,
    /// One line.
    pub description: String,
    /// Where the constants come from.
    pub source: String,
    /// Where an object's mass comes from.
    pub object_mass: ObjectMass,
    /// Density for objects without a mass, kg/m3.
    pub object_density_kg_m3: f64,
    /// Time step, s.
    pub dt_s: f64,
    /// Friction coefficient of the pair of hand and object; a value of the object wins over it.
    pub friction: f64,
    /// Friction while the fingers close, as a multiple of `friction`.
    pub closing_friction_scale: f64,
    /// Torsional friction as a lever arm, m. Only 0 is supported by this version.
    pub friction_torsional_m: f64,
    /// Where the grip force comes from.
    pub grip_force_rule: GripForceRule,
    /// How far the hand stands back along the approach direction, m, seen from the grasp's pose.
    pub standoff_m: f64,
    /// Grip force per finger under the rule `fixed`, N.
    pub grip_force_n: f64,
    /// Grip force per finger and kilogram of the object under the rule `per_mass`, N/kg.
    pub grip_force_per_kg_n: f64,
    /// Multiple of the least force that friction needs, under the rule `coulomb`.
    pub grip_force_safety: f64,
    /// Least force under the rules `per_mass` and `coulomb`, N.
    pub grip_force_min_n: f64,
    /// Largest force under the rules `per_mass` and `coulomb`, N.
    pub grip_force_max_n: f64,
    /// Speed of each finger while closing, m/s.
    pub closing_speed_m_s: f64,
    /// Longest time of closing, s; it ends sooner when both fingers touch and rest.
    pub closing_time_s: f64,
    /// Linear and angular damping of the object while closing, 1/s.
    pub object_damping_1_s: f64,
    /// Gravity from the shake on, m/s2, along -z of the object frame.
    pub gravity_m_s2: f64,
    /// Amplitude of the shake along the approach direction, m.
    pub shake_linear_m: f64,
    /// Its frequency, Hz.
    pub shake_linear_hz: f64,
    /// Its number of cycles.
    pub shake_linear_cycles: f64,
    /// Amplitude of the shake about the closing axis through the hand origin, rad.
    pub shake_angular_rad: f64,
    /// Its frequency, Hz.
    pub shake_angular_hz: f64,
    /// Its number of cycles.
    pub shake_angular_cycles: f64,
    /// Rest before the verdict, s.
    pub hold_s: f64,
    /// Largest motion of the object's centre of mass in the hand after closing, m.
    pub max_slip_m: f64,
    /// Largest rotation of the object in the hand after closing, rad.
    pub max_slip_rad: f64,
    /// Dropped when no finger has touched the object for this long, s.
    pub lost_contact_s: f64,
    /// Deepest overlap of hand and object at the start that is not an `initial_collision`, m.
    pub initial_penetration_max_m: f64,
    /// Settings of the solver.
    pub solver: Solver,
}

/// Settings of the physics engine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Solver {
    /// What the fingers touch.
    pub object_contact: ObjectContact,
    /// Solver iterations (substeps) per step.
    pub iterations: usize,
    /// Stiffness of contacts as a frequency, Hz.
    pub contact_hz: f64,
    /// Damping ratio of contacts.
    pub contact_damping_ratio: f64,
    /// Solve friction in the biased pass too.
    pub friction_in_bias_pass: bool,
    /// Distance at which contacts are prepared, m.
    pub prediction_m: f64,
    /// Largest speed at which penetration is corrected, m/s.
    pub corrective_speed_m_s: f64,
    /// Mass of a finger in the simulation, kg.
    pub finger_mass_kg: f64,
    /// Frequency of the spring that couples the fingers, Hz.
    pub coupling_hz: f64,
    /// Voxels along the longest edge for convex pieces.
    pub piece_resolution: u32,
    /// Concavity left in a piece.
    pub piece_concavity: f64,
    /// Most pieces.
    pub piece_max: u32,
}

impl Protocol {
    /// Names of the presets.
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.iter().map(|(name, _)| *name)
    }

    /// TOML text of a preset, to copy and change.
    pub fn source_text(name: &str) -> Option<&'static str> {
        BUILT_IN.iter().find(|(n, _)| *n == name).map(|(_, t)| *t)
    }

    /// A preset, or the protocol of a file if `name` ends with `.toml`, with `key=value` overrides.
    ///
    /// # Errors
    /// An unknown name or key (with the nearest one), an unreadable file, a value out of range.
    pub fn load(name: &str, overrides: &[String]) -> Result<Self, ProtocolError> {
        let path = Path::new(name);
        let text = if path.extension().is_some_and(|e| e == "toml") {
            fs::read_to_string(path).map_err(|source| ProtocolError::Io {
                path: path.to_owned(),
                source,
            })?
        } else {
            Self::source_text(name)
                .ok_or_else(|| ProtocolError::Unknown {
                    name: name.to_owned(),
                    hint: nearest(name, Self::names()),
                })?
                .to_owned()
        };
        Self::parse(&text, name, overrides)
    }

    /// The protocol of a TOML text with overrides; `origin` names it in messages.
    ///
    /// # Errors
    /// As [`Protocol::load`].
    pub fn parse(text: &str, origin: &str, overrides: &[String]) -> Result<Self, ProtocolError> {
        let bad = |what: String| ProtocolError::Bad {
            origin: origin.to_owned(),
            what,
        };
        let mut table: toml::Table = text.parse().map_err(|e: toml::de::Error| {
            let line = e
                .span()
                .map_or(1, |s| text[..s.start].matches('\n').count() + 1);
            bad(format!("line {line}: {}", e.message()))
        })?;
        let keys = known_keys();
        for (key, _) in flatten(&table) {
            if !keys.contains(&key) {
                return Err(bad(format!(
                    "there is no constant {key:?}; {}",
                    nearest(&key, keys.iter().map(String::as_str))
                )));
            }
        }
        for item in overrides {
            let set = |what: String| ProtocolError::Bad {
                origin: format!("--set {item}"),
                what,
            };
            let (key, value) = item
                .split_once('=')
                .ok_or_else(|| set("write key=value".into()))?;
            if !keys.iter().any(|k| k == key) {
                return Err(set(format!(
                    "there is no constant {key:?}; {}",
                    nearest(key, keys.iter().map(String::as_str))
                )));
            }
            let (target, leaf) = match key.split_once('.') {
                Some((section, leaf)) => {
                    let section = table
                        .get_mut(section)
                        .and_then(toml::Value::as_table_mut)
                        .ok_or_else(|| set(format!("there is no section {section:?}")))?;
                    (section, leaf)
                }
                None => (&mut table, key),
            };
            let value = typed(target.get(leaf), value).map_err(set)?;
            target.insert(leaf.to_owned(), value);
        }
        let protocol: Self = toml::Value::Table(table)
            .try_into()
            .map_err(|e: toml::de::Error| bad(e.message().to_owned()))?;
        protocol.check().map_err(bad)?;
        Ok(protocol)
    }

    fn check(&self) -> Result<(), String> {
        let s = &self.solver;
        let positive = [
            ("object_density_kg_m3", self.object_density_kg_m3),
            ("dt_s", self.dt_s),
            ("grip_force_n", self.grip_force_n),
            ("grip_force_per_kg_n", self.grip_force_per_kg_n),
            ("grip_force_safety", self.grip_force_safety),
            ("grip_force_min_n", self.grip_force_min_n),
            ("grip_force_max_n", self.grip_force_max_n),
            ("closing_speed_m_s", self.closing_speed_m_s),
            ("closing_time_s", self.closing_time_s),
            ("shake_linear_hz", self.shake_linear_hz),
            ("shake_angular_hz", self.shake_angular_hz),
            ("max_slip_m", self.max_slip_m),
            ("max_slip_rad", self.max_slip_rad),
            ("lost_contact_s", self.lost_contact_s),
            ("solver.contact_hz", s.contact_hz),
            ("solver.contact_damping_ratio", s.contact_damping_ratio),
            ("solver.prediction_m", s.prediction_m),
            ("solver.corrective_speed_m_s", s.corrective_speed_m_s),
            ("solver.finger_mass_kg", s.finger_mass_kg),
            ("solver.piece_concavity", s.piece_concavity),
        ];
        for (key, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("{key} is {value}; give a positive number"));
            }
        }
        let not_negative = [
            ("friction", self.friction),
            ("closing_friction_scale", self.closing_friction_scale),
            ("standoff_m", self.standoff_m),
            ("object_damping_1_s", self.object_damping_1_s),
            ("gravity_m_s2", self.gravity_m_s2),
            ("shake_linear_m", self.shake_linear_m),
            ("shake_linear_cycles", self.shake_linear_cycles),
            ("shake_angular_rad", self.shake_angular_rad),
            ("shake_angular_cycles", self.shake_angular_cycles),
            ("hold_s", self.hold_s),
            ("initial_penetration_max_m", self.initial_penetration_max_m),
            ("solver.coupling_hz", s.coupling_hz),
        ];
        for (key, value) in not_negative {
            if !(value.is_finite() && value >= 0.0) {
                return Err(format!("{key} is {value}; give a number >= 0"));
            }
        }
        if self.friction_torsional_m != 0.0 {
            return Err(
                "friction_torsional_m: this version models no torsional friction of its own; use 0"
                    .into(),
            );
        }
        if self.dt_s > 0.02 {
            return Err(format!(
                "dt_s is {}; steps over 0.02 s decide nothing",
                self.dt_s
            ));
        }
        if s.iterations == 0 || s.piece_resolution < 8 || s.piece_max == 0 {
            return Err(
                "solver.iterations and solver.piece_max need at least 1, solver.piece_resolution 8"
                    .into(),
            );
        }
        Ok(())
    }

    /// Force of each finger on an object of this mass, N.
    pub fn grip_force_on(&self, mass_kg: f64, friction: f64) -> f64 {
        let clamped = |force: f64| force.clamp(self.grip_force_min_n, self.grip_force_max_n);
        match self.grip_force_rule {
            GripForceRule::Fixed => self.grip_force_n,
            GripForceRule::PerMass => clamped(self.grip_force_per_kg_n * mass_kg),
            GripForceRule::Coulomb => {
                let omega = std::f64::consts::TAU * self.shake_linear_hz;
                let peak = self.gravity_m_s2 + self.shake_linear_m * omega * omega;
                clamped(self.grip_force_safety * mass_kg * peak / (2.0 * friction))
            }
        }
    }

    /// All constants by their `--set` names, in a fixed order, as TOML values.
    pub fn constants(&self) -> Vec<(String, toml::Value)> {
        let table = toml::Table::try_from(self).expect("a protocol is a table");
        flatten(&table)
    }
}

fn known_keys() -> Vec<String> {
    let (_, text) = BUILT_IN[0];
    let table: toml::Table = text.parse().expect("the preset parses");
    flatten(&table).into_iter().map(|(k, _)| k).collect()
}

fn flatten(table: &toml::Table) -> Vec<(String, toml::Value)> {
    let mut out = Vec::new();
    for (key, value) in table {
        match value {
            toml::Value::Table(inner) => {
                out.extend(inner.iter().map(|(k, v)| (format!("{key}.{k}"), v.clone())));
            }
            value => out.push((key.clone(), value.clone())),
        }
    }
    out
}

/// Reads a command-line value with the type of the one it replaces.
fn typed(old: Option<&toml::Value>, text: &str) -> Result<toml::Value, String> {
    let wrong = |kind: &str| format!("{text:?} is not {kind}");
    Ok(match old {
        Some(toml::Value::Float(_)) => {
            toml::Value::Float(text.parse().map_err(|_| wrong("a number"))?)
        }
        Some(toml::Value::Integer(_)) => {
            toml::Value::Integer(text.parse().map_err(|_| wrong("a whole number"))?)
        }
        Some(toml::Value::Boolean(_)) => {
            toml::Value::Boolean(text.parse().map_err(|_| wrong("true or false"))?)
        }
        _ => toml::Value::String(text.to_owned()),
    })
}

fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.collect();
    let best = known
        .iter()
        .map(|k| (strsim::jaro_winkler(k, name), *k))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        Some((score, k)) if score > 0.75 => format!("did you mean {k:?}?"),
        _ => format!("known are: {}", known.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_loads_under_its_name_and_names_all_constants() {
        let all = known_keys();
        for name in Protocol::names() {
            let p = Protocol::load(name, &[]).unwrap();
            assert_eq!(p.name, name);
            let mut keys: Vec<String> = p.constants().into_iter().map(|(k, _)| k).collect();
            let mut expected = all.clone();
            keys.sort();
            expected.sort();
            assert_eq!(keys, expected);
        }
    }

    #[test]
    fn one_constant_can_be_set_and_a_misspelt_one_gets_the_nearest_name() {
        let set = |s: &str| Protocol::load("acronym", &[s.to_owned()]);
        assert_eq!(set("friction=0.3").unwrap().friction, 0.3);
        assert_eq!(set("solver.iterations=12").unwrap().solver.iterations, 12);
        assert_eq!(
            set("solver.object_contact=surface")
                .unwrap()
                .solver
                .object_contact,
            ObjectContact::Surface
        );
        for (item, needle) in [
            ("frction=1", "did you mean \"friction\""),
            ("friction=slippery", "not a number"),
            ("friction=-1", "friction is -1"),
            ("dt_s=0", "dt_s is 0"),
            ("friction", "key=value"),
            ("solver.object_contact=hull", "hull"),
        ] {
            let e = set(item).unwrap_err().to_string();
            assert!(e.contains(needle), "{item}: {e}");
        }
        let e = Protocol::load("acronim", &[]).unwrap_err().to_string();
        assert!(e.contains("did you mean \"acronym\""), "{e}");
    }
}
