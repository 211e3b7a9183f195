//! The model of the contract: `encoder.onnx` once per object, `velocity.onnx` at every step.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use ort::session::Session;
use ort::session::builder::GraphOptimizationLevel;
use ort::value::{Tensor, TensorElementType, ValueType};
use shakedown_gripper_assets::{Grasp, Gripper, HandFrame};
use shakedown_objects::{NormalisedSdf, Object, Probe, SdfGrid};

use crate::card::{Centring, ModelCard, ModelError};
use crate::files::ModelFiles;
use crate::flow::{FlowSample, Velocity, VelocityField, step};
use crate::runtime::{Runtime, runtime};
use crate::seed;
use crate::vet::vet;

/// Samples that go through the velocity network at once.
const BATCH: usize = 256;

/// Batches with which graphs from outside are measured. One object is encoded at a time; a velocity
/// network that looks at whole grids would fill the memory long before [`BATCH`].
const MEASURED_OBJECTS: usize = 1;
const MEASURED_SAMPLES: usize = 64;

/// What the velocity network wants besides pose, time and latent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Extras {
    sdf: bool,
    scale: bool,
    sdf_at_points: bool,
}

/// Where a grasp came from and where it ended.
#[derive(Debug, Clone, PartialEq)]
pub struct FlowPath {
    /// Noise, the pose after each step, and the end; normalised frame of the model, in the axes that its
    /// centring says.
    pub states: Vec<FlowSample>,
    /// The end as a grasp, ACRONYM frame.
    pub object_from_hand: Isometry3<f64>,
}

/// A loaded and checked model.
pub struct FlowModel {
    /// Its card.
    pub card: ModelCard,
    /// blake3 of its files.
    pub hash: String,
    /// The engine that runs it.
    pub runtime: Runtime,
    frame: HandFrame,
    encoder: Session,
    velocity: Session,
    velocity_path: PathBuf,
    encoder_path: PathBuf,
    latent: usize,
    extras: Extras,
    probe: Probe,
}

impl FlowModel {
    /// Loads `directory/{model.toml, encoder.onnx, velocity.onnx}`; see [`FlowModel::open`].
    ///
    /// # Errors
    /// Says which file and which tensor is wrong, and what was expected.
    pub fn load(directory: &Path, ort: Option<&Path>) -> Result<Self, ModelError> {
        Self::open(&ModelFiles::read(directory)?, ort)
    }

    /// Makes a model of its files and checks every name, type and shape against the contract and
    /// the card.
    ///
    /// # Errors
    /// Says which file and which tensor is wrong, and what was expected.
    pub fn open(files: &ModelFiles, ort: Option<&Path>) -> Result<Self, ModelError> {
        let card = files.parsed_card()?;
        let directory = &files.place;
        let toml = directory.join("model.toml");
        let frame: HandFrame = card
            .frame
            .parse()
            .map_err(|e: String| ModelError::bad(&toml, format!("frame: {e}")))?;
        let encoder_path = directory.join("encoder.onnx");
        let velocity_path = directory.join("velocity.onnx");
        vet_files(files, &card, [&encoder_path, &velocity_path], ort)?;
        let (runtime, encoder) = session(&encoder_path, &files.encoder, ort)?;
        let (_, velocity) = session(&velocity_path, &files.velocity, ort)?;
        let d = card.resolution as i64;
        let check = Check {
            path: &encoder_path,
            session: &encoder,
        };
        check.names(&["sdf", "scale"], &[], &["latent"])?;
        check.input("sdf", &[-1, 1, d, d, d])?;
        check.input("scale", &[-1, 1])?;
        let latent = check.output_width("latent")?;
        let check = Check {
            path: &velocity_path,
            session: &velocity,
        };
        let optional = ["sdf", "scale", "sdf_at_points"];
        check.names(
            &["latent", "rotation", "translation", "time"],
            &optional,
            &["rotation_velocity", "translation_velocity"],
        )?;
        check.input("rotation", &[-1, 3, 3])?;
        check.input("translation", &[-1, 3])?;
        check.input("time", &[-1, 1])?;
        let has = |name: &str| velocity.inputs().iter().any(|i| i.name() == name);
        let extras = Extras {
            sdf: has("sdf"),
            scale: has("scale"),
            sdf_at_points: has("sdf_at_points"),
        };
        if extras.sdf {
            check.input("sdf", &[-1, 1, d, d, d])?;
        }
        if extras.sdf_at_points {
            if card.control_points_m.is_empty() {
                let what = "`sdf_at_points` is wanted, but model.toml names no control_points_m";
                return Err(check.bad(what.into()));
            }
            check.input("sdf_at_points", &[-1, card.control_points_m.len() as i64])?;
        }
        let hash = files.hash();
        let mut model = Self {
            probe: Probe::new(&card.control_points_m),
            card,
            hash,
            runtime,
            frame,
            encoder,
            velocity,
            velocity_path,
            encoder_path,
            latent: latent.unwrap_or(0),
            extras,
        };
        // A trial run settles what the declared shapes leave open, before any real work.
        let grid = vec![0.5f32; model.card.resolution.pow(3)];
        let bound = model.bind(&grid, 1.0, None)?;
        model.latent = bound.len();
        Ok(model)
    }

