//! LDR-ꟻLIP: how large the difference of two pictures looks when one flips between them (Andersson, Nilsson, Akenine-Möller,
//! Oskarsson, Åström, Fairchild 2020, "ꟻLIP: A Difference Evaluator for Alternating Images"). Equations are the paper's.

use std::f64::consts::{PI, SQRT_2};

use super::color::{Color, from_ycxcz, lab, ycxcz};
use super::filter::{Plane, balanced, kernel};

/// Pixels per degree of sight: a screen 0.7 m wide with 3840 pixels, seen from 0.7 m.
pub(super) const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;

/// Contrast sensitivity of the channels Y, Cx, Cz as sums of Gaussians: a₁, b₁, a₂, b₂ (table 1; b in deg²).
const SENSITIVITY: [[f64; 4]; 3] = [[1.0, 0.0047, 0.0, 1e-5], [1.0, 0.0053, 0.0, 1e-5], [34.1, 0.04, 13.5, 0.025]];
/// Exponent of colour differences (q_c) and of feature differences (q_f).
const COLOR_EXPONENT: f64 = 0.7;
const FEATURE_EXPONENT: f64 = 0.5;
/// Differences up to p_c of the largest possible take p_t of the range of errors (equation 15).
const KNEE: f64 = 0.4;
const KNEE_VALUE: f64 = 0.95;
/// Width of the edges and points that eyes look for, degrees (w).
const FEATURE_WIDTH: f64 = 0.082;

/// The filters for one distance of sight.
pub(super) struct Flip {
    /// For each channel the Gaussians of its sensitivity, with the weight of each.
    sensitivity: [Vec<(f64, Vec<f64>)>; 3],
    smooth: Vec<f64>,
    edge: Vec<f64>,
    point: Vec<f64>,
    /// Largest difference of colours after the exponent: green against blue.
    largest: f64,
}

impl Flip {
    pub fn new(pixels_per_degree: f64) -> Self {
        let widest = SENSITIVITY.iter().flat_map(|s| [s[1], s[3]]).fold(0.0, f64::max);
        let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as usize;
        let sigma = 0.5 * FEATURE_WIDTH * pixels_per_degree;
        let reach = (3.0 * sigma).ceil() as usize;
        let gauss = |x: f64| (-0.5 * x * x / (sigma * sigma)).exp();
        let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|c| hunt(lab(c)));
        Self {
            sensitivity: SENSITIVITY.map(|s| gaussians(s, radius, pixels_per_degree)),
            smooth: balanced(&kernel(reach, gauss)),
            edge: balanced(&kernel(reach, |x| -x * gauss(x))),
            point: balanced(&kernel(reach, |x| (x * x / (sigma * sigma) - 1.0) * gauss(x))),
            largest: hyab(green, blue).powf(COLOR_EXPONENT),
        }
    }

    /// The error of every pixel, 0 to 1, of two pictures of linear sRGB in [0, 1].
    pub fn map(&self, width: usize, height: usize, test: &[Color], reference: &[Color]) -> Vec<f64> {
        let [a, b] = [test, reference].map(|p| Seen::new(self, width, height, p));
        let error = |i: usize| {
            let color = self.redistributed(hyab(a.colors[i], b.colors[i]).powf(COLOR_EXPONENT));
            let edge = (a.edges[i] - b.edges[i]).abs();
            let point = (a.points[i] - b.points[i]).abs();
            let feature = (edge.max(point) / SQRT_2).powf(FEATURE_EXPONENT);
            color.powf(1.0 - feature)
        };
        Plane::new(width, height, error).values
    }

    /// Equation 15: most of the range for small differences, which are the ones that matter.
    fn redistributed(&self, difference: f64) -> f64 {
        let knee = KNEE * self.largest;
        if difference < knee {
            KNEE_VALUE / knee * difference
        } else {
            // Filters leave sRGB's gamut by round-off, so the largest difference is one but for round-off.
            let above = (difference - knee) / (self.largest - knee);
            (KNEE_VALUE + above * (1.0 - KNEE_VALUE)).clamp(0.0, 1.0)
        }
    }
}

/// What the eye makes of one picture.
struct Seen {
    /// L*a*b* after filtering by contrast sensitivity, with chroma adjusted to lightness (Hunt).
    colors: Vec<Color>,
    /// Strength of edges and of points in lightness.
    edges: Vec<f64>,
    points: Vec<f64>,
}

