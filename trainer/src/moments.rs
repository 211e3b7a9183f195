//! Where is the object, as a whole? Moments of shells about and inside its surface.
//!
//! What lies around the hand does not tell to which side of a long or one-sided object most of the grasps
//! are. Moments do, and turning the object turns them: they are the few numbers of a shape whose value in
//! the hand's frame follows from that in the grid's. Beside the surface itself, what is thick has much inside,
//! what stands out has much around it.

use nalgebra::Matrix3;

/// A shell: the space between two distances from the surface, softly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shell {
    /// Normalised distances between which a node weighs about 1; the first may be negative infinity.
    pub between: [f32; 2],
}

/// The shells: the surface (about a cell of the grid to each side), what is inside, what is deep inside,
/// what lies around.
pub const SHELLS: [Shell; 4] = [
    Shell {
        between: [-0.04, 0.04],
    },
    Shell {
        between: [f32::NEG_INFINITY, -0.04],
    },
    Shell {
        between: [f32::NEG_INFINITY, -0.15],
    },
    Shell {
        between: [0.1, 0.25],
    },
];

/// Steepness of the shells' sides, 1 / normalised distance.
pub const STEEPNESS: f32 = 60.0;

/// What the surface weighs at least (a node in its middle weighs 0.8), so that a grid without one has moments too.
pub const LEAST_MASS: f32 = 1e-6;

/// Powers of x, y and z of each moment: all up to the third degree.
pub const POWERS: [[usize; 3]; OF_SHELL] = [
    [0, 0, 0],
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [2, 0, 0],
    [1, 1, 0],
    [1, 0, 1],
    [0, 2, 0],
    [0, 1, 1],
    [0, 0, 2],
    [3, 0, 0],
    [2, 1, 0],
    [2, 0, 1],
    [1, 2, 0],
    [1, 1, 1],
    [1, 0, 2],
    [0, 3, 0],
    [0, 2, 1],
    [0, 1, 2],
    [0, 0, 3],
];

/// How many moments a shell has.
pub const OF_SHELL: usize = 20;

/// How many there are.
pub const COUNT: usize = SHELLS.len() * OF_SHELL;

/// Which moments are entries `i` of the vector, `3 i + j` of the matrix and `9 i + 3 j + k` of the cube of those of
/// the first, second and third degree.
pub const VECTOR: [usize; 3] = [1, 2, 3];
/// See [`VECTOR`].
pub const MATRIX: [usize; 9] = [4, 5, 6, 5, 7, 8, 6, 8, 9];
/// See [`VECTOR`].
pub const CUBE: [usize; 27] = [
    10, 11, 12, 11, 13, 14, 12, 14, 15, 11, 13, 14, 13, 16, 17, 14, 17, 18, 12, 14, 15, 14, 17, 18,
    15, 18, 19,
];

/// Sums of `x^a y^b z^c` over each of the [`SHELLS`], see [`POWERS`], as shares of what the surface weighs;
/// x, y and z are normalised and begin at the centre of the grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments(pub [[f32; OF_SHELL]; SHELLS.len()]);

impl Moments {
    /// Of a grid `[x, y, z]` of normalised distances; its nodes span [-1, 1].
    pub fn new(values: &[f32], resolution: usize) -> Self {
        let powers = powers(resolution);
        let mut sums = [[0f64; OF_SHELL]; SHELLS.len()];
        for (i, d) in values.iter().enumerate() {
            let [x, y, z] =
                [i / resolution / resolution, i / resolution, i].map(|i| powers[i % resolution]);
            for (sums, shell) in sums.iter_mut().zip(SHELLS) {
                let weight = shell.weight(*d);
                for (sum, [a, b, c]) in sums.iter_mut().zip(POWERS) {
                    *sum += f64::from(weight * (x[a] * y[b] * z[c]));
                }
            }
        }
        let mass = sums[0][0] + f64::from(LEAST_MASS);
        Self(sums.map(|s| s.map(|s| (s / mass) as f32)))
    }

    /// The moments along the columns of `rotation`: of the same object in a frame that stands so.
    pub fn along(&self, rotation: &Matrix3<f32>) -> Self {
        Self(self.0.map(|m| along(&m, rotation)))
    }
}