    /// Draws `count` grasps of an object for the hand, numbers `first..first + count`.
    ///
    /// `steps` overrides the card's number of steps.
    ///
    /// # Errors
    /// A network that fails or returns non-finite numbers.
    pub fn sample(
        &mut self,
        object: &Object,
        gripper: &Gripper,
        count: u64,
        run_seed: u64,
        steps: Option<usize>,
    ) -> Result<Vec<Grasp>, ModelError> {
        let pairs = self.paths(object, gripper, count, run_seed, steps)?;
        Ok(pairs
            .into_iter()
            .enumerate()
            .map(|(i, path)| Grasp::new(i as u64, path.object_from_hand))
            .collect())
    }

    /// As [`FlowModel::sample`], with the pose before and after every step.
    ///
    /// # Errors
    /// A network that fails or returns non-finite numbers.
    pub fn paths(
        &mut self,
        object: &Object,
        gripper: &Gripper,
        count: u64,
        run_seed: u64,
        steps: Option<usize>,
    ) -> Result<Vec<FlowPath>, ModelError> {
        let axes = match self.card.centring {
            Centring::BoxCentre => UnitQuaternion::identity(),
            Centring::SnugBox => object.snug_axes(),
        };
        let turned = (axes != UnitQuaternion::identity()).then(|| object.turned(&axes));
        let surface = &turned.as_ref().unwrap_or(object).surface;
        let grid = SdfGrid::bake(surface, self.card.resolution, self.card.padding);
        let sdf = NormalisedSdf::new(&grid, self.card.normalisation);
        let latent = self.bind(&sdf.values, sdf.scale_m, Some(&object.id))?;
        let mut samples: Vec<FlowSample> = (0..count)
            .map(|index| {
                let mut rng = seed::stream(run_seed, "flow-v1", &object.id, &gripper.name, index);
                FlowSample {
                    rotation: seed::uniform_rotation(&mut rng),
                    translation: seed::normal_vector(&mut rng) * self.card.noise_translation_std,
                }
            })
            .collect();
        let (steps, integrator) = (steps.unwrap_or(self.card.steps), self.card.integrator);
        let frame = self.frame;
        let mut field = Bound {
            model: self,
            latent,
            sdf: &sdf,
        };
        let mut states: Vec<Vec<FlowSample>> = samples.iter().map(|s| vec![*s]).collect();
        for k in 0..steps {
            step(&mut field, &mut samples, k, steps, integrator, BATCH)?;
            for (path, sample) in states.iter_mut().zip(&samples) {
                path.push(*sample);
            }
        }
        Ok(states
            .into_iter()
            .map(|states| {
                let end = states[steps];
                let translation = sdf.centre_m.coords + end.translation * sdf.scale_m;
                let pose = Isometry3::from_parts(Translation3::from(translation), end.rotation);
                FlowPath {
                    states,
                    object_from_hand: axes.inverse() * frame.to_hand(&pose, gripper.tcp_z_m),
                }
            })
            .collect())
    }

    /// Encodes a normalised grid.
    fn bind(
        &mut self,
        sdf: &[f32],
        scale_m: f64,
        object: Option<&str>,
    ) -> Result<Vec<f32>, ModelError> {
        let d = self.card.resolution as i64;
        let path = self.encoder_path.clone();
        let inputs = vec![
            ("sdf", tensor(&path, vec![1, 1, d, d, d], sdf.to_vec())?),
            ("scale", tensor(&path, vec![1, 1], vec![scale_m as f32])?),
        ];
        let outputs = self.encoder.run(inputs).map_err(|e| failed(&path, &e))?;
        let latent = extract(&path, &outputs, "latent")?;
        finite(&path, "latent", &latent, object)?;
        Ok(latent)
    }
}

/// The velocity network with everything that belongs to one object.
struct Bound<'a> {
    model: &'a mut FlowModel,
    latent: Vec<f32>,
    sdf: &'a NormalisedSdf,
}

