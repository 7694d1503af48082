//! How a budget is shared out: of all settings that fit into it the one with the least error, and what one more of each would buy.

use serde::Serialize;

use super::links::Try;
use super::{ChainSweep, summary};
use crate::numeric::estimate::Estimate;
use crate::tradeoff::design::Setting;
use crate::tradeoff::sweep::Runs;

/// The best that a budget buys.
#[derive(Debug, Clone, Serialize)]
pub struct Share {
    /// The budget, s.
    pub budget_s: f64,
    /// Readings averaged at each pair of directions.
    pub readings: u32,
    /// Every how many-th pair is fitted.
    pub stride: usize,
    /// Samples per pixel.
    pub samples: u32,
    /// Time of the instrument, s.
    pub instrument_s: f64,
    /// Time of the fit, s.
    pub fit_s: f64,
    /// Time of the picture, s.
    pub render_s: f64,
    /// Error of the picture that comes of readings and fit, and of its own noise: the whole is the root of the sum of their squares.
    pub from_data: f64,
    /// The second of these.
    pub from_pixels: f64,
    /// What the whole chain was found to be off by.
    pub measured: Option<Estimate>,
    /// What more of each would buy, best first.
    pub next: Vec<Next>,
}

/// One step more of something.
#[derive(Debug, Clone, Serialize)]
pub struct Next {
    /// What to do.
    pub step: String,
    /// Seconds more that it takes; below 0 where it takes less.
    pub seconds: f64,
    /// Share by which the picture's error falls.
    pub gain: f64,
}

impl Next {
    /// Share by which the error falls for each second; infinite where it costs nothing.
    #[must_use]
    pub fn rate(&self) -> f64 {
        if self.seconds > 0.0 { self.gain / self.seconds } else { f64::INFINITY }
    }
}

impl Share {
    /// All of its time, s.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.instrument_s + self.fit_s + self.render_s
    }

    /// What the picture is predicted to be off by.
    #[must_use]
    pub fn predicted(&self) -> f64 {
        self.from_data.hypot(self.from_pixels)
    }

    /// Its options.
    #[must_use]
    pub fn typed(&self) -> String {
        let Self { readings, stride, samples, .. } = self;
        format!("--readings {readings} --stride {stride} --samples {samples}")
    }
}

/// What was measured of the links.
struct Known {
    /// Readings, stride, seconds of the instrument and of the fit, squared error.
    data: Vec<(u32, usize, f64, f64, f64)>,
    /// Samples, seconds, squared error.
    pixels: Vec<(u32, f64, f64)>,
}

impl Known {
    fn of(settings: &[Setting<Try>], runs: &Runs) -> Self {
        let mut known = Self { data: Vec::new(), pixels: Vec::new() };
        for (setting, trials) in settings.iter().zip(&runs.trials) {
            let Some((square, seconds)) = summary(trials) else { continue };
            match (setting.what, setting.instrument_s) {
                (Try::Data(readings, stride), Some(time)) => known.data.push((readings, stride, time, seconds, square)),
                (Try::Pixels(samples), _) => known.pixels.push((samples, seconds, square)),
                _ => {}
            }
        }
        known
    }

    fn shares(&self) -> impl Iterator<Item = Share> {
        self.data.iter().flat_map(|d| self.pixels.iter().map(move |p| (d, p))).map(|(d, p)| Share {
            budget_s: 0.0,
            readings: d.0,
            stride: d.1,
            samples: p.0,
            instrument_s: d.2,
            fit_s: d.3,
            render_s: p.1,
            from_data: d.4.sqrt(),
            from_pixels: p.2.sqrt(),
            measured: None,
            next: Vec::new(),
        })
    }

    /// The least error within a budget.
    fn best(&self, budget_s: f64) -> Option<Share> {
        let fitting = self.shares().filter(|s| s.seconds() <= budget_s);
        let best = fitting.min_by(|a, b| a.predicted().total_cmp(&b.predicted()))?;
        let next = self.next(&best);
        Some(Share { budget_s, next, ..best })
    }

