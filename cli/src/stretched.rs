//! More objects to learn from than there are files: stretched copies.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::RngExt as _;
use shakedown_objects::Object;
use shakedown_sampler::seed;

/// A copy is at most this much longer or shorter along each of the axes of its stretch.
const STRETCH_MAX: f64 = 1.4;

/// Copy number `index` of an object. Every third is stretched along axes of its own, so that what
/// was upright leans and what was round does not stay so; the others along the axes of the mesh.
pub fn copy(object: &Object, index: u64, run_seed: u64) -> Object {
    let mut rng = seed::stream(run_seed, "stretch-v1", &object.hash, "", index);
    let axes = if index % 3 == 2 {
        seed::uniform_rotation(&mut rng).to_rotation_matrix()
    } else {
        Rotation3::identity()
    };
    let lengths = Vector3::from_fn(|_, _| STRETCH_MAX.powf(2.0 * rng.random::<f64>() - 1.0));
    let stretch = axes.matrix() * Matrix3::from_diagonal(&lengths) * axes.matrix().transpose();
    let id = format!("{}~{index}", object.id);
    object.stretched(&id, &stretch)
}
