//! The model of the contract: `encoder.onnx` once per object, `velocity.onnx` at every step, and, where
//! there is one, `evaluator.onnx` on where the flow ended.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use shakedown_gripper_assets::{Grasp, Gripper, HandFrame};
use shakedown_objects::{NormalisedSdf, Object, Probe, SdfGrid};

use crate::card::{Centring, ModelCard, ModelError, NoiseKind};
use crate::files::ModelFiles;
use crate::flow::{FlowSample, Velocity, VelocityField, Way, integrate};
use crate::graph::{Graph, Input};
use crate::noise::{Attempt, Noise};
use crate::redraw::Drawn;
use crate::runtime::{Runtime, runtime};
use crate::shell::Shell;
use crate::vet::vet;

/// Samples that go through the velocity network at once.
const BATCH: usize = 256;

/// Batches with which graphs from outside are measured. One object is encoded at a time; a velocity
/// network that looks at whole grids would fill the memory long before [`BATCH`].
const MEASURED_OBJECTS: usize = 1;
const MEASURED_SAMPLES: usize = 64;

/// Which of the inputs that describe samples a graph wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Wants {
    latent: bool,
    rotation: bool,
    translation: bool,
    time: bool,
    sdf: bool,
    scale: bool,
    sdf_at_points: bool,
}

impl Wants {
    fn of(graph: &Graph) -> Self {
        Self {
            latent: graph.has_input("latent"),
            rotation: graph.has_input("rotation"),
            translation: graph.has_input("translation"),
            time: graph.has_input("time"),
            sdf: graph.has_input("sdf"),
            scale: graph.has_input("scale"),
            sdf_at_points: graph.has_input("sdf_at_points"),
        }
    }
}

/// A graph that looks at samples: velocity or evaluator.
struct SampleGraph {
    graph: Graph,
    wants: Wants,
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

/// How grasps are drawn; what is `None` stands in the card.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DrawSettings {
    /// Steps from noise to grasp.
    pub steps: Option<usize>,
    /// How often a grasp that the evaluator does not believe in is drawn anew at most; 0 asks it for
    /// scores alone.
    pub redraws: Option<usize>,
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
    encoder: Graph,
    velocity: SampleGraph,
    evaluator: Option<SampleGraph>,
    probe: Probe,
}

/// One object as the model sees it.
struct Seen {
    sdf: NormalisedSdf,
    latent: Vec<f32>,
    /// From the object's axes to those of the grid.
    axes: UnitQuaternion<f64>,
    /// Where the flow begins, if not about the middle.
    shell: Option<Shell>,
}

