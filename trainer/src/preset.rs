//! How is a flow trained? Everything that decides the weights, as data.

use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};
use shakedown_objects::Normalisation;
use shakedown_sampler::{Centring, Integrator, NoiseKind};

use crate::error::TrainError;

/// A training preset: `presets/*.toml`, or a file of the same keys.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Preset {
    /// Name in logs and cards.
    pub name: String,
    /// The network.
    pub network: NetworkPreset,
    /// The flow from noise to grasps.
    pub flow: FlowPreset,
    /// The optimisation.
    pub training: TrainingPreset,
}

/// Which function of the object becomes the latent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Encoder {
    /// Four strided 3-D convolutions, as in the RFMGrasp paper.
    Conv,
    /// A soft histogram of the distances: the same for every orientation of the object.
    Histogram,
}

/// The network.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkPreset {
    /// The encoder.
    pub encoder: Encoder,
    /// Length of the latent.
    pub latent: usize,
    /// Pose and velocity in metres in the hand's own frame, and the object's distances at points
    /// fixed to the hand: turning object and hand together then changes nothing.
    pub hand_frame: bool,
    /// Beside the latent, the moments of the object's surface in the hand's axes
    /// ([`crate::moments`]): to which side most of it lies.
    #[serde(default)]
    pub moments: bool,
    /// Width of the hidden layers.
    pub width: usize,
    /// Number of hidden layers; all but the first add to their input.
    pub layers: usize,
}

/// The flow.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlowPreset {
    /// Frame of the poses: `acronym` or `tcp`.
    pub frame: String,
    /// Nodes along an edge of the distance grid.
    pub resolution: usize,
    /// The grid's edge is the longest extent grown by this share.
    pub padding: f64,
    /// Where the grid is centred, and in which axes it stands.
    #[serde(default)]
    pub centring: Centring,
    /// What distances and translations are divided by.
    pub normalisation: Normalisation,
    /// Standard deviation of the initial translation, normalised.
    pub noise_translation_std: f64,
    /// Where translations begin; with `surface` the standard deviation above has no say.
    #[serde(default)]
    pub noise: NoiseKind,
    /// Steps of the sampler.
    pub steps: usize,
    /// Integrator of the sampler.
    pub integrator: Integrator,
    /// Aim at the nearer of the two poses that the hand's half turn makes equal.
    pub nearer_flip: bool,
    /// Pair the noise of an object with its grasps by least total cost instead of at random
    /// (minibatch optimal transport; A. Tong et al., TMLR 2024).
    pub optimal_transport: bool,
    /// So many points of noise of each object are paired with its grasps by least total cost once and for all
    /// ([`crate::coupling`]) instead; 0: noise is drawn anew in every batch.
    #[serde(default)]
    pub couplings: usize,
    /// Turn object and grasps at random in every batch.
    pub random_rotation: bool,
}

/// The optimisation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingPreset {
    /// Objects (encoded grids) in a batch.
    pub objects_per_batch: usize,
    /// Trajectories of each of them.
    pub grasps_per_object: usize,
    /// Steps of the optimiser.
    pub steps: u64,
    /// Highest learning rate (Adam), reached after `warmup_steps`, then down to 0 along a cosine.
    pub learning_rate: f32,
    /// Steps of the linear start.
    pub warmup_steps: u64,
    /// Gradients longer than this are shortened to it.
    pub clip_norm: f32,
    /// Share of the running mean of the weights that stays at each step; the mean is exported.
    pub ema: f32,
    /// Weight of the translation's squared error beside the rotation's.
    pub translation_weight: f32,
}

const BUILT_IN: [(&str, &str); 2] = [
    ("paper", include_str!("../presets/paper.toml")),
    ("best", include_str!("../presets/best.toml")),
];

