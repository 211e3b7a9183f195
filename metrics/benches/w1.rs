//! Exact W1 between two sets of 2 000 poses. Peers on such sets: scipy's `linear_sum_assignment`
//! 0.4 to 0.7 CPU-seconds, POT's `emd2` 0.7 to 0.9.

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Isometry3;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use shakedown_metrics::distribution::{w1_rotation_rad, w1_translation_m};
use shakedown_objects::shapes::Family;
use shakedown_sampler::{AntipodalSettings, sample_antipodal};

/// Grasps of the embedded mug, as two samplers with different seeds draw them.
fn grasps(n: u64, seed: u64) -> Vec<Isometry3<f64>> {
    let object = Family::Mug.member(0).object().expect("built in");
    let gripper = shakedown_gripper_assets::Gripper::load("franka_panda").expect("built in");
    sample_antipodal(&object, &gripper, n, seed, &AntipodalSettings::default())
        .into_iter()
        .map(|g| g.object_from_hand)
        .collect()
}

fn noise(n: usize, seed: u64) -> Vec<Isometry3<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..n)
        .map(|_| {
            let t = shakedown_sampler::seed::normal_vector(&mut rng) * 0.05;
            Isometry3::from_parts(
                t.into(),
                shakedown_sampler::seed::uniform_rotation(&mut rng),
            )
        })
        .collect()
}

fn w1(c: &mut Criterion) {
    let mut group = c.benchmark_group("w1_2000");
    group.sample_size(10);
    for (name, a, b) in [
        ("grasps", grasps(2000, 0), grasps(2000, 1)),
        ("noise", noise(2000, 0), noise(2000, 1)),
    ] {
        assert_eq!((a.len(), b.len()), (2000, 2000));
        group.bench_function(format!("translation, {name}"), |x| {
            x.iter(|| w1_translation_m(&a, &b));
        });
        group.bench_function(format!("rotation, {name}"), |x| {
            x.iter(|| w1_rotation_rad(&a, &b));
        });
    }
    group.finish();
}

criterion_group!(benches, w1);
criterion_main!(benches);