impl FlowModel {
    /// Loads `directory/{model.toml, encoder.onnx, velocity.onnx}`, and `evaluator.onnx` if the card
    /// speaks of one; see [`FlowModel::open`].
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
        let toml = files.place.join("model.toml");
        let frame: HandFrame = card
            .frame
            .parse()
            .map_err(|e: String| ModelError::bad(&toml, format!("frame: {e}")))?;
        let path = |name: &str| files.place.join(name);
        vet_files(files, &card, ort)?;
        let encoder = Graph::open(&path("encoder.onnx"), &files.encoder, ort)?;
        let d = card.resolution as i64;
        encoder.names(&["sdf", "scale"], &[], &["latent"])?;
        encoder.input("sdf", &[-1, 1, d, d, d])?;
        encoder.input("scale", &[-1, 1])?;
        encoder.output_width("latent")?;
        let velocity = Graph::open(&path("velocity.onnx"), &files.velocity, ort)?;
        velocity.names(
            &["latent", "rotation", "translation", "time"],
            &["sdf", "scale", "sdf_at_points"],
            &["rotation_velocity", "translation_velocity"],
        )?;
        let velocity = SampleGraph::new(velocity, &card)?;
        let evaluator = match (&card.evaluator, &files.evaluator) {
            (Some(_), Some(bytes)) => {
                let graph = Graph::open(&path("evaluator.onnx"), bytes, ort)?;
                let optional = [
                    "latent",
                    "rotation",
                    "translation",
                    "sdf",
                    "scale",
                    "sdf_at_points",
                ];
                graph.names(&[], &optional, &["score"])?;
                Some(SampleGraph::new(graph, &card)?)
            }
            (Some(_), None) => {
                let what = "the file is missing, but model.toml has a table [evaluator]";
                return Err(ModelError::bad(&path("evaluator.onnx"), what));
            }
            (None, _) => None,
        };
        let mut model = Self {
            probe: Probe::new(&card.control_points_m),
            hash: files.hash(),
            runtime: encoder.runtime.clone(),
            card,
            frame,
            encoder,
            velocity,
            evaluator,
        };
        // A trial run settles what the declared shapes leave open, before any real work.
        let grid = vec![0.5f32; model.card.resolution.pow(3)];
        model.encode(&grid, 1.0, None)?;
        Ok(model)
    }

    /// Draws `count` grasps of an object for the hand, numbers `0..count`. With an evaluator
    /// each has its score, and one whose score is below the card's `least_score` is drawn anew, until one
    /// is not or the redraws are used up; then the best of them is taken.
    ///
    /// # Errors
    /// A network that fails or returns non-finite numbers.
    pub fn sample(
        &mut self,
        object: &Object,
        gripper: &Gripper,
        count: u64,
        run_seed: u64,
        settings: DrawSettings,
    ) -> Result<Vec<Grasp>, ModelError> {
        let seen = self.look(object)?;
        let steps = settings.steps.unwrap_or(self.card.steps);
        let integrator = self.card.integrator;
        let (least_score, redraws) = match &self.card.evaluator {
            Some(e) => (e.least_score as f32, settings.redraws.unwrap_or(e.redraws)),
            None => (0.0, 0),
        };
        let mut best: Vec<Drawn> = Vec::with_capacity(count as usize);
        let mut open: Vec<u64> = (0..count).collect();
        for turn in 0..=redraws {
            let begin = |&number: &u64| {
                let place = best.get(number as usize).map_or(0, |b| b.next_place(turn));
                (number, Attempt { place, turn })
            };
            let begins: Vec<(u64, Attempt)> = open.iter().map(begin).collect();
            let mut samples = self.noise(object, &seen, gripper, &begins, run_seed);
            let mut field = Bound {
                model: self,
                seen: &seen,
            };
            integrate(&mut field, &mut samples, steps, integrator, BATCH)?;
            let scores = self.scores(&samples, &seen)?;
            let drawn = samples.into_iter().zip(scores).zip(&begins);
            for ((sample, score), (number, attempt)) in drawn {
                let place = attempt.place;
                let drawn = Drawn {
                    sample,
                    score,
                    place,
                };
                match best.get_mut(*number as usize) {
                    None => best.push(drawn),
                    Some(best) if score > best.score => *best = drawn,
                    Some(_) => {}
                }
            }
            open.retain(|&i| best[i as usize].score < least_score);
            if open.is_empty() {
                break;
            }
        }
        let has_scores = self.evaluator.is_some();
        let grasps = best.iter().zip(0..).map(|(drawn, i)| {
            let pose = self.grasp(&drawn.sample, &seen, gripper);
            let mut grasp = Grasp::new(i, pose);
            grasp.score = has_scores.then_some(f64::from(drawn.score));
            grasp
        });
        Ok(grasps.collect())
    }

    /// Draws without the evaluator, with the pose before and after every step.
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
        let seen = self.look(object)?;
        let begins: Vec<(u64, Attempt)> = (0..count).map(|i| (i, Attempt::default())).collect();
        let mut samples = self.noise(object, &seen, gripper, &begins, run_seed);
        let steps = steps.unwrap_or(self.card.steps);
        let mut way = Way::new(steps, self.card.integrator, BATCH);
        let mut states: Vec<Vec<FlowSample>> = samples.iter().map(|s| vec![*s]).collect();
        let mut field = Bound {
            model: self,
            seen: &seen,
        };
        for _ in 0..steps {
            way.step(&mut field, &mut samples)?;
            for (path, sample) in states.iter_mut().zip(&samples) {
                path.push(*sample);
            }
        }
        Ok(states
            .into_iter()
            .map(|states| FlowPath {
                object_from_hand: self.grasp(&states[steps], &seen, gripper),
                states,
            })
            .collect())
    }

    /// The object in the axes that the card asks for, as grid and latent.
    fn look(&mut self, object: &Object) -> Result<Seen, ModelError> {
        let axes = match self.card.centring {
            Centring::BoxCentre => UnitQuaternion::identity(),
            Centring::SnugBox => object.snug_axes(),
        };
        let turned = (axes != UnitQuaternion::identity()).then(|| object.turned(&axes));
        let surface = &turned.as_ref().unwrap_or(object).surface;
        let grid = SdfGrid::bake(surface, self.card.resolution, self.card.padding);
        let sdf = NormalisedSdf::new(&grid, self.card.normalisation);
        let latent = self.encode(&sdf.values, sdf.scale_m, Some(&object.id))?;
        let shell = match self.card.noise {
            NoiseKind::Normal => None,
            NoiseKind::Surface => Some(Shell::new(&sdf)),
        };
        Ok(Seen {
            sdf,
            latent,
            axes,
            shell,
        })
    }

    /// Where the flow begins.
    fn noise(
        &self,
        object: &Object,
        seen: &Seen,
        gripper: &Gripper,
        begins: &[(u64, Attempt)],
        run_seed: u64,
    ) -> Vec<FlowSample> {
        let std = self.card.noise_translation_std;
        let noise = Noise::new(run_seed, &object.id, &gripper.name, std).about(seen.shell.as_ref());
        begins
            .iter()
            .map(|(i, attempt)| noise.at(*i, *attempt))
            .collect()
    }

    /// What the evaluator believes; all certain where there is none.
    fn scores(&mut self, samples: &[FlowSample], seen: &Seen) -> Result<Vec<f32>, ModelError> {
        let Some(evaluator) = &mut self.evaluator else {
            return Ok(vec![1.0; samples.len()]);
        };
        let mut scores = Vec::with_capacity(samples.len());
        for chunk in samples.chunks(BATCH) {
            let inputs = evaluator.inputs(chunk, seen, &self.probe, None)?;
            let [score] = evaluator.graph.run(inputs, ["score"], None)?;
            if score.len() != chunk.len() {
                let what = format!(
                    "score has {} numbers for a batch of {}",
                    score.len(),
                    chunk.len()
                );
                return Err(evaluator.graph.bad(what));
            }
            scores.extend(score);
        }
        Ok(scores)
    }

    /// A sample as a grasp in the object's frame.
    fn grasp(&self, sample: &FlowSample, seen: &Seen, gripper: &Gripper) -> Isometry3<f64> {
        let sdf = &seen.sdf;
        let translation = sdf.centre_m.coords + sample.translation * sdf.scale_m;
        let pose = Isometry3::from_parts(Translation3::from(translation), sample.rotation);
        seen.axes.inverse() * self.frame.to_hand(&pose, gripper.tcp_z_m)
    }

    /// Encodes a normalised grid.
    fn encode(
        &mut self,
        sdf: &[f32],
        scale_m: f64,
        object: Option<&str>,
    ) -> Result<Vec<f32>, ModelError> {
        let d = self.card.resolution as i64;
        let graph = &mut self.encoder;
        let inputs = vec![
            graph.tensor("sdf", vec![1, 1, d, d, d], sdf.to_vec())?,
            graph.tensor("scale", vec![1, 1], vec![scale_m as f32])?,
        ];
        let [latent] = graph.run(inputs, ["latent"], object)?;
        Ok(latent)
    }
}

