//! Which objects belong to this job, and where do the grasps of each come from?

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use shakedown_gripper_assets::{ObjectReference, ReadOptions, read_grasps};
use shakedown_objects::shapes::{Shape, embedded};
use shakedown_objects::{Object, ObjectSpec, set};
use shakedown_report::ManifestObject;

use crate::args::{ObjectArgs, SourceArgs};
use crate::failure::Failure;

/// What an object is made of.
#[derive(Clone)]
pub enum Material {
    /// A member of the embedded set.
    Shape(Shape),
    /// A mesh file with properties.
    Mesh(Box<ObjectSpec>),
    /// An ACRONYM or other grasp file that names its mesh.
    GraspFile(PathBuf),
}

/// One object of a job.
#[derive(Clone)]
pub struct Item {
    pub id: String,
    pub material: Material,
    /// The file its grasps come from; none: a sampler's.
    pub grasps: Option<PathBuf>,
}

/// All items, sorted by id.
pub struct Plan {
    pub items: Vec<Item>,
}

impl Plan {
    /// # Errors
    /// A set that cannot be read, two objects of one id, a filter that is no pattern.
    pub fn new(source: &SourceArgs, object: &ObjectArgs) -> Result<Self, Failure> {
        let mut items = Vec::new();
        if source.grasps.is_empty() {
            let default = vec!["embedded".to_owned()];
            let names = if object.objects.is_empty() {
                &default
            } else {
                &object.objects
            };
            for name in names {
                items.extend(items_of(name)?);
            }
        } else {
            if !object.objects.is_empty() {
                return Err(Failure::usage(
                    "--grasps brings its objects along; use --mesh or --mesh-root instead of --objects",
                ));
            }
            for file in &source.grasps {
                items.push(Item {
                    id: shakedown_objects::object::stem(file),
                    material: Material::GraspFile(file.clone()),
                    grasps: Some(file.clone()),
                });
            }
        }
        if let Some(pattern) = &object.filter {
            let pattern =
                regex::Regex::new(pattern).map_err(|e| Failure::usage(format!("--filter: {e}")))?;
            items.retain(|i| pattern.is_match(&i.id));
        }
        items.sort_by(|a, b| a.id.cmp(&b.id));
        if let Some(pair) = items.windows(2).find(|w| w[0].id == w[1].id) {
            return Err(Failure::input(format!(
                "two objects are called {:?}; rename a file or give ids in a set file",
                pair[0].id
            )));
        }
        if items.is_empty() {
            return Err(Failure::nothing(
                "no object is selected; look at --filter and --objects",
            ));
        }
        Ok(Self { items })
    }
}

fn items_of(name: &str) -> Result<Vec<Item>, Failure> {
    if name == "embedded" {
        return Ok(embedded()
            .into_iter()
            .map(|shape| Item {
                id: shape.id.clone(),
                material: Material::Shape(shape),
                grasps: None,
            })
            .collect());
    }
    let path = Path::new(name);
    let extension = path
        .extension()
        .map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("toml") => Ok(set::read_set(path)?
            .into_iter()
            .map(|spec| Item {
                id: spec.id.clone().unwrap_or_default(),
                material: Material::Mesh(Box::new(spec)),
                grasps: None,
            })
            .collect()),
        Some("h5" | "hdf5") => Ok(vec![Item {
            id: shakedown_objects::object::stem(path),
            material: Material::GraspFile(path.to_owned()),
            grasps: None,
        }]),
        None if !path.exists() => Err(Failure::input(format!(
            "there is no object set {name:?}: the built-in one is called \"embedded\"; otherwise \
             give a mesh, a set (.toml) or an ACRONYM file (.h5)"
        ))),
        _ => Ok(vec![Item {
            id: shakedown_objects::object::stem(path),
            material: Material::Mesh(Box::new(ObjectSpec {
                mesh: path.to_owned(),
                ..ObjectSpec::default()
            })),
            grasps: None,
        }]),
    }
}

impl Item {
    /// Loads the object: flags win over the file, the file over defaults.
    ///
    /// # Errors
    /// Whatever is wrong with mesh or grasp file.
    pub fn load(&self, args: &ObjectArgs, options: &ReadOptions) -> Result<Object, Failure> {
        let mut object = match &self.material {
            Material::Shape(shape) => {
                let mut object = shape.object()?;
                if let Some(mass) = args.mass_kg {
                    object.mass = object.mass.with_mass(mass);
                } else if let Some(density) = args.density_kg_m3 {
                    object.mass = object.mass.with_density(density);
                }
                object
            }
            Material::Mesh(spec) => {
                let mut spec = spec.as_ref().clone();
                spec.id = Some(self.id.clone());
                spec.scale = args.scale.or(spec.scale);
                override_mass(&mut spec, args);
                Object::load(&spec)?
            }
            Material::GraspFile(path) => {
                let reference = read_grasps(path, options)?.object;
                Object::load(&self.spec_of(path, &reference, args)?)?
            }
        };
        if let Some(mu) = args.friction {
            object.friction = Some(mu);
        }
        Ok(object)
    }

