//! Does a probability mean what it says?

/// Bins of the expected calibration error.
pub const BINS: usize = 10;

/// Expected calibration error of `(probability, truth)`: mean over ten equal bins of
/// |mean probability - share of positives|, weighted by their size. `None` without cases.
///
/// M. P. Naeini, G. F. Cooper, M. Hauskrecht, AAAI 2015.
pub fn expected_calibration_error(cases: &[(f64, bool)]) -> Option<f64> {
    let mut bins = [(0.0, 0.0, 0.0); BINS];
    for (p, truth) in cases {
        let bin = &mut bins[((p * BINS as f64) as usize).min(BINS - 1)];
        bin.0 += 1.0;
        bin.1 += p;
        bin.2 += f64::from(u8::from(*truth));
    }
    let gap: f64 = bins.iter().map(|(_, p, hits)| (p - hits).abs()).sum();
    (!cases.is_empty()).then(|| gap / cases.len() as f64)
}

/// Brier score: mean squared distance of the probability from the truth. `None` without cases.
///
/// G. W. Brier, Mon. Weather Rev. 78(1), 1950.
pub fn brier(cases: &[(f64, bool)]) -> Option<f64> {
    let sum: f64 = cases
        .iter()
        .map(|(p, truth)| (p - f64::from(u8::from(*truth))).powi(2))
        .sum();
    (!cases.is_empty()).then(|| sum / cases.len() as f64)
}

/// Average precision of `(score, truth)`: precision at each positive, cases with the same score
/// taken together; `None` without positives.
///
/// As `sklearn.metrics.average_precision_score`: sum of (R_n - R_{n-1}) P_n.
pub fn average_precision(cases: &[(f64, bool)]) -> Option<f64> {
    let positives = cases.iter().filter(|c| c.1).count() as f64;
    if positives == 0.0 {
        return None;
    }
    let mut sorted: Vec<&(f64, bool)> = cases.iter().collect();
    sorted.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut hits, mut visited, mut sum) = (0.0, 0.0, 0.0);
    let mut i = 0;
    while i < sorted.len() {
        let before = hits;
        let score = sorted[i].0;
        while i < sorted.len() && sorted[i].0 == score {
            hits += f64::from(u8::from(sorted[i].1));
            visited += 1.0;
            i += 1;
        }
        sum += (hits - before) / positives * hits / visited;
    }
    Some(sum)
}

/// Share of positives among the `k` highest scores; ties are broken by the order of the cases.
/// `None` without cases.
pub fn precision_at_k(cases: &[(f64, bool)], k: usize) -> Option<f64> {
    let mut sorted: Vec<&(f64, bool)> = cases.iter().collect();
    sorted.sort_by(|a, b| b.0.total_cmp(&a.0));
    sorted.truncate(k);
    let hits = sorted.iter().filter(|c| c.1).count();
    (!sorted.is_empty()).then(|| hits as f64 / sorted.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CASES: [(f64, bool); 6] = [
        (0.1, false),
        (0.4, false),
        (0.35, true),
        (0.8, true),
        (0.8, false),
        (0.95, true),
    ];

    /// scikit-learn 1.9.1: `brier_score_loss`, `average_precision_score`; the calibration error by
    /// hand: (|0.1 - 0| + |0.35 - 1| + |0.4 - 0| + |1.6 - 1| + |0.95 - 1|) / 6.
    #[test]
    fn scores_equal_those_of_scikit_learn() {
        assert!((brier(&CASES).unwrap() - 0.212_5).abs() < 1e-12);
        assert!((average_precision(&CASES).unwrap() - 0.755_555_555_555_555_6).abs() < 1e-12);
        let by_hand = (0.1 + 0.65 + 0.4 + 0.6 + 0.05) / 6.0;
        assert!((expected_calibration_error(&CASES).unwrap() - by_hand).abs() < 1e-12);
        assert_eq!(precision_at_k(&CASES, 2), Some(1.0));
        assert_eq!(average_precision(&CASES[..2]), None);
        assert_eq!(expected_calibration_error(&[]), None);
    }
}
