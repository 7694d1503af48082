//! Advice: the setting for a wanted error or time, from what was measured.
//!
//! A trial of a setting stays below its prediction limit with probability 95 %: Student's, of the logarithms, whose scatter all settings of a curve
//! share. Between two settings of a knob that is a dial the limits are joined by a power law; beyond the last one the curve's slope carries on, at the
//! end of its interval that promises less, for a few times the size.

use serde::Serialize;

use super::curve::{Curve, Point, Sweep};
use super::design::Cost;
use crate::numeric::estimate::{Estimate, LogScatter};
use crate::numeric::line::Line;

/// Sizes beyond the last that was measured: up to so many times it.
const BEYOND: f64 = 8.0;

/// What is wanted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Wish {
    /// An error of at most this, with 95 % confidence, in as little time as possible. The measure by its name; none is each curve's main one.
    Error(Option<String>, f64),
    /// A computation of at most so many seconds, with 95 % confidence, with as small an error as possible.
    Time(f64),
    /// The same of the instrument's seconds, which are certain.
    InstrumentTime(f64),
}

/// What is to be expected of one more trial, and what it stays below with probability 95 %.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Forecast {
    /// The mean of the logarithms' own.
    pub expected: f64,
    /// The limit.
    pub at_most: f64,
}

/// A setting to take.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Advice {
    /// The curve that it is on.
    pub curve: String,
    /// Its options.
    pub setting: String,
    /// How much of what the knob turns.
    pub size: Option<f64>,
    /// Name of the measure.
    pub measure: &'static str,
    /// The error.
    pub error: Forecast,
    /// The computer's time, s.
    pub seconds: Forecast,
    /// The instrument's time, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instrument_s: Option<f64>,
    /// Whether the size lies beyond all that were measured.
    pub beyond: bool,
}

/// Why there is no advice.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoAdvice {
    /// No such measure.
    #[error("expected an error out of {known}, found {name}")]
    Measure {
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// Nothing that was measured is good enough, or fast enough.
    #[error("nothing that was measured has {wanted} with 95 % confidence; {nearest}")]
    OutOfReach {
        /// What was wanted.
        wanted: String,
        /// What comes nearest.
        nearest: String,
    },
}

/// The forecasts of one curve and measure.
#[derive(Debug)]
pub struct Adviser<'a> {
    curve: &'a Curve,
    measure: &'static str,
    /// Of every setting that enough is known of, by size.
    known: Vec<Known<'a>>,
}

