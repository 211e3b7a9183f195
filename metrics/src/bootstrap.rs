//! How sure is a number over grasps of few objects? Resample objects, not grasps: grasps of one
//! object share its shape, so they are not independent.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Resamples of every cluster bootstrap.
pub const RESAMPLES: usize = 2000;

/// 95 % percentile interval of `statistic` over resampled clusters, or `None` with fewer than two
/// clusters or where the statistic is undefined in over 5 % of the resamples.
///
/// C. A. Field and A. H. Welsh, "Bootstrapping clustered data", J. R. Stat. Soc. B 69(3), 2007.
/// Deterministic: the stream's seed is fixed.
pub fn cluster_95<T>(
    clusters: &[T],
    statistic: impl Fn(&mut dyn Iterator<Item = &T>) -> Option<f64>,
) -> Option<[f64; 2]> {
    if clusters.len() < 2 {
        return None;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(0x5348_414b_4544_4f57);
    let mut values: Vec<f64> = (0..RESAMPLES)
        .filter_map(|_| {
            let picks: Vec<usize> = (0..clusters.len())
                .map(|_| rng.random_range(0..clusters.len()))
                .collect();
            statistic(&mut picks.iter().map(|&i| &clusters[i]))
        })
        .collect();
    if values.len() < RESAMPLES * 95 / 100 {
        return None;
    }
    values.sort_by(f64::total_cmp);
    let at = |q: f64| values[((values.len() - 1) as f64 * q).round() as usize];
    Some([at(0.025), at(0.975)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean(it: &mut dyn Iterator<Item = &(u64, u64)>) -> Option<f64> {
        let (k, n) = it.fold((0, 0), |s, c| (s.0 + c.0, s.1 + c.1));
        (n > 0).then(|| k as f64 / n as f64)
    }

    #[test]
    fn clustered_grasps_give_a_wider_interval_than_independent_ones() {
        // Ten objects, each all or nothing: as sure as ten coin flips, not as a thousand.
        let lumps: Vec<(u64, u64)> = (0..10)
            .map(|i| (if i % 2 == 0 { 100 } else { 0 }, 100))
            .collect();
        let [lo, hi] = cluster_95(&lumps, mean).unwrap();
        let [wilson_lo, wilson_hi] = crate::interval::wilson_95(500, 1000);
        assert!(hi - lo > 5.0 * (wilson_hi - wilson_lo));
        let even = vec![(50, 100); 10];
        assert_eq!(cluster_95(&even, mean), Some([0.5, 0.5]));
        assert_eq!(cluster_95(&even[..1], mean), None);
    }
}
