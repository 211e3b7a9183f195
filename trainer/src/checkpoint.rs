//! A training that can be killed at any time: weights, moments and history in one file.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use candle_core::{Device, Tensor, safetensors};

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
    let mut tensors = HashMap::new();
    let cpu = &Device::Cpu;
    for (k, p) in weights.parameters.iter().enumerate() {
        let mut add = |kind: &str, values: &[f32]| -> Result<(), TrainError> {
            let tensor = Tensor::from_slice(values, p.shape.as_slice(), cpu)?;
            tensors.insert(format!("{kind}/{}", p.name), tensor);
            Ok(())
        };
        add("weight", &p.values)?;
        add("mean", &weights.mean[k])?;
        add("first", &weights.first[k])?;
        add("second", &weights.second[k])?;
    }
    tensors.insert("step".into(), Tensor::new(&[weights.step as i64], cpu)?);
    replace(&directory.join(PRESET), |p| fs::write(p, preset.to_toml()))?;
    replace(&file(directory), |p| {
        safetensors::save(&tensors, p).map_err(std::io::Error::other)
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
    let tensors = safetensors::load(&path, &Device::Cpu).map_err(|e| damaged(e.to_string()))?;
    let get = |name: String, shape: &[usize]| -> Result<Vec<f32>, TrainError> {
        let tensor = tensors
            .get(&name)
            .ok_or_else(|| damaged(format!("no {name}")))?;
        if tensor.dims() != shape {
            return Err(damaged(format!("{name} is {:?}", tensor.dims())));
        }
        Ok(tensor.flatten_all()?.to_vec1()?)
    };
    let step = tensors
        .get("step")
        .and_then(|t| t.to_vec1::<i64>().ok())
        .and_then(|v| u64::try_from(*v.first()?).ok())
        .ok_or_else(|| damaged("no step".into()))?;
    let mut weights = Weights::new(Vec::new());
    weights.step = step;
    for (name, shape) in layout(preset) {
        weights.mean.push(get(format!("mean/{name}"), &shape)?);
        weights.first.push(get(format!("first/{name}"), &shape)?);
        weights.second.push(get(format!("second/{name}"), &shape)?);
        let values = get(format!("weight/{name}"), &shape)?;
        weights.parameters.push(Parameter {
            name,
            shape,
            values,
        });
    }
    Ok(weights)
}