    /// The object that a grasp file speaks of.
    pub fn spec_of(
        &self,
        path: &Path,
        reference: &ObjectReference,
        args: &ObjectArgs,
    ) -> Result<ObjectSpec, Failure> {
        let mesh = match (&args.mesh, &reference.mesh) {
            (Some(mesh), _) => mesh.clone(),
            (None, Some(name)) => find_mesh(path, name, args.mesh_root.as_deref())?,
            (None, None) => {
                return Err(Failure::input(format!(
                    "{}: the file names no mesh; give it with --mesh",
                    path.display()
                )));
            }
        };
        let mut spec = ObjectSpec {
            id: Some(self.id.clone()),
            mesh,
            scale: args.scale.or(reference.scale),
            mass_kg: reference.mass_kg,
            density_kg_m3: reference.density_kg_m3,
            friction: reference.friction,
            com_m: None,
            inertia_kg_m2: None,
        };
        override_mass(&mut spec, args);
        Ok(spec)
    }

    /// What the manifest says of the object.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn describe(
        &self,
        args: &ObjectArgs,
        options: &ReadOptions,
    ) -> Result<ManifestObject, Failure> {
        let mut properties = BTreeMap::new();
        let mut note = |key: &str, value: Option<f64>| {
            if let Some(v) = value {
                properties.insert(key.to_owned(), serde_json::json!(v));
            }
        };
        let mut source = blake3::Hasher::new();
        let mut mesh_bytes = blake3::Hasher::new();
        let read = |path: &Path| -> Result<Vec<u8>, Failure> {
            fs::read(path)
                .map_err(|e| Failure::input(format!("cannot read {}: {e}", path.display())))
        };
        let mut add_mesh = |path: &Path| -> Result<(), Failure> {
            mesh_bytes.update(&read(path)?);
            Ok(())
        };
        let mesh = match &self.material {
            Material::Shape(shape) => {
                mesh_bytes.update(format!("{} {:?}", shape.family.name(), shape.values).as_bytes());
                for ((name, _, _), value) in shape.family.parameters().iter().zip(&shape.values) {
                    note(name, Some(*value));
                }
                note("density_kg_m3", Some(shape.family.density_kg_m3()));
                format!("embedded {}", shape.family.name())
            }
            Material::Mesh(spec) => {
                add_mesh(&spec.mesh)?;
                note("scale", spec.scale);
                note("mass_kg", spec.mass_kg);
                note("density_kg_m3", spec.density_kg_m3);
                note("friction", spec.friction);
                spec.mesh.display().to_string()
            }
            Material::GraspFile(path) => {
                source.update(&read(path)?);
                let spec = self.spec_of(path, &read_grasps(path, options)?.object, args)?;
                add_mesh(&spec.mesh)?;
                note("scale", spec.scale);
                note("mass_kg", spec.mass_kg);
                note("density_kg_m3", spec.density_kg_m3);
                note("friction", spec.friction);
                // The name inside the file, not where it lies on this machine.
                shakedown_objects::object::stem(&spec.mesh)
            }
        };
        note("flag_scale", args.scale);
        note("flag_mass_kg", args.mass_kg);
        note("flag_density_kg_m3", args.density_kg_m3);
        note("flag_friction", args.friction);
        Ok(ManifestObject {
            id: self.id.clone(),
            mesh,
            properties: serde_json::json!(properties),
            source_hash: short(source.update(mesh_bytes.finalize().as_bytes())),
            mesh_hash: short(&mesh_bytes),
        })
    }
}

fn short(hasher: &blake3::Hasher) -> String {
    hasher.finalize().to_hex()[..32].to_owned()
}

/// Flags beat what the file says; a density flag beats a mass of the file.
fn override_mass(spec: &mut ObjectSpec, args: &ObjectArgs) {
    if let Some(density) = args.density_kg_m3 {
        spec.mass_kg = None;
        spec.density_kg_m3 = Some(density);
    }
    if let Some(mass) = args.mass_kg {
        spec.mass_kg = Some(mass);
    }
}

/// The mesh a grasp file names: under the root, beside the file, or one folder up.
fn find_mesh(file: &Path, name: &str, root: Option<&Path>) -> Result<PathBuf, Failure> {
    let beside = file.parent().unwrap_or(Path::new("."));
    let places: Vec<PathBuf> = match root {
        Some(root) => vec![root.join(name)],
        None => vec![
            beside.join(name),
            beside.join("..").join(name),
            PathBuf::from(name),
        ],
    };
    places.iter().find(|p| p.is_file()).cloned().ok_or_else(|| {
        let tried: Vec<String> = places.iter().map(|p| p.display().to_string()).collect();
        Failure::input(format!(
            "{}: its mesh {name:?} is not at {}; say where with --mesh-root or --mesh",
            file.display(),
            tried.join(" or ")
        ))
    })
}
