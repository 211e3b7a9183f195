//! More objects to learn from than there are files: stretched copies, with the grasps carried along.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt as _;
use shakedown_gripper_assets::Grasp;
use shakedown_objects::Object;
use shakedown_sampler::seed;

/// A copy is at most this much longer or shorter along each of the axes of its stretch.
const STRETCH_MAX: f64 = 1.4;

/// Copy number `index` of an object. Every third is stretched along axes of its own, so that what
/// was upright leans and what was round does not stay so; the others along the axes of the mesh.
pub fn copy(object: &Object, index: u64, run_seed: u64) -> (Object, Matrix3<f64>) {
    let mut rng = seed::stream(run_seed, "stretch-v1", &object.hash, "", index);
    let axes = if index % 3 == 2 {
        seed::uniform_rotation(&mut rng).to_rotation_matrix()
    } else {
        Rotation3::identity()
    };
    let lengths = Vector3::from_fn(|_, _| STRETCH_MAX.powf(2.0 * rng.random::<f64>() - 1.0));
    let stretch = axes.matrix() * Matrix3::from_diagonal(&lengths) * axes.matrix().transpose();
    let id = format!("{}~{index}", object.id);
    (object.stretched(&id, &stretch), stretch)
}

/// A grasp where the stretch takes it: the tcp moves with the material, the closing axis turns as
/// the normals of the touched faces do, the approach as a line on the object does. Whether it is
/// still good is for others to say.
pub fn carry(grasp: &Grasp, stretch: &Matrix3<f64>, tcp_z_m: f64) -> Grasp {
    let pose = &grasp.object_from_hand;
    let tcp = stretch * (pose * Point3::new(0.0, 0.0, tcp_z_m));
    let normals = stretch
        .try_inverse()
        .expect("a stretch can be undone")
        .transpose();
    let closing = (normals * (pose.rotation * Vector3::x())).normalize();
    let approach = stretch * (pose.rotation * Vector3::z());
    let approach = (approach - closing * closing.dot(&approach)).normalize();
    let axes = Matrix3::from_columns(&[closing, approach.cross(&closing), approach]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    let origin = tcp.coords - approach * tcp_z_m;
    Grasp {
        object_from_hand: Isometry3::from_parts(Translation3::from(origin), rotation),
        ..*grasp
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_of_all_axes_alike_scales_the_grasp_with_the_object() {
        let pose = Isometry3::from_parts(
            Translation3::new(0.1, -0.2, 0.05),
            UnitQuaternion::from_euler_angles(0.3, 1.1, -2.0),
        );
        let grasp = Grasp::new(0, pose);
        let carried = carry(&grasp, &Matrix3::from_diagonal_element(1.2), 0.1);
        let turned = grasp
            .object_from_hand
            .rotation
            .angle_to(&carried.object_from_hand.rotation);
        assert!(turned < 1e-7);
        let tcp = |g: &Grasp| g.object_from_hand * Point3::new(0.0, 0.0, 0.1);
        assert!((tcp(&carried).coords - tcp(&grasp).coords * 1.2).norm() < 1e-12);
    }

    #[test]
    fn pads_stay_flat_on_the_faces_they_touched() {
        // A face with normal x, sheared: the closing axis follows its normal, at right angles to
        // the images of y and z.
        let stretch = Matrix3::new(1.0, 0.3, 0.1, 0.0, 1.1, 0.0, 0.0, 0.2, 0.9);
        let carried = carry(&Grasp::new(0, Isometry3::identity()), &stretch, 0.1);
        let closing = carried.object_from_hand.rotation * Vector3::x();
        assert!(closing.dot(&(stretch * Vector3::y())).abs() < 1e-12);
        assert!(closing.dot(&(stretch * Vector3::z())).abs() < 1e-12);
    }
}
