//! Colour differences: CIE 1976 and CIE 2000.

use super::color::Color;

/// Distance in L*a*b* (CIE 1976).
pub(super) fn delta_e_1976(a: Color, b: Color) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1]).hypot(a[2] - b[2])
}

/// CIEDE2000 with k_L = k_C = k_H = 1 (Sharma, Wu, Dalal 2005, equations 2 to 22).
pub(super) fn delta_e_2000(a: Color, b: Color) -> f64 {
    let mean_chroma = 0.5 * (a[1].hypot(a[2]) + b[1].hypot(b[2]));
    let g = 1.5 - 0.5 * share_of_25(mean_chroma);
    let (c1, h1) = chroma_and_hue(g * a[1], a[2]);
    let (c2, h2) = chroma_and_hue(g * b[1], b[2]);
    let dl = b[0] - a[0];
    let dc = c2 - c1;
    let hue = hue_difference(c1 * c2, h2 - h1);
    let dh = 2.0 * (c1 * c2).sqrt() * (0.5 * hue).to_radians().sin();
    let (l, c, h) = (0.5 * (a[0] + b[0]), 0.5 * (c1 + c2), mean_hue(c1 * c2, h1, h2));
    let cosine = |degrees: f64| degrees.to_radians().cos();
    let t = 1.0 - 0.17 * cosine(h - 30.0) + 0.24 * cosine(2.0 * h) + 0.32 * cosine(3.0 * h + 6.0)
        - 0.20 * cosine(4.0 * h - 63.0);
    let l50 = (l - 50.0) * (l - 50.0);
    let (dl, dc, dh) =
        (dl / (1.0 + 0.015 * l50 / (20.0 + l50).sqrt()), dc / (1.0 + 0.045 * c), dh / (1.0 + 0.015 * c * t));
    let turn = 30.0 * (-((h - 275.0) / 25.0).powi(2)).exp();
    let rotation = -(2.0 * turn).to_radians().sin() * 2.0 * share_of_25(c);
    // The quadratic form is positive; round-off of nearly equal colours must not make it less than 0.
    (dl * dl + dc * dc + dh * dh + rotation * dc * dh).clamp(0.0, f64::INFINITY).sqrt()
}

/// √(C⁷/(C⁷ + 25⁷)).
fn share_of_25(chroma: f64) -> f64 {
    let c7 = chroma.powi(7);
    (c7 / (c7 + 25.0f64.powi(7))).sqrt()
}

/// Chroma, and hue from 0° up to 360°.
fn chroma_and_hue(a: f64, b: f64) -> (f64, f64) {
    (a.hypot(b), b.atan2(a).to_degrees().rem_euclid(360.0))
}

/// The difference of hue the short way round, degrees; 0 where one of the colours is grey.
fn hue_difference(product: f64, d: f64) -> f64 {
    if product == 0.0 {
        0.0
    } else if d > 180.0 {
        d - 360.0
    } else if d < -180.0 {
        d + 360.0
    } else {
        d
    }
}

/// The hue midway on the short way round, degrees; the sum where one of the colours is grey.
fn mean_hue(product: f64, h1: f64, h2: f64) -> f64 {
    let sum = h1 + h2;
    if product == 0.0 {
        sum
    } else if (h1 - h2).abs() <= 180.0 {
        0.5 * sum
    } else if sum < 360.0 {
        0.5 * (sum + 360.0)
    } else {
        0.5 * (sum - 360.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sharma, Wu, Dalal 2005, table 1.
    const PUBLISHED: [(Color, Color, f64); 34] = [
        ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
        ([50.0, 3.1571, -77.2803], [50.0, 0.0, -82.7485], 2.8615),
        ([50.0, 2.8361, -74.0200], [50.0, 0.0, -82.7485], 3.4412),
        ([50.0, -1.3802, -84.2814], [50.0, 0.0, -82.7485], 1.0),
        ([50.0, -1.1848, -84.8006], [50.0, 0.0, -82.7485], 1.0),
        ([50.0, -0.9009, -85.5211], [50.0, 0.0, -82.7485], 1.0),
        ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
        ([50.0, -1.0, 2.0], [50.0, 0.0, 0.0], 2.3669),
        ([50.0, 2.49, -0.001], [50.0, -2.49, 0.0009], 7.1792),
        ([50.0, 2.49, -0.001], [50.0, -2.49, 0.0010], 7.1792),
        ([50.0, 2.49, -0.001], [50.0, -2.49, 0.0011], 7.2195),
        ([50.0, 2.49, -0.001], [50.0, -2.49, 0.0012], 7.2195),
        ([50.0, -0.001, 2.49], [50.0, 0.0009, -2.49], 4.8045),
        ([50.0, -0.001, 2.49], [50.0, 0.0010, -2.49], 4.8045),
        ([50.0, -0.001, 2.49], [50.0, 0.0011, -2.49], 4.7461),
        ([50.0, 2.5, 0.0], [50.0, 0.0, -2.5], 4.3065),
        ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
        ([50.0, 2.5, 0.0], [61.0, -5.0, 29.0], 22.8977),
        ([50.0, 2.5, 0.0], [56.0, -27.0, -3.0], 31.9030),
        ([50.0, 2.5, 0.0], [58.0, 24.0, 15.0], 19.4535),
        ([50.0, 2.5, 0.0], [50.0, 3.1736, 0.5854], 1.0),
        ([50.0, 2.5, 0.0], [50.0, 3.2972, 0.0], 1.0),
        ([50.0, 2.5, 0.0], [50.0, 1.8634, 0.5757], 1.0),
        ([50.0, 2.5, 0.0], [50.0, 3.2592, 0.3350], 1.0),
        ([60.2574, -34.0099, 36.2677], [60.4626, -34.1751, 39.4387], 1.2644),
        ([63.0109, -31.0961, -5.8663], [62.8187, -29.7946, -4.0864], 1.2630),
        ([61.2901, 3.7196, -5.3901], [61.4292, 2.2480, -4.9620], 1.8731),
        ([35.0831, -44.1164, 3.7933], [35.0232, -40.0716, 1.5901], 1.8645),
        ([22.7233, 20.0904, -46.6940], [23.0331, 14.9730, -42.5619], 2.0373),
        ([36.4612, 47.8580, 18.3852], [36.2715, 50.5065, 21.2231], 1.4146),
        ([90.8027, -2.0831, 1.4410], [91.1528, -1.6435, 0.0447], 1.4441),
        ([90.9257, -0.5406, -0.9208], [88.6381, -0.8985, -0.7239], 1.5381),
        ([6.7747, -0.2908, -2.4247], [5.8714, -0.0985, -2.2286], 0.6377),
        ([2.0776, 0.0795, -1.1350], [0.9033, -0.0636, -0.5514], 0.9082),
    ];

    #[test]
    fn ciede2000_gives_the_published_pairs() {
        for (a, b, want) in PUBLISHED {
            let got = delta_e_2000(a, b);
            assert!((got - want).abs() < 1e-4, "{a:?} {b:?}: {got:.5} vs {want}");
            assert!(delta_e_2000(a, a) == 0.0 && delta_e_1976(b, b) == 0.0);
        }
    }

    #[test]
    fn black_and_white_are_100_apart() {
        let (black, white) = (super::super::color::lab([0.0; 3]), super::super::color::lab([1.0; 3]));
        assert!((delta_e_1976(black, white) - 100.0).abs() < 1e-9);
        assert!((delta_e_2000(black, white) - 100.0).abs() < 1e-9);
    }
}
