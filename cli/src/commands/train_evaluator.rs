//! `shakedown train --evaluator-for MODEL`: a network that judges the grasps that a flow draws.

use std::sync::Mutex;

use rayon::prelude::*;
use shakedown_gripper_assets::{Grasp, Gripper};
use shakedown_metrics::agreement::auroc;
use shakedown_objects::{Object, Probe};
use shakedown_sampler::{Centring, EvaluatorCard, FlowModel, ModelCard, ModelFiles};
use shakedown_sim::Protocol;
use shakedown_trainer::evaluator::{
    Evaluator, EvaluatorPreset, TriedObject, look, train_evaluator,
};
use shakedown_trainer::features::control_points_m;
use shakedown_trainer::network::Parameter;
use shakedown_trainer::{Preset, TrainingObject, export};

use crate::args::Global;
use crate::args_judging::TrainArgs;
use crate::commands::train::command_line;
use crate::failure::{Exit, Failure};
use crate::progress;
use crate::stretched;
use crate::teacher::Approval;
use crate::training_data::{Source, kept, scene, snug, sources};

/// Steps between two looks at the objects that were held out.
const VALIDATION_STEPS: u64 = 2000;

/// Shares of a model's grasps that are kept in the table at the end.
const KEPT: [f64; 5] = [1.0, 0.9, 0.8, 0.6, 0.4];

pub fn run(
    global: &Global,
    args: &TrainArgs,
    model: &str,
    gripper: &Gripper,
    protocol: &Protocol,
) -> Result<Exit, Failure> {
    let files = ModelFiles::find(model)?;
    let mut flow = FlowModel::open(&files, args.ort.as_deref())?;
    if let Some(steps) = args.draw_steps {
        flow.card.steps = steps.get();
    }
    let mut card = flow.card.clone();
    let seen = what_it_sees(&flow, model)?;
    let mut preset = EvaluatorPreset::built_in();
    if let Some(steps) = args.steps {
        preset.training.steps = steps.max(1);
    }
    if let Some(rate) = args.learning_rate {
        preset.training.learning_rate = rate;
    }
    let maker = Maker {
        global,
        args,
        gripper,
        protocol,
        seen: &seen,
        model: flow.hash.clone(),
        flow: Mutex::new(flow),
    };
    let (learned, held_out) = maker.objects()?;
    let count = |objects: &[TriedObject], good: bool| -> usize {
        let ends = objects.iter().flat_map(|o| &o.ends);
        ends.filter(|e| e.1 || !good).count()
    };
    let description = format!(
        "{} grasps of its own on {} objects, {} good and held in our own trial ({})",
        count(&learned, false),
        learned.len(),
        count(&learned, true),
        protocol.version
    );
    progress::note(global, &description);
    let bar = progress::bar(global, preset.training.steps);
    bar.set_message("evaluator");
    let weights = train_evaluator(&preset, &learned, global.seed, |step, loss, now| {
        bar.set_position(step);
        if step.is_multiple_of(50) {
            bar.set_message(format!("evaluator {loss:.3}"));
        }
        if step.is_multiple_of(VALIDATION_STEPS) && !held_out.is_empty() && !global.quiet {
            let judged = judged(&now.averaged(), &held_out);
            let area = auroc(&judged).unwrap_or(f64::NAN);
            bar.suspend(|| eprintln!("step {step}: AUROC {area:.3} on objects held out"));
        }
    })?;
    bar.finish_and_clear();
    let (name, objects) = match held_out.is_empty() {
        true => ("training_objects", &learned),
        false => ("held_out_objects", &held_out),
    };
    let judged = judged(&weights, objects);
    let area = auroc(&judged).unwrap_or(f64::NAN);
    println!("evaluator: AUROC {area:.3} ({name})");
    report(judged);
    card.evaluator = Some(EvaluatorCard {
        least_score: args.least_score,
        redraws: args.redraws,
    });
    forget_evaluator(&mut card);
    card.training_data += &format!("{ITS_EVALUATOR}{description}");
    card.command += &format!("; {}", command_line());
    card.metrics.insert(format!("{name}_evaluator_auroc"), area);
    if let Some(name) = &args.name {
        card.name.clone_from(name);
    }
    if let Some(licence) = &args.licence {
        card.licence.clone_from(licence);
    }
    export::add_evaluator(&args.out, &files, &card, &weights)?;
    println!("model: {}", args.out.display());
    Ok(Exit::Success)
}

/// What a card says of its evaluator's data.
const ITS_EVALUATOR: &str = "; its evaluator: ";

/// Takes out what the card says of an evaluator that is replaced.
fn forget_evaluator(card: &mut ModelCard) {
    if let Some(at) = card.training_data.find(ITS_EVALUATOR) {
        card.training_data.truncate(at);
    }
    let commands = card.command.split("; ");
    let of_flow: Vec<&str> = commands
        .filter(|c| !c.contains("--evaluator-for"))
        .collect();
    card.command = of_flow.join("; ");
    card.metrics
        .retain(|name, _| !name.ends_with("_evaluator_auroc"));
}

/// The preset under which our features are what this model sees.
fn what_it_sees(model: &FlowModel, name: &str) -> Result<Preset, Failure> {
    let card = &model.card;
    if card.control_points_m != control_points_m() {
        return Err(Failure::input(format!(
            "{name}: an evaluator sees an object from the hand, at the control points of the preset \
             `best`; this model has others or none"
        )));
    }
    let mut preset = Preset::load("best")?;
    let flow = &mut preset.flow;
    flow.frame.clone_from(&card.frame);
    flow.resolution = card.resolution;
    flow.padding = card.padding;
    flow.centring = card.centring;
    flow.normalisation = card.normalisation;
    flow.steps = card.steps;
    flow.integrator = card.integrator;
    preset.check()?;
    Ok(preset)
}

