//! The grasps of one object: read or drawn, then chosen by `--limit`.

use shakedown_gripper_assets::{Grasp, Gripper, ReadOptions, read_grasps};
use shakedown_objects::Object;
use shakedown_sampler::{sample_antipodal, seed};

use crate::args::SourceArgs;
use crate::failure::Failure;
use crate::plan::Item;
use crate::settings::Source;

/// Grasps of an object and how many rotations had to be mended.
pub struct Selected {
    pub grasps: Vec<Grasp>,
    pub reorthonormalised: usize,
}

/// # Errors
/// An unreadable grasp file or a model that fails.
pub fn of_item(
    item: &Item,
    object: &Object,
    gripper: &Gripper,
    source: &Source,
    args: &SourceArgs,
    options: &ReadOptions,
    run_seed: u64,
) -> Result<Selected, Failure> {
    let drawn = |grasps| Selected {
        grasps,
        reorthonormalised: 0,
    };
    match (&item.grasps, source) {
        (Some(path), _) => {
            let file = read_grasps(path, options)?;
            Ok(Selected {
                grasps: file.grasps,
                reorthonormalised: file.reorthonormalised,
            })
        }
        (None, Source::Antipodal(settings)) => Ok(drawn(sample_antipodal(
            object,
            gripper,
            args.candidates,
            run_seed,
            settings,
        ))),
        #[cfg(feature = "onnx")]
        (None, Source::Model(model)) => {
            let mut model = model.lock().expect("nobody panics while holding it");
            let settings = shakedown_sampler::DrawSettings {
                steps: args.steps.map(std::num::NonZeroUsize::get),
                redraws: args.redraws,
            };
            let turn = args.turn_objects.then(|| {
                let mut rng = seed::stream(run_seed, "turn-v1", &object.id, "", 0);
                seed::uniform_rotation(&mut rng)
            });
            let turned = turn.map(|turn| object.turned(&turn));
            let shown = turned.as_ref().unwrap_or(object);
            let mut grasps = model.sample(shown, gripper, args.candidates, run_seed, settings)?;
            if let Some(turn) = turn {
                for grasp in &mut grasps {
                    grasp.object_from_hand = turn.inverse() * grasp.object_from_hand;
                }
            }
            Ok(drawn(grasps))
        }
        (None, Source::Files) => Err(Failure::internal("an item without grasps")),
    }
}

/// A random subset of at most `limit` grasps in their order. Every grasp has a rank of its own
/// from seed, object and number, so a larger limit only adds.
pub fn limit(grasps: &mut Vec<Grasp>, limit: Option<u64>, run_seed: u64, object: &str) {
    let Some(limit) = limit.map(|l| l as usize).filter(|l| *l < grasps.len()) else {
        return;
    };
    use rand::Rng as _;
    let mut ranked: Vec<(u64, usize)> = grasps
        .iter()
        .enumerate()
        .map(|(i, g)| {
            (
                seed::stream(run_seed, "limit-v1", object, "", g.index).next_u64(),
                i,
            )
        })
        .collect();
    ranked.sort_unstable();
    ranked.truncate(limit);
    let mut keep: Vec<usize> = ranked.into_iter().map(|(_, i)| i).collect();
    keep.sort_unstable();
    *grasps = keep.into_iter().map(|i| grasps[i]).collect();
}
