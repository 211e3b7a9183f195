//! How much of eight triangles lies in a prism, and how high?

use fearless_simd::prelude::*;
use fearless_simd::{f32x8, mask32x8};

use crate::prism::{Prism, Triangles, not_zero};

impl Prism {
    /// Of what lies in the prism and where `sign * x >= border`, seen along x: signed area (m2,
    /// positive for faces that look towards +x) and its first moment in z about the middle of the
    /// prism (m3).
    ///
    /// By Green's theorem along the outline. What the prism cuts off is folded onto its walls: that
    /// leaves the winding about every point inside as it was.
    #[inline(always)]
    pub(crate) fn moments<S: Simd>(
        &self,
        simd: S,
        corners: &Triangles<S>,
        sign: f32,
        border: f32,
    ) -> (f32x8<S>, f32x8<S>) {
        let zero = f32x8::splat(simd, 0.0);
        let [min, max] = self.splat(simd);
        let middle = [(min[0] + max[0]) * 0.5, (min[1] + max[1]) * 0.5];
        let reach = [max[0] - middle[0], max[1] - middle[1]];
        let [a, b, c] = corners;
        let beyond = [
            a[0] * sign - border,
            b[0] * sign - border,
            c[0] * sign - border,
        ];
        let points = [
            [a[1] - middle[0], a[2] - middle[1]],
            [b[1] - middle[0], b[2] - middle[1]],
            [c[1] - middle[0], c[2] - middle[1]],
        ];
        let mut sum = (zero, zero);
        // Where the outline leaves and enters what is beyond; the same point where it never does.
        let mut leaves = points[0];
        let mut enters = points[0];
        for k in 0..3 {
            let (p, q) = (points[k], points[(k + 1) % 3]);
            let (hp, hq) = (beyond[k], beyond[(k + 1) % 3]);
            let (p_out, q_out) = (hp.simd_lt(zero), hq.simd_lt(zero));
            let t = hp / not_zero(hp - hq);
            let cut = [p[0] + (q[0] - p[0]) * t, p[1] + (q[1] - p[1]) * t];
            leaves = either(q_out & !p_out, cut, leaves);
            enters = either(p_out & !q_out, cut, enters);
            let from = either(p_out, cut, p);
            // An edge wholly on this side is no way at all.
            let to = either(q_out, either(p_out, from, cut), q);
            along(simd, &mut sum, from, to, reach);
        }
        along(simd, &mut sum, leaves, enters, reach);
        sum
    }
}

/// Adds the integrals of `y dz` and `y z dz` along the way from `p` to `q`, folded onto the rectangle
/// `-reach..reach`.
#[inline(always)]
fn along<S: Simd>(
    simd: S,
    sum: &mut (f32x8<S>, f32x8<S>),
    p: [f32x8<S>; 2],
    q: [f32x8<S>; 2],
    reach: [f32x8<S>; 2],
) {
    let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
    let step = [q[0] - p[0], q[1] - p[1]];
    let y = between(p[0], one / not_zero(step[0]), reach[0]);
    let z = between(p[1], one / not_zero(step[1]), reach[1]);
    // Below and above the rectangle z does not change, so only the part between counts.
    let enter = z.0.max(zero);
    let leave = z.1.min(one).max(enter);
    let mut from = fold(&p, &step, &reach, enter);
    for t in [y.0.max(enter).min(leave), y.1.max(enter).min(leave), leave] {
        let to = fold(&p, &step, &reach, t);
        let rise = to[1] - from[1];
        sum.0 += (from[0] + to[0]) * 0.5 * rise;
        let straight = from[0] * from[1] + to[0] * to[1];
        let crossed = from[0] * to[1] + to[0] * from[1];
        sum.1 += (straight + straight + crossed) * (1.0 / 6.0) * rise;
        from = to;
    }
}

/// When the way from `p` is between `-reach` and `reach`.
#[inline(always)]
fn between<S: Simd>(p: f32x8<S>, inverse: f32x8<S>, reach: f32x8<S>) -> (f32x8<S>, f32x8<S>) {
    let (t0, t1) = ((-reach - p) * inverse, (reach - p) * inverse);
    (t0.min(t1), t0.max(t1))
}

/// The point at `t` of the way, moved onto the rectangle where it is not in it.
#[inline(always)]
fn fold<S: Simd>(
    p: &[f32x8<S>; 2],
    step: &[f32x8<S>; 2],
    reach: &[f32x8<S>; 2],
    t: f32x8<S>,
) -> [f32x8<S>; 2] {
    [
        (p[0] + step[0] * t).max(-reach[0]).min(reach[0]),
        (p[1] + step[1] * t).max(-reach[1]).min(reach[1]),
    ]
}

#[inline(always)]
fn either<S: Simd>(mask: mask32x8<S>, a: [f32x8<S>; 2], b: [f32x8<S>; 2]) -> [f32x8<S>; 2] {
    [mask.select(a[0], b[0]), mask.select(a[1], b[1])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prism::tests::{MAX, MIN, clipped, levels, side_by_side, triangle};
    use fearless_simd::{Level, dispatch};
    use nalgebra::Vector3;
    use proptest::prelude::*;

    fn moments(level: Level, t: &[Vector3<f32>; 3], sign: f32, border: f32) -> (f32, f32) {
        dispatch!(level, simd => {
            let prism = Prism::new(MIN, MAX);
            let (area, moment) = prism.moments(simd, &side_by_side(simd, t), sign, border);
            (area.to_array()[0], moment.to_array()[0])
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]
        #[test]
        fn area_and_moment_are_those_of_the_polygon_cut_plane_by_plane(
            x in proptest::array::uniform9(0.0f32..1.0), border in -0.04f32..0.04, left in any::<bool>()
        ) {
            let t = triangle(&x);
            let sign = if left { -1.0 } else { 1.0 };
            let (area, moment) = moments(Level::new(), &t, sign, border);
            let (mut area_m2, mut moment_m3) = (0.0, 0.0);
            let cut = clipped(&t).and_then(|mut p| p.clip_axis(0, -sign, -border).then_some(p));
            if let Some(polygon) = cut {
                let middle = 0.5 * (MIN[1] + MAX[1]);
                for [a, b, c] in polygon.fan() {
                    let part = 0.5 * (b - a).cross(&(c - a)).x;
                    area_m2 += part;
                    moment_m3 += part * ((a.z + b.z + c.z) / 3.0 - middle);
                }
            }
            prop_assert!((area - area_m2).abs() < 2e-9, "{} {}", area, area_m2);
            prop_assert!((moment - moment_m3).abs() < 2e-11, "{} {}", moment, moment_m3);
        }

        #[test]
        fn moments_are_the_same_to_the_bit_on_every_instruction_set(
            x in proptest::array::uniform9(0.0f32..1.0), border in -0.04f32..0.04
        ) {
            let t = triangle(&x);
            let bits = |(area, moment): (f32, f32)| (area.to_bits(), moment.to_bits());
            let here = bits(moments(Level::new(), &t, 1.0, border));
            for level in levels() {
                prop_assert_eq!(bits(moments(level, &t, 1.0, border)), here, "{:?}", level);
            }
        }
    }
}
