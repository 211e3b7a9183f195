//! How often does at least one of k candidates succeed?

/// Unbiased estimate of success@k from `successes` among `n` candidates: one minus the chance that
/// k candidates drawn without replacement all fail, `1 - C(n - c, k) / C(n, k)`. `None` if n < k.
///
/// M. Chen et al., "Evaluating large language models trained on code", 2021, equation 1.
pub fn success_at_k(successes: u64, n: u64, k: u64) -> Option<f64> {
    if k == 0 || n < k {
        return None;
    }
    let failures = n - successes;
    if failures < k {
        return Some(1.0);
    }
    let all_fail: f64 = (0..k)
        .map(|i| (failures - i) as f64 / (n - i) as f64)
        .product();
    Some(1.0 - all_fail)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_estimate_is_the_mean_over_all_subsets() {
        let (n, c) = (9u32, 3u32);
        for k in 1..=9u32 {
            let (mut hits, mut subsets) = (0u32, 0u32);
            for bits in 0u32..1 << n {
                if bits.count_ones() == k {
                    subsets += 1;
                    hits += u32::from(bits & ((1 << c) - 1) != 0);
                }
            }
            let exact = f64::from(hits) / f64::from(subsets);
            let estimate = success_at_k(c.into(), n.into(), k.into()).unwrap();
            assert!((estimate - exact).abs() < 1e-14, "k = {k}");
        }
        assert_eq!(success_at_k(1, 3, 4), None);
    }
}