impl Preset {
    /// Names of the built-in presets.
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.into_iter().map(|(n, _)| n)
    }

    /// A built-in preset, or a TOML file of the same keys.
    ///
    /// # Errors
    /// An unknown name, an unreadable file, an unknown key, a value out of range.
    pub fn load(name: &str) -> Result<Self, TrainError> {
        if let Some((_, text)) = BUILT_IN.iter().find(|(n, _)| *n == name) {
            return Self::parse(text, Path::new(name));
        }
        let path = Path::new(name);
        let text = fs::read_to_string(path).map_err(|e| {
            if path.extension().is_some() {
                TrainError::io("read", path, e)
            } else {
                let names: Vec<_> = Self::names().collect();
                TrainError::bad(
                    path,
                    format!("no such preset: {} or a TOML file", names.join(", ")),
                )
            }
        })?;
        Self::parse(&text, path)
    }

    /// Reads a preset from text; `path` names it in errors.
    ///
    /// # Errors
    /// As [`Preset::load`].
    pub fn parse(text: &str, path: &Path) -> Result<Self, TrainError> {
        let preset: Self = toml::from_str(text).map_err(|e| {
            let line = e
                .span()
                .map_or(1, |s| text[..s.start].matches('\n').count() + 1);
            TrainError::bad(path, format!("line {line}: {}", e.message()))
        })?;
        preset
            .checked()
            .map_err(|what| TrainError::bad(path, what))?;
        Ok(preset)
    }

    /// Checks values that were changed after reading.
    ///
    /// # Errors
    /// A value out of range.
    pub fn check(&self) -> Result<(), TrainError> {
        self.checked().map_err(TrainError::Data)
    }

    fn checked(&self) -> Result<(), String> {
        let (n, f, t) = (&self.network, &self.flow, &self.training);
        let within = |name: &str, value: usize, low: usize, high: usize| {
            if (low..=high).contains(&value) {
                Ok(())
            } else {
                Err(format!("{name} is {value}, not within {low}..={high}"))
            }
        };
        within("network.latent", n.latent, 1, 4096)?;
        within("network.width", n.width, 1, 4096)?;
        within("network.layers", n.layers, 1, 64)?;
        within("flow.resolution", f.resolution, 8, 128)?;
        within("flow.steps", f.steps, 1, 10_000)?;
        within("training.objects_per_batch", t.objects_per_batch, 1, 4096)?;
        within("training.grasps_per_object", t.grasps_per_object, 1, 4096)?;
        within("training.steps", t.steps as usize, 1, 100_000_000)?;
        if n.encoder == Encoder::Conv && !f.resolution.is_multiple_of(16) {
            return Err(format!(
                "flow.resolution is {}: the convolutions halve it four times, give a multiple of 16",
                f.resolution
            ));
        }
        if n.moments && !(n.hand_frame && f.normalisation == Normalisation::HalfEdge) {
            return Err(
                "network.moments needs network.hand_frame and flow.normalisation = \"half_edge\""
                    .into(),
            );
        }
        if f.noise == NoiseKind::Surface && f.couplings == 0 {
            return Err("flow.noise = \"surface\" needs flow.couplings above 0".into());
        }
        if f.optimal_transport && f.couplings > 0 {
            return Err("flow.optimal_transport pairs in every batch, flow.couplings once and for all: give one".into());
        }
        let positive = [
            ("flow.noise_translation_std", f.noise_translation_std),
            ("training.learning_rate", f64::from(t.learning_rate)),
            ("training.clip_norm", f64::from(t.clip_norm)),
            (
                "training.translation_weight",
                f64::from(t.translation_weight),
            ),
        ];
        for (name, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("{name} is {value}, not a number above 0"));
            }
        }
        if !(0.0..1.0).contains(&t.ema) {
            return Err(format!("training.ema is {}, not within 0..1", t.ema));
        }
        if !(f.padding.is_finite() && f.padding >= 0.0) {
            return Err(format!("flow.padding is {}", f.padding));
        }
        Ok(())
    }

    /// The preset as TOML: what a checkpoint keeps.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("plain data")
    }

    /// Trajectories in a batch.
    pub fn batch(&self) -> usize {
        self.training.objects_per_batch * self.training.grasps_per_object
    }
}
