//! `shakedown sample`: only draw grasps and write them.

use std::path::{Path, PathBuf};

use shakedown_gripper_assets::{
    GraspFile, GraspFormat, Gripper, ObjectReference, ReadOptions, write_grasps,
};

use crate::args::{Global, ObjectArgs, SampleArgs};
use crate::failure::{Exit, Failure};
use crate::grasps;
use crate::plan::{Item, Material, Plan};
use crate::progress;
use crate::settings::Source;

pub fn run(global: &Global, args: &SampleArgs) -> Result<Exit, Failure> {
    let gripper = Gripper::load(&args.source.gripper)?;
    let source = Source::resolve(&args.source)?;
    let plan = Plan::new(&args.source, &args.object)?;
    let options = args.source.read_options(&gripper);
    let format = match args.out_format {
        Some(f) => f,
        None => by_extension(&args.out),
    };
    let many = plan.items.len() > 1;
    for item in &plan.items {
        let object = item.load(&args.object, &options)?;
        let selected = grasps::of_item(
            item,
            &object,
            &gripper,
            &source,
            &args.source,
            &options,
            global.seed,
        )?;
        let path = if many {
            args.out.join(file_name(&item.id, format))
        } else {
            args.out.clone()
        };
        let count = selected.grasps.len();
        write_grasps(&GraspFile {
            path: path.clone(),
            format,
            gripper: Some(gripper.name.clone()),
            object: reference_of(item, &args.object, &options)?,
            grasps: selected.grasps,
            reorthonormalised: 0,
        })?;
        progress::note(
            global,
            &format!("{count} grasps of {} in {}", item.id, path.display()),
        );
    }
    Ok(Exit::Success)
}

/// What a grasp file says of the object of an item.
///
/// # Errors
/// An item whose grasp file cannot be read.
pub fn reference_of(
    item: &Item,
    args: &ObjectArgs,
    options: &ReadOptions,
) -> Result<ObjectReference, Failure> {
    let (mesh, scale) = match &item.material {
        Material::Mesh(spec) => (Some(spec.mesh.clone()), args.scale.or(spec.scale)),
        Material::Shape(_) => (None, None),
        Material::GraspFile(path) => {
            let file = shakedown_gripper_assets::read_grasps(path, options)?;
            (file.object.mesh.map(PathBuf::from), file.object.scale)
        }
    };
    Ok(ObjectReference {
        mesh: mesh.map(|m| m.display().to_string()),
        scale: scale.or(Some(1.0)),
        ..ObjectReference::default()
    })
}

/// The format that a file's name asks for.
pub fn by_extension(path: &Path) -> GraspFormat {
    match path.extension().and_then(|e| e.to_str()) {
        Some("yaml" | "yml") => GraspFormat::IsaacYaml,
        Some("npz") => GraspFormat::Npz,
        Some("csv") => GraspFormat::Csv,
        _ => GraspFormat::GraspGenJson,
    }
}

fn file_name(id: &str, format: GraspFormat) -> String {
    let extension = match format {
        GraspFormat::IsaacYaml => "yaml",
        GraspFormat::Npz => "npz",
        GraspFormat::Csv => "csv",
        _ => "json",
    };
    format!("{id}.{extension}")
}
