//! What is this model? The card `model.toml` beside the two graphs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use shakedown_objects::Normalisation;

/// Most times that a grasp is drawn anew.
pub const REDRAWS_MAX: usize = 1000;

/// Why a model cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A file of the model cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file of the model does not fit the contract.
    #[error("{}: {what}", path.display())]
    Bad {
        /// The file.
        path: PathBuf,
        /// What is wrong, naming the tensor or key, and what was expected.
        what: String,
    },
    /// No model of this name.
    #[error("there is no model {name:?}; {hint}")]
    Unknown {
        /// What was asked for.
        name: String,
        /// What there is.
        hint: String,
    },
}

impl ModelError {
    pub(crate) fn bad(path: &Path, what: impl Into<String>) -> Self {
        Self::Bad {
            path: path.to_owned(),
            what: what.into(),
        }
    }
}

/// How the velocity field is integrated from time 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Integrator {
    /// One evaluation a step (RFMGrasp equations 14 to 16).
    #[default]
    Euler,
    /// Two evaluations a step: the mean of the velocities at both ends.
    Heun,
    /// One evaluation a step, of second order: one and a half times the velocity here less half of that one
    /// step before (J. C. Adams and F. Bashforth, 1883); the first step is Euler's.
    AdamsBashforth,
}

/// Where the grid and the normalised frame are centred.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Centring {
    /// The middle of the object's axis-aligned box.
    #[default]
    BoxCentre,
    /// The middle of a snug box about the object, in whose axes the grid stands
    /// ([`shakedown_objects::Object::snug_axes`]): what is drawn does not depend on how the mesh stands.
    SnugBox,
}

/// Where the translations begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoiseKind {
    /// Normally distributed about the middle of the grid.
    #[default]
    Normal,
    /// Close to the object's surface ([`crate::shell::Shell`]).
    Surface,
}

/// When a grasp is drawn anew: the table `[evaluator]` of `model.toml`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvaluatorCard {
    /// A grasp whose score is lower is drawn anew.
    pub least_score: f64,
    /// So many times at most; then the best of all is taken.
    pub redraws: usize,
}

impl EvaluatorCard {
    /// What is out of range.
    fn complaint(&self) -> Option<String> {
        let Self {
            least_score,
            redraws,
        } = self;
        if !(0.0..=1.0).contains(least_score) {
            Some(format!(
                "evaluator.least_score is {least_score}, not within 0..=1"
            ))
        } else if *redraws > REDRAWS_MAX {
            Some(format!(
                "evaluator.redraws is {redraws}, more than {REDRAWS_MAX}"
            ))
        } else {
            None
        }
    }
}

/// The content of `model.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelCard {
    /// Name in results.
    pub name: String,
    /// One line.
    #[serde(default)]
    pub description: String,
    /// Licence of the weights.
    pub licence: String,
    /// What it was trained on.
    pub training_data: String,
    /// The command that made it.
    pub command: String,
    /// Hand whose poses it draws.
    pub gripper: String,
    /// Frame of those poses: `acronym`, `panda_hand` or `tcp`.
    pub frame: String,
    /// Nodes along an edge of the signed distance grid.
    pub resolution: usize,
    /// The grid's edge is the object's longest extent grown by this share.
    pub padding: f64,
    /// Where the grid is centred.
    #[serde(default)]
    pub centring: Centring,
    /// What the distances and translations are divided by.
    #[serde(default)]
    pub normalisation: Normalisation,
    /// Standard deviation of the initial translation, in the normalised frame. Initial rotations
    /// are uniform.
    pub noise_translation_std: f64,
    /// Where translations begin.
    #[serde(default)]
    pub noise: NoiseKind,
    /// Steps from time 0 to 1.
    pub steps: usize,
    /// Integrator.
    #[serde(default)]
    pub integrator: Integrator,
    /// Points in the frame of the poses (`frame` above), metres, behind the input `sdf_at_points`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub control_points_m: Vec<[f64; 3]>,
    /// What `evaluator.onnx` is for, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evaluator: Option<EvaluatorCard>,
    /// What it was measured to reach.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub metrics: BTreeMap<String, f64>,
}

impl ModelCard {
    /// Reads and checks a card; `path` names it in errors.
    ///
    /// # Errors
    /// An unknown key, a value out of range.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ModelError> {
        let card: Self = toml::from_str(text).map_err(|e| {
            let line = e
                .span()
                .map_or(1, |s| text[..s.start].matches('\n').count() + 1);
            ModelError::bad(path, format!("line {line}: {}", e.message()))
        })?;
        let complaint = if !(8..=256).contains(&card.resolution) {
            Some(format!(
                "resolution is {}, not within 8..=256",
                card.resolution
            ))
        } else if card.steps == 0 {
            Some("steps is 0".to_owned())
        } else if !(card.padding.is_finite() && card.padding >= 0.0) {
            Some(format!("padding is {}", card.padding))
        } else if !(card.noise_translation_std.is_finite() && card.noise_translation_std >= 0.0) {
            Some(format!(
                "noise_translation_std is {}",
                card.noise_translation_std
            ))
        } else {
            card.evaluator.as_ref().and_then(EvaluatorCard::complaint)
        };
        match complaint {
            Some(what) => Err(ModelError::bad(path, what)),
            None => Ok(card),
        }
    }
}