/// Draws and tries.
struct Maker<'a> {
    global: &'a Global,
    args: &'a TrainArgs,
    gripper: &'a Gripper,
    protocol: &'a Protocol,
    seen: &'a Preset,
    /// Hash of the flow's files.
    model: String,
    flow: Mutex<FlowModel>,
}

impl Maker<'_> {
    /// Objects to learn from, and those held out.
    fn objects(&self) -> Result<(Vec<TriedObject>, Vec<TriedObject>), Failure> {
        let (args, sources) = (self.args, sources(self.args)?);
        let every = match args.hold_out {
            0 => usize::MAX,
            n => sources.len().div_ceil(n),
        };
        let bar = progress::bar(self.global, sources.len() as u64);
        bar.set_message("drawn and tried");
        let made: Vec<(bool, Vec<TriedObject>)> = sources
            .par_iter()
            .enumerate()
            .map(|(i, source)| {
                let is_held_out = args.hold_out > 0 && i % every == 0;
                let copies = if is_held_out { 0 } else { args.stretched };
                let tried = self.tried(source, copies)?;
                bar.inc(1);
                Ok((is_held_out, tried))
            })
            .collect::<Result<_, Failure>>()?;
        bar.finish_and_clear();
        let (held_out, learned): (Vec<_>, Vec<_>) = made.into_iter().partition(|m| m.0);
        let all = |made: Vec<(bool, Vec<TriedObject>)>| made.into_iter().flat_map(|m| m.1);
        Ok((all(learned).collect(), all(held_out).collect()))
    }

    /// An object and stretched copies of it.
    fn tried(&self, source: &Source, copies: u64) -> Result<Vec<TriedObject>, Failure> {
        let object = source.object(self.args)?;
        let mut all = vec![self.tried_object(&object)?];
        for index in 0..copies {
            let copy = stretched::copy(&object, index, self.global.seed);
            all.push(self.tried_object(&copy)?);
        }
        Ok(all)
    }

    fn tried_object(&self, object: &Object) -> Result<TriedObject, Failure> {
        // What lies there of another model, in other steps or of another trial, is not taken for this one's.
        let file = format!(
            "{}-{}-{}-{}-{}-{}",
            object.id,
            self.args.paths,
            self.global.seed,
            &self.model[..8],
            self.seen.flow.steps,
            self.protocol.version
        );
        let grasps = kept(&self.args.out, &file, || self.draw_and_try(object))?;
        let boxed = (self.seen.flow.centring == Centring::SnugBox).then(|| snug(object, &grasps));
        let (object, grasps) = match &boxed {
            Some((object, grasps)) => (object, grasps),
            None => (object, &grasps),
        };
        let (id, surface, tcp_z_m) = (&object.id, &object.surface, self.gripper.tcp_z_m);
        let shown = TrainingObject::new(id, surface, grasps, tcp_z_m, self.seen)?;
        let labels = grasps.iter().map(|g| g.label == Some(true));
        Ok(TriedObject {
            ends: shown.poses.into_iter().zip(labels).collect(),
            sdf: shown.sdf,
        })
    }

    /// A grasp is good if geometry and a trial say so.
    fn draw_and_try(&self, object: &Object) -> Result<Vec<Grasp>, Failure> {
        let mut flow = self.flow.lock().expect("nobody panics while holding it");
        let paths = flow.paths(
            object,
            self.gripper,
            self.args.paths,
            self.global.seed,
            None,
        )?;
        drop(flow);
        let scene = scene(object, self.gripper, self.protocol)?;
        let approval = Approval::new(object, self.gripper, 0.0)?.with_trial(scene);
        Ok(paths
            .into_par_iter()
            .enumerate()
            .map(|(i, path)| {
                let mut grasp = Grasp::new(i as u64, path.object_from_hand);
                grasp.label = Some(approval.is_good(&path.object_from_hand));
                grasp
            })
            .collect())
    }
}

/// Scores (logits) of all grasps, with what became of them.
fn judged(weights: &[Parameter], objects: &[TriedObject]) -> Vec<(f64, bool)> {
    let probe = Probe::new(&control_points_m());
    objects
        .par_iter()
        .flat_map_iter(|object| {
            let mut features = Vec::new();
            let poses = object.ends.iter().map(|e| e.0);
            look(&probe, &object.sdf, poses, &mut features);
            let mut evaluator = Evaluator::default();
            let logits = evaluator.forward(weights, &features).to_vec();
            let good = object.ends.iter().map(|e| e.1);
            logits.into_iter().map(f64::from).zip(good)
        })
        .collect()
}

/// What is good among the best of all, and from which score on.
fn report(mut judged: Vec<(f64, bool)>) {
    judged.sort_by(|a, b| b.0.total_cmp(&a.0));
    println!("  kept   good   from score");
    for share in KEPT {
        let n = ((share * judged.len() as f64) as usize).clamp(1, judged.len());
        let good = judged[..n].iter().filter(|j| j.1).count() as f64 / n as f64;
        let score = 1.0 / (1.0 + (-judged[n - 1].0).exp());
        println!(
            "  {:3.0} %  {:5.1} %  {score:.3}",
            100.0 * share,
            100.0 * good
        );
    }
}
