//! What lies between two linear layers, eight numbers at a time.

use wide::f32x8;

fn sigmoid(x: f32x8) -> f32x8 {
    f32x8::splat(1.0) / (f32x8::splat(1.0) + (-x).exp())
}

/// `x <- f(x)` eight by eight; what is left over is filled up with zeros.
fn in_place(x: &mut [f32], mut f: impl FnMut(f32x8) -> f32x8) {
    let (eights, left) = x.as_chunks_mut();
    for x in eights {
        *x = f(f32x8::from(*x)).to_array();
    }
    let mut last = [0.0; 8];
    last[..left.len()].copy_from_slice(left);
    let last = f(f32x8::from(last)).to_array();
    left.copy_from_slice(&last[..left.len()]);
}

/// `out += x sigmoid(x)` (S. Elfwing et al., Neural Networks 107, 2018), and in place of `x` the
/// derivative by it, which is all that the way back needs.
pub fn add_silu(x: &mut [f32], out: &mut [f32]) {
    let one = f32x8::splat(1.0);
    let mut i = 0;
    in_place(x, |x| {
        let s = sigmoid(x);
        if let Some(out) = out.get_mut(i..i + 8) {
            let eight: &mut [f32; 8] = out.try_into().expect("eight");
            *eight = (f32x8::from(*eight) + x * s).to_array();
        } else {
            let value = (x * s).to_array();
            for (out, value) in out[i..].iter_mut().zip(value) {
                *out += value;
            }
        }
        i += 8;
        s * (one + x * (one - s))
    });
}

/// `x <- tanh(factor x)`, within 1e-6.
pub fn tanh(x: &mut [f32], factor: f32) {
    let (one, two) = (f32x8::splat(1.0), f32x8::splat(2.0));
    let steep = f32x8::splat(2.0 * factor);
    in_place(x, |x| two * sigmoid(x * steep) - one);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_and_derivatives_are_those_of_the_formulas() {
        let xs: Vec<f32> = (-15..=15).map(|i| i as f32 * 0.4).collect();
        let mut slopes = xs.clone();
        let mut y = vec![0.0; xs.len()];
        add_silu(&mut slopes, &mut y);
        let mut with_shortcut = xs.clone();
        add_silu(&mut xs.clone(), &mut with_shortcut);
        let mut t = xs.clone();
        tanh(&mut t, 3.0);
        let f = |x: f64| x / (1.0 + (-x).exp());
        for (i, x) in xs.iter().map(|x| f64::from(*x)).enumerate() {
            assert!((f64::from(y[i]) - f(x)).abs() < 1e-5);
            assert!((f64::from(with_shortcut[i]) - x - f(x)).abs() < 1e-5);
            let slope = (f(x + 1e-5) - f(x - 1e-5)) / 2e-5;
            assert!((f64::from(slopes[i]) - slope).abs() < 1e-5);
            assert!((f64::from(t[i]) - (3.0 * x).tanh()).abs() < 1e-6);
        }
        // Far from zero, too.
        let mut far = [-1e4, -100.0, 100.0, 1e4];
        tanh(&mut far, 1.0);
        assert_eq!(far, [-1.0, -1.0, 1.0, 1.0]);
    }
}
