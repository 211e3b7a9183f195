//! Where does the flow begin? Points of a low-discrepancy sequence instead of independent ones: each
//! number alone is distributed as the model was taught, and many together leave fewer gaps.
//!
//! Owen-scrambled Sobol points (A. B. Owen, "Randomly permuted (t,m,s)-nets and (t,s)-sequences",
//! 1995; B. Burley, "Practical hash-based Owen scrambling", JCGT 9(4), 2020), six numbers each.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rand::RngExt as _;
use statrs::distribution::{ContinuousCDF as _, Normal};

use crate::flow::FlowSample;
use crate::seed;
use crate::shell::Shell;

/// Points of one scrambled sequence; what comes after begins another.
const SEQUENCE: u64 = 1 << 16;

/// Of so many places the nearest is taken for a grasp that leaves its own.
const PLACES: usize = 4;

/// The sequences of an object and a hand under the run's seed.
pub struct Noise<'a> {
    run_seed: u64,
    object: &'a str,
    gripper: &'a str,
    translation_std: f64,
    normal: Normal,
    shell: Option<&'a Shell>,
}

/// Which draw of a grasp? Place and turn are drawn apart, each by the number of an attempt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Attempt {
    /// The attempt for which the place was drawn.
    pub place: usize,
    /// The attempt itself: what the rotation is drawn for.
    pub turn: usize,
}

impl<'a> Noise<'a> {
    /// `translation_std`: standard deviation of each coordinate, in the model's normalised frame.
    pub fn new(run_seed: u64, object: &'a str, gripper: &'a str, translation_std: f64) -> Self {
        Self {
            run_seed,
            object,
            gripper,
            translation_std,
            normal: Normal::standard(),
            shell: None,
        }
    }

    /// Translations begin in a shell instead, if there is one.
    pub fn about(self, shell: Option<&'a Shell>) -> Self {
        Self { shell, ..self }
    }

    /// Where the grasp of this number begins in this attempt. A place that was drawn for a later attempt is the
    /// nearest to the first of some, so that a grasp that has to leave its place does not go far.
    pub fn at(&self, number: u64, attempt: Attempt) -> FlowSample {
        let first = self.place(number, &purpose(0));
        let translation = match attempt.place {
            0 => first,
            n => (0..PLACES)
                .map(|k| self.place(number, &format!("{}, place {k}", purpose(n))))
                .min_by(|a, b| (a - first).norm().total_cmp(&(b - first).norm()))
                .expect("some are drawn"),
        };
        let [a, b, c] = self.uniform(number, &purpose(attempt.turn), [3, 4, 5]);
        FlowSample {
            translation,
            rotation: rotation(a, b, c),
        }
    }

    /// A place of this number.
    fn place(&self, number: u64, purpose: &str) -> Vector3<f64> {
        let uniform = self.uniform(number, purpose, [0, 1, 2]);
        match self.shell {
            Some(shell) => shell.at(uniform),
            None => uniform
                .map(|u| self.translation_std * self.normal.inverse_cdf(u))
                .into(),
        }
    }

    /// Three coordinates of a point of the sequence of some purpose.
    fn uniform(&self, number: u64, purpose: &str, dimensions: [u32; 3]) -> [f64; 3] {
        let (block, point) = (number / SEQUENCE, (number % SEQUENCE) as u32);
        let mut stream = seed::stream(self.run_seed, purpose, self.object, self.gripper, block);
        let scramble = stream.random();
        // 24 bits a number; the middle of each cell keeps away from 0 and 1.
        dimensions.map(|dimension| {
            f64::from(sobol_burley::sample(point, dimension, scramble)) + 0.5 / (1u32 << 24) as f64
        })
    }
}

/// The name of what is drawn for an attempt.
fn purpose(attempt: usize) -> String {
    match attempt {
        0 => "flow-v2".to_owned(),
        n => format!("flow-v2, redraw {n}"),
    }
}