impl Shell {
    /// What a node at this distance weighs.
    fn weight(&self, distance: f32) -> f32 {
        let [inner, outer] = self
            .between
            .map(|c| 1.0 / (1.0 + (STEEPNESS * (distance - c)).exp()));
        outer - inner
    }
}

fn along(m: &[f32; OF_SHELL], rotation: &Matrix3<f32>) -> [f32; OF_SHELL] {
    let r = |i: usize, j: usize| rotation[(i, j)];
    let mut matrix = MATRIX.map(|k| m[k]);
    let mut cube = CUBE.map(|k| m[k]);
    // The last index is contracted and comes first, until all of them have been.
    for _ in 0..2 {
        let from = matrix;
        for a in 0..3 {
            for i in 0..3 {
                matrix[3 * a + i] = (0..3).map(|j| from[3 * i + j] * r(j, a)).sum();
            }
        }
    }
    for _ in 0..3 {
        let from = cube;
        for a in 0..3 {
            for i in 0..9 {
                cube[9 * a + i] = (0..3).map(|j| from[3 * i + j] * r(j, a)).sum();
            }
        }
    }
    let mut out = *m;
    for (a, k) in VECTOR.into_iter().enumerate() {
        out[k] = VECTOR
            .into_iter()
            .enumerate()
            .map(|(i, k)| m[k] * r(i, a))
            .sum();
    }
    for (k, x) in MATRIX.into_iter().zip(matrix) {
        out[k] = x;
    }
    for (k, x) in CUBE.into_iter().zip(cube) {
        out[k] = x;
    }
    out
}

/// Powers 0 to 3 of the nodes' coordinates along an edge.
pub fn powers(resolution: usize) -> Vec<[f32; 4]> {
    let last = (resolution - 1) as f32;
    (0..resolution)
        .map(|i| {
            let u = 2.0 * i as f32 / last - 1.0;
            [1.0, u, u * u, u * u * u]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Vector3};

    const RESOLUTION: usize = 32;

    /// Signed distances to a box off the centre, its axes those of `rotation`.
    fn grid(rotation: &Rotation3<f32>) -> Vec<f32> {
        let u = powers(RESOLUTION);
        let mut values = Vec::new();
        for x in &u {
            for y in &u {
                for z in &u {
                    let p = rotation.inverse() * Vector3::new(x[1], y[1], z[1]);
                    let q =
                        (p - Vector3::new(0.15, -0.1, 0.05)).abs() - Vector3::new(0.5, 0.3, 0.15);
                    values.push(q.map(|v| v.max(0.0)).norm() + q.max().min(0.0));
                }
            }
        }
        values
    }

    #[test]
    fn turning_the_object_turns_its_moments() {
        let still = Moments::new(&grid(&Rotation3::identity()), RESOLUTION);
        assert!((still.0[0][1] - 0.15).abs() < 0.01 && (still.0[0][2] + 0.1).abs() < 0.01);
        let rotation = Rotation3::from_euler_angles(0.4, -1.1, 2.0);
        let turned = Moments::new(&grid(&rotation), RESOLUTION);
        let apart = |a: &Moments, b: &Moments| {
            let of_b = b.0.as_flattened();
            let way =
                a.0.as_flattened()
                    .iter()
                    .zip(of_b)
                    .map(|(a, b)| (a - b).abs() / (1.0 + a.abs()));
            way.fold(0f32, f32::max)
        };
        assert!(apart(&still, &turned) > 0.1);
        // In the frame that stands as the turned box does, it is the box that was not turned.
        let back = turned.along(rotation.matrix());
        assert!(apart(&still, &back) < 0.01, "{still:?} {back:?}");
    }

    #[test]
    fn a_frame_along_other_axes_permutes_moments() {
        let still = Moments::new(&grid(&Rotation3::identity()), RESOLUTION);
        // Its x is our y, its y our z, its z our x.
        let cycle = Matrix3::new(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
        let along = still.along(&cycle);
        for (along, still) in along.0.iter().zip(still.0) {
            for (m, [x, y, z]) in along.iter().zip(POWERS) {
                let ours = POWERS.iter().position(|p| *p == [z, x, y]);
                assert!((m - still[ours.expect("of the same degree")]).abs() < 1e-6);
            }
        }
    }
}
