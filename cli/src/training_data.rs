//! What a training learns from: ACRONYM files, or embedded shapes with grasps we tried ourselves.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use shakedown_gripper_assets::{
    Grasp, GraspFile, GraspFormat, Gripper, ReadOptions, read_grasps, write_grasps,
};
use shakedown_objects::Object;
use shakedown_objects::shapes::{Family, Shape, Split};
use shakedown_report::results::{Metric, Results};
use shakedown_sampler::{AntipodalSettings, Centring, sample_antipodal};
use shakedown_sim::{Protocol, Scene, run_trial};
use shakedown_trainer::{Preset, TrainingObject};

use crate::args::{Global, ObjectArgs};
use crate::args_judging::TrainArgs;
use crate::failure::Failure;
use crate::plan::{Item, Material};
use crate::progress;
use crate::stretched;
use crate::teacher::{Approval, Teacher};

/// Objects to learn from, and some of them to validate on.
pub struct TrainingData {
    pub objects: Vec<TrainingObject>,
    pub validation: Vec<Object>,
    /// One line for the card.
    pub description: String,
}

/// What is asked of grasps that nobody labelled, unless --min-p-hold says so.
const LEAST_P_HOLD: f64 = 0.5;

/// Objects that a validation draws grasps for.
const VALIDATION_OBJECTS: usize = 10;

impl TrainingData {
    /// # Errors
    /// Unreadable files, missing meshes, no successful grasp.
    pub fn load(
        global: &Global,
        args: &TrainArgs,
        preset: &Preset,
        gripper: &Gripper,
        protocol: &Protocol,
    ) -> Result<Self, Failure> {
        let embedded = is_embedded(args);
        if embedded && (args.stretched > 0 || args.hold_out > 0) {
            return Err(Failure::usage(
                "--stretched and --hold-out are for files; embedded shapes are drawn with --variants",
            ));
        }
        let held = Held::read(&args.held_in)?;
        let sources = sources(args)?;
        let bar = progress::bar(global, sources.len() as u64);
        bar.set_message("data");
        let context = Context {
            global,
            args,
            gripper,
            protocol,
            held: &held,
        };
        let teacher = Teacher::load(args)?;
        let validated = match args.hold_out {
            0 => VALIDATION_OBJECTS,
            n => n,
        };
        let every = sources.len().div_ceil(validated);
        let loaded: Vec<(Vec<TrainingObject>, Option<Object>)> = sources
            .par_iter()
            .enumerate()
            .map(|(i, source)| {
                let is_validated = i % every == 0;
                let (learned, object) = if is_validated && args.hold_out > 0 {
                    (Vec::new(), source.object(args)?)
                } else {
                    context.learned(source, preset, teacher.as_ref())?
                };
                bar.inc(1);
                Ok((learned, is_validated.then_some(object)))
            })
            .collect::<Result<_, Failure>>()?;
        bar.finish_and_clear();
        let (objects, validation): (Vec<_>, Vec<_>) = loaded.into_iter().unzip();
        let (objects, empty): (Vec<_>, Vec<_>) = objects
            .into_iter()
            .flatten()
            .partition(|o| !o.poses.is_empty());
        for o in &empty {
            progress::note(
                global,
                &format!("{}: no grasp of it is good; left out", o.id),
            );
        }
        let grasps: usize = objects.iter().map(|o| o.poses.len()).sum();
        let mut description = if embedded {
            format!(
                "{} embedded shapes, antipodal grasps that held under {}",
                objects.len(),
                protocol.name
            )
        } else {
            let held_out = if args.hold_out > 0 {
                validation.iter().flatten().count()
            } else {
                0
            };
            format!(
                "{} ACRONYM files, successful grasps",
                sources.len() - held_out
            )
        };
        if args.stretched > 0 {
            description += &format!(", each object with {} stretched copies", args.stretched);
        }
        if !args.held_in.is_empty() {
            description += " that also held in our own trial";
        }
        if let Some(least) = args.min_p_hold {
            description += &format!(" with p_hold >= {least} by geometry");
        }
        description += &format!(", {grasps} grasps");
        Ok(Self {
            objects,
            validation: validation.into_iter().flatten().collect(),
            description,
        })
    }
}

/// Where an object comes from.
pub enum Source {
    File(PathBuf),
    Shape(Shape),
}

/// Are our own shapes learned from?
pub fn is_embedded(args: &TrainArgs) -> bool {
    args.data.iter().any(|d| d == "embedded")
}

/// What --data names.
///
/// # Errors
/// Shapes and files together, a directory without files, nothing left by --hold-out.
pub fn sources(args: &TrainArgs) -> Result<Vec<Source>, Failure> {
    let sources: Vec<Source> = if !is_embedded(args) {
        files(&args.data)?.into_iter().map(Source::File).collect()
    } else if args.data.len() > 1 {
        return Err(Failure::usage(
            "--data embedded stands alone; files and directories may be mixed",
        ));
    } else {
        variants(args.variants).map(Source::Shape).collect()
    };
    if args.hold_out >= sources.len() && args.hold_out > 0 {
        return Err(Failure::usage(format!(
            "--hold-out {} leaves none of the {} objects to learn from",
            args.hold_out,
            sources.len()
        )));
    }
    Ok(sources)
}

