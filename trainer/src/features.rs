//! What does the network see of one pose? The same numbers as the exported graph computes.

use nalgebra::Isometry3;
use shakedown_objects::{NormalisedSdf, Probe};

use crate::activation::tanh;
use crate::moments::{self, Moments};
use crate::preset::NetworkPreset;

/// Lengths inside the network are in decimetres, the size of a hand.
pub const LENGTH_UNIT_M: f32 = 0.1;

/// Distances at the control points enter as `tanh(d / w)` for both widths (metres): one resolves
/// contact, the other the way there.
pub const DISTANCE_WIDTHS_M: [f32; 2] = [0.01, 0.05];

/// Time enters as itself and as sine and cosine of these multiples of pi.
pub const TIME_FREQUENCIES: [f32; 4] = [1.0, 2.0, 4.0, 8.0];

/// Normalised distances about which the soft histogram counts.
pub const HISTOGRAM_CENTRES: [f32; 16] = [
    -0.3, -0.2, -0.12, -0.08, -0.05, -0.03, -0.015, 0.0, 0.015, 0.03, 0.06, 0.12, 0.2, 0.35, 0.5,
    0.7,
];

/// Steepness of its steps, 1 / normalised distance.
pub const HISTOGRAM_STEEPNESS: f32 = 60.0;

/// Share of the grid below each centre, softened: mean of `1 / (1 + exp(k (d - c)))`. It is the
/// same for every orientation of the object, up to the grid's resolution.
pub fn histogram(values: &[f32], centres: &[f32]) -> Vec<f32> {
    centres
        .iter()
        .map(|c| {
            let sum: f64 = values
                .iter()
                .map(|d| f64::from(1.0 / (1.0 + (HISTOGRAM_STEEPNESS * (d - c)).exp())))
                .sum();
            (sum / values.len() as f64) as f32
        })
        .collect()
}

/// Points fixed to the hand (tcp frame, metres; x closing, z approach). Some fill the open fingers
/// and the palm, so that a distance below the spacing tells a collision; some fill the space
/// between the pads; a coarse grid says what lies around.
pub fn control_points_m() -> Vec<[f64; 3]> {
    let mut points = Vec::new();
    let mut grid = |xs: &[f64], ys: &[f64], zs: &[f64]| {
        for x in xs {
            for y in ys {
                for z in zs {
                    points.push([*x, *y, *z]);
                }
            }
        }
    };
    let fingers = [-0.054, -0.047, -0.041, 0.041, 0.047, 0.054];
    grid(
        &fingers,
        &[-0.009, 0.0, 0.009],
        &[-0.038, -0.026, -0.014, -0.002, 0.008],
    );
    let across = [-0.09, -0.06, -0.03, 0.0, 0.03, 0.06, 0.09];
    grid(&across, &[-0.02, 0.0, 0.02], &[-0.095, -0.07, -0.046]);
    let between = [
        -0.032, -0.024, -0.016, -0.008, 0.0, 0.008, 0.016, 0.024, 0.032,
    ];
    grid(
        &between,
        &[-0.009, 0.0, 0.009],
        &[-0.026, -0.014, -0.002, 0.008],
    );
    let around = [-0.1, -0.05, 0.0, 0.05, 0.1];
    grid(&around, &around, &around);
    points
}

/// How many numbers describe a time.
pub const TIMES: usize = 1 + 2 * TIME_FREQUENCIES.len();

/// How many numbers say what can be seen from the hand; they come first.
pub fn seen_count() -> usize {
    DISTANCE_WIDTHS_M.len() * control_points_m().len() + 3 + 1
}

/// How many numbers describe one pose and time.
pub fn count(network: &NetworkPreset) -> usize {
    let pose = if network.hand_frame {
        seen_count()
    } else {
        9 + 3
    };
    let moments = if network.moments { moments::COUNT } else { 0 };
    pose + TIMES + moments
}

/// Writes what can be seen from the hand in a pose (normalised frame): distances at the points of `probe`
/// ([`control_points_m`]), the grid's centre, the scale. Returns what of `out` comes after it.
pub fn from_the_hand<'o>(
    probe: &Probe,
    sdf: &NormalisedSdf,
    pose: &Isometry3<f32>,
    out: &'o mut [f32],
) -> &'o mut [f32] {
    let scale_m = sdf.scale_m as f32;
    let rotation = pose.rotation.to_rotation_matrix();
    let t = pose.translation.vector;
    let (first, rest) = out.split_at_mut(probe.len());
    let (second, rest) = rest.split_at_mut(probe.len());
    sdf.at_probe(probe, &(rotation.matrix() / scale_m), &t, first);
    second.copy_from_slice(first);
    for (part, width) in [first, second].into_iter().zip(DISTANCE_WIDTHS_M) {
        tanh(part, scale_m / width);
    }
    let (centre_and_scale, after) = rest.split_at_mut(3 + 1);
    let centre = rotation.inverse() * t * (scale_m / LENGTH_UNIT_M);
    centre_and_scale[..3].copy_from_slice(centre.as_slice());
    centre_and_scale[3] = (scale_m / LENGTH_UNIT_M).ln();
    after
}

/// Writes the features of a pose (normalised frame) at a time into `out`; `probe` holds the
/// [`control_points_m`], `moments` are those of the grid in its own axes.
pub fn write(
    network: &NetworkPreset,
    probe: &Probe,
    (sdf, moments): (&NormalisedSdf, &Moments),
    pose: &Isometry3<f32>,
    time: f32,
    out: &mut [f32],
) {
    let rotation = pose.rotation.to_rotation_matrix();
    let rest = if network.hand_frame {
        from_the_hand(probe, sdf, pose, out)
    } else {
        let (seen, rest) = out.split_at_mut(9 + 3);
        let entries = rotation.matrix().transpose();
        seen[..9].copy_from_slice(entries.as_slice());
        seen[9..].copy_from_slice(pose.translation.vector.as_slice());
        rest
    };
    let (times, rest) = rest.split_at_mut(TIMES);
    times[0] = time;
    for (k, f) in TIME_FREQUENCIES.into_iter().enumerate() {
        let phase = std::f32::consts::PI * f * time;
        times[1 + k] = phase.sin();
        times[1 + TIME_FREQUENCIES.len() + k] = phase.cos();
    }
    if network.moments {
        let unit = sdf.scale_m as f32 / LENGTH_UNIT_M;
        let along = moments.along(rotation.matrix());
        for (out, m) in rest.iter_mut().zip(along.0.as_flattened()) {
            *out = m * unit;
        }
    }
}
