//! Options resolved: the hand, the protocol and the source of grasps, loaded and checked.

use std::path::PathBuf;

use shakedown_classifier::{HandModel, Thresholds};
use shakedown_gripper_assets::Gripper;
use shakedown_sampler::{AntipodalSettings, built_in_names};
#[cfg(feature = "onnx")]
use shakedown_sampler::{ModelCard, ModelFiles};
use shakedown_sim::Protocol;

use crate::args::{RunArgs, Sampler, SourceArgs, Stage};
use crate::failure::Failure;

/// What tries grasps and how.
pub struct Settings {
    pub gripper: Gripper,
    pub hand: HandModel,
    pub protocol: Protocol,
    pub thresholds: Thresholds,
    pub geometry: bool,
    pub physics: bool,
    pub wrench: bool,
    pub cache: Option<PathBuf>,
}

impl Settings {
    pub fn resolve(args: &RunArgs) -> Result<Self, Failure> {
        let gripper = Gripper::load(&args.source.gripper)?;
        let hand = HandModel::new(&gripper, gripper.opening_max_m)?;
        let protocol = args.protocol.load()?;
        if let Some(mu) = args.object.friction
            && !(mu.is_finite() && mu >= 0.0)
        {
            return Err(Failure::usage(format!(
                "--friction {mu}: give a number >= 0"
            )));
        }
        Ok(Self {
            gripper,
            hand,
            protocol,
            thresholds: Thresholds::default(),
            geometry: args.stages.contains(&Stage::Geometry),
            physics: args.stages.contains(&Stage::Physics),
            wrench: args.wrench,
            cache: shakedown_objects::pieces::default_cache_directory(),
        })
    }
}

/// Where grasps come from.
pub enum Source {
    /// Grasp files.
    Files,
    /// The antipodal sampler.
    Antipodal(AntipodalSettings),
    /// A flow model.
    #[cfg(feature = "onnx")]
    Model(Box<std::sync::Mutex<shakedown_sampler::FlowModel>>),
}

impl Source {
    pub fn resolve(args: &SourceArgs) -> Result<Self, Failure> {
        if !args.grasps.is_empty() {
            return Ok(Self::Files);
        }
        let antipodal = Self::Antipodal(AntipodalSettings::default());
        match (&args.model, args.sampler) {
            (Some(name), _) => Self::model(name, args),
            (None, Some(Sampler::Antipodal)) => Ok(antipodal),
            (None, None) if cfg!(feature = "onnx") => {
                let name = built_in_names().next().expect("there is a default model");
                Self::model(name, args)
            }
            (None, None) => Ok(antipodal),
        }
    }

    #[cfg(feature = "onnx")]
    fn model(name: &str, args: &SourceArgs) -> Result<Self, Failure> {
        let files = ModelFiles::find(name)?;
        let model = shakedown_sampler::FlowModel::open(&files, args.ort.as_deref())?;
        Ok(Self::Model(Box::new(std::sync::Mutex::new(model))))
    }

    #[cfg(not(feature = "onnx"))]
    fn model(name: &str, _: &SourceArgs) -> Result<Self, Failure> {
        Err(Failure::input(format!(
            "model {name:?}: this binary was built without the feature `onnx`"
        )))
    }

    /// What the manifest says of the source.
    pub fn describe(&self, args: &SourceArgs) -> serde_json::Value {
        match self {
            Self::Files => serde_json::json!({
                "from": "files",
                "frame": args.frame.map(|f| f.name()),
            }),
            Self::Antipodal(settings) => serde_json::json!({
                "from": "antipodal-v1",
                "settings": settings,
                "candidates": args.candidates,
            }),
            #[cfg(feature = "onnx")]
            Self::Model(model) => {
                let model = model.lock().expect("nobody panics while holding it");
                // The points are part of the hash and would fill pages.
                let card = ModelCard {
                    control_points_m: Vec::new(),
                    ..model.card.clone()
                };
                serde_json::json!({
                    "from": "model",
                    "card": card,
                    "hash": model.hash,
                    "runtime": { "name": model.runtime.name, "version": model.runtime.version },
                    "steps": args.steps,
                    "redraws": args.redraws,
                    "turn_objects": args.turn_objects,
                    "candidates": args.candidates,
                })
            }
        }
    }
}