struct Context<'a> {
    global: &'a Global,
    args: &'a TrainArgs,
    gripper: &'a Gripper,
    protocol: &'a Protocol,
    held: &'a Held,
}

impl Context<'_> {
    /// What is asked of grasps that nobody labelled.
    fn least_p_hold(&self) -> f64 {
        self.args.min_p_hold.unwrap_or(LEAST_P_HOLD)
    }

    fn good_grasps(&self, source: &Source) -> Result<(Object, Vec<Grasp>), Failure> {
        match source {
            Source::File(path) => self.acronym(path),
            Source::Shape(shape) => self.tried(shape),
        }
    }

    /// What a source teaches, by its object and the stretched copies of it, which together are shown as often; and
    /// that object.
    fn learned(
        &self,
        source: &Source,
        preset: &Preset,
        teacher: Option<&Teacher>,
    ) -> Result<(Vec<TrainingObject>, Object), Failure> {
        let (object, good) = self.good_grasps(source)?;
        let mut learned = vec![self.one(&object, &good, preset, teacher)?];
        for index in 0..self.args.stretched {
            let copy = stretched::copy(&object, index, self.global.seed);
            let likely = self.likely_candidates(&copy)?;
            let mut copy = self.one(&copy, &likely, preset, teacher)?;
            copy.share = 1.0 / self.args.stretched as f32;
            learned.push(copy);
        }
        Ok((learned, object))
    }

    /// Candidates that lie as ACRONYM's do, where geometry says that they hold: a stretched wall may have become
    /// thin enough for the hand, or too thick, so the grasps of the original would not be all, nor all good.
    fn likely_candidates(&self, object: &Object) -> Result<Vec<Grasp>, Failure> {
        let settings = AntipodalSettings::like_acronym();
        let (count, seed) = (self.args.candidates, self.global.seed);
        let candidates = sample_antipodal(object, self.gripper, count, seed, &settings);
        let approval = Approval::new(object, self.gripper, self.least_p_hold())?;
        Ok(candidates
            .into_par_iter()
            .filter(|g| approval.is_good(&g.object_from_hand))
            .collect())
    }

    fn one(
        &self,
        object: &Object,
        good: &[Grasp],
        preset: &Preset,
        teacher: Option<&Teacher>,
    ) -> Result<TrainingObject, Failure> {
        let tcp_z_m = self.gripper.tcp_z_m;
        let snug = (preset.flow.centring == Centring::SnugBox).then(|| snug(object, good));
        let (object, good) = match &snug {
            Some((object, good)) => (object, good.as_slice()),
            None => (object, good),
        };
        let mut trained = TrainingObject::new(&object.id, &object.surface, good, tcp_z_m, preset)?;
        trained.couple(preset, self.global.seed);
        if let Some(teacher) = teacher.filter(|_| !good.is_empty()) {
            let mut approval = Approval::new(object, self.gripper, self.least_p_hold())?;
            if self.args.try_ends {
                approval = approval.with_trial(self.scene(object)?);
            }
            let paths = teacher.paths(object, self.gripper, &approval, self.global.seed)?;
            let weight = preset.training.translation_weight;
            trained.rectify(&paths, weight, tcp_z_m);
        }
        Ok(trained)
    }

    fn scene(&self, object: &Object) -> Result<Scene, Failure> {
        scene(object, self.gripper, self.protocol)
    }

    fn acronym(&self, path: &Path) -> Result<(Object, Vec<Grasp>), Failure> {
        let options = ReadOptions::default();
        let object = file_object(path, self.args)?;
        let mut grasps = read_grasps(path, &options)?.grasps;
        grasps.retain(|g| g.label == Some(true) && self.held.allows(&object.id, g.index));
        if let Some(least) = self.args.min_p_hold {
            grasps = self.likely(&object, grasps, least)?;
        }
        Ok((object, grasps))
    }

    /// The grasps whose `p_hold` by geometry alone is at least `least`.
    fn likely(
        &self,
        object: &Object,
        grasps: Vec<Grasp>,
        least: f64,
    ) -> Result<Vec<Grasp>, Failure> {
        let approval = Approval::new(object, self.gripper, least)?;
        Ok(grasps
            .into_par_iter()
            .filter(|g| approval.is_likely(&g.object_from_hand))
            .collect())
    }

    /// Candidates of a shape that held; kept on disk, so that a resumed training tries none twice.
    fn tried(&self, shape: &Shape) -> Result<(Object, Vec<Grasp>), Failure> {
        let object = shape.object()?;
        let file = format!("{}-{}-{}", shape.id, self.args.candidates, self.global.seed);
        let mut grasps = kept(&self.args.out, &file, || {
            let mut grasps = sample_antipodal(
                &object,
                self.gripper,
                self.args.candidates,
                self.global.seed,
                &AntipodalSettings::default(),
            );
            let scene = self.scene(&object)?;
            grasps.par_iter_mut().for_each(|g| {
                g.label = Some(run_trial(&scene, &g.object_from_hand).is_held());
            });
            Ok(grasps)
        })?;
        grasps.retain(|g| g.label == Some(true));
        Ok((object, grasps))
    }
}