impl VelocityField for Bound<'_> {
    fn velocities(
        &mut self,
        samples: &[FlowSample],
        time: f64,
    ) -> Result<Vec<Velocity>, ModelError> {
        let n = samples.len();
        let b = n as i64;
        let path = self.model.velocity_path.clone();
        let rotations = samples.iter().flat_map(|s| {
            let m = *s.rotation.to_rotation_matrix().matrix();
            (0..9).map(move |k| m[(k / 3, k % 3)] as f32)
        });
        let translations = samples
            .iter()
            .flat_map(|s| s.translation.map(|x| x as f32).data.0[0]);
        let mut inputs = vec![
            (
                "latent",
                tensor(
                    &path,
                    vec![b, self.latent.len() as i64],
                    self.latent.repeat(n),
                )?,
            ),
            (
                "rotation",
                tensor(&path, vec![b, 3, 3], rotations.collect())?,
            ),
            (
                "translation",
                tensor(&path, vec![b, 3], translations.collect())?,
            ),
            ("time", tensor(&path, vec![b, 1], vec![time as f32; n])?),
        ];
        let extras = self.model.extras;
        if extras.sdf {
            let d = self.model.card.resolution as i64;
            inputs.push((
                "sdf",
                tensor(&path, vec![b, 1, d, d, d], self.sdf.values.repeat(n))?,
            ));
        }
        if extras.scale {
            inputs.push((
                "scale",
                tensor(&path, vec![b, 1], vec![self.sdf.scale_m as f32; n])?,
            ));
        }
        if extras.sdf_at_points {
            let points = self.model.probe.len();
            let mut values = vec![0.0; n * points];
            for (s, out) in samples.iter().zip(values.chunks_mut(points)) {
                let turn = (s.rotation.to_rotation_matrix().matrix() / self.sdf.scale_m).cast();
                let shift = s.translation.cast();
                self.sdf.at_probe(&self.model.probe, &turn, &shift, out);
            }
            let shape = vec![b, points as i64];
            inputs.push(("sdf_at_points", tensor(&path, shape, values)?));
        }
        let outputs = self
            .model
            .velocity
            .run(inputs)
            .map_err(|e| failed(&path, &e))?;
        let rotation = extract(&path, &outputs, "rotation_velocity")?;
        let translation = extract(&path, &outputs, "translation_velocity")?;
        finite(&path, "rotation_velocity", &rotation, None)?;
        finite(&path, "translation_velocity", &translation, None)?;
        if rotation.len() != 9 * n || translation.len() != 3 * n {
            let what = format!(
                "rotation_velocity and translation_velocity have {} and {} numbers for a batch of {n}",
                rotation.len(),
                translation.len()
            );
            return Err(ModelError::bad(&path, what));
        }
        Ok((0..n)
            .map(|i| Velocity {
                rotation: Matrix3::from_fn(|r, c| f64::from(rotation[9 * i + 3 * r + c])),
                translation: Vector3::from_fn(|k, _| f64::from(translation[3 * i + k])),
            })
            .collect())
    }
}

/// Graphs from outside are tried where they can do no harm, if tract is to run them.
fn vet_files(
    files: &ModelFiles,
    card: &ModelCard,
    [encoder_path, velocity_path]: [&Path; 2],
    ort: Option<&Path>,
) -> Result<(), ModelError> {
    let (runtime, _) = runtime(ort).map_err(|e| ModelError::bad(encoder_path, e))?;
    if files.is_built_in() || runtime.name != "tract" {
        return Ok(());
    }
    let d = card.resolution;
    let grid = move |n: usize| vec![n, 1, d, d, d];
    let latent = vet(&files.encoder, MEASURED_OBJECTS, |name| match name {
        "sdf" => Some(grid(1)),
        "scale" => Some(vec![1, 1]),
        _ => None,
    })
    .map_err(|e| ModelError::bad(encoder_path, e))?;
    // A batch of two, so that no dimension of one hides a wrong shape.
    vet(&files.velocity, MEASURED_SAMPLES, |name| match name {
        "latent" => Some(vec![2, latent?]),
        "rotation" => Some(vec![2, 3, 3]),
        "translation" => Some(vec![2, 3]),
        "time" | "scale" => Some(vec![2, 1]),
        "sdf" => Some(grid(2)),
        "sdf_at_points" => Some(vec![2, card.control_points_m.len()]),
        _ => None,
    })
    .map_err(|e| ModelError::bad(velocity_path, e))?;
    Ok(())
}

