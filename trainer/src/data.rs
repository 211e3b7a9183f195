//! What is learned from? Objects as distance grids, with the grasps that held.

use nalgebra::Isometry3;
use shakedown_gripper_assets::{Grasp, HandFrame};
use shakedown_objects::{NormalisedSdf, SdfGrid, Surface};
use shakedown_sampler::FlowSample;

use crate::error::TrainError;
use crate::features::{HISTOGRAM_CENTRES, LENGTH_UNIT_M};
use crate::pairing;
use crate::preset::Preset;

/// One object with good grasps, as the trainer keeps it.
#[derive(Debug, Clone)]
pub struct TrainingObject {
    /// Identity.
    pub id: String,
    /// The grid the network sees.
    pub sdf: NormalisedSdf,
    /// Soft histogram of that grid, see [`crate::features::histogram`].
    pub histogram: Vec<f32>,
    /// Poses of the model's frame in the normalised frame of the grid.
    pub poses: Vec<Isometry3<f32>>,
    /// Noise with the grasp that it shall become, both in that frame; empty: drawn and paired anew
    /// in every batch.
    pub pairs: Vec<(Isometry3<f32>, Isometry3<f32>)>,
}

impl TrainingObject {
    /// Bakes the grid of a surface and turns `grasps` (all of them good) into the model's frame.
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
        let hand_from_frame = frame.hand_from_this(tcp_z_m);
        let poses = grasps
            .iter()
            .map(|g| {
                let pose = g.object_from_hand * hand_from_frame;
                let translation = (pose.translation.vector - sdf.centre_m.coords) / sdf.scale_m;
                Isometry3::from_parts(translation.cast::<f32>().into(), pose.rotation.cast())
            })
            .collect();
        let histogram = crate::features::histogram(&sdf.values, &HISTOGRAM_CENTRES);
        Ok(Self {
            id: id.to_owned(),
            sdf,
            histogram,
            poses,
            pairs: Vec::new(),
        })
    }

    /// Fixes the pairing (rectified flow: X. Liu, C. Gong, Q. Liu, ICLR 2023): each noise goes where
    /// a trained model took it, or, where that was no good grasp, to the nearest one that is.
    ///
    /// `ends` are noise, end, and whether the end is good. With straight paths that do not cross,
    /// few steps suffice; and what the teacher got wrong is what is learned.
    pub fn rectify(&mut self, ends: &[(FlowSample, FlowSample, bool)], translation_weight: f32) {
        let pose = |s: &FlowSample| {
            Isometry3::from_parts(s.translation.cast::<f32>().into(), s.rotation.cast())
        };
        let unit = self.sdf.scale_m as f32 / LENGTH_UNIT_M;
        self.pairs = ends
            .iter()
            .map(|(noise, end, is_good)| {
                let (noise, end) = (pose(noise), pose(end));
                let to = if *is_good {
                    end
                } else {
                    pairing::nearest(&end, &self.poses, unit, translation_weight)
                };
                (noise, to)
            })
            .collect();
    }
}
