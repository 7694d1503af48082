//! HDR-ꟻLIP: the largest LDR-ꟻLIP over the exposures at which somebody may look at a picture (Andersson, Nilsson, Shirley,
//! Akenine-Möller 2021, "Visualizing Errors in Rendered High Dynamic Range Images").

use super::color::{Color, luminance};
use super::flip::Flip;

/// The tone curve: coefficients of (k₀x² + k₁x + k₂)/(k₃x² + k₄x + k₅), the approximation of ACES by Narkowicz (2016) with its exposure
/// of 0.6 taken in.
const CURVE: [f64; 6] = [0.36 * 2.51, 0.6 * 0.03, 0.0, 0.36 * 2.43, 0.6 * 0.59, 0.14];
/// The brightest pixel at the first exposure, and the median one at the last, reach this value (section 3.1).
const REACHED: f64 = 0.85;

/// HDR-ꟻLIP of every pixel of two pictures of linear radiance; negative values count as 0. `None` where the reference is black,
/// which leaves no exposure to look at.
pub(super) fn map(flip: &Flip, width: usize, height: usize, test: &[Color], reference: &[Color]) -> Option<Vec<f64>> {
    let mut largest = vec![0.0f64; test.len()];
    for exposure in exposures(reference)? {
        let gain = exposure.exp2();
        let developed = |p: &[Color]| -> Vec<Color> { p.iter().map(|p| p.map(|x| tone(gain * x))).collect() };
        let map = flip.map(width, height, &developed(test), &developed(reference));
        largest.iter_mut().zip(map).for_each(|(l, e)| *l = l.max(e));
    }
    Some(largest)
}

/// Exposures from the one that shows the brightest pixel to the one that shows the median, about a stop apart (equation 6).
fn exposures(reference: &[Color]) -> Option<Vec<f64>> {
    let mut light: Vec<f64> = reference.iter().map(|p| luminance(p.map(|x| x.max(0.0)))).collect();
    light.sort_by(f64::total_cmp);
    let brightest = light.last().copied().filter(|l| *l > 0.0)?;
    let n = light.len();
    let median = 0.5 * (light[(n - 1) / 2] + light[n / 2]);
    // Where more than half is black, the median of the rest says what is dark.
    let lit = &light[light.partition_point(|l| *l <= 0.0)..];
    let median = if median > 0.0 { median } else { lit[lit.len() / 2] };
    let white = reached();
    let (start, stop) = ((white / brightest).log2(), (white / median).log2());
    let count = (stop - start).ceil().max(2.0) as usize;
    Some((0..count).map(|i| start + (stop - start) * i as f64 / (count - 1) as f64).collect())
}

/// The tone curve, clipped to [0, 1].
fn tone(x: f64) -> f64 {
    let [k0, k1, k2, k3, k4, k5] = CURVE;
    // Beyond 10⁶ the curve has long been clipped; squares of 10²⁰⁰ would be ∞/∞.
    let x = x.clamp(0.0, 1e6);
    (((k0 * x + k1) * x + k2) / ((k3 * x + k4) * x + k5)).clamp(0.0, 1.0)
}

/// The x at which the tone curve is [`REACHED`]: the positive root of its quadratic equation.
fn reached() -> f64 {
    let [a, b, c] = [0, 1, 2].map(|i| CURVE[i] - REACHED * CURVE[i + 3]);
    let (half, root) = (-0.5 * b / a, (0.25 * b * b / (a * a) - c / a).sqrt());
    half + root
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::flip::PIXELS_PER_DEGREE;

    #[test]
    fn the_curve_reaches_its_value_and_scale_does_not_matter() {
        assert!((tone(reached()) - REACHED).abs() < 1e-12);
        let picture = |scale: f64| -> Vec<Color> { (0..64).map(|i| [scale * (1.0 + f64::from(i)); 3]).collect() };
        let other = |scale: f64| -> Vec<Color> { (0..64).map(|i| [scale * (1.2 + f64::from(i)); 3]).collect() };
        let flip = Flip::new(PIXELS_PER_DEGREE);
        let mean = |s: f64| map(&flip, 8, 8, &other(s), &picture(s)).unwrap().iter().sum::<f64>() / 64.0;
        for scale in [1e-20, 1e20] {
            assert!((mean(scale) / mean(1.0) - 1.0).abs() < 1e-9, "{scale}");
        }
    }

    #[test]
    fn exposures_lie_a_stop_apart_and_black_has_none() {
        let ramp: Vec<Color> = (0..101).map(|i| [f64::from(i).exp2() * 2e-20; 3]).collect();
        let found = exposures(&ramp).unwrap();
        assert_eq!(found.len(), 50);
        assert!((found[49] - found[0] - 50.0).abs() < 1e-9);
        assert!(exposures(&[[0.0; 3]; 4]).is_none());
        assert!(exposures(&[[0.0; 3], [0.0; 3], [0.0; 3], [3.0; 3]]).is_some());
    }
}
