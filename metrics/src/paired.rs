//! The same grasps twice: did the rate change?

use serde::{Deserialize, Serialize};
use statrs::distribution::{Binomial, ContinuousCDF as _, Discrete as _, DiscreteCDF as _, Normal};

use crate::interval::wilson_95;

/// Counts of pairs of two binary results.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pairs {
    /// Success both times.
    pub both: u64,
    /// Success only in the base run: lost.
    pub lost: u64,
    /// Success only in the new run: won.
    pub won: u64,
    /// Failure both times.
    pub neither: u64,
}

impl Pairs {
    /// Adds one pair.
    pub fn add(&mut self, base: bool, new: bool) {
        match (base, new) {
            (true, true) => self.both += 1,
            (true, false) => self.lost += 1,
            (false, true) => self.won += 1,
            (false, false) => self.neither += 1,
        }
    }

    /// Adds all pairs of another table.
    pub fn merge(&mut self, other: &Self) {
        self.both += other.both;
        self.lost += other.lost;
        self.won += other.won;
        self.neither += other.neither;
    }

    /// Number of pairs.
    pub fn n(&self) -> u64 {
        self.both + self.lost + self.won + self.neither
    }

    /// New rate less base rate; 0 without pairs.
    pub fn difference(&self) -> f64 {
        if self.n() == 0 {
            return 0.0;
        }
        (self.won as f64 - self.lost as f64) / self.n() as f64
    }

    /// Exact two-sided McNemar test: the chance of a split of the changed pairs at least as
    /// uneven, if each were a fair coin.
    ///
    /// Q. McNemar, Psychometrika 12(2), 1947; the exact form is the sign test.
    pub fn mcnemar_exact(&self) -> f64 {
        let changed = self.lost + self.won;
        if changed == 0 {
            return 1.0;
        }
        let coin = Binomial::new(0.5, changed).expect("0.5 is a probability");
        (2.0 * coin.cdf(self.lost.min(self.won))).min(1.0)
    }

    /// The mid-p form: half of the observed split counts.
    ///
    /// M. W. Fagerland, S. Lydersen, P. Laake, BMC Med. Res. Methodol. 13:91, 2013.
    pub fn mcnemar_mid_p(&self) -> f64 {
        let changed = self.lost + self.won;
        if changed == 0 {
            return 1.0;
        }
        if self.lost == self.won {
            // Both tails meet in the middle, which must not count twice.
            let coin = Binomial::new(0.5, changed).expect("0.5 is a probability");
            return 1.0 - 0.5 * coin.pmf(self.lost);
        }
        let coin = Binomial::new(0.5, changed).expect("0.5 is a probability");
        let smaller = self.lost.min(self.won);
        (2.0 * coin.cdf(smaller) - coin.pmf(smaller)).min(1.0)
    }

    /// 95 % interval of the difference of the two rates, which share their grasps; `[-1, 1]`
    /// without pairs.
    ///
    /// R. G. Newcombe, Stat. Med. 17, 2635-2650, 1998, method 10.
    pub fn newcombe_95(&self) -> [f64; 2] {
        let n = self.n();
        if n == 0 {
            return [-1.0, 1.0];
        }
        let [a, b, c, d] = [self.both, self.won, self.lost, self.neither].map(|x| x as f64);
        let total = n as f64;
        // Marginals: new = a + b, base = a + c.
        let (new, base) = ((a + b) / total, (a + c) / total);
        let [new_low, new_high] = wilson_95(self.both + self.won, n);
        let [base_low, base_high] = wilson_95(self.both + self.lost, n);
        let product = (a + b) * (c + d) * (a + c) * (b + d);
        let raw = a * d - b * c;
        let phi = if product == 0.0 {
            0.0
        } else {
            let corrected = if raw > total / 2.0 {
                raw - total / 2.0
            } else if raw >= 0.0 {
                0.0
            } else {
                raw
            };
            corrected / product.sqrt()
        };
        let length = |x: f64, y: f64| (x * x - 2.0 * phi * x * y + y * y).max(0.0).sqrt();
        let below = length(new - new_low, base_high - base);
        let above = length(new_high - new, base - base_low);
        [new - base - below, new - base + above]
    }
}

/// 95 % interval of the difference `successes_2 / n_2 - successes_1 / n_1` of independent rates.
///
/// R. G. Newcombe, Stat. Med. 17, 873-890, 1998, method 10 (hybrid score, no correction).
pub fn newcombe_independent_95(first: (u64, u64), second: (u64, u64)) -> [f64; 2] {
    if first.1 == 0 || second.1 == 0 {
        return [-1.0, 1.0];
    }
    let rate = |(k, n): (u64, u64)| k as f64 / n as f64;
    let [low_1, high_1] = wilson_95(first.0, first.1);
    let [low_2, high_2] = wilson_95(second.0, second.1);
    let (p1, p2) = (rate(first), rate(second));
    [
        p2 - p1 - ((p2 - low_2).powi(2) + (high_1 - p1).powi(2)).sqrt(),
        p2 - p1 + ((high_2 - p2).powi(2) + (p1 - low_1).powi(2)).sqrt(),
    ]
}

