//! The settings of one curve that meet a wish: those that were tried, one between them, one beyond.

use super::forecast::{Forecast, forecast, scatter};
use super::{Advice, Wish};
use crate::numeric::estimate::Estimate;
use crate::numeric::line::Line;
use crate::tradeoff::curve::{Curve, Point, Sweep};
use crate::tradeoff::design::Cost;

/// Sizes beyond the last that was measured: up to so many times it.
const BEYOND: f64 = 8.0;

/// The forecasts of one curve and measure.
#[derive(Debug)]
pub struct Adviser<'a> {
    curve: &'a Curve,
    pub(super) measure: &'static str,
    /// Of every setting that enough is known of, by size.
    pub(super) known: Vec<Known<'a>>,
}

/// A setting, and what one more trial of it will be like.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known<'a> {
    pub point: &'a Point,
    pub error: Forecast,
    pub seconds: Forecast,
}

impl<'a> Adviser<'a> {
    /// Of the measure with this index.
    #[must_use]
    pub fn new(sweep: &Sweep, curve: &'a Curve, measure: usize) -> Self {
        // Errors that could be told beside others that could not are not chosen by chance: such a setting takes no part.
        let errors = |p: &Point| {
            let all: Vec<f64> = p.trials.iter().map(|t| t.errors[measure]).collect();
            if all.iter().any(|e| e.is_nan()) { Vec::new() } else { all }
        };
        let seconds = |p: &Point| p.trials.iter().map(|t| t.seconds).collect();
        let [of_errors, of_seconds] = [scatter(curve, &errors), scatter(curve, &seconds)];
        let known = |point: &'a Point| {
            let error = forecast(&of_errors, &errors(point))?;
            Some(Known { point, error, seconds: forecast(&of_seconds, &seconds(point))? })
        };
        let mut known: Vec<Known<'a>> = curve.points.iter().filter_map(known).collect();
        known.sort_by(|a, b| a.point.size.unwrap_or(0.0).total_cmp(&b.point.size.unwrap_or(0.0)));
        Self { curve, measure: sweep.measures[measure].name, known }
    }

    /// All settings that meet the wish: those that were measured, and the one that just does.
    pub(super) fn candidates(&self, wish: &Wish) -> Vec<Advice> {
        let met = self.known.iter().filter(|k| meets(k.error.at_most, k.seconds.at_most, k.point.instrument_s, wish));
        let mut all: Vec<Advice> = met.map(|k| self.of(k)).collect();
        if self.curve.knob.is_dial() {
            all.extend(self.between(wish));
            all.extend(self.beyond(wish).filter(|_| all.is_empty() || !matches!(wish, Wish::Error(..))));
        }
        // Rounding of a size must not have spoilt it.
        let slack = 1.0 + 1e-9;
        all.retain(|a| {
            meets(a.error.at_most / slack, a.seconds.at_most / slack, a.instrument_s.map(|s| s / slack), wish)
        });
        all
    }

    /// What one setting is taken before another for: the time that it spends, or its error where the time is wished for.
    pub(super) fn price(&self, advice: &Advice, wish: &Wish) -> f64 {
        let instrument_s = advice.instrument_s.unwrap_or(f64::INFINITY);
        match (wish, self.curve.cost) {
            (Wish::Error(..), Cost::Computer) => advice.seconds.expected,
            (Wish::Error(..), Cost::Instrument) => instrument_s,
            (Wish::Error(..), Cost::Both) => instrument_s + advice.seconds.expected,
            _ => advice.error.at_most,
        }
    }

    fn of(&self, known: &Known<'_>) -> Advice {
        let Known { point, error, seconds } = *known;
        Advice {
            curve: self.curve.name.clone(),
            setting: point.setting.clone(),
            size: point.size,
            measure: self.measure,
            error,
            seconds,
            instrument_s: point.instrument_s,
            beyond: false,
        }
    }

    /// The size between two neighbours at which the wish is just met.
    fn between(&self, wish: &Wish) -> Option<Advice> {
        let mut pairs = self.known.windows(2).filter_map(|pair| {
            let [a, b] = [&pair[0], &pair[1]];
            let (x, y) = (a.point.size?.ln(), b.point.size?.ln());
            let (p, q, want) = (bound(a, wish)?.ln(), bound(b, wish)?.ln(), limit(wish).ln());
            if !(p.is_finite() && q.is_finite()) {
                return None;
            }
            // The errors fall with the size, times rise.
            let crosses = if matches!(wish, Wish::Error(..)) { p > want && q <= want } else { p <= want && q > want };
            crosses.then(|| self.at((x + (y - x) * (want - p) / (q - p)).exp(), matches!(wish, Wish::Error(..))))?
        });
        pairs.next_back()
    }

    /// A size beyond the largest.
    fn beyond(&self, wish: &Wish) -> Option<Advice> {
        let last = self.known.last().filter(|_| self.known.len() >= 3)?;
        let size = last.point.size?;
        let most = if self.curve.whole > 0.0 { self.curve.whole } else { BEYOND * size }.min(BEYOND * size);
        let (own, want) = (bound(last, wish)?, limit(wish));
        let rises = !matches!(wish, Wish::Error(..));
        let slope = if rises { self.slope_of(|k| k.cost(wish))?.high } else { self.slope_of(|k| Some(k.error))?.high };
        // An error that may not fall at all promises nothing.
        if rises != (slope > 0.0) || rises != (want > own) {
            return None;
        }
        let reached = size * (want / own).powf(1.0 / slope);
        if !rises && reached > most {
            return None;
        }
        self.at(reached.min(most), !rises)
    }

    /// What is to be expected at a size, rounded to one that can be asked for, up or down.
    fn at(&self, size: f64, up: bool) -> Option<Advice> {
        let size = self.curve.knob.rounded(size, up, self.curve.whole);
        let (first, last) = (self.known.first()?.point.size?, self.known.last()?.point.size?);
        let forecast = |of: &dyn Fn(&Known<'_>) -> Option<Forecast>| {
            Some(Forecast {
                expected: self.value(size, &|k| of(k).map(|f| f.expected))?,
                at_most: self.value(size, &|k| of(k).map(|f| f.at_most))?,
            })
        };
        Some(Advice {
            curve: self.curve.name.clone(),
            setting: self.curve.knob.typed(size, self.curve.whole),
            size: Some(size),
            measure: self.measure,
            error: forecast(&|k| Some(k.error))?,
            seconds: forecast(&|k| Some(k.seconds))?,
            instrument_s: self.value(size, &|k| k.point.instrument_s),
            beyond: !(first..=last).contains(&size),
        })
    }

    /// A quantity at a size: by power laws between neighbours, beyond the last by the slope of all, at its upper end.
    fn value(&self, size: f64, of: &dyn Fn(&Known<'_>) -> Option<f64>) -> Option<f64> {
        let logs: Option<Vec<(f64, f64)>> =
            self.known.iter().map(|k| Some((k.point.size?.ln(), of(k)?.ln()))).collect();
        let (logs, x) = (logs?, size.ln());
        let (last, _) = (logs.last()?, logs.first()?);
        if x > last.0 {
            let points: Vec<(f64, f64, f64)> = logs.iter().map(|(x, y)| (*x, *y, 0.0)).collect();
            let slope = Line::through(&points)?.slope.high;
            return Some((last.1 + slope * (x - last.0)).exp());
        }
        let pair = logs.windows(2).find(|pair| x <= pair[1].0)?;
        let share = (x - pair[0].0) / (pair[1].0 - pair[0].0);
        let value = pair[0].1 + share * (pair[1].1 - pair[0].1);
        // To an error of 0, of all there is, no power law leads.
        value.is_finite().then(|| value.exp())
    }

    fn slope_of(&self, of: impl Fn(&Known<'_>) -> Option<Forecast>) -> Option<Estimate> {
        let point = |k: &Known<'_>| Some((k.point.size?.ln(), of(k)?.expected.ln(), 0.0));
        let points: Vec<(f64, f64, f64)> = self.known.iter().filter_map(point).collect();
        Line::through(&points).map(|line| line.slope)
    }
}

impl Known<'_> {
    pub fn cost(&self, wish: &Wish) -> Option<Forecast> {
        match wish {
            Wish::InstrumentTime(_) => self.point.instrument_s.map(|s| Forecast { expected: s, at_most: s }),
            _ => Some(self.seconds),
        }
    }
}

/// The bound that the wish is about.
fn bound(known: &Known<'_>, wish: &Wish) -> Option<f64> {
    match wish {
        Wish::Error(..) => Some(known.error.at_most),
        _ => known.cost(wish).map(|f| f.at_most),
    }
}

/// What is asked for.
pub(super) fn limit(wish: &Wish) -> f64 {
    match wish {
        Wish::Error(_, limit) | Wish::Time(limit) | Wish::InstrumentTime(limit) => *limit,
    }
}

fn meets(error: f64, seconds: f64, instrument_s: Option<f64>, wish: &Wish) -> bool {
    match wish {
        Wish::Error(_, most) => error <= *most,
        Wish::Time(most) => seconds <= *most,
        Wish::InstrumentTime(most) => instrument_s.is_some_and(|s| s <= *most),
    }
}