/// Three uniform numbers as a rotation, uniform on SO(3) (K. Shoemake, "Uniform random rotations",
/// Graphics Gems III, 1992).
fn rotation(a: f64, b: f64, c: f64) -> UnitQuaternion<f64> {
    let (r, s) = ((1.0 - a).sqrt(), a.sqrt());
    let (sin_b, cos_b) = (std::f64::consts::TAU * b).sin_cos();
    let (sin_c, cos_c) = (std::f64::consts::TAU * c).sin_cos();
    UnitQuaternion::from_quaternion(Quaternion::new(s * cos_c, r * sin_b, r * cos_b, s * sin_c))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(run_seed: u64) -> Noise<'static> {
        Noise::new(run_seed, "mug", "panda", 0.5)
    }

    /// In the first attempt.
    fn at(run_seed: u64, number: u64) -> FlowSample {
        noise(run_seed).at(number, Attempt::default())
    }

    #[test]
    fn every_seed_attempt_and_number_begins_elsewhere() {
        let base = at(5, 3);
        assert_eq!(base, at(5, 3));
        let anew = |place, turn| noise(5).at(3, Attempt { place, turn });
        let others = [at(6, 3), at(5, 4), anew(0, 1), anew(1, 1), anew(1, 2)];
        // After 65 536 numbers the points come again in another order.
        for other in others.into_iter().chain([at(5, SEQUENCE + 3)]) {
            assert_ne!(base, other);
        }
    }

    #[test]
    fn a_place_and_a_turn_are_drawn_apart() {
        let angle = |i| {
            let anew = |place| noise(5).at(i, Attempt { place, turn: 1 });
            assert_eq!(at(5, i).translation, anew(0).translation);
            assert_ne!(at(5, i).translation, anew(1).translation);
            assert_eq!(anew(0).rotation, anew(1).rotation);
            at(5, i).rotation.angle_to(&anew(0).rotation)
        };
        // Independent rotations are 2.2 rad apart on average.
        let mean = (0..100).map(angle).sum::<f64>() / 100.0;
        assert!((mean - 2.2).abs() < 0.2, "{mean}");
    }

    #[test]
    fn a_grasp_that_leaves_its_place_does_not_go_far() {
        let way = |a: FlowSample, b: FlowSample| (a.translation - b.translation).norm();
        let left = |i| noise(5).at(i, Attempt { place: 1, turn: 1 });
        let mean = |of: &dyn Fn(u64) -> f64| (0..200).map(of).sum::<f64>() / 200.0;
        let gone = mean(&|i| way(at(5, i), left(i)));
        let apart = mean(&|i| way(at(5, i), at(6, i)));
        assert!(gone < 0.7 * apart && gone > 0.2 * apart, "{gone} {apart}");
    }

    #[test]
    fn many_together_have_the_moments_that_were_asked_for() {
        let samples: Vec<FlowSample> = (0..1 << 12).map(|number| at(0, number)).collect();
        let n = samples.len() as f64;
        for k in 0..3 {
            let of = |power| {
                samples
                    .iter()
                    .map(|s| s.translation[k].powi(power))
                    .sum::<f64>()
                    / n
            };
            // A third of the standard error of independent numbers.
            assert!(of(1).abs() < 0.5 / n.sqrt() / 3.0, "{}", of(1));
            assert!((of(2) - 0.25).abs() < 0.25 * (2.0 / n).sqrt(), "{}", of(2));
        }
        // Moments of the Haar measure: the mean angle is pi / 2 + 2 / pi, axes have no direction.
        let angle = samples.iter().map(|s| s.rotation.angle()).sum::<f64>() / n;
        let expected = std::f64::consts::FRAC_PI_2 + std::f64::consts::FRAC_2_PI;
        assert!((angle - expected).abs() < 0.01, "{angle}");
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let mean = samples
                .iter()
                .map(|s| s.rotation * axis)
                .sum::<Vector3<f64>>()
                / n;
            assert!(mean.norm() < 0.01, "{mean}");
        }
    }

    #[test]
    fn two_hundred_leave_fewer_gaps_than_independent_ones() {
        // Each of 16 slices of equal probability of a coordinate holds its share to within one.
        let normal = Normal::standard();
        for seed in 0..5 {
            let mut counts = [0i32; 16];
            for s in (0..208).map(|number| at(seed, number)) {
                counts[(normal.cdf(s.translation.y / 0.5) * 16.0) as usize] += 1;
            }
            assert!(counts.iter().all(|c| (c - 13).abs() <= 1), "{counts:?}");
        }
    }
}