fn session(
    path: &Path,
    bytes: &[u8],
    ort: Option<&Path>,
) -> Result<(Runtime, Session), ModelError> {
    let (runtime, environment) = runtime(ort).map_err(|e| ModelError::bad(path, e))?;
    let session = Session::builder(environment)
        .map_err(|e| failed(path, &e))?
        .with_optimization_level(GraphOptimizationLevel::All)
        .map_err(|e| failed(path, &e))?
        .with_intra_threads(1)
        .map_err(|e| failed(path, &e))?
        .commit_from_memory(bytes)
        .map_err(|e| ModelError::bad(path, format!("not a usable ONNX graph: {e}")))?;
    Ok((runtime.clone(), session))
}

fn failed(path: &Path, error: &impl std::fmt::Display) -> ModelError {
    ModelError::bad(path, format!("the network fails: {error}"))
}

fn tensor(path: &Path, shape: Vec<i64>, data: Vec<f32>) -> Result<Tensor<f32>, ModelError> {
    Tensor::from_array((shape, data)).map_err(|e| failed(path, &e))
}

fn extract(
    path: &Path,
    outputs: &ort::session::SessionOutputs<'_>,
    name: &str,
) -> Result<Vec<f32>, ModelError> {
    let value = outputs
        .get(name)
        .ok_or_else(|| ModelError::bad(path, format!("there is no output `{name}`")))?;
    value
        .try_extract_tensor::<f32>()
        .map(|(_, data)| data.to_vec())
        .map_err(|e| ModelError::bad(path, format!("output `{name}`: {e}")))
}

fn finite(path: &Path, name: &str, values: &[f32], object: Option<&str>) -> Result<(), ModelError> {
    if values.iter().all(|v| v.is_finite()) {
        return Ok(());
    }
    let of = object
        .map(|o| format!(" for object {o}"))
        .unwrap_or_default();
    Err(ModelError::bad(
        path,
        format!("output `{name}` is not finite{of}"),
    ))
}

struct Check<'a> {
    path: &'a Path,
    session: &'a Session,
}

impl Check<'_> {
    fn bad(&self, what: String) -> ModelError {
        ModelError::bad(self.path, what)
    }

    fn names(
        &self,
        needed: &[&str],
        optional: &[&str],
        outputs: &[&str],
    ) -> Result<(), ModelError> {
        let inputs: Vec<&str> = self.session.inputs().iter().map(|i| i.name()).collect();
        for name in needed {
            if !inputs.contains(name) {
                return Err(self.bad(format!("there is no input `{name}`; it has {inputs:?}")));
            }
        }
        for name in &inputs {
            if !needed.contains(name) && !optional.contains(name) {
                return Err(self.bad(format!("nobody knows what to feed to input `{name}`")));
            }
        }
        let found: Vec<&str> = self.session.outputs().iter().map(|o| o.name()).collect();
        for name in outputs {
            if !found.contains(name) {
                return Err(self.bad(format!("there is no output `{name}`; it has {found:?}")));
            }
        }
        Ok(())
    }

    /// Checks type and shape of an input; -1 is a dimension that may be anything.
    fn input(&self, name: &str, expected: &[i64]) -> Result<(), ModelError> {
        let outlet = self.session.inputs().iter().find(|i| i.name() == name);
        let Some(ValueType::Tensor { ty, shape, .. }) = outlet.map(|o| o.dtype()) else {
            return Err(self.bad(format!("input `{name}` is no tensor")));
        };
        if *ty != TensorElementType::Float32 {
            return Err(self.bad(format!("input `{name}` is {ty:?}, not float32")));
        }
        let found: Vec<i64> = shape.iter().copied().collect();
        let fits = found.len() == expected.len()
            && found
                .iter()
                .zip(expected)
                .all(|(f, e)| *f == -1 || *e == -1 || f == e);
        if !fits {
            return Err(self.bad(format!(
                "input `{name}` has shape {found:?}, expected {expected:?} (-1: any)"
            )));
        }
        if found.first().is_some_and(|b| *b != -1) {
            return Err(self.bad(format!("input `{name}` has a fixed batch of {}", found[0])));
        }
        Ok(())
    }

    /// Width of a [B, L] output, if the graph declares it.
    fn output_width(&self, name: &str) -> Result<Option<usize>, ModelError> {
        let outlet = self.session.outputs().iter().find(|o| o.name() == name);
        let Some(ValueType::Tensor { shape, .. }) = outlet.map(|o| o.dtype()) else {
            return Err(self.bad(format!("output `{name}` is no tensor")));
        };
        Ok(shape.last().and_then(|&l| usize::try_from(l).ok()))
    }
}
