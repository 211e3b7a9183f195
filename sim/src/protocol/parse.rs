//! From a preset's name or a TOML file to a checked [`Protocol`].
//!
//! A file gives only what it changes; everything else comes from `protocols/defaults.toml`.

use std::fs;
use std::path::{Path, PathBuf};

use super::Protocol;

const DEFAULTS: &str = include_str!("../../protocols/defaults.toml");
const BUILT_IN: [(&str, &str); 9] = [
    ("acronym", include_str!("../../protocols/acronym.toml")),
    (
        "acronym-stated",
        include_str!("../../protocols/acronym-stated.toml"),
    ),
    ("se3dif", include_str!("../../protocols/se3dif.toml")),
    (
        "graspdatagen",
        include_str!("../../protocols/graspdatagen.toml"),
    ),
    ("dgb-fc", include_str!("../../protocols/dgb-fc.toml")),
    (
        "mgg-gravity",
        include_str!("../../protocols/mgg-gravity.toml"),
    ),
    ("lift", include_str!("../../protocols/lift.toml")),
    ("hardness", include_str!("../../protocols/hardness.toml")),
    ("hold", include_str!("../../protocols/hold.toml")),
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

impl Protocol {
    /// Names of the presets.
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.iter().map(|(name, _)| *name)
    }

    /// TOML text of a preset, to copy and change: what it sets, then every default it keeps.
    pub fn source_text(name: &str) -> Option<String> {
        let (_, text) = BUILT_IN.iter().find(|(n, _)| *n == name)?;
        let own: toml::Table = text.parse().expect("the preset parses");
        let own: Vec<String> = flatten(&own).into_iter().map(|(k, _)| k).collect();
        let (top, solver) = DEFAULTS
            .split_once("[solver]")
            .expect("defaults have a solver");
        let (own_top, own_solver) = text.split_once("[solver]").unwrap_or((text, ""));
        let kept = |lines: &str, prefix: &str| -> String {
            lines
                .lines()
                .filter(|line| {
                    line.split_once(" = ").is_some_and(|(key, _)| {
                        !line.starts_with('#') && !own.contains(&format!("{prefix}{key}"))
                    })
                })
                .map(|line| format!("{line}\n"))
                .collect()
        };
        Some(format!(
            "{}\n# As in every preset\n{}\n[solver]\n{}{}",
            own_top.trim_end(),
            kept(top, ""),
            own_solver.trim_start(),
            kept(solver, "solver.")
        ))
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
            let (_, text) = BUILT_IN.iter().find(|(n, _)| *n == name).ok_or_else(|| {
                ProtocolError::Unknown {
                    name: name.to_owned(),
                    hint: nearest(name, Self::names()),
                }
            })?;
            (*text).to_owned()
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
        let defaults: toml::Table = DEFAULTS.parse().expect("the defaults parse");
        let keys: Vec<String> = flatten(&defaults).into_iter().map(|(k, _)| k).collect();
        for (key, _) in flatten(&table) {
            if !keys.contains(&key) {
                return Err(bad(format!(
                    "there is no constant {key:?}; {}",
                    nearest(&key, keys.iter().map(String::as_str))
                )));
            }
        }
        table = merged(defaults, table);
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

    /// All constants by their `--set` names, in a fixed order, as TOML values.
    pub fn constants(&self) -> Vec<(String, toml::Value)> {
        let table = toml::Table::try_from(self).expect("a protocol is a table");
        flatten(&table)
    }
}

/// `over` on top of `base`, section by section.
fn merged(mut base: toml::Table, over: toml::Table) -> toml::Table {
    for (key, value) in over {
        let value = match (base.remove(&key), value) {
            (Some(toml::Value::Table(inner)), toml::Value::Table(value)) => {
                toml::Value::Table(merged(inner, value))
            }
            (_, value) => value,
        };
        base.insert(key, value);
    }
    base
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
        Some(toml::Value::Array(_)) => {
            let table: toml::Table = format!("x = {text}")
                .parse()
                .map_err(|_| wrong("a list like [[0, 0, 1.0]]"))?;
            table["x"].clone()
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
    use crate::protocol::ObjectContact;

    #[test]
    fn every_preset_loads_under_its_name_and_names_all_constants() {
        let defaults: toml::Table = DEFAULTS.parse().unwrap();
        let all: Vec<String> = flatten(&defaults).into_iter().map(|(k, _)| k).collect();
        for name in Protocol::names() {
            let p = Protocol::load(name, &[]).unwrap();
            assert_eq!(p.name, name);
            let mut keys: Vec<String> = p.constants().into_iter().map(|(k, _)| k).collect();
            let mut expected = all.clone();
            keys.sort();
            expected.sort();
            assert_eq!(keys, expected);
            let printed = Protocol::source_text(name).unwrap();
            assert_eq!(Protocol::parse(&printed, name, &[]).unwrap(), p, "{name}");
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
