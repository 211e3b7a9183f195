//! Do predictions agree with labels?

use serde::{Deserialize, Serialize};

/// Counts of a binary prediction against a binary label.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Confusion {
    /// Predicted and labelled positive.
    pub tp: u64,
    /// Predicted positive, labelled negative.
    pub fp: u64,
    /// Predicted negative, labelled positive.
    pub fn_: u64,
    /// Predicted and labelled negative.
    pub tn: u64,
}

impl Confusion {
    /// Adds one case.
    pub fn add(&mut self, predicted: bool, label: bool) {
        match (predicted, label) {
            (true, true) => self.tp += 1,
            (true, false) => self.fp += 1,
            (false, true) => self.fn_ += 1,
            (false, false) => self.tn += 1,
        }
    }

    /// Adds all cases of another table.
    pub fn merge(&mut self, other: &Self) {
        self.tp += other.tp;
        self.fp += other.fp;
        self.fn_ += other.fn_;
        self.tn += other.tn;
    }

    /// Number of cases.
    pub fn n(&self) -> u64 {
        self.tp + self.fp + self.fn_ + self.tn
    }

    /// Mean of both recalls; `None` if a class is absent.
    pub fn balanced_accuracy(&self) -> Option<f64> {
        let recall = |hit: u64, all: u64| (all > 0).then(|| hit as f64 / all as f64);
        let (positive, negative) = (
            recall(self.tp, self.tp + self.fn_)?,
            recall(self.tn, self.tn + self.fp)?,
        );
        Some((positive + negative) / 2.0)
    }

    /// Matthews correlation coefficient; `None` if a class is absent, 0 if one side is constant.
    ///
    /// B. W. Matthews, Biochim. Biophys. Acta 405, 1975.
    pub fn mcc(&self) -> Option<f64> {
        let [tp, fp, fn_, tn] = [self.tp, self.fp, self.fn_, self.tn].map(|x| x as f64);
        if tp + fn_ == 0.0 || tn + fp == 0.0 {
            return None;
        }
        let product = (tp + fp) * (tp + fn_) * (tn + fp) * (tn + fn_);
        Some(if product == 0.0 {
            0.0
        } else {
            (tp * tn - fp * fn_) / product.sqrt()
        })
    }
}

/// Area under the ROC curve of `(score, label)`, ties counted half; `None` if a class is absent.
///
/// H. B. Mann and D. R. Whitney, Ann. Math. Stat. 18(1), 1947.
pub fn auroc(cases: &[(f64, bool)]) -> Option<f64> {
    let positives = cases.iter().filter(|c| c.1).count() as f64;
    let negatives = cases.len() as f64 - positives;
    if positives == 0.0 || negatives == 0.0 {
        return None;
    }
    let mut sorted: Vec<&(f64, bool)> = cases.iter().collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut rank_sum = 0.0;
    let mut i = 0;
    while i < sorted.len() {
        let mut j = i;
        while j < sorted.len() && sorted[j].0 == sorted[i].0 {
            j += 1;
        }
        let mean_rank = (i + 1 + j) as f64 / 2.0;
        rank_sum += mean_rank * sorted[i..j].iter().filter(|c| c.1).count() as f64;
        i = j;
    }
    Some((rank_sum - positives * (positives + 1.0) / 2.0) / (positives * negatives))
}

/// The agreement block of `summary.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Agreement {
    /// Labelled and predicted cases.
    pub n: u64,
    /// Predicted and labelled positive.
    pub tp: u64,
    /// Predicted positive, labelled negative.
    pub fp: u64,
    /// Predicted negative, labelled positive.
    #[serde(rename = "fn")]
    pub fn_: u64,
    /// Predicted and labelled negative.
    pub tn: u64,
    /// Mean of both recalls.
    pub balanced_accuracy: Option<f64>,
    /// Matthews correlation coefficient.
    pub mcc: Option<f64>,
    /// Area under the ROC curve of the score, where there is one.
    pub auroc: Option<f64>,
    /// Expected calibration error of `p_hold`, where there is one.
    pub ece: Option<f64>,
    /// Mean over objects that have both labels.
    pub mean_object_balanced_accuracy: Option<f64>,
    /// 95 % interval of the balanced accuracy, objects resampled.
    pub ci95: Option<[f64; 2]>,
}

impl Agreement {
    /// Sums up per-object tables and an optional list of scores.
    pub fn of(objects: &[Confusion], scores: Option<&[(f64, bool)]>) -> Self {
        let mut all = Confusion::default();
        objects.iter().for_each(|c| all.merge(c));
        let each: Vec<f64> = objects
            .iter()
            .filter_map(Confusion::balanced_accuracy)
            .collect();
        let ci95 = crate::bootstrap::cluster_95(objects, |picked| {
            let mut sum = Confusion::default();
            picked.for_each(|c| sum.merge(c));
            sum.balanced_accuracy()
        });
        Self {
            n: all.n(),
            tp: all.tp,
            fp: all.fp,
            fn_: all.fn_,
            tn: all.tn,
            balanced_accuracy: all.balanced_accuracy(),
            mcc: all.mcc(),
            auroc: scores.and_then(auroc),
            ece: None,
            mean_object_balanced_accuracy: (!each.is_empty())
                .then(|| each.iter().sum::<f64>() / each.len() as f64),
            ci95,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of scikit-learn 1.9.1: `balanced_accuracy_score`, `matthews_corrcoef`,
    /// for TP 117, FP 65, TN 12, FN 6; and `roc_auc_score` of the textbook example in its docs.
    #[test]
    fn scores_equal_those_of_scikit_learn() {
        let c = Confusion {
            tp: 117,
            fp: 65,
            fn_: 6,
            tn: 12,
        };
        assert!((c.balanced_accuracy().unwrap() - 0.553_531_834_019_638_9).abs() < 1e-14);
        assert!((c.mcc().unwrap() - 0.182_040_529_534_249_04).abs() < 1e-14);
        let cases = [(0.1, false), (0.4, false), (0.35, true), (0.8, true)];
        assert_eq!(auroc(&cases), Some(0.75));
        assert_eq!(auroc(&[(0.5, true), (0.5, false)]), Some(0.5));
        assert_eq!(auroc(&[(0.5, true)]), None);
    }
}