    /// The next larger setting of each link, the others as they are.
    fn next(&self, own: &Share) -> Vec<Next> {
        let steps = self.shares().filter(|s| {
            let changed = [s.readings != own.readings, s.stride != own.stride, s.samples != own.samples];
            let larger = s.readings > own.readings || s.stride < own.stride || s.samples > own.samples;
            larger && changed.iter().filter(|c| **c).count() == 1
        });
        let mut nearest: [Option<Share>; 3] = [None, None, None];
        for step in steps {
            let kind = if step.readings == own.readings { 1 + usize::from(step.stride == own.stride) } else { 0 };
            let nearer = |other: &Share| {
                step.readings <= other.readings && step.stride >= other.stride && step.samples <= other.samples
            };
            if nearest[kind].as_ref().is_none_or(nearer) {
                nearest[kind] = Some(step);
            }
        }
        let named = |(kind, step): (usize, Option<Share>)| {
            let step = step?;
            let text = match kind {
                0 => format!("--readings {}", step.readings),
                1 => format!("--stride {}", step.stride),
                _ => format!("--samples {}", step.samples),
            };
            let gain = 1.0 - step.predicted() / own.predicted();
            Some(Next { step: text, seconds: step.seconds() - own.seconds(), gain })
        };
        let mut next: Vec<Next> = nearest.into_iter().enumerate().filter_map(named).collect();
        // What does not help is no next step, whatever it costs.
        next.sort_by(|a, b| (b.gain > 0.0).cmp(&(a.gain > 0.0)).then(b.rate().total_cmp(&a.rate())));
        next
    }
}

/// The budgets' shares, each once.
pub(super) fn all(what: &ChainSweep<'_>, settings: &[Setting<Try>], runs: &Runs) -> Vec<Share> {
    let known = Known::of(settings, runs);
    let times: Vec<f64> = known.shares().map(|s| s.seconds()).collect();
    let (least, most) = times.iter().fold((f64::INFINITY, 0.0f64), |(l, m), t| (l.min(*t), m.max(*t)));
    let mut budgets = what.budgets.clone();
    if budgets.is_empty() && least.is_finite() {
        budgets = (0..4).map(|k| 1.001 * least * (most / least).powf(f64::from(k) / 3.0)).collect();
    }
    let mut shares: Vec<Share> = budgets.iter().filter_map(|budget| known.best(*budget)).collect();
    shares.dedup_by(|a, b| a.typed() == b.typed());
    shares
}

/// What a reader must know of them: budgets that buy nothing.
pub(super) fn notes(what: &ChainSweep<'_>, settings: &[Setting<Try>], runs: &Runs) -> Vec<String> {
    let least = Known::of(settings, runs).shares().map(|s| s.seconds()).fold(f64::INFINITY, f64::min);
    if least == f64::INFINITY {
        return vec!["no setting of the whole was tried: its links have too few trials".into()];
    }
    let small = what.budgets.iter().filter(|budget| **budget < least);
    small.map(|budget| format!("no setting fits into {budget:.3} s in all: the least takes {least:.3} s")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings take a second each and leave 1/√n of error, twice as much of a fifth of them; samples 1 ms each, 4/√n.
    fn known() -> Known {
        let data = |n: u32, stride: usize| {
            let error = 1.0 / f64::from(n).sqrt() * if stride == 1 { 1.0 } else { 2.0 };
            (n, stride, f64::from(n), if stride == 1 { 0.5 } else { 0.1 }, error * error)
        };
        Known {
            data: [1, 4, 16].into_iter().flat_map(|n| [data(n, 1), data(n, 5)]).collect(),
            pixels: [4u32, 64, 1024].map(|m| (m, 1e-3 * f64::from(m), 16.0 / f64::from(m))).to_vec(),
        }
    }

    #[test]
    fn a_budget_buys_the_least_error_and_its_next_step_is_the_one_that_pays() {
        let known = known();
        let share = known.best(6.0).expect("fits");
        assert_eq!((share.readings, share.stride, share.samples), (4, 1, 1024));
        assert!((share.predicted() - (0.25f64 + 16.0 / 1024.0).sqrt()).abs() < 1e-12);
        assert!((share.seconds() - (4.0 + 0.5 + 1.024)).abs() < 1e-12);
        assert_eq!(share.next.len(), 1, "only more readings are left: {:?}", share.next);
        // With little time everything is coarse; pixels are the cheapest step.
        let share = known.best(1.2).expect("fits");
        assert_eq!((share.readings, share.stride, share.samples), (1, 5, 64));
        let steps: Vec<&str> = share.next.iter().map(|n| n.step.as_str()).collect();
        assert_eq!(steps, ["--stride 1", "--readings 4", "--samples 1024"], "{:?}", share.next);
        let rate = share.next[0].gain / share.next[0].seconds;
        let want = (1.0 - ((1.0f64 + 0.25) / (4.0 + 0.25)).sqrt()) / 0.4;
        assert!((rate - want).abs() < 1e-9, "{rate} of {want}");
        assert!(known.best(0.5).is_none());
    }
}
