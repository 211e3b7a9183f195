//! One batch: noise, a point on the way to a grasp, and the velocity there.
//!
//! Paths and targets are RFMGrasp's eq. 5 and 7, `t(s) = t0 + s (t1 - t0)` and
//! `R(s) = R0 exp(s log(R0^T R1))`. Their velocities are constant along the way, `t1 - t0` and
//! `log(R0^T R1)` in the body frame; the targets printed as eq. 8 and 9 divide by `s` and are not
//! the derivatives of these paths.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use shakedown_objects::{NormalisedSdf, Probe};
use shakedown_sampler::seed;

use crate::coupling;
use crate::data::{Pair, TrainingObject};
use crate::features::{self, LENGTH_UNIT_M};
use crate::pairing;
use crate::preset::{Encoder, Preset};

/// Arrays of one batch, row-major; `G` objects with `K` trajectories each.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Batch {
    /// What the encoder reads: `[G, D, D, D]` or `[G, bins]`.
    pub grids: Vec<f32>,
    /// `[G]`.
    pub scale_m: Vec<f32>,
    /// `[G K, F]`.
    pub features: Vec<f32>,
    /// `[G K, 6]`: angular velocity (body frame, rad), translation velocity (normalised frame, or
    /// hand frame in decimetres).
    pub targets: Vec<f32>,
}

/// Builds batches of a data set; batch `step` depends on the seed and the step alone.
pub struct Batches<'a> {
    preset: &'a Preset,
    objects: &'a [TrainingObject],
    probe: Probe,
    /// Sums of the objects' shares, times their difficulties where a teacher has shown them.
    up_to: Vec<f32>,
    run_seed: u64,
}

/// From where to where one trajectory leads, both in the frame of the grid.
struct Way {
    from: Isometry3<f32>,
    to: Isometry3<f32>,
    /// Time at `from`; at 1 it is at `to`.
    start: f32,
    /// Times that are learned.
    within: [f32; 2],
}

struct Part {
    grid: Vec<f32>,
    scale_m: f32,
    features: Vec<f32>,
    targets: Vec<f32>,
}

impl<'a> Batches<'a> {
    /// Batches of `objects`, each of which has grasps, and couplings if the preset wants them.
    ///
    /// # Panics
    /// If one lacks them.
    pub fn new(preset: &'a Preset, objects: &'a [TrainingObject], run_seed: u64) -> Self {
        assert!(
            preset.flow.couplings == 0 || objects.iter().all(|o| !o.couplings.is_empty()),
            "the preset wants couplings"
        );
        let is_taught = objects.iter().any(|o| !o.pairs.is_empty());
        let mut sum = 0.0;
        let up_to = objects.iter().map(|o| {
            sum += o.share * if is_taught { o.difficulty() } else { 1.0 };
            sum
        });
        Self {
            up_to: up_to.collect(),
            preset,
            objects,
            probe: Probe::new(&features::control_points_m()),
            run_seed,
        }
    }

    /// Batch number `step`.
    pub fn batch(&self, step: u64) -> Batch {
        let mut chosen = seed::stream(self.run_seed, "batch-v1", "", "", step);
        let picks: Vec<usize> = (0..self.preset.training.objects_per_batch)
            .map(|_| {
                let sum = self.up_to.last().expect("there are objects");
                let at = sum * chosen.random::<f32>();
                let pick = self.up_to.partition_point(|u| *u <= at);
                pick.min(self.objects.len() - 1)
            })
            .collect();
        let parts: Vec<Part> = picks
            .par_iter()
            .enumerate()
            .map(|(slot, &pick)| {
                let name = format!("slot{slot}");
                let mut rng = seed::stream(self.run_seed, "batch-v1", &name, "", step);
                self.part(&self.objects[pick], &mut rng)
            })
            .collect();
        let mut batch = Batch::default();
        for part in parts {
            batch.grids.extend(part.grid);
            batch.scale_m.push(part.scale_m);
            batch.features.extend(part.features);
            batch.targets.extend(part.targets);
        }
        batch
    }

