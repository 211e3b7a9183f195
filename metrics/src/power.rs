//! How many grasps of how many objects does a comparison need?

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF as _, Normal};

use crate::compare::Gate;

/// What is known before the experiment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Assumptions {
    /// The true drop that should be found, as a fraction.
    pub drop: f64,
    /// With which probability.
    pub power: f64,
    /// Share of grasps that end differently in two runs that are equally good.
    pub discordance: f64,
    /// Standard deviation over objects of the change of their rates.
    pub object_sd: f64,
}

impl Default for Assumptions {
    /// Three points, 95 %; 4 % of grasps change sides by themselves (what half the time step does
    /// to our trials), objects move by two points.
    fn default() -> Self {
        Self {
            drop: 0.03,
            power: 0.95,
            discordance: 0.04,
            object_sd: 0.02,
        }
    }
}

/// Objects needed at a number of grasps per object; `None`: no number suffices.
///
/// The difference of paired rates has the variance `(object_sd^2 + (discordance + drop) / g) / m`
/// for m objects of g grasps. It must lie below `-min_effect` with the wanted power, and be
/// significant with it: the normal approximation of both (J. L. Fleiss, Statistical Methods for
/// Rates and Proportions, 3rd ed., chapter 13).
pub fn objects_needed(a: &Assumptions, gate: &Gate, grasps_per_object: u64) -> Option<u64> {
    let normal = Normal::standard();
    let z_power = normal.inverse_cdf(a.power);
    let z_alpha = normal.inverse_cdf(1.0 - gate.alpha / 2.0);
    let margin = a.drop - gate.min_effect;
    if margin <= 0.0 || grasps_per_object == 0 {
        return None;
    }
    let one = a.object_sd.powi(2) + (a.discordance + a.drop) / grasps_per_object as f64;
    let for_size = one * (z_power / margin).powi(2);
    let for_significance = one * ((z_alpha + z_power) / a.drop).powi(2);
    Some(for_size.max(for_significance).ceil().max(2.0) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_grasps_need_fewer_objects_and_a_drop_below_the_gate_none_suffices_for() {
        let (a, gate) = (Assumptions::default(), Gate::default());
        let needed: Vec<u64> = [20, 70, 200, 2000]
            .iter()
            .map(|g| objects_needed(&a, &gate, *g).unwrap())
            .collect();
        assert!(needed.windows(2).all(|w| w[0] > w[1]), "{needed:?}");
        // By hand, 70 grasps: (0.0004 + 0.07 / 70) (1.6449 / 0.01)^2 = 37.9.
        assert_eq!(needed[1], 38);
        let small = Assumptions { drop: 0.02, ..a };
        assert_eq!(objects_needed(&small, &gate, 1000), None);
    }
}
