//! Which random numbers belong to this item? One ChaCha8 stream per name.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// The stream of a named item under the run's seed: blake3 of seed and names seeds ChaCha8.
pub fn stream(seed: u64, purpose: &str, object: &str, gripper: &str, index: u64) -> ChaCha8Rng {
    let mut hasher = blake3::Hasher::new();
    hasher.update(b"shakedown-stream-v1");
    hasher.update(&seed.to_le_bytes());
    for name in [purpose, object, gripper] {
        hasher.update(&(name.len() as u64).to_le_bytes());
        hasher.update(name.as_bytes());
    }
    hasher.update(&index.to_le_bytes());
    ChaCha8Rng::from_seed(*hasher.finalize().as_bytes())
}

/// Two independent standard normal numbers (G. E. P. Box and M. E. Muller, 1958).
pub fn normal_pair(rng: &mut ChaCha8Rng) -> (f64, f64) {
    // 1 - u lies in (0, 1], where the logarithm is finite.
    let u: f64 = 1.0 - rng.random::<f64>();
    let v: f64 = rng.random();
    let r = (-2.0 * u.ln()).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
    (r * cos, r * sin)
}

/// A vector of independent standard normal numbers.
pub fn normal_vector(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    let (x, y) = normal_pair(rng);
    let (z, _) = normal_pair(rng);
    Vector3::new(x, y, z)
}

/// A rotation, uniform on SO(3): a normal 4-vector, normalised.
pub fn uniform_rotation(rng: &mut ChaCha8Rng) -> UnitQuaternion<f64> {
    let (a, b) = normal_pair(rng);
    let (c, d) = normal_pair(rng);
    UnitQuaternion::from_quaternion(Quaternion::new(a, b, c, d))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_depend_on_every_part_of_their_name() {
        let first = |s, p, o, g, i| stream(s, p, o, g, i).random::<u64>();
        let base = first(0, "p", "mug", "panda", 0);
        assert_eq!(base, first(0, "p", "mug", "panda", 0));
        for other in [
            first(1, "p", "mug", "panda", 0),
            first(0, "q", "mug", "panda", 0),
            first(0, "p", "mugp", "anda", 0),
            first(0, "p", "mug", "panda", 1),
        ] {
            assert_ne!(base, other);
        }
    }

    #[test]
    fn uniform_rotations_turn_by_126_degrees_on_average() {
        // The mean rotation angle of the Haar measure is pi / 2 + 2 / pi.
        let mut rng = stream(0, "test", "", "", 0);
        let n = 4000;
        let mean = (0..n)
            .map(|_| uniform_rotation(&mut rng).angle())
            .sum::<f64>()
            / f64::from(n);
        let expected = std::f64::consts::FRAC_PI_2 + std::f64::consts::FRAC_2_PI;
        assert!((mean - expected).abs() < 0.04, "{mean} {expected}");
    }
}
