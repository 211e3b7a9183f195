//! One object to grasp: its surface, its mass and where they come from.

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Point3};

use crate::error::{ObjectError, Place};
use crate::io::read_mesh;
use crate::mass::MassProperties;
use crate::mesh::{MeshReport, TriMesh};
use crate::surface::Surface;

/// Extents outside of this range mean wrong units, metres.
const PLAUSIBLE_EXTENT_M: std::ops::RangeInclusive<f64> = 0.001..=5.0;

/// What is known of an object before its mesh is read; everything but the mesh may be missing.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ObjectSpec {
    /// Identity in results; defaults to the mesh file's stem.
    pub id: Option<String>,
    /// The mesh file.
    pub mesh: PathBuf,
    /// Metres per file unit (default 1).
    pub scale: Option<f64>,
    /// Mass, kg. Wins over the density.
    pub mass_kg: Option<f64>,
    /// Density, kg/m3.
    pub density_kg_m3: Option<f64>,
    /// Friction coefficient of the pair of hand and object.
    pub friction: Option<f64>,
    /// Centre of mass, object frame, metres; default: of the homogeneous solid.
    pub com_m: Option<Point3<f64>>,
    /// Inertia about the centre of mass, kg m2, with the usual sign of off-diagonal elements.
    pub inertia_kg_m2: Option<Matrix3<f64>>,
}

/// An object with a mass, immutable, in the scaled mesh frame ("object frame"), SI units.
#[derive(Debug, Clone)]
pub struct Object {
    /// Identity in results.
    pub id: String,
    /// The surface and its tree.
    pub surface: Surface,
    /// Mass properties. `mass_kg` is the given mass, or density times volume; see
    /// [`Object::has_own_mass`].
    pub mass: MassProperties,
    /// Did a file, set or flag give mass or density? If not, protocols apply theirs.
    pub has_own_mass: bool,
    /// Friction coefficient that came with the object, if any.
    pub friction: Option<f64>,
    /// What was mended in the mesh.
    pub report: MeshReport,
    /// blake3 of the scaled geometry.
    pub hash: String,
}

impl Object {
    /// Reads the mesh of `spec` and makes the object.
    ///
    /// # Errors
    /// An unreadable mesh, a size that means wrong units (suggests a scale), no volume, or a mesh
    /// that is not closed and has no mass given.
    pub fn load(spec: &ObjectSpec) -> Result<Self, ObjectError> {
        let (mesh, report) = read_mesh(&spec.mesh)?;
        Self::from_mesh(spec, mesh, report)
    }

    /// Makes the object of a mesh at hand, in file units.
    ///
    /// # Errors
    /// As [`Object::load`].
    pub fn from_mesh(
        spec: &ObjectSpec,
        mesh: TriMesh,
        report: MeshReport,
    ) -> Result<Self, ObjectError> {
        let path = spec.mesh.as_path();
        let id = spec.id.clone().unwrap_or_else(|| stem(path));
        let scale = positive(path, "scale", spec.scale)?.unwrap_or(1.0);
        let mesh = if scale == 1.0 {
            mesh
        } else {
            mesh.scaled(scale)
        };
        check_size(path, &mesh, scale)?;
        let mass_kg = positive(path, "mass_kg", spec.mass_kg)?;
        let density = positive(path, "density_kg_m3", spec.density_kg_m3)?;
        let solid = MassProperties::of_mesh(&mesh);
        let box_volume = mesh.extents().product();
        let is_solid = report.is_watertight()
            && solid.volume_m3.is_finite()
            && solid.volume_m3 > 1e-9 * box_volume.max(1e-12);
        let mut mass = if is_solid {
            match (mass_kg, density) {
                (Some(m), _) => solid.with_mass(m),
                (None, Some(d)) => solid.with_density(d),
                (None, None) => solid,
            }
        } else if report.is_watertight() {
            return Err(ObjectError::bad(
                path,
                Place::Whole,
                format!("the mesh encloses no volume ({:.3e} m3)", solid.volume_m3),
                "a closed surface around some material is needed",
            ));
        } else if let Some(m) = mass_kg {
            hull_mass(path, &mesh)?.with_mass(m)
        } else {
            return Err(ObjectError::bad(
                path,
                Place::Whole,
                format!(
                    "the mesh is not closed ({} open and {} overfull edges), so it has no volume to weigh",
                    report.boundary_edges, report.non_manifold_edges
                ),
                "close it, or give its mass with --mass-kg (its convex hull then tells the inertia)",
            ));
        };
        if let Some(com) = spec.com_m {
            mass.com_m = com;
        }
        if let Some(inertia) = spec.inertia_kg_m2 {
            mass.inertia_kg_m2 = inertia;
        }
        let hash = mesh.content_hash();
        Ok(Self {
            id,
            surface: Surface::new(mesh, report.is_watertight()),
            mass,
            has_own_mass: mass_kg.is_some() || density.is_some(),
            friction: spec.friction,
            report,
            hash,
        })
    }
}