impl SampleGraph {
    /// Checks the shapes of the inputs that it wants.
    fn new(graph: Graph, card: &ModelCard) -> Result<Self, ModelError> {
        let wants = Wants::of(&graph);
        let (d, points) = (card.resolution as i64, card.control_points_m.len() as i64);
        if wants.rotation {
            graph.input("rotation", &[-1, 3, 3])?;
        }
        if wants.translation {
            graph.input("translation", &[-1, 3])?;
        }
        if wants.time {
            graph.input("time", &[-1, 1])?;
        }
        if wants.sdf {
            graph.input("sdf", &[-1, 1, d, d, d])?;
        }
        if wants.sdf_at_points {
            if points == 0 {
                let what = "`sdf_at_points` is wanted, but model.toml names no control_points_m";
                return Err(graph.bad(what));
            }
            graph.input("sdf_at_points", &[-1, points])?;
        }
        Ok(Self { graph, wants })
    }

    /// What it wants to know of samples of one object.
    fn inputs(
        &self,
        samples: &[FlowSample],
        seen: &Seen,
        probe: &Probe,
        time: Option<f64>,
    ) -> Result<Vec<Input>, ModelError> {
        let Seen { sdf, latent, .. } = seen;
        let (n, b) = (samples.len(), samples.len() as i64);
        let mut inputs = Vec::new();
        let mut put = |name, mut shape: Vec<i64>, data| {
            shape.insert(0, b);
            inputs.push(self.graph.tensor(name, shape, data)?);
            Ok::<(), ModelError>(())
        };
        if self.wants.latent {
            put("latent", vec![latent.len() as i64], latent.repeat(n))?;
        }
        if self.wants.rotation {
            let rotations = samples.iter().flat_map(|s| {
                let m = *s.rotation.to_rotation_matrix().matrix();
                (0..9).map(move |k| m[(k / 3, k % 3)] as f32)
            });
            put("rotation", vec![3, 3], rotations.collect())?;
        }
        if self.wants.translation {
            let translations = samples
                .iter()
                .flat_map(|s| s.translation.map(|x| x as f32).data.0[0]);
            put("translation", vec![3], translations.collect())?;
        }
        if let Some(time) = time.filter(|_| self.wants.time) {
            put("time", vec![1], vec![time as f32; n])?;
        }
        if self.wants.sdf {
            let d = sdf.resolution as i64;
            put("sdf", vec![1, d, d, d], sdf.values.repeat(n))?;
        }
        if self.wants.scale {
            put("scale", vec![1], vec![sdf.scale_m as f32; n])?;
        }
        if self.wants.sdf_at_points {
            let points = probe.len();
            let mut values = vec![0.0; n * points];
            for (s, out) in samples.iter().zip(values.chunks_mut(points)) {
                let turn = (s.rotation.to_rotation_matrix().matrix() / sdf.scale_m).cast();
                sdf.at_probe(probe, &turn, &s.translation.cast(), out);
            }
            put("sdf_at_points", vec![points as i64], values)?;
        }
        Ok(inputs)
    }
}

