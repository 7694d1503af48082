//! Structural similarity (Wang, Bovik, Sheikh, Simoncelli 2004).

use super::filter::{Plane, balanced, kernel};

/// The window is 11 × 11 pixels.
const RADIUS: usize = 5;
/// Standard deviation of the window's Gaussian, pixels.
const SIGMA: f64 = 1.5;
/// C₁ = (0.01 L)² and C₂ = (0.03 L)² for a range of values of L = 1.
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// SSIM (equation 13) of every pixel of two pictures with values from 0 to 1. Beyond the edges, edge pixels repeat.
pub(super) fn ssim_map(a: &Plane, b: &Plane) -> Vec<f64> {
    let window = balanced(&kernel(RADIUS, |x| (-0.5 * x * x / (SIGMA * SIGMA)).exp()));
    let mean = |f: &(dyn Fn(usize) -> f64 + Sync)| Plane::new(a.width, a.height, f).filtered(&window, &window).values;
    let (x, y) = (&a.values, &b.values);
    let (mx, my) = (mean(&|i| x[i]), mean(&|i| y[i]));
    let (xx, yy, xy) = (mean(&|i| x[i] * x[i]), mean(&|i| y[i] * y[i]), mean(&|i| x[i] * y[i]));
    let at = |i: usize| {
        let (vx, vy, cov) = (xx[i] - mx[i] * mx[i], yy[i] - my[i] * my[i], xy[i] - mx[i] * my[i]);
        let structure = (2.0 * cov + C2) / (vx + vy + C2);
        (2.0 * mx[i] * my[i] + C1) / (mx[i] * mx[i] + my[i] * my[i] + C1) * structure
    };
    (0..x.len()).map(at).collect()
}

/// Mean of a map over the `known` pixels whose window lies inside of the picture, as its authors take it; over all that are
/// known where there is none such.
pub(super) fn mean_ssim(map: &[f64], width: usize, height: usize, known: &[bool]) -> f64 {
    let inside = |i: usize, n: usize| i >= RADIUS && i + RADIUS < n;
    let mean = |choose: &dyn Fn(usize) -> bool| {
        let chosen = || (0..map.len()).filter(|i| known[*i] && choose(*i));
        chosen().map(|i| map[i]).sum::<f64>() / chosen().count() as f64
    };
    let whole = mean(&|i| inside(i % width, width) && inside(i / width, height));
    if whole.is_nan() { mean(&|_| true) } else { whole }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean(a: &Plane, b: &Plane) -> f64 {
        mean_ssim(&ssim_map(a, b), a.width, a.height, &vec![true; a.values.len()])
    }

    #[test]
    fn same_pictures_have_1_and_constant_ones_the_closed_form() {
        let ramp = Plane::new(16, 16, |i| i as f64 / 256.0);
        assert!((mean(&ramp, &ramp) - 1.0).abs() < 1e-12);
        for (a, b) in [(0.0, 1.0), (0.4, 0.5), (1.0, 1.0)] {
            let flat = |v: f64| Plane::new(1, 1, |_| v);
            let want = (2.0 * a * b + C1) / (a * a + b * b + C1);
            assert!((mean(&flat(a), &flat(b)) - want).abs() < 1e-9, "{a} {b}");
        }
        // Opposite structure about the same mean is negative.
        let wave = |sign: f64| Plane::new(16, 16, |i| 0.5 + sign * 0.4 * f64::from(i as u32 % 2 * 2) - sign * 0.4);
        assert!(mean(&wave(1.0), &wave(-1.0)) < -0.9);
    }
}