/// File name without directory and extension.
pub fn stem(path: &Path) -> String {
    path.file_stem()
        .map_or_else(|| "object".into(), |s| s.to_string_lossy().into_owned())
}

fn positive(path: &Path, name: &str, value: Option<f64>) -> Result<Option<f64>, ObjectError> {
    match value {
        Some(v) if !(v.is_finite() && v > 0.0) => Err(ObjectError::bad(
            path,
            Place::Whole,
            format!("{name} is {v}"),
            "give a positive number",
        )),
        v => Ok(v),
    }
}

fn check_size(path: &Path, mesh: &TriMesh, scale: f64) -> Result<(), ObjectError> {
    let extent = mesh.extents().max();
    if PLAUSIBLE_EXTENT_M.contains(&extent) {
        return Ok(());
    }
    // The power of ten that brings the longest edge nearest to 0.1 m.
    let factor = 10f64.powi((0.1 / extent).log10().round() as i32);
    Err(ObjectError::bad(
        path,
        Place::Whole,
        format!("the object would be {extent:.3e} m long, which no 80 mm hand is made for"),
        format!("are the units right? try --scale {}", scale * factor),
    ))
}

fn hull_mass(path: &Path, mesh: &TriMesh) -> Result<MassProperties, ObjectError> {
    let flat = || {
        ObjectError::bad(
            path,
            Place::Whole,
            "the mesh is flat: not even its convex hull has a volume",
            "a body with some thickness is needed",
        )
    };
    let points: Vec<parry3d::math::Vector> = mesh
        .vertices()
        .iter()
        .map(|v| parry3d::math::Vector::new(v.x as f32, v.y as f32, v.z as f32))
        .collect();
    let (vertices, faces) =
        parry3d::transformation::try_convex_hull(&points).map_err(|_| flat())?;
    let raw = crate::mesh::RawMesh {
        vertices: vertices
            .iter()
            .map(|v| [v.x, v.y, v.z].map(f64::from))
            .collect(),
        faces,
    };
    let (hull, _) = TriMesh::from_raw(raw, path)?;
    let mass = MassProperties::of_mesh(&hull);
    if mass.volume_m3 > 0.0 {
        Ok(mass)
    } else {
        Err(flat())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::loft;
    use nalgebra::Vector3;

    fn make(
        spec: &ObjectSpec,
        size: Vector3<f64>,
        drop_faces: usize,
    ) -> Result<Object, ObjectError> {
        let mut raw = loft::cuboid(size);
        raw.faces.truncate(raw.faces.len() - drop_faces);
        let (mesh, report) = TriMesh::from_raw(raw, &spec.mesh).unwrap();
        Object::from_mesh(spec, mesh, report)
    }

    fn spec() -> ObjectSpec {
        ObjectSpec {
            mesh: "dir/block.obj".into(),
            ..ObjectSpec::default()
        }
    }

    #[test]
    fn wrong_units_are_an_error_that_suggests_the_scale() {
        for (edge, hint) in [(100.0, "--scale 0.001"), (0.00001, "--scale 10000")] {
            let e = make(&spec(), Vector3::repeat(edge), 0)
                .unwrap_err()
                .to_string();
            assert!(e.contains(hint) && e.contains("block.obj"), "{e}");
        }
    }

    #[test]
    fn an_open_mesh_needs_a_mass() {
        let e = make(&spec(), Vector3::repeat(0.05), 2)
            .unwrap_err()
            .to_string();
        assert!(e.contains("--mass-kg"), "{e}");
        let with_mass = ObjectSpec {
            mass_kg: Some(0.2),
            ..spec()
        };
        let object = make(&with_mass, Vector3::repeat(0.05), 2).unwrap();
        assert!((object.mass.mass_kg - 0.2).abs() < 1e-12);
        assert!(!object.surface.is_watertight());
    }

    #[test]
    fn mass_wins_over_density_and_none_is_told_apart() {
        let both = ObjectSpec {
            mass_kg: Some(0.3),
            density_kg_m3: Some(150.0),
            ..spec()
        };
        assert!((make(&both, Vector3::repeat(0.05), 0).unwrap().mass.mass_kg - 0.3).abs() < 1e-12);
        let object = make(&spec(), Vector3::repeat(0.05), 0).unwrap();
        assert!(!object.has_own_mass);
        assert_eq!(object.id, "block");
    }
}
