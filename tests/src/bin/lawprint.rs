//! x
use shakedown_tests::laws::*;
use shakedown_sim::{probe::Probe,ObjectLoad};
use nalgebra::*;
fn main() {
    let scene = gripped(&block(Vector3::new(0.03, 0.03, 0.05), 0.1), 0.5, 20.0, &[]);
    let off = Translation3::new(0.006, 0.0, 0.0);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
    let closing = |pose: &Isometry3<f64>| {
        let mut probe = Probe::new(&scene, pose, 0.08);
        for k in 0..300 {
            probe.step(&Isometry3::identity(), &ObjectLoad::default());
            if k%30==0 {println!("{k} {:?} {:?} {:?} {:?}",pose.rotation*probe.motion().0*1e3,pose.rotation*probe.motion().1,probe.fingers().position_m, probe.contacts().map(|c|c.force_n.x));}
        }
    };
    closing(&(centred() * off));
    closing(&(off * centred() * turn));
    for l in shakedown_tests::laws::all() {
        println!("{} {:18} {:60} {:10.5} {:10.5} {}", if l.holds() {"ok  "} else {"FAIL"}, l.law, l.case, l.analytic, l.measured, l.unit);
    }
}
