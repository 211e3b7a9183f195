//! Where the files of a model come from: a directory, or this binary.

use std::borrow::Cow;
use std::fs;
use std::path::{Path, PathBuf};

use shakedown_objects::io::read_at_most;

use crate::card::{ModelCard, ModelError};

/// The files of a model.
#[derive(Debug, Clone)]
pub struct ModelFiles {
    /// Names the model in messages: a directory, or `built-in NAME`.
    pub place: PathBuf,
    /// `model.toml`.
    pub card: Cow<'static, str>,
    /// `encoder.onnx`.
    pub encoder: Cow<'static, [u8]>,
    /// `velocity.onnx`.
    pub velocity: Cow<'static, [u8]>,
    /// `evaluator.onnx`, if there is one.
    pub evaluator: Option<Cow<'static, [u8]>>,
}

macro_rules! built_in {
    ($($name:literal),+) => {
        &[$((
            $name,
            include_str!(concat!("../models/", $name, "/model.toml")),
            include_bytes!(concat!("../models/", $name, "/encoder.onnx")),
            include_bytes!(concat!("../models/", $name, "/velocity.onnx")),
            include_bytes!(concat!("../models/", $name, "/evaluator.onnx")),
        )),+]
    };
}

type BuiltIn = (
    &'static str,
    &'static str,
    &'static [u8],
    &'static [u8],
    &'static [u8],
);

/// The models made by this repository's own command; the first is the default.
const BUILT_IN: &[BuiltIn] = built_in!("rfm-embedded", "rfm-acronym");

/// Names of the built-in models; the first is the default.
pub fn built_in_names() -> impl Iterator<Item = &'static str> {
    BUILT_IN.iter().map(|m| m.0)
}

/// Largest file of a model that is read, bytes.
const MODEL_BYTES_MAX: u64 = 256 << 20;

impl ModelFiles {
    /// Do both graphs come from this binary?
    pub fn is_built_in(&self) -> bool {
        let is_own = |graph: &Cow<'static, [u8]>| matches!(graph, Cow::Borrowed(_));
        is_own(&self.encoder)
            && is_own(&self.velocity)
            && self.evaluator.as_ref().is_none_or(is_own)
    }

    /// A built-in model by name, or the files of a directory.
    ///
    /// # Errors
    /// Neither a name nor a directory with the three files.
    pub fn find(name: &str) -> Result<Self, ModelError> {
        let built_in = BUILT_IN.iter().find(|m| m.0 == name);
        if let Some((name, card, encoder, velocity, evaluator)) = built_in {
            return Ok(Self {
                place: PathBuf::from(format!("built-in {name}")),
                card: Cow::Borrowed(card),
                encoder: Cow::Borrowed(encoder),
                velocity: Cow::Borrowed(velocity),
                evaluator: Some(Cow::Borrowed(evaluator)),
            });
        }
        let directory = Path::new(name);
        if directory.is_dir() {
            return Self::read(directory);
        }
        let names: Vec<&str> = built_in_names().collect();
        Err(ModelError::Unknown {
            name: name.to_owned(),
            hint: format!(
                "built in are {}; otherwise give a directory with model.toml, encoder.onnx and \
                 velocity.onnx, or use --sampler antipodal",
                names.join(" and ")
            ),
        })
    }

    /// Reads `directory/{model.toml, encoder.onnx, velocity.onnx}`.
    ///
    /// # Errors
    /// A missing file.
    pub fn read(directory: &Path) -> Result<Self, ModelError> {
        let bytes = |name: &str| {
            let path = directory.join(name);
            if !path.exists() {
                return Err(ModelError::bad(&path, "the file is missing"));
            }
            read_at_most(&path, MODEL_BYTES_MAX).map_err(|source| ModelError::Io { path, source })
        };
        let evaluator = if directory.join("evaluator.onnx").exists() {
            Some(Cow::Owned(bytes("evaluator.onnx")?))
        } else {
            None
        };
        let card = directory.join("model.toml");
        let card = fs::read_to_string(&card).map_err(|source| ModelError::Io {
            path: card.clone(),
            source,
        })?;
        Ok(Self {
            place: directory.to_owned(),
            card: Cow::Owned(card),
            encoder: Cow::Owned(bytes("encoder.onnx")?),
            velocity: Cow::Owned(bytes("velocity.onnx")?),
            evaluator,
        })
    }

    /// The checked card.
    ///
    /// # Errors
    /// An unknown key, a value out of range.
    pub fn parsed_card(&self) -> Result<ModelCard, ModelError> {
        ModelCard::parse(&self.card, &self.place.join("model.toml"))
    }

    /// blake3 of all files.
    pub fn hash(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        let evaluator = self.evaluator.as_deref();
        let parts = [self.card.as_bytes(), &self.encoder, &self.velocity];
        for part in parts.into_iter().chain(evaluator) {
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part);
        }
        hasher.finalize().to_hex()[..32].to_owned()
    }
}