#[derive(Debug, Clone, Copy)]
struct Known<'a> {
    point: &'a Point,
    error: Forecast,
    seconds: Forecast,
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
    fn candidates(&self, wish: &Wish) -> Vec<Advice> {
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
    fn cost(&self, wish: &Wish) -> Option<Forecast> {
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

fn limit(wish: &Wish) -> f64 {
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

fn scatter(curve: &Curve, of: &dyn Fn(&Point) -> Vec<f64>) -> LogScatter {
    let mut scatter = LogScatter::default();
    for point in &curve.points {
        let values = of(point);
        if values.iter().all(|v| *v > 0.0) {
            scatter.add(&values.iter().map(|v| v.ln()).collect::<Vec<_>>());
        }
    }
    scatter
}

/// Of one more value like these; an error that is 0 throughout stays so.
fn forecast(scatter: &LogScatter, values: &[f64]) -> Option<Forecast> {
    if !values.is_empty() && values.iter().all(|v| *v == 0.0) {
        return Some(Forecast { expected: 0.0, at_most: 0.0 });
    }
    let n = values.len();
    let mean = values.iter().map(|v| v.ln()).sum::<f64>() / n as f64;
    let at_most = scatter.upper_limit(mean, n).filter(|_| n > 0 && mean.is_finite())?;
    Some(Forecast { expected: mean.exp(), at_most })
}

/// The setting that meets a wish best: the fastest with an error small enough, or the most accurate that is fast enough.
///
/// # Errors
/// [`NoAdvice`] where the sweep has no such measure, or nothing meets the wish.
pub fn advise(sweep: &Sweep, wish: &Wish) -> Result<Advice, NoAdvice> {
    let named = match wish {
        Wish::Error(Some(name), _) => Some(sweep.measure(name).ok_or_else(|| NoAdvice::Measure {
            name: name.clone(),
            known: sweep.measures.iter().map(|m| m.name).collect::<Vec<_>>().join(", "),
        })?),
        _ => None,
    };
    let of_instrument = |curve: &&Curve| curve.cost == Cost::Instrument;
    let wants_instrument = match wish {
        Wish::InstrumentTime(_) => true,
        Wish::Time(_) => false,
        Wish::Error(..) => sweep.curves.first().is_some_and(|c| c.cost == Cost::Instrument),
    };
    let advisers: Vec<Adviser<'_>> = sweep
        .curves
        .iter()
        .filter(|curve| of_instrument(curve) == wants_instrument)
        .filter_map(|curve| Some(Adviser::new(sweep, curve, named.or_else(|| sweep.measure(curve.main))?)))
        .collect();
    let price = |a: &Advice| match (wish, wants_instrument) {
        (Wish::Error(..), true) => a.instrument_s.unwrap_or(f64::INFINITY),
        (Wish::Error(..), false) => a.seconds.expected,
        _ => a.error.at_most,
    };
    let all = advisers.iter().flat_map(|adviser| adviser.candidates(wish));
    all.min_by(|a, b| price(a).total_cmp(&price(b))).ok_or_else(|| out_of_reach(&advisers, wish))
}

fn out_of_reach(advisers: &[Adviser<'_>], wish: &Wish) -> NoAdvice {
    let all = || advisers.iter().flat_map(|a| a.known.iter().map(move |k| (a, k)));
    let (wanted, nearest) = match wish {
        Wish::Error(_, most) => (
            format!("an error of {most:.3e}"),
            all().min_by(|a, b| a.1.error.at_most.total_cmp(&b.1.error.at_most)).map(|(a, k)| {
                format!("the best, {}, stays below {} = {:.3e}", k.point.setting, a.measure, k.error.at_most)
            }),
        ),
        _ => (
            format!("a time of {:.3e} s", limit(wish)),
            all().min_by(|a, b| a.1.seconds.at_most.total_cmp(&b.1.seconds.at_most)).map(|(_, k)| {
                let time = k.cost(wish).map_or(f64::NAN, |f| f.at_most);
                format!("the fastest, {}, stays below {time:.3e} s", k.point.setting)
            }),
        ),
    };
    let nearest = nearest.unwrap_or_else(|| "no setting was tried twice".into());
    NoAdvice::OutOfReach { wanted, nearest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::{Purpose, stream};
    use crate::tradeoff::design::{Law, Measure, Series, Setting, Theory};
    use crate::tradeoff::knob::Knob;
    use crate::tradeoff::sweep::{Effort, Trial, run};
    use rand_distr::{Distribution, Normal};

    /// A trial of a made-up renderer: error 0.4/√n, scattering by 10 %, time 1 ms and 10 µs a sample, scattering by 20 %.
    fn made_up(size: f64, seed: u64) -> Trial {
        let mut rng = stream(seed, Purpose::Study, 1);
        let normal = Normal::new(0.0, 1.0).expect("a distribution");
        let [a, b]: [f64; 2] = [normal.sample(&mut rng), normal.sample(&mut rng)];
        Trial { seconds: (1e-3 + 1e-5 * size) * (0.2 * a).exp(), errors: vec![0.4 / size.sqrt() * (0.1 * b).exp()] }
    }

    fn sweep_of(seed: u64) -> Sweep {
        let law = Law { theory: Theory::Exactly(-0.5), why: "independent" };
        let series = Series {
            name: "made up".into(),
            knob: Knob::Samples,
            cost: Cost::Computer,
            main: 0,
            laws: vec![Some(law)],
            whole: 0.0,
        };
        let sizes = [4.0, 16.0, 64.0, 256.0, 1024.0];
        let settings = sizes.map(|n| Setting::sized(0, n, Knob::Samples.typed(n, 0.0), ()));
        let effort = Effort { trials: 5, seed, deadline: None };
        let control = crate::control::Control::silent();
        let runs = run::<_, ()>(&settings, &effort, control, |i, turn| Ok(made_up(sizes[i], turn.seed))).expect("runs");
        let measures = vec![Measure { name: "error", what: "made up" }];
        let curves =
            super::super::curve::curves(&[series], &settings, &measures, &runs, &super::super::curve::Beside::NOTHING);
        let about = super::super::curve::About {
            stage: "render",
            subject: String::new(),
            command: String::new(),
            reference: vec![],
            notes: vec![],
        };
        about.sweep(measures, curves, &effort, None, std::time::Instant::now())
    }

    /// Sweeps, advice, one more trial each: what is promised at 95 % holds in at least 89 of 100, which a true 95 % misses in 1 of 200 sets.
    #[test]
    fn what_is_promised_holds() {
        for (wish, sizes) in [
            (Wish::Error(None, 0.03), 180.0..400.0),
            (Wish::Error(None, 0.008), 2500.0..8192.0), // beyond what was measured
            (Wish::Time(4e-3), 60.0..300.0),
        ] {
            let mut held = 0;
            for seed in 0..200 {
                let advice = advise(&sweep_of(seed), &wish).expect("within reach");
                let size = advice.size.expect("a size");
                assert!(sizes.contains(&size), "{wish:?}: {size}");
                let trial = made_up(size, 1000 + seed);
                let got = if matches!(wish, Wish::Time(_)) { trial.seconds } else { trial.errors[0] };
                held += u32::from(got <= limit(&wish));
                assert_eq!(advice.beyond, size > 1024.0);
            }
            assert!(held >= 178, "{wish:?}: {held} of 200");
        }
    }

    /// A fit to all samples is off by nothing; what lies between it and a part is not known.
    #[test]
    fn nothing_is_promised_on_the_way_to_an_error_of_0() {
        let mut sweep = sweep_of(4);
        if let Some(last) = sweep.curves[0].points.last_mut() {
            last.trials.iter_mut().for_each(|t| t.errors[0] = 0.0);
        }
        let advice = advise(&sweep, &Wish::Error(None, 0.01)).expect("within reach");
        assert_eq!((advice.setting.as_str(), advice.error.at_most), ("--samples 1024", 0.0));
        for most in [0.03, 0.05, 0.1] {
            let advice = advise(&sweep, &Wish::Error(None, most)).expect("within reach");
            assert!(advice.error.at_most <= most * (1.0 + 1e-9), "{advice:?}");
        }
    }

    #[test]
    fn a_setting_with_an_error_that_could_not_be_told_takes_no_part() {
        let mut sweep = sweep_of(4);
        if let Some(last) = sweep.curves[0].points.last_mut() {
            last.trials[2].errors[0] = f64::NAN;
        }
        let adviser = Adviser::new(&sweep, &sweep.curves[0], 0);
        let sizes: Vec<f64> = adviser.known.iter().filter_map(|k| k.point.size).collect();
        assert_eq!(sizes, [4.0, 16.0, 64.0, 256.0]);
    }

    #[test]
    fn the_slope_is_that_of_theory_and_what_can_t_be_had_is_said() {
        let sweep = sweep_of(3);
        let slope = &sweep.curves[0].slopes[0];
        assert!(slope.slope.low <= -0.5 && slope.slope.high >= -0.5, "{slope:?}");
        let said = |wish| advise(&sweep, &wish).expect_err("out of reach").to_string();
        let error = said(Wish::Error(None, 1e-6));
        assert!(error.contains("1.000e-6") && error.contains("--samples 1024"), "{error}");
        let error = said(Wish::Error(Some("flip".into()), 1e-6));
        assert!(error.contains("error") && error.contains("flip"), "{error}");
        let error = said(Wish::Time(1e-6));
        assert!(error.contains("1.000e-6 s") && error.contains("the fastest, --samples"), "{error}");
    }
}
