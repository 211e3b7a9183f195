//! Which candidate should the robot try first? A race: every round tries the survivors once more,
//! all under the same disturbance, and drops those that can no longer reach the top.

use serde::{Deserialize, Serialize};

use crate::interval::wilson_95;

/// What is known of one candidate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Standing {
    /// Place among the candidates as given.
    pub candidate: usize,
    /// Probability to hold before any disturbed trial.
    pub prior: f64,
    /// Disturbed trials.
    pub trials: u32,
    /// How many of them held.
    pub held: u32,
}

/// Disturbed trials that the prior is worth.
const PRIOR_WEIGHT: f64 = 2.0;

impl Standing {
    /// Estimate of the probability to hold: the share that held, drawn towards the prior.
    pub fn p_hold(&self) -> f64 {
        (f64::from(self.held) + PRIOR_WEIGHT * self.prior) / (f64::from(self.trials) + PRIOR_WEIGHT)
    }

    /// 95 % interval of the share that holds; `[0, 1]` before the first trial.
    pub fn interval(&self) -> [f64; 2] {
        wilson_95(self.held.into(), self.trials.into())
    }
}

/// Runs a race for the `top` best of candidates with these priors: at most `rounds` trials each,
/// `try_all(round, candidates)` says which of them hold under disturbance number `round`.
///
/// A candidate leaves when its interval lies wholly below the lower ends of `top` others. Where many
/// are equally good no interval ever tells, so after 2, 4, 8, ... rounds the worse half leaves too
/// (successive halving: Z. Karnin, T. Koren, O. Somekh, ICML 2013), down to twice `top`. Returns all
/// candidates, best first.
pub fn race(
    priors: &[f64],
    top: usize,
    rounds: u32,
    mut try_all: impl FnMut(u32, &[usize]) -> Vec<bool>,
) -> Vec<Standing> {
    let mut standings: Vec<Standing> = priors
        .iter()
        .enumerate()
        .map(|(candidate, &prior)| Standing {
            candidate,
            prior,
            trials: 0,
            held: 0,
        })
        .collect();
    let mut racing: Vec<usize> = (0..priors.len()).collect();
    for round in 0..rounds {
        for (&i, held) in racing.iter().zip(try_all(round, &racing)) {
            standings[i].trials += 1;
            standings[i].held += u32::from(held);
        }
        let mut lows: Vec<f64> = racing.iter().map(|&i| standings[i].interval()[0]).collect();
        lows.sort_by(|a, b| b.total_cmp(a));
        if let Some(&bar) = lows.get(top.saturating_sub(1)) {
            racing.retain(|&i| standings[i].interval()[1] >= bar);
        }
        // After 2, 4, 8, ... rounds the better half goes on, but never fewer than twice the top.
        let done = round + 1;
        if done >= 2 && done.is_power_of_two() && racing.len() > 2 * top {
            let keep = racing.len().div_ceil(2).max(2 * top);
            racing.sort_by(|&a, &b| {
                let by = standings[b].p_hold().total_cmp(&standings[a].p_hold());
                by.then(a.cmp(&b))
            });
            racing.truncate(keep);
            racing.sort_unstable();
        }
    }
    // Who raced longer stands before who was dropped; then the estimate.
    standings.sort_by(|a, b| {
        let key = |s: &Standing| (s.trials == rounds, s.p_hold());
        let ((a_done, a_p), (b_done, b_p)) = (key(a), key(b));
        b_done
            .cmp(&a_done)
            .then(b_p.total_cmp(&a_p))
            .then(a.candidate.cmp(&b.candidate))
    });
    standings
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Held exactly in the share `truth` of the rounds, spread evenly.
    fn holds(truth: f64, round: u32) -> bool {
        let k = f64::from(round);
        ((k + 1.0) * truth).floor() > (k * truth).floor()
    }

    #[test]
    fn the_race_finds_the_best_and_spends_little_on_the_rest() {
        let truth: Vec<f64> = (0..100).map(|i| f64::from(i * 37 % 100) / 100.0).collect();
        let mut trials = 0;
        let order = race(&[0.5; 100], 5, 32, |round, who| {
            trials += who.len();
            who.iter().map(|&i| holds(truth[i], round)).collect()
        });
        let best: Vec<f64> = order[..5].iter().map(|s| truth[s.candidate]).collect();
        assert!(best.iter().all(|t| *t >= 0.9), "{best:?}");
        assert!(trials < 100 * 32 * 2 / 3, "{trials}");
        assert_eq!(order.len(), 100);
    }

    #[test]
    fn without_rounds_the_prior_decides() {
        let order = race(&[0.2, 0.9, 0.4], 1, 0, |_, _| unreachable!());
        let ids: Vec<usize> = order.iter().map(|s| s.candidate).collect();
        assert_eq!(ids, [1, 2, 0]);
    }
}