impl Seen {
    fn new(filters: &Flip, width: usize, height: usize, linear: &[Color]) -> Self {
        let planes = [0, 1, 2].map(|c| Plane::new(width, height, |i| ycxcz(linear[i])[c]));
        let lightness = Plane::new(width, height, |i| (planes[0].values[i] + 16.0) / 116.0);
        let blurred = [0, 1, 2].map(|c| blurred(&planes[c], &filters.sensitivity[c]));
        let color = |i: usize| hunt(lab(from_ycxcz([0, 1, 2].map(|c| blurred[c][i])).map(|v| v.clamp(0.0, 1.0))));
        let strength = |along: &[f64]| {
            let (x, y) = (lightness.filtered(along, &filters.smooth), lightness.filtered(&filters.smooth, along));
            x.values.into_iter().zip(y.values).map(|(x, y)| x.hypot(y)).collect()
        };
        Self {
            colors: (0..linear.len()).map(color).collect(),
            edges: strength(&filters.edge),
            points: strength(&filters.point),
        }
    }
}

/// The Gaussians a √(π/b) exp(−π² r²/b) of a channel as separable kernels of sum 1, each with its share of the whole.
fn gaussians([a1, b1, a2, b2]: [f64; 4], radius: usize, pixels_per_degree: f64) -> Vec<(f64, Vec<f64>)> {
    let one = |a: f64, b: f64| {
        let weights = kernel(radius, |x| (-PI * PI * (x / pixels_per_degree).powi(2) / b).exp());
        let sum: f64 = weights.iter().sum();
        (a * (PI / b).sqrt() * sum * sum, balanced(&weights))
    };
    let both: Vec<_> = [(a1, b1), (a2, b2)].into_iter().filter(|(a, _)| *a > 0.0).map(|(a, b)| one(a, b)).collect();
    let total: f64 = both.iter().map(|g| g.0).sum();
    both.into_iter().map(|(share, weights)| (share / total, weights)).collect()
}

fn blurred(plane: &Plane, gaussians: &[(f64, Vec<f64>)]) -> Vec<f64> {
    let mut sum = vec![0.0; plane.values.len()];
    for (share, weights) in gaussians {
        let part = plane.filtered(weights, weights);
        sum.iter_mut().zip(part.values).for_each(|(s, v)| *s += share * v);
    }
    sum
}

/// Colours of dark things look less colourful (Hunt's effect; equation 11).
fn hunt([l, a, b]: Color) -> Color {
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// The HyAB distance (Abasi, Amani Tehran, Fairchild 2020; equation 12).
fn hyab(a: Color, b: Color) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(color: Color) -> Vec<Color> {
        vec![color; 24 * 20]
    }

    fn mean(a: &[Color], b: &[Color]) -> f64 {
        let map = Flip::new(PIXELS_PER_DEGREE).map(24, 20, a, b);
        assert!(map.iter().all(|e| (0.0..=1.0).contains(e)));
        map.iter().sum::<f64>() / map.len() as f64
    }

    #[test]
    fn constant_pictures_have_closed_forms() {
        assert_eq!(mean(&flat([0.3, 0.2, 0.7]), &flat([0.3, 0.2, 0.7])), 0.0);
        // Green against blue is the largest difference that there is; constant pictures have no features.
        assert!((mean(&flat([0.0, 1.0, 0.0]), &flat([0.0, 0.0, 1.0])) - 1.0).abs() < 1e-9);
        // Black against white: 100^0.7 = 25.1 of 41.3, by equation 15 beyond the knee.
        let largest = Flip::new(PIXELS_PER_DEGREE).largest;
        let want = 0.95 + (100f64.powf(0.7) - 0.4 * largest) / (0.6 * largest) * 0.05;
        let got = mean(&flat([0.0; 3]), &flat([1.0; 3]));
        assert!((got - want).abs() < 1e-9 && got > 0.96 && (largest - 41.28).abs() < 0.05, "{got} {want} {largest}");
    }

    #[test]
    fn flip_is_symmetric_and_sees_edges() {
        let edge: Vec<Color> = (0..480).map(|i| [if i % 24 < 12 { 0.2 } else { 0.6 }; 3]).collect();
        let (a, b) = (mean(&edge, &flat([0.4; 3])), mean(&flat([0.4; 3]), &edge));
        assert!((a - b).abs() < 1e-12 && a > 0.1, "{a} {b}");
    }
}
