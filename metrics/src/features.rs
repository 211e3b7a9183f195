//! What is known of a grasp that could tell whether it holds? The inputs of `p_hold`.
//!
//! Geometry first (no simulation): what the pads will meet, how evenly, how far from the centre of
//! mass. Then what a trial measured, missing (NaN) where none ran.

use nalgebra::{Isometry3, Point3};
use shakedown_classifier::profile::{COLUMNS, Line, Profile, ROWS};
use shakedown_classifier::{HandModel, Verdict};
use shakedown_sim::{Label, Outcome, Stage};

/// What a feature needs to know of the object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectFacts {
    /// Mass in the trial, kg.
    pub mass_kg: f64,
    /// Centre of mass, object frame, metres.
    pub com_m: Point3<f64>,
    /// Longest extent, metres.
    pub extent_m: f64,
}

/// Names of the features, in their order.
pub const NAMES: [&str; GEOMETRIC + 9] = [
    "width_mm",
    "offset_mm",
    "angle_left_rad",
    "angle_right_rad",
    "contact_z_left_mm",
    "contact_z_right_mm",
    "lines_hit",
    "rows_hit",
    "first_row_hit",
    "patch_left_lines",
    "patch_right_lines",
    "patch_both_lines",
    "patch_deep_lines",
    "patch_row_mean",
    "patch_row_spread",
    "patch_column_spread",
    "patch_left_cosine",
    "patch_right_cosine",
    "patch_offset_y_mm",
    "patch_offset_z_mm",
    "depth_first_row_mm",
    "depth_middle_rows_mm",
    "palm_gap_mm",
    "com_x_mm",
    "com_y_mm",
    "com_z_mm",
    "com_lever_mm",
    "log_mass",
    "extent_mm",
    "wedge_rad",
    "row1_hits",
    "row1_left_mm",
    "row1_right_mm",
    "row2_hits",
    "row2_left_mm",
    "row2_right_mm",
    "row3_hits",
    "row3_left_mm",
    "row3_right_mm",
    "row4_hits",
    "row4_left_mm",
    "row4_right_mm",
    "row5_hits",
    "row5_left_mm",
    "row5_right_mm",
    "row6_hits",
    "row6_left_mm",
    "row6_right_mm",
    "row7_hits",
    "row7_left_mm",
    "row7_right_mm",
    "row8_hits",
    "row8_left_mm",
    "row8_right_mm",
    "row9_hits",
    "row9_left_mm",
    "row9_right_mm",
    "trial_held",
    "trial_stage",
    "trial_slip_mm",
    "trial_slip_rad",
    "trial_closing_mm",
    "trial_closing_rad",
    "trial_force_per_kg",
    "trial_width_mm",
    "trial_time_s",
];

/// The first so many features need no simulation.
pub const GEOMETRIC: usize = 57;

/// A contact patch is what lies within this of the first contact, metres: the rubber gives.
const PATCH_M: f64 = 0.001;
/// The part of a pad that FleX's labels ask for lies at least so far from its tip; rows counted.
const DEEP_ROW: usize = 2;

/// The features of one grasp; NaN where unknown.
pub fn features(
    hand: &HandModel,
    object: &ObjectFacts,
    object_from_hand: &Isometry3<f64>,
    verdict: &Verdict,
    profile: &Profile,
    outcome: Option<&Outcome>,
) -> [f32; NAMES.len()] {
    let mut values = [f64::NAN; NAMES.len()];
    if let Some(c) = &verdict.closing {
        values[0] = 1e3 * c.width_m();
        values[1] = 1e3 * c.offset_m();
        values[2] = c.angle_rad[0];
        values[3] = c.angle_rad[1];
        let tip = hand.region[1].z;
        values[4] = 1e3 * (tip - c.z_m[0]);
        values[5] = 1e3 * (tip - c.z_m[1]);
    }
    let com = object_from_hand.inverse_transform_point(&object.com_m);
    patches(&mut values, hand, profile, &com);
    values[23] = 1e3 * com.x;
    values[24] = 1e3 * com.y;
    values[25] = 1e3 * (com.z - hand.region[1].z);
    values[27] = object.mass_kg.ln();
    values[28] = 1e3 * object.extent_m;
    if let Some(o) = outcome {
        let some = |x: Option<f64>, unit: f64| x.map_or(f64::NAN, |x| unit * x);
        values[GEOMETRIC] = f64::from(u8::from(o.label == Label::Held));
        values[GEOMETRIC + 1] = match o.stage {
            Stage::Start => 0.0,
            Stage::Closing | Stage::Squeeze => 1.0,
            Stage::Settle | Stage::ShakeLinear | Stage::Tug | Stage::Lift => 2.0,
            Stage::ShakeAngular | Stage::Hardness => 3.0,
            Stage::Hold => 4.0,
        };
        values[GEOMETRIC + 2] = some(o.slip_linear_m, 1e3);
        values[GEOMETRIC + 3] = some(o.slip_angular_rad, 1.0);
        values[GEOMETRIC + 4] = some(o.closing_linear_m, 1e3);
        values[GEOMETRIC + 5] = some(o.closing_angular_rad, 1.0);
        values[GEOMETRIC + 6] = some(o.grip_force_n, 1.0 / object.mass_kg);
        values[GEOMETRIC + 7] = some(o.width_m, 1e3);
        values[GEOMETRIC + 8] = o.sim_s;
    }
    values.map(|v| v as f32)
}