    fn part(&self, object: &TrainingObject, rng: &mut ChaCha8Rng) -> Part {
        let (network, flow) = (&self.preset.network, &self.preset.flow);
        let turned = flow
            .random_rotation
            .then(|| turn(&object.sdf, seed::uniform_rotation(rng).cast()));
        let (sdf, moments, rotation) = match &turned {
            Some((sdf, rotation)) => {
                let back = rotation.inverse().to_rotation_matrix();
                (sdf, object.moments.along(back.matrix()), *rotation)
            }
            None => (&object.sdf, object.moments, UnitQuaternion::identity()),
        };
        let turned_by = Isometry3::from_parts(Translation3::identity(), rotation);
        let scale_m = sdf.scale_m as f32;
        let k = self.preset.training.grasps_per_object;
        let unit = if network.hand_frame {
            scale_m / LENGTH_UNIT_M
        } else {
            1.0
        };
        // With pairs, half of the trajectories are theirs, and the others end where they begin.
        let until = object.pairs_from();
        let drawn = match until {
            0.0 => 0,
            1.0 => k,
            _ => k / 2,
        };
        let mut ways = self.drawn(object, &turned_by, unit, drawn, until, rng);
        while ways.len() < k {
            let pair = drawn_pair(object, rng);
            ways.push(Way {
                from: turned_by * pair.from,
                to: turned_by * pair.to,
                start: pair.time,
                within: [pair.time, 1.0],
            });
        }
        let width = features::count(network);
        let mut features = vec![0.0; k * width];
        let mut targets = Vec::with_capacity(6 * k);
        for (i, way) in ways.iter().enumerate() {
            let Way { from, to, .. } = way;
            let to = if flow.nearer_flip {
                pairing::nearer_flip(from, to)
            } else {
                *to
            };
            let [low, high] = way.within;
            let time = low + (high - low) * rng.random::<f32>();
            let left = 1.0 - way.start;
            let omega = rotation_between(&from.rotation, &to.rotation) / left;
            let velocity = (to.translation.vector - from.translation.vector) / left;
            let s = time - way.start;
            let here = Isometry3::from_parts(
                Translation3::from(from.translation.vector + velocity * s),
                from.rotation * UnitQuaternion::new(omega * s),
            );
            let out = &mut features[i * width..(i + 1) * width];
            features::write(network, &self.probe, (sdf, &moments), &here, time, out);
            let v = if network.hand_frame {
                here.rotation.inverse() * velocity * unit
            } else {
                velocity
            };
            targets.extend(omega.iter().chain(v.iter()));
        }
        let grid = match network.encoder {
            Encoder::Conv => sdf.values.clone(),
            Encoder::Histogram => object.histogram.clone(),
        };
        Part {
            grid,
            scale_m,
            features,
            targets,
        }
    }

    /// Fresh noise and random grasps of an object, paired as the preset says; times up to `until`.
    fn drawn(
        &self,
        object: &TrainingObject,
        turned_by: &Isometry3<f32>,
        unit: f32,
        count: usize,
        until: f32,
        rng: &mut ChaCha8Rng,
    ) -> Vec<Way> {
        let (flow, training) = (&self.preset.flow, &self.preset.training);
        let way = |(from, to)| Way {
            from,
            to,
            start: 0.0,
            within: [0.0, until],
        };
        let coupled = &object.couplings;
        if !coupled.is_empty() {
            let of = |_| coupled[rng.random_range(0..coupled.len())].map(|pose| turned_by * pose);
            return (0..count)
                .map(of)
                .map(|[from, to]| way((from, to)))
                .collect();
        }
        let mut grasps: Vec<Isometry3<f32>> = (0..count)
            .map(|_| {
                let mut pose = object.poses[rng.random_range(0..object.poses.len())];
                if rng.random::<bool>() {
                    pose.rotation *= pairing::half_turn();
                }
                turned_by * pose
            })
            .collect();
        let noise: Vec<Isometry3<f32>> = (0..count)
            .map(|_| coupling::noise(flow, None, rng))
            .collect();
        if flow.optimal_transport {
            let order = pairing::optimal(&noise, &grasps, unit, training.translation_weight);
            grasps = order.into_iter().map(|j| grasps[j]).collect();
        }
        noise.into_iter().zip(grasps).map(way).collect()
    }
}

/// A pair of an object: one that mends something with the probability of its difficulty.
fn drawn_pair(object: &TrainingObject, rng: &mut ChaCha8Rng) -> Pair {
    let (mended, straight) = object.mended_and_straight();
    let prefers_mended = rng.random::<f32>() < object.difficulty();
    let pairs = match (mended.is_empty(), straight.is_empty()) {
        (true, _) => straight,
        (_, true) => mended,
        _ if prefers_mended => mended,
        _ => straight,
    };
    pairs[rng.random_range(0..pairs.len())]
}

/// `log(a^T b)`: through the quaternion, exact to f32 at every angle, where the arc cosine of the
/// trace loses all digits near half a turn.
fn rotation_between(a: &UnitQuaternion<f32>, b: &UnitQuaternion<f32>) -> Vector3<f32> {
    (a.inverse() * b).scaled_axis()
}

/// The grid of the object turned by `rotation` about the grid's centre, and that rotation.
fn turn(
    sdf: &NormalisedSdf,
    rotation: UnitQuaternion<f32>,
) -> (NormalisedSdf, UnitQuaternion<f32>) {
    let n = sdf.resolution;
    let back = rotation.inverse().to_rotation_matrix();
    let node = |i: usize| sdf.half_edge * (2.0 * i as f32 / (n - 1) as f32 - 1.0);
    let mut values = Vec::with_capacity(n.pow(3));
    for x in 0..n {
        for y in 0..n {
            for z in 0..n {
                let q = back * Vector3::new(node(x), node(y), node(z));
                values.push(sdf.at([q.x, q.y, q.z]));
            }
        }
    }
    let turned = NormalisedSdf { values, ..*sdf };
    (turned, rotation)
}
