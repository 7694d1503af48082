//! Where a lobe is largest, and how wide it is.

use super::Curve;

/// Values that differ by less than this share are one: rounding.
const LEVEL: f64 = 1e-9;

/// The largest value of a curve and the width about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// The value, in the curve's unit.
    pub value: f64,
    /// Its angle, degrees; none where the curve is level.
    pub theta_o_deg: Option<f64>,
    /// From half the value on one side to half on the other, degrees; none where a side does not fall that far.
    pub width_deg: Option<f64>,
}

/// The peak of a channel: the largest of the curve's own points; its half width between them is interpolated.
#[must_use]
pub fn peak(curve: &Curve, channel: usize) -> Option<Peak> {
    let values = curve.values.get(channel)?;
    let known = |k: &usize| values[*k].is_finite();
    let at = (0..values.len()).filter(known).max_by(|a, b| values[*a].total_cmp(&values[*b]))?;
    let value = values[at];
    let half = 0.5 * value;
    // The angle at which the curve first falls to half between two points, from the peak outwards; a gap hides it.
    let falls = |a: usize, b: usize| {
        let ((x, p), (y, q)) = ((curve.theta_o_deg[a], values[a]), (curve.theta_o_deg[b], values[b]));
        x + (y - x) * (p - half) / (p - q)
    };
    let ends = |(_, b): &(usize, usize)| values[*b].is_nan() || values[*b] <= half;
    let fallen = |(a, b): (usize, usize)| (!values[b].is_nan()).then(|| falls(a, b));
    let right = (at..values.len() - 1).map(|k| (k, k + 1)).find(ends).and_then(fallen);
    let left = (1..=at).rev().map(|k| (k, k - 1)).find(ends).and_then(fallen);
    let width_deg = right.zip(left).map(|(r, l)| r - l).filter(|_| value > 0.0);
    let least = values.iter().copied().fold(value, f64::min); // which passes over NaN
    let is_level = value - least <= LEVEL * value.abs();
    Some(Peak { value, theta_o_deg: (!is_level).then(|| curve.theta_o_deg[at]), width_deg })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(step: f64, of: impl Fn(f64) -> f64) -> Curve {
        let theta: Vec<f64> = (0..=(180.0 / step) as u32).map(|k| -90.0 + step * f64::from(k)).collect();
        let values = vec![theta.iter().map(|t| of(*t)).collect()];
        Curve { name: "c".into(), readings: false, color: 1, theta_o_deg: theta, values, sigma: None }
    }

    #[test]
    fn a_power_of_the_cosine_has_its_half_width() {
        for n in [3.0, 30.0, 300.0] {
            let lobe = |t: f64| (t - 20.0).to_radians().cos().max(0.0).powf(n);
            let found = peak(&curve(0.25, lobe), 0).expect("a peak");
            let want = 2.0 * 0.5f64.powf(1.0 / n).acos().to_degrees();
            assert_eq!((found.theta_o_deg, found.value), (Some(20.0), 1.0));
            let width = found.width_deg.expect("falls on both sides");
            // Lines between points a quarter of a degree apart, over a peak of this width.
            assert!((width - want).abs() < 0.01, "n {n}: {width} vs {want}");
        }
    }

    #[test]
    fn what_does_not_fall_to_half_or_is_not_known_there_has_no_width() {
        let width = |of: fn(f64) -> f64| peak(&curve(1.0, of), 0).expect("a peak").width_deg;
        assert_eq!(width(|t| 1.0 + 0.1 * t.to_radians().cos()), None);
        assert_eq!(width(|t| (-(t - 80.0).abs() / 20.0).exp()), None, "cut off by the horizon");
        assert_eq!(width(|t| if (5.0..6.0).contains(&t) { f64::NAN } else { (-t.abs() / 10.0).exp() }), None);
        let level = peak(&curve(1.0, |t| if t > 80.0 { f64::NAN } else { 0.1 }), 0).expect("values");
        assert_eq!((level.theta_o_deg, level.width_deg), (None, None));
        assert!(peak(&curve(1.0, |_| f64::NAN), 0).is_none() && peak(&curve(1.0, |_| 1.0), 1).is_none());
    }
}
