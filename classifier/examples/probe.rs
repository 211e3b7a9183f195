use nalgebra::*;
use shakedown_classifier::*;
use shakedown_gripper_assets::*;
use shakedown_objects::*;
use std::time::Instant;
fn main() {
    let root = std::path::Path::new("/work/shared/acronym/seen");
    let f = read_grasps(
        &root.join("grasps/Mug_10f6e09036350e92b3f21f1137c3c347_0.0002682457830986903.h5"),
        &ReadOptions::default(),
    )
    .unwrap();
    let o = Object::load(&ObjectSpec {
        mesh: root.join(f.object.mesh.as_ref().unwrap()),
        scale: f.object.scale,
        density_kg_m3: f.object.density_kg_m3,
        ..Default::default()
    })
    .unwrap();
    println!("{} faces {:?}", o.surface.mesh().faces().len(), o.report);
    println!("mass {} vs {:?}", o.mass.mass_kg, f.object.mass_kg);
    let g = Gripper::load("franka_panda").unwrap();
    let h = HandModel::new(&g, 0.08).unwrap();
    let th = Thresholds::default();
    for (i, b) in h.bodies.iter().enumerate() {
        println!("{} {}", h.part_names[i], b.planes.len());
    }
    for s in [0.0, 0.005, 0.01, 0.02] {
        let v: Vec<_> = f
            .grasps
            .iter()
            .map(|q| {
                classify(
                    &h,
                    &o.surface,
                    &(q.object_from_hand * Translation3::new(0., 0., s)),
                    &th,
                )
            })
            .collect();
        let n = v.len() as f64;
        println!(
            "shift {s}: collides {:.4} reach {:.4} optimal {:.4} strict {:.4}",
            v.iter().filter(|v| v.collides).count() as f64 / n,
            v.iter().filter(|v| v.reachable).count() as f64 / n,
            v.iter().filter(|v| v.class() == Class::Optimal).count() as f64 / n,
            v.iter().filter(|v| v.is_strictly_optimal()).count() as f64 / n
        );
        if s == 0.0 {
            for (i, x) in v.iter().enumerate().filter(|(_, x)| x.collides).take(10) {
                println!("{i} {x:?}");
            }
        }
    }
    // perturbed
    let mut st = 12345u64;
    let mut r = || {
        st ^= st << 13;
        st ^= st >> 7;
        st ^= st << 17;
        (st >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut gauss = || {
        let (a, b): (f64, f64) = (r(), r());
        (-2.0 * a.ln()).sqrt() * (6.283185307 * b).cos()
    };
    let poses: Vec<_> = f
        .grasps
        .iter()
        .map(|q| {
            let t = Translation3::new(gauss() * 0.015, gauss() * 0.015, gauss() * 0.015);
            let a = Vector3::new(gauss(), gauss(), gauss()).normalize() * gauss() * 0.3;
            q.object_from_hand * Isometry3::from_parts(t, UnitQuaternion::new(a))
        })
        .collect();
    for (name, ps) in [
        ("perturbed", poses),
        (
            "as is",
            f.grasps.iter().map(|g| g.object_from_hand).collect(),
        ),
    ] {
        let mut c = [0; 3];
        let t = Instant::now();
        let reps = 60;
        for _ in 0..reps {
            for p in &ps {
                c[classify(&h, &o.surface, p, &th).class() as usize] += 1;
            }
        }
        let us = t.elapsed().as_secs_f64() * 1e6 / (reps * ps.len()) as f64;
        println!(
            "{name} {:?} {us:.2} us/pose {:.0}/s",
            c.map(|x| x / reps),
            1e6 / us
        );
    }
    if std::env::args().nth(1).is_some() {
        return;
    }
    let t = Instant::now();
    let pool = 1;
    let _ = pool;
    let g64 = SdfGrid::bake(&o.surface, 64, 0.1);
    println!("sdf {:.3}s {}", t.elapsed().as_secs_f64(), g64.values_m[0]);
    let m = &o.mass;
    println!("com err {:e}", (m.com_m - f.object.com_m.unwrap()).norm());
    let inertia = f.object.inertia_kg_m2.unwrap();
    println!(
        "inertia err {:e}",
        (m.inertia_kg_m2 - inertia).norm() / inertia.norm()
    );
    let t = Instant::now();
    let p = shakedown_objects::pieces::decompose(o.surface.mesh(), &Default::default());
    println!("pieces {} in {:.2}s", p.len(), t.elapsed().as_secs_f64());
}
