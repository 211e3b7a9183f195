use nalgebra::{Isometry3, Vector3};
use shakedown_sim::{ObjectLoad, probe::Probe};
use shakedown_tests::rig::{centred, cylinder, gripped};
#[test]
fn scratch() {
    let object = cylinder(0.025, 0.06, 0.1);
    let scene = gripped(&object, 0.5, 10.0, &[]);
    for share in [0.5, 0.92] {
    let mut probe = Probe::new(&scene, &centred(), 0.08);
    probe.close(0.6, &Vector3::zeros());
    for k in 1..=600 {
        let s = (f64::from(k) * 0.002 / 0.2).min(1.0);
        probe.step(&Isometry3::identity(), &ObjectLoad { force_n: Vector3::y() * 10.0 * share * s, torque_n_m: Vector3::zeros() });
        if k % 40 == 0 { let c = probe.contacts(); let m = probe.motion(); eprintln!("{share} {k} {:?} {:?} F {:.3} {:.3} c {:?} {:?}", m.0.map(|x| (x*1e6).round()/1e3).as_slice(), m.1.map(|x| (x*1e4).round()/1e4).as_slice(), c[0].force_n.norm(), c[1].force_n.norm(), c[0].centre_m.coords.map(|x| (x*1e5).round()/1e2).as_slice(), c[1].centre_m.coords.map(|x| (x*1e5).round()/1e2).as_slice()); }
    }}
}