/// Labelled grasps that lie in `out/data`, or else are made and laid there: a training that is resumed
/// tries none twice.
///
/// # Errors
/// Those of the making; a disk that cannot be written.
pub fn kept(
    out: &Path,
    name: &str,
    make: impl FnOnce() -> Result<Vec<Grasp>, Failure>,
) -> Result<Vec<Grasp>, Failure> {
    let directory = out.join("data");
    let path = directory.join(format!("{name}.json"));
    if path.is_file() {
        return Ok(read_grasps(&path, &ReadOptions::default())?.grasps);
    }
    let grasps = make()?;
    if grasps.is_empty() {
        return Ok(grasps);
    }
    let cannot =
        |e: std::io::Error| Failure::input(format!("cannot write {}: {e}", directory.display()));
    fs::create_dir_all(&directory).map_err(cannot)?;
    let new = path.with_extension("new");
    write_grasps(&GraspFile {
        path: new.clone(),
        format: GraspFormat::GraspGenJson,
        gripper: None,
        object: Default::default(),
        grasps: grasps.clone(),
        reorthonormalised: 0,
    })?;
    fs::rename(&new, &path).map_err(cannot)?;
    Ok(grasps)
}

impl Source {
    /// The object itself.
    ///
    /// # Errors
    /// A mesh that cannot be read.
    pub fn object(&self, args: &TrainArgs) -> Result<Object, Failure> {
        match self {
            Self::File(path) => file_object(path, args),
            Self::Shape(shape) => Ok(shape.object()?),
        }
    }
}

fn file_object(path: &Path, args: &TrainArgs) -> Result<Object, Failure> {
    let item = Item {
        id: shakedown_objects::object::stem(path),
        material: Material::GraspFile(path.to_owned()),
        grasps: Some(path.to_owned()),
    };
    let args = ObjectArgs {
        mesh_root: args.mesh_root.clone(),
        ..ObjectArgs::default()
    };
    item.load(&args, &ReadOptions::default())
}

/// Where grasps of an object are tried.
///
/// # Errors
/// An object that cannot be simulated.
pub fn scene(object: &Object, gripper: &Gripper, protocol: &Protocol) -> Result<Scene, Failure> {
    let cache = shakedown_objects::pieces::default_cache_directory();
    Ok(Scene::new(
        object,
        gripper,
        protocol,
        None,
        cache.as_deref(),
    )?)
}

/// `each` variants of every family, drawn from the ranges of the seen members.
fn variants(each: u64) -> impl Iterator<Item = Shape> {
    (0..each).flat_map(|i| {
        Family::ALL
            .into_iter()
            .map(move |f| f.variant(Split::Seen, 0, i))
    })
}

/// An object in the axes of its snug box, as the model will see it.
pub fn snug(object: &Object, grasps: &[Grasp]) -> (Object, Vec<Grasp>) {
    let axes = object.snug_axes();
    let turned = |g: &Grasp| Grasp {
        object_from_hand: axes * g.object_from_hand,
        ..*g
    };
    let grasps = grasps.iter().map(turned).collect();
    (object.turned(&axes), grasps)
}

/// ACRONYM files given by name or by directory, sorted.
fn files(names: &[String]) -> Result<Vec<PathBuf>, Failure> {
    let mut found = BTreeSet::new();
    for name in names {
        let path = PathBuf::from(name);
        if !path.is_dir() {
            found.insert(path);
            continue;
        }
        let listing = fs::read_dir(&path)
            .map_err(|e| Failure::input(format!("cannot read {}: {e}", path.display())))?;
        let before = found.len();
        for entry in listing.filter_map(Result::ok) {
            if entry.path().extension().is_some_and(|e| e == "h5") {
                found.insert(entry.path());
            }
        }
        if found.len() == before {
            return Err(Failure::input(format!(
                "{}: there is no .h5 file in it; give the directory of the grasp files",
                path.display()
            )));
        }
    }
    Ok(found.into_iter().collect())
}

/// Which grasps held in earlier runs.
struct Held(Option<BTreeMap<String, BTreeSet<u64>>>);

impl Held {
    fn read(runs: &[PathBuf]) -> Result<Self, Failure> {
        if runs.is_empty() {
            return Ok(Self(None));
        }
        let mut held: BTreeMap<String, BTreeSet<u64>> = BTreeMap::new();
        for run in runs {
            let name = run.display().to_string();
            let tries = Results::open(&name)?.tries(Metric::Held).ok_or_else(|| {
                Failure::input(format!(
                    "{name}: no trial was run in it; run the physics stage"
                ))
            })?;
            for (object, grasps) in tries {
                let good = grasps.iter().filter(|t| t.success).map(|t| t.grasp);
                held.entry(object).or_default().extend(good);
            }
        }
        Ok(Self(Some(held)))
    }

    fn allows(&self, object: &str, grasp: u64) -> bool {
        match &self.0 {
            None => true,
            Some(held) => held.get(object).is_some_and(|s| s.contains(&grasp)),
        }
    }
}
