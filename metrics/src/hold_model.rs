//! p_hold: the calibrated probability that a grasp holds, from trees fitted to labels.
//!
//! Gradient-boosted trees (J. H. Friedman, Ann. Stat. 29(5), 2001) over [`crate::features`], in a
//! JSON file that a person can read. `tests/calibration/fit_p_hold.py` makes it.

use std::sync::OnceLock;

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};
use shakedown_classifier::profile::profile;
use shakedown_classifier::{HandModel, Verdict};
use shakedown_objects::{Object, Surface};
use shakedown_sim::{Outcome, Protocol};

use crate::features::{NAMES, ObjectFacts, features};

/// One node of a tree: a question, or the end.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Node {
    /// Feature that is asked for; unused at an end.
    #[serde(default)]
    pub feature: usize,
    /// Left if the feature is at most this.
    #[serde(default)]
    pub at_most: f32,
    /// Left if the feature is missing.
    #[serde(default)]
    pub missing_left: bool,
    /// Node to go on with on the left; 0: this is an end.
    #[serde(default)]
    pub left: usize,
    /// Node to go on with on the right.
    #[serde(default)]
    pub right: usize,
    /// At an end: what is added to the logit.
    #[serde(default)]
    pub value: f32,
}

/// The model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HoldModel {
    /// What it is and how it was made.
    pub about: String,
    /// Protocol whose trials it reads.
    pub protocol: String,
    /// Names of the features, in the order of the nodes' numbers: in a file any of [`NAMES`], once
    /// read all of them.
    pub features: Vec<String>,
    /// Logit before any tree.
    pub base: f32,
    /// Slope and shift of the calibrated logit (J. Platt, 1999).
    pub calibration: [f32; 2],
    /// The trees; the root of each is node 0.
    pub trees: Vec<Vec<Node>>,
}

const GEOMETRY: &str = include_str!("../models/p_hold_geometry.json");
const TRIAL: &str = include_str!("../models/p_hold_acronym.json");

impl HoldModel {
    /// The built-in model for geometry alone, or for geometry and a trial of preset `acronym`.
    pub fn built_in(with_trial: bool) -> &'static Self {
        static MODELS: [OnceLock<HoldModel>; 2] = [OnceLock::new(), OnceLock::new()];
        MODELS[usize::from(with_trial)].get_or_init(|| {
            let text = if with_trial { TRIAL } else { GEOMETRY };
            Self::parse(text).expect("the built-in models are tested")
        })
    }

    /// Reads a model from its JSON.
    ///
    /// # Errors
    /// Unknown features, nodes that lead nowhere or in circles.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut model: Self = serde_json::from_str(text).map_err(|e| e.to_string())?;
        // The nodes number the model's own features; they are found here by name.
        let places = model
            .features
            .iter()
            .map(|name| {
                let place = NAMES.iter().position(|n| n == name);
                place.ok_or_else(|| format!("no feature is called {name:?}; fit the model again"))
            })
            .collect::<Result<Vec<_>, _>>()?;
        for (t, tree) in model.trees.iter_mut().enumerate() {
            let count = tree.len();
            for (i, node) in tree.iter_mut().enumerate() {
                if node.left == 0 {
                    continue;
                }
                // Children come after their parent, so no walk can go in circles.
                let leads = |to: usize| to > i && to < count;
                if !leads(node.left) || !leads(node.right) || node.feature >= places.len() {
                    return Err(format!("tree {t}, node {i}: leads nowhere"));
                }
                node.feature = places[node.feature];
            }
            if count == 0 {
                return Err(format!("tree {t} is empty"));
            }
        }
        model.features = NAMES.map(str::to_owned).to_vec();
        Ok(model)
    }

    /// The probability to hold.
    pub fn p_hold(&self, features: &[f32; NAMES.len()]) -> f64 {
        let mut logit = f64::from(self.base);
        for tree in &self.trees {
            let mut node = &tree[0];
            while node.left != 0 {
                let x = features[node.feature];
                let goes_left = if x.is_nan() {
                    node.missing_left
                } else {
                    x <= node.at_most
                };
                node = &tree[if goes_left { node.left } else { node.right }];
            }
            logit += f64::from(node.value);
        }
        let [slope, shift] = self.calibration.map(f64::from);
        1.0 / (1.0 + (-(slope * logit + shift)).exp())
    }
}

/// The model with the facts of one object: what callers ask for `p_hold`.
pub struct HoldJudge {
    model: &'static HoldModel,
    facts: ObjectFacts,
}

impl HoldJudge {
    /// For an object of that mass in the trial; `with_trial` if outcomes will be given.
    pub fn new(object: &Object, mass_kg: f64, with_trial: bool) -> Self {
        Self {
            model: HoldModel::built_in(with_trial),
            facts: ObjectFacts {
                mass_kg,
                com_m: object.mass.com_m,
                extent_m: object.surface.mesh().extents().max(),
            },
        }
    }

    /// Was the model fitted to trials of exactly this protocol: the preset, nothing overridden?
    pub fn reads(protocol: &Protocol) -> bool {
        Protocol::load(&protocol.name, &[]).is_ok_and(|preset| preset == *protocol)
            && HoldModel::built_in(true).protocol == protocol.version
    }

    /// The probability that a grasp holds.
    pub fn p_hold(
        &self,
        hand: &HandModel,
        surface: &Surface,
        object_from_hand: &Isometry3<f64>,
        verdict: &Verdict,
        outcome: Option<&Outcome>,
    ) -> f64 {
        let lines = profile(hand, surface, object_from_hand);
        let values = features(
            hand,
            &self.facts,
            object_from_hand,
            verdict,
            &lines,
            outcome,
        );
        self.model.p_hold(&values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::GEOMETRIC;

    #[test]
    fn the_model_was_fitted_to_trials_of_the_preset_as_it_is() {
        let preset = Protocol::load("acronym", &[]).unwrap();
        assert!(HoldJudge::reads(&preset));
        let other = Protocol::load("acronym", &["friction=0.9".to_owned()]).unwrap();
        assert!(!HoldJudge::reads(&other));
    }

    #[test]
    fn the_built_in_models_can_be_read_and_prefer_what_held() {
        for with_trial in [false, true] {
            let model = HoldModel::built_in(with_trial);
            let missing = [f32::NAN; NAMES.len()];
            let p = model.p_hold(&missing);
            assert!((0.0..=1.0).contains(&p));
        }
        // Over many grasps, those that held in the trial are more likely to hold.
        let model = HoldModel::built_in(true);
        let mut state = 1u32;
        let mut unit = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut means = [0.0; 2];
        for _ in 0..500 {
            let mut values: [f32; NAMES.len()] = std::array::from_fn(|_| 20.0 * unit());
            for (held, mean) in means.iter_mut().enumerate() {
                values[GEOMETRIC] = held as f32;
                *mean += model.p_hold(&values) / 500.0;
            }
        }
        assert!(means[1] > means[0], "{means:?}");
    }

    #[test]
    fn a_tree_that_leads_nowhere_is_refused() {
        let mut model = HoldModel::built_in(false).clone();
        model.trees[0][0].left = 10_000;
        let text = serde_json::to_string(&model).unwrap();
        assert!(
            HoldModel::parse(&text)
                .unwrap_err()
                .contains("tree 0, node 0")
        );
    }
}
