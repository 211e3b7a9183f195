//! A training that can be killed at any time: weights, moments and history in one file.

use std::fs;
use std::path::{Path, PathBuf};

use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use crate::adam::Weights;
use crate::error::TrainError;
use crate::network::{Parameter, layout};
use crate::preset::Preset;

/// Name of the checkpoint in the output directory; the preset lies beside it.
pub const FILE: &str = "checkpoint.safetensors";
const PRESET: &str = "preset.toml";

fn file(directory: &Path) -> PathBuf {
    directory.join(FILE)
}

/// Is there a checkpoint in `directory`?
pub fn exists(directory: &Path) -> bool {
    file(directory).is_file()
}

/// Writes a file so that a kill or a full disk leaves the old one.
///
/// # Errors
/// A disk that cannot be written.
pub fn replace(
    path: &Path,
    write: impl FnOnce(&Path) -> std::io::Result<()>,
) -> Result<(), TrainError> {
    let new = path.with_extension("new");
    write(&new)
        .and_then(|()| fs::File::open(&new)?.sync_all())
        .and_then(|()| fs::rename(&new, path))
        .map_err(|e| {
            let _ = fs::remove_file(&new);
            TrainError::io("write", path, e)
        })
}

/// Saves weights and preset.
///
/// # Errors
/// A disk that cannot be written; the previous checkpoint stays.
pub fn save(directory: &Path, preset: &Preset, weights: &Weights) -> Result<(), TrainError> {
    let mut arrays = vec![(
        "step".to_owned(),
        Dtype::I64,
        vec![1],
        weights.step.to_le_bytes().to_vec(),
    )];
    for (k, p) in weights.parameters.iter().enumerate() {
        let kinds = [
            ("weight", &p.values),
            ("mean", &weights.mean[k]),
            ("first", &weights.first[k]),
            ("second", &weights.second[k]),
        ];
        for (kind, values) in kinds {
            let bytes = values.iter().flat_map(|x| x.to_le_bytes()).collect();
            arrays.push((
                format!("{kind}/{}", p.name),
                Dtype::F32,
                p.shape.clone(),
                bytes,
            ));
        }
    }
    let views = arrays.iter().map(|(name, dtype, shape, bytes)| {
        let view = TensorView::new(*dtype, shape.clone(), bytes).expect("as many bytes as numbers");
        (name, view)
    });
    replace(&directory.join(PRESET), |p| fs::write(p, preset.to_toml()))?;
    replace(&file(directory), |p| {
        safetensors::serialize_to_file(views, None, p).map_err(std::io::Error::other)
    })
}

/// The averaged weights of another training, whose network must be that of `preset`.
///
/// # Errors
/// No checkpoint, a damaged one, another network.
pub fn averaged(directory: &Path, preset: &Preset) -> Result<Vec<Parameter>, TrainError> {
    let beside = directory.join(PRESET);
    let text = fs::read_to_string(&beside).map_err(|e| TrainError::io("read", &beside, e))?;
    let own = Preset::parse(&text, &beside)?;
    if own.network != preset.network || own.flow.frame != preset.flow.frame {
        return Err(TrainError::bad(
            &beside,
            "its network is not that of the preset: rectify with the preset it was trained with",
        ));
    }
    Ok(load(directory, &own)?.averaged())
}

/// Reads the checkpoint of `directory`, which must be one of `preset`.
///
/// # Errors
/// A damaged file, or another preset.
pub fn load(directory: &Path, preset: &Preset) -> Result<Weights, TrainError> {
    let path = file(directory);
    let beside = directory.join(PRESET);
    let text = fs::read_to_string(&beside).map_err(|e| TrainError::io("read", &beside, e))?;
    if Preset::parse(&text, &beside)? != *preset {
        return Err(TrainError::bad(
            &path,
            "the checkpoint belongs to another preset (see preset.toml beside it): give that \
             preset, or another --out",
        ));
    }
    let damaged = |what: String| TrainError::bad(&path, format!("damaged checkpoint: {what}"));
    let bytes = fs::read(&path).map_err(|e| TrainError::io("read", &path, e))?;
    let tensors = SafeTensors::deserialize(&bytes).map_err(|e| damaged(e.to_string()))?;
    let get = |name: &str, dtype: Dtype, shape: &[usize]| {
        let tensor = tensors.tensor(name).map_err(|e| damaged(e.to_string()))?;
        if tensor.dtype() != dtype || tensor.shape() != shape {
            let (dtype, shape) = (tensor.dtype(), tensor.shape());
            return Err(damaged(format!("{name} is {dtype:?} {shape:?}")));
        }
        Ok(tensor.data())
    };
    let numbers = |name: String, shape: &[usize]| -> Result<Vec<f32>, TrainError> {
        let (numbers, _) = get(&name, Dtype::F32, shape)?.as_chunks();
        Ok(numbers.iter().map(|b| f32::from_le_bytes(*b)).collect())
    };
    let step = get("step", Dtype::I64, &[1])?;
    let step = i64::from_le_bytes(step.try_into().expect("one number of 64 bits"));
    let step = u64::try_from(step).map_err(|_| damaged(format!("step {step}")))?;
    let mut weights = Weights::new(Vec::new());
    weights.step = step;
    for (name, shape) in layout(preset) {
        weights.mean.push(numbers(format!("mean/{name}"), &shape)?);
        weights
            .first
            .push(numbers(format!("first/{name}"), &shape)?);
        weights
            .second
            .push(numbers(format!("second/{name}"), &shape)?);
        let values = numbers(format!("weight/{name}"), &shape)?;
        weights.parameters.push(Parameter {
            name,
            shape,
            values,
        });
    }
    Ok(weights)
}
