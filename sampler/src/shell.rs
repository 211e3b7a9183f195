//! Points close to an object's surface: where a flow may begin instead of a normal distribution about
//! the object's middle.

use nalgebra::Vector3;
use shakedown_objects::NormalisedSdf;

/// Half the thickness of the shell, in cells of the grid.
const HALF_THICKNESS_CELLS: f32 = 1.5;

/// Points about the surface, as many everywhere on it: the density falls linearly with the distance
/// from it, to nothing at one and a half cells of the grid.
#[derive(Debug, Clone)]
pub struct Shell {
    /// Half the edge of the grid, normalised units.
    half_edge: f64,
    resolution: usize,
    /// Weights summed up: over the planes of the grid, the rows of each plane, the nodes of each row.
    planes: Vec<f32>,
    rows: Vec<f32>,
    nodes: Vec<f32>,
}

impl Shell {
    /// The shell of an object's distance grid.
    pub fn new(sdf: &NormalisedSdf) -> Self {
        let n = sdf.resolution;
        let reach = HALF_THICKNESS_CELLS * 2.0 * sdf.half_edge / (n - 1) as f32;
        let weight = |d: &f32| (1.0 - d.abs() / reach).max(0.0);
        let mut nodes: Vec<f32> = sdf.values.iter().map(weight).collect();
        if nodes.iter().all(|w| *w == 0.0) {
            nodes.fill(1.0);
        }
        let mut rows: Vec<f32> = nodes.chunks_mut(n).map(sum_up).collect();
        let mut planes: Vec<f32> = rows.chunks_mut(n).map(sum_up).collect();
        sum_up(&mut planes);
        Self {
            half_edge: f64::from(sdf.half_edge),
            resolution: n,
            planes,
            rows,
            nodes,
        }
    }

    /// Three uniform numbers as a point of the shell, normalised frame.
    pub fn at(&self, uniform: [f64; 3]) -> Vector3<f64> {
        let n = self.resolution;
        let [x, y, z] = uniform;
        let (i, x) = pick(&self.planes, x);
        let (j, y) = pick(&self.rows[i * n..(i + 1) * n], y);
        let row = (i * n + j) * n;
        let (k, z) = pick(&self.nodes[row..row + n], z);
        let cell = 2.0 * self.half_edge / (n - 1) as f64;
        let place =
            |index: usize, within: f64| (index as f64 + within - 0.5) * cell - self.half_edge;
        Vector3::new(place(i, x), place(j, y), place(k, z))
    }
}

/// Running sums in place; the last.
fn sum_up(weights: &mut [f32]) -> f32 {
    let mut sum = 0.0;
    for w in weights {
        sum += *w;
        *w = sum;
    }
    sum
}

/// Which of some weights (summed up) a uniform number falls into, and where in it.
fn pick(sums: &[f32], uniform: f64) -> (usize, f64) {
    let at = uniform * f64::from(sums[sums.len() - 1]);
    let index = sums
        .partition_point(|s| f64::from(*s) <= at)
        .min(sums.len() - 1);
    let low = if index == 0 {
        0.0
    } else {
        f64::from(sums[index - 1])
    };
    let weight = f64::from(sums[index]) - low;
    let within = if weight > 0.0 {
        (at - low) / weight
    } else {
        0.5
    };
    (index, within.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    /// A grid of edge 2 about `distance`.
    fn shell(distance: impl Fn(Vector3<f32>) -> f32) -> Shell {
        let n = 32;
        let node = |i: usize| 2.0 * i as f32 / (n - 1) as f32 - 1.0;
        let values = (0..n * n * n)
            .map(|i| distance(Vector3::new(node(i / n / n), node(i / n % n), node(i % n))))
            .collect();
        Shell::new(&NormalisedSdf {
            resolution: n,
            centre_m: Point3::origin(),
            scale_m: 1.0,
            half_edge: 1.0,
            values,
        })
    }

    #[test]
    fn points_lie_about_the_surface_and_each_part_of_it_has_its_share() {
        let (radius, centre) = (0.5, Vector3::new(0.1, -0.2, 0.0));
        let shell = shell(|p| (p - centre.cast()).norm() - radius as f32);
        let cell = 2.0 / 31.0;
        let n = 24;
        let middle = |i: usize| (i as f64 + 0.5) / n as f64;
        let mut octants = [0; 8];
        for i in 0..n * n * n {
            let p = shell.at([i / n / n, i / n % n, i % n].map(middle)) - centre;
            // One and a half cells of the weights, and half a diagonal of the cell about a node.
            assert!((p.norm() - radius).abs() < (1.5 + 0.9) * cell, "{p}");
            octants[p.iter().fold(0, |o, x| 2 * o + usize::from(*x > 0.0))] += 1;
        }
        for count in octants {
            assert!(
                (f64::from(count) / (n * n * n / 8) as f64 - 1.0).abs() < 0.05,
                "{octants:?}"
            );
        }
    }

    #[test]
    fn a_grid_that_no_surface_crosses_is_used_as_a_whole() {
        let shell = shell(|_| 1.0);
        for (u, x) in [(0.001, -1.0), (0.5, 0.0), (0.999, 1.0)] {
            assert!((shell.at([u; 3]).x - x).abs() < 0.05);
        }
    }
}