/// The velocity network with everything that belongs to one object.
struct Bound<'a> {
    model: &'a mut FlowModel,
    seen: &'a Seen,
}

impl VelocityField for Bound<'_> {
    fn velocities(
        &mut self,
        samples: &[FlowSample],
        time: f64,
    ) -> Result<Vec<Velocity>, ModelError> {
        let n = samples.len();
        let FlowModel {
            velocity, probe, ..
        } = &mut *self.model;
        let inputs = velocity.inputs(samples, self.seen, probe, Some(time))?;
        let names = ["rotation_velocity", "translation_velocity"];
        let [rotation, translation] = velocity.graph.run(inputs, names, None)?;
        if rotation.len() != 9 * n || translation.len() != 3 * n {
            let what = format!(
                "rotation_velocity and translation_velocity have {} and {} numbers for a batch of {n}",
                rotation.len(),
                translation.len()
            );
            return Err(velocity.graph.bad(what));
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
fn vet_files(files: &ModelFiles, card: &ModelCard, ort: Option<&Path>) -> Result<(), ModelError> {
    let path = |name: &str| -> PathBuf { files.place.join(name) };
    let encoder_path = path("encoder.onnx");
    let (runtime, _) = runtime(ort).map_err(|e| ModelError::bad(&encoder_path, e))?;
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
    .map_err(|e| ModelError::bad(&encoder_path, e))?;
    let of_samples = [
        ("velocity.onnx", Some(&files.velocity)),
        ("evaluator.onnx", files.evaluator.as_ref()),
    ];
    for (name, bytes) in of_samples {
        let Some(bytes) = bytes else { continue };
        // A batch of two, so that no dimension of one hides a wrong shape.
        vet(bytes, MEASURED_SAMPLES, |name| match name {
            "latent" => Some(vec![2, latent?]),
            "rotation" => Some(vec![2, 3, 3]),
            "translation" => Some(vec![2, 3]),
            "time" | "scale" => Some(vec![2, 1]),
            "sdf" => Some(grid(2)),
            "sdf_at_points" => Some(vec![2, card.control_points_m.len()]),
            _ => None,
        })
        .map_err(|e| ModelError::bad(&path(name), e))?;
    }
    Ok(())
}