/// Two-sided p of equal independent rates: the score test with the pooled rate.
///
/// K. Pearson, 1900; equals the chi-squared test of the 2 x 2 table without correction.
pub fn independent_p(first: (u64, u64), second: (u64, u64)) -> f64 {
    let (n1, n2) = (first.1 as f64, second.1 as f64);
    let pooled = (first.0 + second.0) as f64 / (n1 + n2).max(1.0);
    let variance = pooled * (1.0 - pooled) * (1.0 / n1 + 1.0 / n2);
    if !(variance > 0.0 && variance.is_finite()) {
        return 1.0;
    }
    let z = (second.0 as f64 / n2 - first.0 as f64 / n1).abs() / variance.sqrt();
    2.0 * (1.0 - Normal::standard().cdf(z))
}

/// Holm's adjustment: p-values that may be compared with one alpha although there are many.
///
/// S. Holm, Scand. J. Stat. 6(2), 1979.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|a, b| p[*a].total_cmp(&p[*b]));
    let mut adjusted = vec![0.0; p.len()];
    let mut highest = 0.0f64;
    for (rank, &i) in order.iter().enumerate() {
        highest = highest.max((p.len() - rank) as f64 * p[i]).min(1.0);
        adjusted[i] = highest;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(both: u64, lost: u64, won: u64, neither: u64) -> Pairs {
        Pairs {
            both,
            lost,
            won,
            neither,
        }
    }

    /// `statsmodels.stats.contingency_tables.mcnemar(table, exact=True)`, version 0.15.0; mid-p by
    /// `2 * binom.cdf(b, n, 0.5) - binom.pmf(b, n, 0.5)` of SciPy 1.17.1.
    #[test]
    fn mcnemar_equals_statsmodels_and_scipy() {
        let p = pairs(10, 12, 4, 6);
        assert!((p.mcnemar_exact() - 0.076_812_744_140_625).abs() < 1e-12);
        assert!((p.mcnemar_mid_p() - 0.049_041_748_046_875).abs() < 1e-12);
        assert_eq!(pairs(5, 0, 0, 5).mcnemar_exact(), 1.0);
        assert_eq!(pairs(5, 3, 3, 5).mcnemar_exact(), 1.0);
        let many = pairs(0, 5200, 4800, 0);
        assert!(
            (many.mcnemar_exact() - 6.593_515_6e-5).abs() < 1e-11,
            "{}",
            many.mcnemar_exact()
        );
    }

    #[test]
    fn the_paired_interval_is_symmetric_where_the_table_is() {
        let [low, high] = pairs(30, 5, 5, 10).newcombe_95();
        assert!((low + high).abs() < 1e-12 && low < 0.0);
        let mirrored = pairs(30, 9, 2, 10).newcombe_95();
        let straight = pairs(30, 2, 9, 10).newcombe_95();
        assert!((mirrored[0] + straight[1]).abs() < 1e-12);
        assert!((mirrored[1] + straight[0]).abs() < 1e-12);
        assert_eq!(pairs(0, 0, 0, 0).newcombe_95(), [-1.0, 1.0]);
    }

    /// Newcombe 1998, table II, first row: 56/70 less 48/80 is 0.2 with [0.0524, 0.3339].
    #[test]
    fn the_independent_interval_is_that_of_the_paper() {
        let [low, high] = newcombe_independent_95((48, 80), (56, 70));
        assert!(
            (low - 0.0524).abs() < 5e-5 && (high - 0.3339).abs() < 5e-5,
            "{low} {high}"
        );
    }

    /// `scipy.stats.chi2_contingency([[48, 32], [56, 14]], correction=False)`, SciPy 1.17.1.
    #[test]
    fn the_independent_test_is_that_of_scipy() {
        assert!((independent_p((48, 80), (56, 70)) - 0.008045081368196582).abs() < 1e-9);
        assert_eq!(independent_p((0, 5), (0, 7)), 1.0);
        assert_eq!(independent_p((0, 0), (3, 7)), 1.0);
    }

    /// `statsmodels.stats.multitest.multipletests(p, method="holm")`, version 0.15.0.
    #[test]
    fn holm_equals_statsmodels() {
        let adjusted = holm(&[0.01, 0.04, 0.03, 0.005]);
        for (a, b) in adjusted.iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert!((a - b).abs() < 1e-12);
        }
    }
}
