//! `shakedown objects`: what is there to grasp, and what does a mesh hold?

use std::fmt::Write as _;
use std::fs;

use shakedown_gripper_assets::ReadOptions;
use shakedown_objects::{Object, TriMesh};
use shakedown_report::table::aligned;

use crate::args::{Format, Global, ObjectArgs, ObjectsArgs, SourceArgs};
use crate::failure::{Exit, Failure};
use crate::plan::{Item, Material, Plan};

pub fn run(global: &Global, args: &ObjectsArgs) -> Result<Exit, Failure> {
    let object_args = ObjectArgs {
        objects: args.files.clone(),
        scale: args.scale,
        mesh_root: args.mesh_root.clone(),
        ..ObjectArgs::default()
    };
    let plan = Plan::new(&SourceArgs::default(), &object_args)?;
    let mut rows = Vec::new();
    let mut values = Vec::new();
    for item in &plan.items {
        let object = item.load(&object_args, &ReadOptions::default())?;
        if let Some(directory) = &args.export {
            let io = |e| Failure::input(format!("cannot write {}: {e}", directory.display()));
            fs::create_dir_all(directory).map_err(io)?;
            let path = directory.join(format!("{}.obj", item.id));
            fs::write(path, obj_text(object.surface.mesh())).map_err(io)?;
        }
        rows.push(row(item, &object));
        values.push(value(item, &object));
    }
    match global.format {
        Format::Json => println!(
            "{}",
            serde_json::to_string_pretty(&values).expect("plain data")
        ),
        Format::Text | Format::Md => {
            let header = [
                "object",
                "split",
                "size mm",
                "mass g",
                "volume cm3",
                "faces",
                "bodies",
                "closed",
                "mends",
            ];
            print!("{}", aligned(&header, &rows));
        }
    }
    Ok(Exit::Success)
}

fn split(item: &Item) -> &'static str {
    match &item.material {
        Material::Shape(s) if s.split == shakedown_objects::shapes::Split::Unseen => "unseen",
        Material::Shape(_) => "seen",
        _ => "-",
    }
}

fn row(item: &Item, object: &Object) -> Vec<String> {
    let size = object.surface.mesh().extents() * 1000.0;
    let mass = if object.has_own_mass {
        format!("{:.1}", object.mass.mass_kg * 1e3)
    } else {
        "-".into()
    };
    vec![
        item.id.clone(),
        split(item).into(),
        format!("{:.0} x {:.0} x {:.0}", size.x, size.y, size.z),
        mass,
        format!("{:.1}", object.mass.volume_m3 * 1e6),
        object.surface.mesh().faces().len().to_string(),
        object.report.bodies.to_string(),
        if object.surface.is_watertight() {
            "yes"
        } else {
            "no"
        }
        .into(),
        object.report.mends().join(", "),
    ]
}

fn value(item: &Item, object: &Object) -> serde_json::Value {
    let com = object.mass.com_m;
    serde_json::json!({
        "object": item.id,
        "split": split(item),
        "extents_m": object.surface.mesh().extents().as_slice(),
        "mass_kg": object.has_own_mass.then_some(object.mass.mass_kg),
        "volume_m3": object.mass.volume_m3,
        "com_m": [com.x, com.y, com.z],
        "faces": object.surface.mesh().faces().len(),
        "watertight": object.surface.is_watertight(),
        "report": object.report,
        "mesh_blake3": object.hash,
    })
}

/// A mesh as OBJ, metres.
pub fn obj_text(mesh: &TriMesh) -> String {
    let mut text = String::new();
    for v in mesh.vertices() {
        let _ = writeln!(text, "v {} {} {}", v.x, v.y, v.z);
    }
    for f in mesh.faces() {
        let _ = writeln!(text, "f {} {} {}", f[0] + 1, f[1] + 1, f[2] + 1);
    }
    text
}
