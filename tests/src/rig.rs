//! Objects of one's own in the built-in hand.

use std::path::Path;

use nalgebra::{Isometry3, Translation3, Vector3};
use shakedown_gripper_assets::Gripper;
use shakedown_objects::mesh::RawMesh;
use shakedown_objects::shapes::loft;
use shakedown_objects::{Object, ObjectSpec, TriMesh};
use shakedown_sim::{Protocol, Scene};

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
