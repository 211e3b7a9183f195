//! What is learned from? Objects as distance grids, with the grasps that held.

use nalgebra::Isometry3;
use shakedown_gripper_assets::{Grasp, HandFrame};
use shakedown_objects::{NormalisedSdf, SdfGrid, Surface};
use shakedown_sampler::FlowSample;

use crate::error::TrainError;
use crate::features::{HISTOGRAM_CENTRES, LENGTH_UNIT_M};
use crate::moments::Moments;
use crate::pairing;
use crate::preset::Preset;

/// One object with good grasps, as the trainer keeps it.
#[derive(Debug, Clone)]
pub struct TrainingObject {
    /// Identity.
    pub id: String,
    /// How often it is drawn, beside others: 1, or less for one of several copies.
    pub share: f32,
    /// The grid the network sees.
    pub sdf: NormalisedSdf,
    /// The model's frame on the hand.
    pub frame: HandFrame,
    /// Soft histogram of that grid, see [`crate::features::histogram`].
    pub histogram: Vec<f32>,
    /// Moments of the same grid.
    pub moments: Moments,
    /// Poses of the model's frame in the normalised frame of the grid.
    pub poses: Vec<Isometry3<f32>>,
    /// Noise with the grasps that it shall become, both in that frame; where there is none, noise is drawn
    /// and paired anew in every batch.
    pub couplings: Vec<[Isometry3<f32>; 2]>,
    /// Poses on their way with the grasps that they shall become, both in that frame. What comes
    /// before the earliest of their times, or all where there are none, is drawn and paired anew in
    /// every batch. Those that are mended come first.
    pub pairs: Vec<Pair>,
}

impl TrainingObject {
    /// Bakes the grid of a surface and turns `grasps` (all of them good) into the model's frame. Surface
    /// and grasps are in the axes that the preset's centring wants.
    ///
    /// # Errors
    /// A preset with an unknown frame.
    pub fn new(
        id: &str,
        surface: &Surface,
        grasps: &[Grasp],
        tcp_z_m: f64,
        preset: &Preset,
    ) -> Result<Self, TrainError> {
        let flow = &preset.flow;
        let frame: HandFrame = flow.frame.parse().map_err(TrainError::Data)?;
        let grid = SdfGrid::bake(surface, flow.resolution, flow.padding);
        let sdf = NormalisedSdf::new(&grid, flow.normalisation);
        let histogram = crate::features::histogram(&sdf.values, &HISTOGRAM_CENTRES);
        let moments = Moments::new(&sdf.values, sdf.resolution);
        let mut object = Self {
            id: id.to_owned(),
            share: 1.0,
            sdf,
            frame,
            histogram,
            moments,
            poses: Vec::new(),
            couplings: Vec::new(),
            pairs: Vec::new(),
        };
        let pose = |g: &Grasp| object.normalised(&g.object_from_hand, tcp_z_m);
        object.poses = grasps.iter().map(pose).collect();
        Ok(object)
    }

    /// A pose of the ACRONYM hand frame in the model's frame and the normalised frame of the grid.
    fn normalised(&self, object_from_hand: &Isometry3<f64>, tcp_z_m: f64) -> Isometry3<f32> {
        let pose = object_from_hand * self.frame.hand_from_this(tcp_z_m);
        let centre = self.sdf.centre_m.coords;
        let translation = (pose.translation.vector - centre) / self.sdf.scale_m;
        Isometry3::from_parts(translation.cast::<f32>().into(), pose.rotation.cast())
    }

    /// Fixes the pairing from some time on (rectified flow: X. Liu, C. Gong, Q. Liu, ICLR 2023): a
    /// pose on the way goes where a trained model took it, or, where that was no good grasp, to the
    /// nearest that is: a known one, another good end, or the one found close by.
    ///
    /// With straight paths that do not cross, few steps suffice; and what the teacher got wrong is
    /// what is learned.
    pub fn rectify(&mut self, paths: &[TaughtPath], translation_weight: f32, tcp_z_m: f64) {
        let pose = |s: &FlowSample| {
            Isometry3::from_parts(s.translation.cast::<f32>().into(), s.rotation.cast())
        };
        let unit = self.sdf.scale_m as f32 / LENGTH_UNIT_M;
        let mut good = self.poses.clone();
        good.extend(paths.iter().filter(|p| p.is_good).map(|p| pose(&p.end)));
        self.pairs = paths
            .iter()
            .map(|path| {
                let end = pose(&path.end);
                let to = if path.is_good {
                    end
                } else {
                    let close_by = path.close_by.map(|g| self.normalised(&g, tcp_z_m));
                    let known = pairing::nearest(&end, &good, unit, translation_weight);
                    let both: Vec<_> = close_by.into_iter().chain([known]).collect();
                    pairing::nearest(&end, &both, unit, translation_weight)
                };
                Pair {
                    time: path.time,
                    from: pose(&path.from),
                    to,
                    is_mended: !path.is_good,
                }
            })
            .collect();
        // What is mended comes first.
        self.pairs.sort_by_key(|p| !p.is_mended);
    }

    /// The pairs that mend something, and the others.
    pub fn mended_and_straight(&self) -> (&[Pair], &[Pair]) {
        let mended = self.pairs.partition_point(|p| p.is_mended);
        self.pairs.split_at(mended)
    }

    /// How much is left to learn here: the standard deviation of "this path is mended",
    /// `sqrt(f (1 - f))`, in proportion to which a stratified sample is best drawn (J. Neyman, Journal of
    /// the Royal Statistical Society 97, 1934). The share f is smoothed, so that no object is forgotten.
    pub fn difficulty(&self) -> f32 {
        let mended = self.mended_and_straight().0.len() as f32;
        let share = (mended + 1.0) / (self.pairs.len() as f32 + 2.0);
        (share * (1.0 - share)).sqrt()
    }

    /// The earliest time of a pair; 1 without pairs.
    pub fn pairs_from(&self) -> f32 {
        self.pairs.iter().map(|p| p.time).fold(1.0, f32::min)
    }
}

/// A pose on its way with the grasp that it shall become, normalised frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Time at `from`; 0: noise.
    pub time: f32,
    /// The pose.
    pub from: Isometry3<f32>,
    /// The grasp.
    pub to: Isometry3<f32>,
    /// Did the teacher end elsewhere, in no good grasp?
    pub is_mended: bool,
}

/// A path of a trained model, judged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TaughtPath {
    /// A time on the path.
    pub time: f32,
    /// The pose at that time.
    pub from: FlowSample,
    /// The end.
    pub end: FlowSample,
    /// Is the end a good grasp?
    pub is_good: bool,
    /// If not: a good grasp close to it, ACRONYM frame, where one was found.
    pub close_by: Option<Isometry3<f64>>,
}
