//! The gate against a known truth: it finds a real drop and does not cry wolf.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use shakedown_metrics::compare::{Gate, Tried, Tries, Verdict, compare};

const REPEATS: usize = 1000;
const OBJECTS: usize = 28;
const GRASPS: usize = 2000;

/// Two runs of the same 2 000 grasps on 28 objects. Objects differ in their rate; a grasp of the
/// new run ends otherwise than in the base run by chance (`noise` of all, both ways alike) and by
/// the true drop, which differs from object to object with standard deviation `object_sd`.
fn runs(rng: &mut ChaCha8Rng, drop: f64, noise: f64, object_sd: f64) -> (Tries, Tries) {
    let (mut base, mut new) = (Tries::new(), Tries::new());
    let mut normal = || {
        // Sum of twelve uniform numbers: close enough to normal for effects of objects.
        (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
    };
    let effects: Vec<(f64, f64)> = (0..OBJECTS)
        .map(|_| {
            let rate = (0.7 + 0.15 * normal()).clamp(0.2, 0.95);
            (rate, drop + object_sd * normal())
        })
        .collect();
    for (i, (rate, lost)) in effects.into_iter().enumerate() {
        let n = GRASPS / OBJECTS + usize::from(i < GRASPS % OBJECTS);
        let (mut a, mut b) = (Vec::new(), Vec::new());
        for grasp in 0..n as u64 {
            let success = rng.random::<f64>() < rate;
            // Chances that keep the expected change at `-lost` whatever the rate.
            let flip = if success {
                (noise / 2.0 + lost.max(0.0)) / rate
            } else {
                (noise / 2.0 + (-lost).max(0.0)) / (1.0 - rate)
            };
            let after = success != (rng.random::<f64>() < flip);
            let tried = |success| Tried {
                grasp,
                pose: grasp as u16,
                success,
            };
            a.push(tried(success));
            b.push(tried(after));
        }
        base.insert(format!("object_{i:02}"), a);
        new.insert(format!("object_{i:02}"), b);
    }
    (base, new)
}

fn share(seed: u64, drop: f64, gate: Gate, wanted: Verdict) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let hits = (0..REPEATS)
        .filter(|_| {
            let (base, new) = runs(&mut rng, drop, 0.02, 0.015);
            compare(&base, &new, gate, None).unwrap().verdict == wanted
        })
        .count();
    hits as f64 / REPEATS as f64
}

/// At the gate as it stands: a change counts from two points on.
#[test]
fn a_true_drop_of_three_points_is_found() {
    let found = share(1, 0.03, Gate::default(), Verdict::Regression);
    assert!(found >= 0.95, "{found}");
}

/// Without a smallest effect the test alone has to keep its promise, objects moving or not.
#[test]
fn no_change_alarms_no_more_often_than_alpha() {
    let strict = Gate {
        min_effect: 0.0,
        ..Gate::default()
    };
    let alarms = share(2, 0.0, strict, Verdict::Regression);
    assert!(alarms <= strict.alpha, "{alarms}");
    let usual = share(3, 0.0, Gate::default(), Verdict::Regression);
    assert!(usual <= 0.001, "{usual}");
}
