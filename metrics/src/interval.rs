//! How sure is a rate?

/// 0.975 quantile of the standard normal distribution.
const Z_95: f64 = 1.959_963_984_540_054;

/// 95 % score interval of a proportion `successes / n`; `[0, 1]` if `n` is 0.
///
/// E. B. Wilson, J. Am. Stat. Assoc. 22, 1927.
pub fn wilson_95(successes: u64, n: u64) -> [f64; 2] {
    if n == 0 {
        return [0.0, 1.0];
    }
    let (n, p) = (n as f64, successes as f64 / n as f64);
    let z2 = Z_95 * Z_95;
    let centre = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = Z_95 / (1.0 + z2 / n) * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
    [(centre - half).max(0.0), (centre + half).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of `statsmodels.stats.proportion.proportion_confint(k, n, method="wilson")`,
    /// version 0.15.0.
    #[test]
    fn intervals_equal_those_of_statsmodels() {
        for (k, n, lo, hi) in [
            (0, 10, 0.0, 0.277_532_799_862_889_26),
            (5, 10, 0.236_593_090_512_564, 0.763_406_909_487_436),
            (81, 263, 0.255_288_519_878_274_2, 0.366_209_576_982_8),
        ] {
            let [a, b] = wilson_95(k, n);
            assert!(
                (a - lo).abs() < 1e-12 && (b - hi).abs() < 1e-12,
                "{k}/{n}: {a} {b}"
            );
        }
        assert_eq!(wilson_95(0, 0), [0.0, 1.0]);
    }
}