/// What the lines say of both contact patches.
fn patches(values: &mut [f64], hand: &HandModel, profile: &Profile, com: &Point3<f64>) {
    let hits: Vec<(usize, usize, Line)> = (0..ROWS * COLUMNS)
        .filter_map(|i| {
            let (row, column) = (i / COLUMNS, i % COLUMNS);
            profile.lines[row][column].map(|l| (row, column, l))
        })
        .collect();
    values[6] = hits.len() as f64;
    values[7] = (0..ROWS).filter(|r| hits.iter().any(|h| h.0 == *r)).count() as f64;
    values[8] = hits.first().map_or(ROWS as f64, |h| h.0 as f64);
    // From the innermost row down to the palm there is free air.
    let deepest = hits.iter().map(|h| h.0).max();
    values[22] = deepest.map_or(f64::NAN, |r| 1e3 * (profile.row_z_m[r] - hand.region[0].z));
    if hits.is_empty() {
        return;
    }
    let first = [
        hits.iter().map(|h| h.2.x_m[0]).fold(f64::MAX, f64::min),
        hits.iter().map(|h| h.2.x_m[1]).fold(f64::MIN, f64::max),
    ];
    let in_patch = |side: usize, l: &Line| (l.x_m[side] - first[side]).abs() <= PATCH_M;
    let mut centre = [[0.0; 2]; 2];
    for side in 0..2 {
        let patch: Vec<_> = hits.iter().filter(|h| in_patch(side, &h.2)).collect();
        let n = patch.len() as f64;
        values[9 + side] = n;
        values[16 + side] = patch.iter().map(|h| h.2.cosine[side]).sum::<f64>() / n;
        centre[side] = [
            patch.iter().map(|h| profile.column_y_m[h.1]).sum::<f64>() / n,
            patch.iter().map(|h| profile.row_z_m[h.0]).sum::<f64>() / n,
        ];
    }
    let either: Vec<_> = hits
        .iter()
        .filter(|h| in_patch(0, &h.2) || in_patch(1, &h.2))
        .collect();
    let n = either.len() as f64;
    let both = |h: &&&(usize, usize, Line)| in_patch(0, &h.2) && in_patch(1, &h.2);
    values[11] = either.iter().filter(both).count() as f64;
    values[12] = either.iter().filter(|h| h.0 >= DEEP_ROW).count() as f64;
    let spread = |f: &dyn Fn(&(usize, usize, Line)) -> f64| {
        let mean = either.iter().map(|h| f(h)).sum::<f64>() / n;
        let variance = either.iter().map(|h| (f(h) - mean).powi(2)).sum::<f64>() / n;
        (mean, variance.sqrt())
    };
    (values[13], values[14]) = spread(&|h| h.0 as f64);
    values[15] = spread(&|h| h.1 as f64).1;
    values[18] = 1e3 * (centre[1][0] - centre[0][0]);
    values[19] = 1e3 * (centre[1][1] - centre[0][1]);
    let width_of = |rows: std::ops::Range<usize>| {
        let widths: Vec<f64> = hits
            .iter()
            .filter(|h| rows.contains(&h.0))
            .map(|h| h.2.x_m[1] - h.2.x_m[0])
            .collect();
        1e3 * widths.iter().sum::<f64>() / widths.len() as f64
    };
    values[20] = width_of(0..2);
    values[21] = width_of(2..6);
    let middle = [
        (centre[0][0] + centre[1][0]) / 2.0,
        (centre[0][1] + centre[1][1]) / 2.0,
    ];
    values[26] = 1e3 * (com.y - middle[0]).hypot(com.z - middle[1]);
    values[29] = wedge(&hits, profile);
    for row in 0..ROWS {
        let here: Vec<_> = hits.iter().filter(|h| h.0 == row).collect();
        let n = here.len() as f64;
        let back = |side: usize| {
            let sum: f64 = here
                .iter()
                .map(|h| (h.2.x_m[side] - first[side]).abs())
                .sum();
            1e3 * sum / n
        };
        values[30 + 3 * row] = n;
        values[31 + 3 * row] = back(0);
        values[32 + 3 * row] = back(1);
    }
}

/// Angle by which the object narrows towards the tip: slope of the width over the height.
fn wedge(hits: &[(usize, usize, Line)], profile: &Profile) -> f64 {
    let n = hits.len() as f64;
    let z = |h: &(usize, usize, Line)| profile.row_z_m[h.0];
    let w = |h: &(usize, usize, Line)| h.2.x_m[1] - h.2.x_m[0];
    let mean_z = hits.iter().map(z).sum::<f64>() / n;
    let mean_w = hits.iter().map(w).sum::<f64>() / n;
    let above: f64 = hits.iter().map(|h| (z(h) - mean_z) * (w(h) - mean_w)).sum();
    let below: f64 = hits.iter().map(|h| (z(h) - mean_z).powi(2)).sum();
    if below == 0.0 {
        f64::NAN
    } else {
        (above / below).atan()
    }
}
