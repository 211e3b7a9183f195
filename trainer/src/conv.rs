//! 3-D convolution with stride 2: neighbourhoods as rows, then a matrix product.
//!
//! The tensor library has none (K. Chellapilla et al., 2006, for the unfolding). Channels come
//! last, so that a row of the unfolded matrix is 27 short copies.

use candle_core::{CpuStorage, CustomOp1, Layout, Result, Shape, Tensor};
use rayon::prelude::*;

use crate::silu::slice;

/// Nodes along an edge of the kernel.
pub const KERNEL: usize = 3;
const STRIDE: usize = 2;

/// `[N, D, D, D, C]` -> `[N (D/2)^3, 27 C]`: kernel 3, stride 2, one layer of zeros around.
/// Differentiable once.
///
/// # Errors
/// Those of the tensor library; an odd edge.
pub fn unfold(x: &Tensor) -> Result<Tensor> {
    let (n, d, _, _, c) = x.dims5()?;
    if d % STRIDE != 0 {
        candle_core::bail!("the edge {d} of the grid is odd");
    }
    x.contiguous()?.apply_op1(Unfold { n, d, c })
}

#[derive(Clone, Copy)]
struct Unfold {
    n: usize,
    d: usize,
    c: usize,
}

struct Fold(Unfold);

impl Unfold {
    fn edge(&self) -> usize {
        self.d / STRIDE
    }

    fn row(&self) -> usize {
        KERNEL.pow(3) * self.c
    }

    /// Calls `f(where in a row, where in a sample's grid)` for each neighbour inside the grid.
    fn neighbours(&self, [ox, oy, oz]: [usize; 3], mut f: impl FnMut(usize, usize)) {
        let d = self.d;
        let mut k = 0;
        let place = |o: usize, k: usize| (STRIDE * o + k).checked_sub(1).filter(|i| *i < d);
        for kx in 0..KERNEL {
            for ky in 0..KERNEL {
                for kz in 0..KERNEL {
                    if let (Some(x), Some(y), Some(z)) =
                        (place(ox, kx), place(oy, ky), place(oz, kz))
                    {
                        f(k * self.c, ((x * d + y) * d + z) * self.c);
                    }
                    k += 1;
                }
            }
        }
    }

    fn outputs(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let o = self.edge();
        (0..o.pow(3)).map(move |i| [i / (o * o), i / o % o, i % o])
    }
}

impl CustomOp1 for Unfold {
    fn name(&self) -> &'static str {
        "unfold3d"
    }

    fn cpu_fwd(&self, storage: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let x = slice(storage, layout)?;
        let (row, c) = (self.row(), self.c);
        let rows = self.edge().pow(3);
        let mut out = vec![0.0f32; self.n * rows * row];
        out.par_chunks_mut(rows * row)
            .zip(x.par_chunks(self.d.pow(3) * c))
            .for_each(|(out, x)| {
                for (out, at) in out.chunks_mut(row).zip(self.outputs()) {
                    self.neighbours(at, |to, from| {
                        out[to..to + c].copy_from_slice(&x[from..from + c]);
                    });
                }
            });
        Ok((CpuStorage::F32(out), Shape::from((self.n * rows, row))))
    }

    fn bwd(&self, _: &Tensor, _: &Tensor, gradient: &Tensor) -> Result<Option<Tensor>> {
        let gradient = gradient.contiguous()?;
        Ok(Some(gradient.apply_op1_no_bwd(&Fold(*self))?))
    }
}

impl CustomOp1 for Fold {
    fn name(&self) -> &'static str {
        "fold3d"
    }

    fn cpu_fwd(&self, storage: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let g = slice(storage, layout)?;
        let Unfold { n, d, c } = self.0;
        let row = self.0.row();
        let rows = self.0.edge().pow(3);
        let mut out = vec![0.0f32; n * d.pow(3) * c];
        out.par_chunks_mut(d.pow(3) * c)
            .zip(g.par_chunks(rows * row))
            .for_each(|(out, g)| {
                for (g, at) in g.chunks(row).zip(self.0.outputs()) {
                    self.0.neighbours(at, |from, to| {
                        for (o, g) in out[to..to + c].iter_mut().zip(&g[from..from + c]) {
                            *o += g;
                        }
                    });
                }
            });
        Ok((CpuStorage::F32(out), Shape::from((n, d, d, d, c))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::{Device, Var};

    #[test]
    fn unfolding_places_neighbours_and_its_gradient_counts_them() {
        let (n, d, c) = (2, 4, 2);
        let numbers: Vec<f32> = (0..n * d * d * d * c).map(|i| i as f32).collect();
        let x = Tensor::from_vec(numbers, (n, d, d, d, c), &Device::Cpu).unwrap();
        let x = Var::from_tensor(&x).unwrap();
        let rows = unfold(&x).unwrap();
        assert_eq!(rows.dims(), [n * 8, 27 * c]);
        // The middle of the kernel of output (1, 0, 1) is node (2, 0, 2).
        let middle = rows.to_vec2::<f32>().unwrap()[5][13 * c];
        assert_eq!(middle, (((2 * d) * d + 2) * c) as f32);
        let gradient = rows.sum_all().unwrap().backward().unwrap();
        let counts = gradient.get(&x).unwrap().flatten_all().unwrap();
        let counts = counts.to_vec1::<f32>().unwrap();
        // Along an axis of four nodes the windows -1..1 and 1..3 see nodes 0, 1, 2, 3 once, twice,
        // once, once.
        let along = [1.0, 2.0, 1.0, 1.0];
        assert_eq!(counts[0], 1.0);
        assert_eq!(counts[((d + 1) * d + 1) * c], 8.0);
        let total: f32 = counts.iter().sum();
        assert_eq!(total, (n * c) as f32 * along.iter().sum::<f32>().powi(3));
    }
}
