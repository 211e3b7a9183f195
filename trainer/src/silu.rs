//! x / (1 + exp(-x)) with its derivative, in one pass each.
//!
//! The tensor library composes it of five passes with a scalar exponential, which took a third of
//! a training step.

use candle_core::{CpuStorage, CustomOp1, CustomOp2, Layout, Result, Shape, Tensor};
use wide::f32x8;

/// `x * sigmoid(x)` (S. Elfwing et al., Neural Networks 107, 2018), differentiable once.
///
/// # Errors
/// Those of the tensor library.
pub fn silu(x: &Tensor) -> Result<Tensor> {
    x.contiguous()?.apply_op1(Silu)
}

struct Silu;
struct SiluGradient;

/// The f32 numbers of a contiguous tensor.
pub(crate) fn slice<'a>(storage: &'a CpuStorage, layout: &Layout) -> Result<&'a [f32]> {
    let (start, end) = layout
        .contiguous_offsets()
        .ok_or_else(|| candle_core::Error::Msg("the tensor is not contiguous".into()))?;
    Ok(&storage.as_slice::<f32>()?[start..end])
}

fn sigmoid(x: f32x8) -> f32x8 {
    f32x8::splat(1.0) / (f32x8::splat(1.0) + (-x).exp())
}

fn map(x: &[f32], y: &[f32], f: impl Fn(f32x8, f32x8) -> f32x8) -> Vec<f32> {
    let mut out = vec![0.0; x.len()];
    let eight = |s: &[f32]| {
        let mut lanes = [0.0; 8];
        lanes[..s.len()].copy_from_slice(s);
        f32x8::from(lanes)
    };
    for ((x, y), out) in x.chunks(8).zip(y.chunks(8)).zip(out.chunks_mut(8)) {
        let value = f(eight(x), eight(y)).to_array();
        out.copy_from_slice(&value[..out.len()]);
    }
    out
}

impl CustomOp1 for Silu {
    fn name(&self) -> &'static str {
        "silu"
    }

    fn cpu_fwd(&self, storage: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let x = slice(storage, layout)?;
        let out = map(x, x, |x, _| x * sigmoid(x));
        Ok((CpuStorage::F32(out), layout.shape().clone()))
    }

    fn bwd(&self, arg: &Tensor, _: &Tensor, gradient: &Tensor) -> Result<Option<Tensor>> {
        let gradient = gradient.contiguous()?;
        Ok(Some(arg.apply_op2_no_bwd(&gradient, &SiluGradient)?))
    }
}

impl CustomOp2 for SiluGradient {
    fn name(&self) -> &'static str {
        "silu_gradient"
    }

    fn cpu_fwd(
        &self,
        x: &CpuStorage,
        x_layout: &Layout,
        gradient: &CpuStorage,
        gradient_layout: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let one = f32x8::splat(1.0);
        let out = map(
            slice(x, x_layout)?,
            slice(gradient, gradient_layout)?,
            |x, g| {
                let s = sigmoid(x);
                g * s * (one + x * (one - s))
            },
        );
        Ok((CpuStorage::F32(out), x_layout.shape().clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use candle_core::{Device, Var};

    #[test]
    fn value_and_gradient_are_those_of_the_formula() {
        let xs: Vec<f32> = (-15..=15).map(|i| i as f32 * 0.4).collect();
        let x = Var::from_tensor(&Tensor::new(&xs[..], &Device::Cpu).unwrap()).unwrap();
        let y = silu(&x).unwrap();
        let g = y.sum_all().unwrap().backward().unwrap();
        let g = g.get(&x).unwrap().to_vec1::<f32>().unwrap();
        let f = |x: f64| x / (1.0 + (-x).exp());
        for (i, y) in y.to_vec1::<f32>().unwrap().iter().enumerate() {
            let x = f64::from(xs[i]);
            assert!((f64::from(*y) - f(x)).abs() < 1e-5);
            let slope = (f(x + 1e-5) - f(x - 1e-5)) / 2e-5;
            assert!(
                (f64::from(g[i]) - slope).abs() < 1e-4,
                "{x}: {} {slope}",
                g[i]
            );
        }
    }
}
