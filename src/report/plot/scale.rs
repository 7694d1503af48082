//! From values to places along an axis, and the marks on it.

/// How values are spread along a scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spacing {
    /// Equal steps are equal differences.
    Linear,
    /// Equal steps are equal factors; both ends are positive.
    Log,
    /// Linear, with marks as angles have them.
    Degrees,
    /// Equal steps are equal differences of the square root, as MERL's θh has them; no end is negative.
    Root,
}

/// A scale between two values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Value at the beginning.
    pub low: f64,
    /// Value at the end.
    pub high: f64,
    /// How values are spread.
    pub spacing: Spacing,
}

/// A mark on an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    /// Where.
    pub value: f64,
    /// What stands there, `^{…}` raised; empty for a small mark.
    pub label: String,
}

impl Scale {
    /// A linear scale.
    #[must_use]
    pub fn linear(low: f64, high: f64) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        Self { low, high, spacing: Spacing::Linear }
    }

    /// A scale of degrees.
    #[must_use]
    pub fn degrees(low: f64, high: f64) -> Self {
        Self { spacing: Spacing::Degrees, ..Self::linear(low, high) }
    }

    /// A scale of square roots.
    #[must_use]
    pub fn root(low: f64, high: f64) -> Self {
        Self { spacing: Spacing::Root, ..Self::linear(low, high) }
    }

    /// A linear scale over all values, with 0, and with round ends.
    #[must_use]
    pub fn around(values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = range(values).unwrap_or((0.0, 1.0));
        let (low, high) = (low.min(0.0), high.max(0.0));
        let high = if high > low { high } else { low + 1.0 };
        let step = step(high - low, 5);
        // A value a hair above a step does not open another one.
        let up = |x: f64| (x / step - 0.02).ceil() * step;
        Self::linear(-up(-low), up(high))
    }

    /// A logarithmic scale over all positive values, at most `decades` deep, with ends at 1, 2 or 5 times a power of ten.
    #[must_use]
    pub fn log_around(values: impl IntoIterator<Item = f64>, decades: f64) -> Self {
        let (low, high) = range(values.into_iter().filter(|v| *v > 0.0)).unwrap_or((0.1, 1.0));
        let low = low.max(high * 10f64.powf(-decades));
        let (low, high) = (round_down(low), -round_down(-high));
        let (low, high) = if high > low { (low, high) } else { (low / 2.0, high * 2.0) };
        Self { low, high, spacing: Spacing::Log }
    }

    /// As a script reads it: low, high, spacing.
    pub(in crate::report) fn data(&self) -> String {
        let spacing = match self.spacing {
            Spacing::Linear | Spacing::Degrees => "linear",
            Spacing::Log => "log",
            Spacing::Root => "root",
        };
        format!("{} {} {spacing}", self.low, self.high)
    }

    /// Where a value stands, 0 at the beginning and 1 at the end; beyond them outside of that. `None` for what the scale has no place for.
    #[must_use]
    pub fn place(&self, value: f64) -> Option<f64> {
        let of = |v: f64| match self.spacing {
            Spacing::Linear | Spacing::Degrees => v,
            Spacing::Log => v.log10(),
            Spacing::Root => v.sqrt(),
        };
        let place = (of(value) - of(self.low)) / (of(self.high) - of(self.low));
        place.is_finite().then_some(place)
    }

    /// Marks at round values, about `count` of them with labels.
    #[must_use]
    pub fn ticks(&self, count: usize) -> Vec<Tick> {
        match self.spacing {
            Spacing::Linear => self.linear_ticks(step(self.high - self.low, count)),
            Spacing::Degrees => self.linear_ticks(if self.high - self.low > 100.0 { 30.0 } else { 15.0 }),
            Spacing::Log => self.log_ticks(count),
            Spacing::Root => self.root_ticks(),
        }
    }

    fn linear_ticks(&self, step: f64) -> Vec<Tick> {
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        let first = (self.low / step - 1e-9).ceil() as i64;
        let last = (self.high / step + 1e-9).floor() as i64;
        let small = step < 1e-4 || self.high.abs().max(self.low.abs()) >= 1e6;
        let label = |k: i64| match k {
            0 => "0".to_owned(),
            _ if small => power_label(k as f64 * step),
            _ => minus(&format!("{:.decimals$}", k as f64 * step)),
        };
        (first..=last).map(|k| Tick { value: k as f64 * step, label: label(k) }).collect()
    }

    /// Degrees that stand well apart.
    fn root_ticks(&self) -> Vec<Tick> {
        let inside = |v: &f64| (self.low..=self.high).contains(v);
        let values = [0.0, 1.0, 5.0, 15.0, 30.0, 60.0, 90.0].into_iter().filter(inside);
        values.map(|value| Tick { value, label: format!("{value}") }).collect()
    }

    fn log_ticks(&self, count: usize) -> Vec<Tick> {
        let (from, to) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        let decades = self.high.log10() - self.low.log10();
        let every = (decades / count as f64).ceil().max(1.0) as i32;
        let inside = |v: f64| v >= self.low * (1.0 - 1e-9) && v <= self.high * (1.0 + 1e-9);
        let mut ticks = Vec::new();
        for k in from..=to {
            for digit in 1..10 {
                let value = f64::from(digit) * 10f64.powi(k);
                let named = if decades < 2.2 { matches!(digit, 1 | 2 | 5) } else { digit == 1 && k % every == 0 };
                if inside(value) && (named || every == 1 || digit == 1) {
                    ticks.push(Tick { value, label: if named { decade_label(digit, k) } else { String::new() } });
                }
            }
        }
        ticks
    }
}

