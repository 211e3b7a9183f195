//! 3-D convolution with stride 2: neighbourhoods as rows, then a matrix product (K. Chellapilla et
//! al., 2006). Channels come last, so that a row is 27 short copies.

use rayon::prelude::*;

/// Nodes along an edge of the kernel.
pub const KERNEL: usize = 3;
const STRIDE: usize = 2;

/// Grids `[N, D, D, D, C]` and their neighbourhoods `[N (D/2)^3, 27 C]`: kernel 3, stride 2, one layer
/// of zeros around.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Neighbourhoods {
    edge: usize,
    channels: usize,
}

impl Neighbourhoods {
    /// Of grids with `edge` nodes along each axis.
    ///
    /// # Panics
    /// If the edge is odd.
    pub fn new(edge: usize, channels: usize) -> Self {
        assert!(edge.is_multiple_of(STRIDE), "the edge {edge} is odd");
        Self { edge, channels }
    }

    /// Nodes along an edge of what comes out.
    pub fn edge_out(&self) -> usize {
        self.edge / STRIDE
    }

    /// Numbers in a row of the unfolded matrix.
    pub fn row(&self) -> usize {
        KERNEL.pow(3) * self.channels
    }

    fn grid(&self) -> usize {
        self.edge.pow(3) * self.channels
    }

    fn unfolded(&self) -> usize {
        self.edge_out().pow(3) * self.row()
    }

    /// Calls `f(where in a row, where in a sample's grid)` for each neighbour inside the grid.
    fn neighbours(&self, [ox, oy, oz]: [usize; 3], mut f: impl FnMut(usize, usize)) {
        let d = self.edge;
        let mut k = 0;
        let place = |o: usize, k: usize| (STRIDE * o + k).checked_sub(1).filter(|i| *i < d);
        for kx in 0..KERNEL {
            for ky in 0..KERNEL {
                for kz in 0..KERNEL {
                    if let (Some(x), Some(y), Some(z)) =
                        (place(ox, kx), place(oy, ky), place(oz, kz))
                    {
                        f(k * self.channels, ((x * d + y) * d + z) * self.channels);
                    }
                    k += 1;
                }
            }
        }
    }

    fn outputs(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let o = self.edge_out();
        (0..o.pow(3)).map(move |i| [i / (o * o), i / o % o, i % o])
    }

    /// Grids -> rows.
    pub fn unfold(&self, grids: &[f32], rows: &mut Vec<f32>) {
        let c = self.channels;
        rows.clear();
        rows.resize(grids.len() / self.grid() * self.unfolded(), 0.0);
        rows.par_chunks_mut(self.unfolded())
            .zip(grids.par_chunks(self.grid()))
            .for_each(|(rows, grid)| {
                for (row, at) in rows.chunks_mut(self.row()).zip(self.outputs()) {
                    self.neighbours(at, |to, from| {
                        row[to..to + c].copy_from_slice(&grid[from..from + c]);
                    });
                }
            });
    }

    /// Rows -> grids, each node the sum of its appearances: the gradient of [`Self::unfold`].
    pub fn fold(&self, rows: &[f32], grids: &mut Vec<f32>) {
        let c = self.channels;
        grids.clear();
        grids.resize(rows.len() / self.unfolded() * self.grid(), 0.0);
        grids
            .par_chunks_mut(self.grid())
            .zip(rows.par_chunks(self.unfolded()))
            .for_each(|(grid, rows)| {
                for (row, at) in rows.chunks(self.row()).zip(self.outputs()) {
                    self.neighbours(at, |from, to| {
                        for (o, g) in grid[to..to + c].iter_mut().zip(&row[from..from + c]) {
                            *o += g;
                        }
                    });
                }
            });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unfolding_places_neighbours_and_its_gradient_counts_them() {
        let (n, d, c) = (2, 4, 2);
        let grids: Vec<f32> = (0..n * d * d * d * c).map(|i| i as f32).collect();
        let around = Neighbourhoods::new(d, c);
        let mut rows = Vec::new();
        around.unfold(&grids, &mut rows);
        assert_eq!(rows.len(), n * 8 * 27 * c);
        // The middle of the kernel of output (1, 0, 1) is node (2, 0, 2).
        let middle = rows[5 * 27 * c + 13 * c];
        assert_eq!(middle, (((2 * d) * d + 2) * c) as f32);
        let mut counts = Vec::new();
        around.fold(&vec![1.0; rows.len()], &mut counts);
        // Along an axis of four nodes the windows -1..1 and 1..3 see nodes 0, 1, 2, 3 once, twice,
        // once, once.
        let along = [1.0, 2.0, 1.0, 1.0];
        assert_eq!(counts[0], 1.0);
        assert_eq!(counts[((d + 1) * d + 1) * c], 8.0);
        let total: f32 = counts.iter().sum();
        assert_eq!(total, (n * c) as f32 * along.iter().sum::<f32>().powi(3));
    }
}
