//! Which objects belong to a run? Object sets: the embedded one, or a TOML file.
//!
//! ```toml
//! [[object]]
//! id = "mug"                # default: the file's stem
//! mesh = "meshes/mug.obj"   # relative to this file
//! scale = 0.001             # metres per file unit, default 1
//! mass_kg = 0.31            # or density_kg_m3
//! friction = 0.6
//! blake3 = "..."            # optional checksum of the mesh file
//! licence = "CC-BY-4.0"
//! ```

use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{ObjectError, Place};
use crate::io::{MESH_BYTES_MAX, read_at_most};
use crate::object::ObjectSpec;

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct SetFile {
    object: Vec<Entry>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    id: Option<String>,
    mesh: PathBuf,
    scale: Option<f64>,
    mass_kg: Option<f64>,
    density_kg_m3: Option<f64>,
    friction: Option<f64>,
    blake3: Option<String>,
    #[expect(dead_code, reason = "kept beside the data for the reader of the file")]
    licence: Option<String>,
}

/// The objects of a set file, in its order, with mesh paths resolved against its directory.
///
/// # Errors
/// Broken TOML or an unknown key (with the line), two objects of one id, a wrong checksum.
pub fn read_set(path: &Path) -> Result<Vec<ObjectSpec>, ObjectError> {
    let text = fs::read_to_string(path).map_err(|e| ObjectError::io(path, e))?;
    let bad = |place, what: String, mend: &str| ObjectError::bad(path, place, what, mend);
    let set: SetFile = toml::from_str(&text).map_err(|e| {
        let line = e
            .span()
            .map_or(1, |s| text[..s.start].matches('\n').count() + 1);
        bad(
            Place::Line(line),
            e.message().to_owned(),
            "see docs/formats.md for the keys of an object set",
        )
    })?;
    let directory = path.parent().unwrap_or(Path::new("."));
    let mut specs: Vec<ObjectSpec> = Vec::new();
    for entry in set.object {
        let mesh = directory.join(&entry.mesh);
        if let Some(expected) = &entry.blake3 {
            let bytes =
                read_at_most(&mesh, MESH_BYTES_MAX).map_err(|e| ObjectError::io(&mesh, e))?;
            let found = blake3::hash(&bytes).to_hex().to_string();
            if &found != expected {
                return Err(bad(
                    Place::Whole,
                    format!("{} has blake3 {found}, not {expected}", mesh.display()),
                    "fetch the mesh again or correct the checksum",
                ));
            }
        }
        let id = entry.id.unwrap_or_else(|| crate::object::stem(&mesh));
        if specs.iter().any(|s| s.id.as_deref() == Some(&id)) {
            return Err(bad(
                Place::Whole,
                format!("two objects are called {id:?}"),
                "give each its own `id`",
            ));
        }
        specs.push(ObjectSpec {
            id: Some(id),
            mesh,
            scale: entry.scale,
            mass_kg: entry.mass_kg,
            density_kg_m3: entry.density_kg_m3,
            friction: entry.friction,
            ..ObjectSpec::default()
        });
    }
    Ok(specs)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<ObjectSpec>, ObjectError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("set.toml");
        fs::write(&path, text).unwrap();
        read_set(&path)
    }

    #[test]
    fn a_set_is_read_in_order_with_defaults() {
        let set = read("[[object]]\nmesh='b.obj'\n[[object]]\nid='x'\nmesh='a.stl'\nscale=0.001\n")
            .unwrap();
        assert_eq!(set[0].id.as_deref(), Some("b"));
        assert_eq!(set[1].scale, Some(0.001));
    }

    #[test]
    fn an_unknown_key_and_a_repeated_id_name_the_place() {
        let e = read("[[object]]\nmesh='b.obj'\nmas_kg=1\n")
            .unwrap_err()
            .to_string();
        assert!(e.contains("set.toml:3") && e.contains("mas_kg"), "{e}");
        let e = read("[[object]]\nmesh='b.obj'\n[[object]]\nmesh='b.stl'\n")
            .unwrap_err()
            .to_string();
        assert!(e.contains("\"b\""), "{e}");
    }
}