/// Smallest and largest of the finite values.
fn range(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    let finite = values.into_iter().filter(|v| v.is_finite());
    finite.fold(None, |range, v| match range {
        None => Some((v, v)),
        Some((low, high)) => Some((v.min(low), v.max(high))),
    })
}

/// 1, 2 or 5 times a power of ten, so that about `count` of them make `span`.
fn step(span: f64, count: usize) -> f64 {
    let raw = span / count.max(1) as f64;
    let decade = 10f64.powf(raw.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0];
    steps.iter().map(|s| s * decade).find(|s| *s >= raw * (1.0 - 1e-9)).unwrap_or(decade)
}

/// The next 1, 2 or 5 times a power of ten below a positive value; for a negative one the next such above its size, negative.
fn round_down(x: f64) -> f64 {
    let size = x.abs();
    let decade = 10f64.powf((size.log10() + 1e-12).floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|s| s * decade);
    let below = steps.iter().rev().find(|s| **s <= size * (1.0 + 1e-9)).unwrap_or(&decade);
    let above = steps.iter().find(|s| **s >= size * (1.0 - 1e-9)).unwrap_or(&decade);
    if x > 0.0 { *below } else { -above }
}

/// With a minus sign in place of a hyphen.
pub(in crate::report) fn minus(text: &str) -> String {
    text.replace('-', "−")
}

fn decade_label(digit: i32, k: i32) -> String {
    if (-3..=3).contains(&k) {
        let value = f64::from(digit) * 10f64.powi(k);
        return format!("{value:.*}", (-k).max(0) as usize);
    }
    let power = minus(&format!("10^{{{k}}}"));
    if digit == 1 { power } else { format!("{digit}·{power}") }
}

/// A number by a power of ten: `2·10^{−5}`.
pub(in crate::report) fn power_label(x: f64) -> String {
    let text = format!("{x:e}");
    let Some((digits, power)) = text.split_once('e') else { return minus(&text) };
    let digits: f64 = digits.parse().unwrap_or(f64::NAN);
    let digits = (digits * 1e3).round() / 1e3;
    minus(&format!("{digits}·10^{{{power}}}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(scale: Scale, count: usize) -> Vec<String> {
        scale.ticks(count).into_iter().map(|t| t.label).filter(|l| !l.is_empty()).collect()
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(labels(Scale::linear(0.0, 1.0), 5), ["0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(Scale::degrees(-90.0, 90.0), 6), ["−90", "−60", "−30", "0", "30", "60", "90"]);
        assert_eq!(
            labels(Scale { low: 0.01, high: 100.0, spacing: Spacing::Log }, 5),
            ["0.01", "0.1", "1", "10", "100"]
        );
        assert_eq!(labels(Scale { low: 1e-5, high: 1e-4, spacing: Spacing::Log }, 5).first().expect("one"), "10^{−5}");
        for scale in [Scale::around([0.013, 7.2]), Scale::log_around([3e-4, 20.0], 8.0)] {
            for tick in scale.ticks(5) {
                let place = scale.place(tick.value).expect("a place");
                assert!((-1e-9..=1.0 + 1e-9).contains(&place), "{scale:?}: {tick:?}");
            }
        }
    }

    #[test]
    fn ends_hold_all_values() {
        for values in [vec![0.3, 1.78], vec![1e-9, 2e-9], vec![-4.0, 3.0], vec![0.0], vec![]] {
            let scale = Scale::around(values.iter().copied());
            for v in values {
                // A hair beyond the last step is drawn there.
                assert!(scale.place(v).is_some_and(|p| (-0.02..=1.02).contains(&p)), "{scale:?} {v}");
            }
        }
        let scale = Scale::log_around([1e-9, 0.03, 7.0], 4.0);
        assert!((scale.high - 10.0).abs() < 1e-9 && scale.low >= 4.9e-4, "{scale:?}");
        assert_eq!(scale.place(0.0), None, "a logarithm has no place for 0");
    }
}
