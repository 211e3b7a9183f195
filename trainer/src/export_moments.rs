//! The moments of [`crate::moments`] as parts of the graphs: of the grid in the encoder, in the hand's axes in the
//! velocity.

use crate::export::{concat, reshaped, scaled};
use crate::moments;
use crate::onnx::{Attribute, Graph};

/// [`moments::Moments::new`] of each grid, `[B, COUNT]`.
pub(crate) fn moments_of(g: &mut Graph, sdf: &str, resolution: usize) -> String {
    let mut shells = Vec::new();
    for shell in moments::SHELLS {
        let [inner, outer] = shell.between;
        let below = |g: &mut Graph, c: f32| {
            let c = g.floats(&[1], &[c]);
            let x = g.node("Sub", &[&c, sdf]);
            let x = scaled(g, &x, moments::STEEPNESS);
            g.node("Sigmoid", &[&x])
        };
        let all = below(g, outer);
        shells.push(if inner.is_finite() {
            let without = below(g, inner);
            g.node("Sub", &[&all, &without])
        } else {
            all
        });
    }
    let shells: Vec<&str> = shells.iter().map(String::as_str).collect();
    let mut sums = concat(g, &shells);
    let powers = moments::powers(resolution);
    let powers = g.floats(&[resolution, 4], powers.as_flattened());
    // Over z, then y, then x; the powers of what is summed come first.
    let d = resolution as i64;
    for rows in [d * d, 4 * d, 16] {
        let last = reshaped(g, &sums, &[-1, rows, d]);
        let summed = g.node("MatMul", &[&last, &powers]);
        sums = transposed(g, &summed, &[0, 2, 1]);
    }
    let flat = reshaped(g, &sums, &[-1, 64]);
    let places = moments::POWERS.map(|[x, y, z]| 16 * x + 4 * y + z);
    let all = gathered(g, &flat, &places);
    let all = reshaped(g, &all, &[-1, moments::COUNT as i64]);
    let mass = gathered(g, &all, &[0]);
    let least = g.floats(&[1], &[moments::LEAST_MASS]);
    let mass = g.node("Add", &[&mass, &least]);
    g.node("Div", &[&all, &mass])
}

/// [`moments::Moments::along`] the hand's axes, in units of the network.
pub(crate) fn moments_along(
    g: &mut Graph,
    moments: &str,
    rotation: &str,
    scale_in_units: &str,
) -> String {
    let shells = moments::SHELLS.len();
    let mut parts = Vec::new();
    // Where each moment is found when all parts stand in a row.
    let mut place = vec![0; moments::COUNT];
    let mut before = 0;
    let degrees: [&[usize]; 4] = [&[0], &moments::VECTOR, &moments::MATRIX, &moments::CUBE];
    for (degree, entries) in degrees.into_iter().enumerate() {
        let from: Vec<usize> = (0..shells)
            .flat_map(|l| entries.iter().map(move |k| moments::OF_SHELL * l + k))
            .collect();
        for (at, moment) in from.iter().enumerate() {
            place[*moment] = before + at;
        }
        before += from.len();
        let mut x = gathered(g, moments, &from);
        let of_shell = entries.len() as i64 / 3;
        for _ in 0..degree {
            let last = reshaped(g, &x, &[-1, shells as i64 * of_shell, 3]);
            let turned = g.node("MatMul", &[&last, rotation]);
            let apart = reshaped(g, &turned, &[-1, shells as i64, of_shell, 3]);
            x = transposed(g, &apart, &[0, 1, 3, 2]);
        }
        parts.push(reshaped(g, &x, &[-1, from.len() as i64]));
    }
    let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
    let all = concat(g, &parts);
    let each = gathered(g, &all, &place);
    g.node("Mul", &[&each, scale_in_units])
}

fn transposed(g: &mut Graph, x: &str, order: &[i64]) -> String {
    g.node_with(
        "Transpose",
        &[x],
        &[("perm", Attribute::Ints(order.to_vec()))],
    )
}

/// Columns of a matrix.
fn gathered(g: &mut Graph, x: &str, places: &[usize]) -> String {
    let places: Vec<i64> = places.iter().map(|p| *p as i64).collect();
    let places = g.integers(&places);
    g.node_with("Gather", &[x, &places], &[("axis", Attribute::Int(1))])
}
