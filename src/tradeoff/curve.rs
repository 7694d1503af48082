//! From trials to curves: intervals, slopes beside those of theory, standings.

use serde::Serialize;

use super::design::{Cost, Law, Measure, Series, Setting};
use super::front::{Standing, standings};
use super::knob::Knob;
use super::sweep::{Effort, Runs, Trial};
use crate::numeric::estimate::{Estimate, median, root_mean_square};
use crate::numeric::line::Line;

/// All that was measured of one stage.
#[derive(Debug, Clone, Serialize)]
pub struct Sweep {
    /// `fit`, `render`, `simulate` or `chain`.
    pub stage: &'static str,
    /// What was fitted, rendered, measured.
    pub subject: String,
    /// The command that the settings' options go with, word by word; of a chain each option's own.
    pub commands: Vec<Vec<String>>,
    /// The errors, in the order in which points have them.
    pub measures: Vec<Measure>,
    /// The curves.
    pub curves: Vec<Curve>,
    /// What errors are measured against, and how good that is.
    pub reference: Vec<String>,
    /// What a reader must know.
    pub notes: Vec<String>,
    /// Trials asked for of each setting.
    pub trials: u32,
    /// Key of all seeds.
    pub seed: u64,
    /// Threads that worked.
    pub threads: usize,
    /// Time of all of it, s.
    pub seconds: f64,
    /// Why there are fewer trials than asked for, where that is so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ended: Option<String>,
}

/// Settings that differ in one knob.
#[derive(Debug, Clone, Serialize)]
pub struct Curve {
    /// What they share.
    pub name: String,
    /// What they differ in.
    pub knob: Knob,
    /// What their size counts.
    pub axis: &'static str,
    /// Whose time counts.
    pub cost: Cost,
    /// Name of the measure that counts.
    pub main: &'static str,
    /// The commands that its settings' options go with, one each, where they are not the sweep's.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub commands: Vec<Vec<String>>,
    /// The settings, as they were tried.
    pub points: Vec<Point>,
    /// Slopes in log-log, for measures that have enough points.
    pub slopes: Vec<Slope>,
    /// All of what sizes are a part of.
    #[serde(skip)]
    pub whole: f64,
    /// Whether one can ask for its settings as for the whole work: advice takes no others.
    #[serde(skip)]
    pub advisable: bool,
}

/// A setting and what came of it.
#[derive(Debug, Clone, Serialize)]
pub struct Point {
    /// How it is typed.
    pub setting: String,
    /// How much of what the knob turns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<f64>,
    /// Median time of a trial, s.
    pub seconds: Estimate,
    /// Time of the simulated instrument, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instrument_s: Option<f64>,
    /// Root mean squares over the trials, measure by measure; none where a trial's could not be told, for those that could are not chosen by chance.
    pub errors: Vec<Option<Estimate>>,
    /// What the setting promises of the main measure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub promise: Option<f64>,
    /// In how many trials that was kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kept: Option<usize>,
    /// Of how many: those in which it can be told.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub judged: Option<usize>,
    /// Where it stands among the settings that spend the same time for the same measure, against the same reference.
    pub standing: Standing,
    /// The trials themselves.
    pub trials: Vec<Trial>,
    /// What of the size theory speaks of.
    #[serde(skip)]
    pub effective: Option<f64>,
}

/// How an error falls with the size.
#[derive(Debug, Clone, Serialize)]
pub struct Slope {
    /// Name of the measure.
    pub measure: &'static str,
    /// d ln error / d ln size.
    pub slope: Estimate,
    /// ln error at ln size = 0 on the line.
    pub intercept: f64,
    /// Points that it goes through.
    pub points: usize,
    /// What theory says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub law: Option<Law>,
}

impl Slope {
    /// Error on the line at a size.
    #[must_use]
    pub fn at(&self, size: f64) -> f64 {
        (self.intercept + self.slope.value * size.ln()).exp()
    }
}

impl Point {
    /// What the time of a series is, of those.
    #[must_use]
    pub fn cost(&self, cost: Cost) -> Option<Estimate> {
        match cost {
            Cost::Computer => Some(self.seconds),
            Cost::Instrument => self.instrument_s.map(Estimate::exact),
            Cost::Both => self.instrument_s.map(|s| self.seconds.plus(s)),
        }
    }
}

impl Sweep {
    /// The measure of this name.
    #[must_use]
    pub fn measure(&self, name: &str) -> Option<usize> {
        self.measures.iter().position(|m| m.name == name)
    }

    /// All points, with the index of their curve.
    pub fn points(&self) -> impl Iterator<Item = (usize, &Point)> {
        self.curves.iter().enumerate().flat_map(|(c, curve)| curve.points.iter().map(move |p| (c, p)))
    }
}

/// What a stage knows beside its trials.
pub(super) struct Beside<'a> {
    /// Errors that are not the root mean square of those of trials, by the index of setting and measure.
    pub errors: &'a dyn Fn(usize, usize) -> Option<Estimate>,
    /// What a trial's main error stays below where it could not be told.
    pub untold: f64,
}

impl Beside<'_> {
    /// Nothing.
    pub const NOTHING: Self = Self { errors: &|_, _| None, untold: f64::INFINITY };
}

/// The curves of the series. Settings without a whole trial are left out, and series without any setting.
pub(super) fn curves<S>(
    series: &[Series],
    settings: &[Setting<S>],
    measures: &[Measure],
    runs: &Runs,
    beside: &Beside<'_>,
) -> Vec<Curve> {
    let mut points: Vec<Option<Point>> = (0..settings.len())
        .map(|i| point(&settings[i], &series[settings[i].series], &runs.trials[i], i, measures.len(), beside))
        .collect();
    stand(series, settings, &mut points);
    let of_series = |(s, series): (usize, &Series)| {
        let own = |(i, point): (usize, &mut Option<Point>)| point.take_if(|_| settings[i].series == s);
        let points: Vec<Point> = points.iter_mut().enumerate().filter_map(own).collect();
        let slopes = (0..measures.len()).filter_map(|m| slope(series, measures, m, &points)).collect();
        Curve {
            name: series.name.clone(),
            knob: series.knob,
            axis: series.knob.axis(),
            cost: series.cost,
            main: measures[series.main].name,
            commands: Vec::new(),
            points,
            slopes,
            whole: series.whole,
            advisable: series.advisable,
        }
    };
    series.iter().enumerate().map(of_series).filter(|curve| !curve.points.is_empty()).collect()
}

fn point<S>(
    setting: &Setting<S>,
    series: &Series,
    trials: &[Trial],
    index: usize,
    measures: usize,
    beside: &Beside<'_>,
) -> Option<Point> {
    let seconds = median(&trials.iter().map(|t| t.seconds).collect::<Vec<_>>())?;
    let of_trials = |m: usize| root_mean_square(&trials.iter().map(|t| t.errors[m]).collect::<Vec<_>>());
    let kept = setting.promise.map(|promise| kept(trials, series.main, promise, beside.untold));
    Some(Point {
        setting: setting.text.clone(),
        size: setting.size,
        effective: setting.effective.or(setting.size),
        seconds,
        instrument_s: setting.instrument_s,
        errors: (0..measures).map(|m| (beside.errors)(index, m).or_else(|| of_trials(m))).collect(),
        promise: setting.promise,
        kept: kept.map(|k| k.0),
        judged: kept.map(|k| k.1),
        standing: Standing::Unknown,
        trials: trials.to_vec(),
    })
}

/// In how many trials an error is at most what was promised, and in how many that can be judged. An error that could not be told stays below `untold`, which
/// keeps a promise of more; of a promise of less it says nothing.
fn kept(trials: &[Trial], main: usize, promise: f64, untold: f64) -> (usize, usize) {
    let met = |t: &Trial| match t.errors[main] {
        e if e.is_nan() => (untold <= promise).then_some(true),
        e => Some(e <= promise),
    };
    let told: Vec<bool> = trials.iter().filter_map(met).collect();
    (told.iter().filter(|met| **met).count(), told.len())
}

/// Settings compete that spend the same time for the same measure, against the same reference: an effect left out is
/// off the instrument with all of them, which is off by nothing itself; other knobs are off the truth.
fn stand<S>(series: &[Series], settings: &[Setting<S>], points: &mut [Option<Point>]) {
    let class = |i: usize| {
        let Series { cost, main, knob, .. } = series[settings[i].series];
        (cost, main, knob == Knob::Effects)
    };
    let of = |i: usize, own: (Cost, usize, bool)| {
        let point = points[i].as_ref().filter(|_| class(i) == own)?;
        point.cost(own.0).zip(point.errors[own.1])
    };
    let found: Vec<Standing> = (0..settings.len())
        .map(|i| {
            let rivals: Vec<_> = (0..settings.len()).map(|k| of(k, class(i))).collect();
            standings(&rivals)[i]
        })
        .collect();
    points.iter_mut().zip(found).for_each(|(point, found)| {
        if let Some(point) = point {
            point.standing = found;
        }
    });
}

/// The slope of a measure, where three points or more tell it.
fn slope(series: &Series, measures: &[Measure], m: usize, points: &[Point]) -> Option<Slope> {
    let told = |p: &Point| {
        let (size, error) = (p.effective?, p.errors[m]?);
        let known = size.is_finite() && error.is_bounded() && error.low > 0.0;
        known.then(|| (size.ln(), error.value.ln(), error.log_deviation()))
    };
    let logs: Vec<(f64, f64, f64)> = points.iter().filter_map(told).collect();
    let line = Line::through(&logs).filter(|_| logs.len() >= 3)?;
    let (slope, intercept) = (line.slope, line.intercept);
    Some(Slope { measure: measures[m].name, slope, intercept, points: logs.len(), law: series.laws[m] })
}

/// A command of these words.
pub(super) fn words<const N: usize>(words: [&str; N]) -> Vec<String> {
    words.map(str::to_owned).to_vec()
}

/// The parts of a sweep that only its stage knows.
pub(super) struct About {
    pub stage: &'static str,
    pub subject: String,
    pub commands: Vec<Vec<String>>,
    pub reference: Vec<String>,
    pub notes: Vec<String>,
}

impl About {
    /// The whole sweep, begun at `began`.
    pub fn sweep(
        self,
        measures: Vec<Measure>,
        curves: Vec<Curve>,
        effort: &Effort,
        ended: Option<String>,
        began: std::time::Instant,
    ) -> Sweep {
        let Self { stage, subject, commands, reference, notes } = self;
        Sweep {
            stage,
            subject,
            commands,
            measures,
            curves,
            reference,
            notes,
            trials: effort.trials,
            seed: effort.seed,
            threads: rayon::current_num_threads(),
            seconds: began.elapsed().as_secs_f64(),
            ended,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_promise_counts_in_trials_that_can_be_judged() {
        let trials = [0.5, 2.0, f64::NAN, 1.0].map(|e| Trial { seconds: 1.0, errors: vec![0.0, e] });
        assert_eq!(kept(&trials, 1, 1.0, f64::INFINITY), (2, 3));
        assert_eq!(kept(&trials, 1, 1.0, 0.9), (3, 4), "it stays below the promise");
        assert_eq!(kept(&trials, 1, 1.0, 1.1), (2, 3), "it may be above");
    }

    #[test]
    fn effects_left_out_compete_among_themselves() {
        let series = [Knob::Quadrature, Knob::Effects].map(|knob| Series {
            name: knob.axis().into(),
            knob,
            cost: Cost::Computer,
            main: 0,
            laws: vec![None],
            whole: 0.0,
            advisable: true,
        });
        // Of each its series, its time and its error: all effects are off by nothing, and quicker than the finest means.
        let tried = [(0, 1.0, 1e-2), (0, 9.0, 1e-6), (1, 3.0, 0.0), (1, 2.0, 0.1), (1, 4.0, 0.2)];
        let settings = tried.map(|(series, size, _)| Setting::sized(series, size, size.to_string(), ()));
        let trial = |(_, seconds, error)| vec![Trial { seconds, errors: vec![error] }; 6];
        let runs = Runs { trials: tried.map(trial).to_vec(), ended: None };
        let measures = [Measure { name: "reading", what: "made up" }];
        let found = curves(&series, &settings, &measures, &runs, &Beside::NOTHING);
        let standings = found.iter().map(|c| c.points.iter().map(|p| p.standing).collect()).collect::<Vec<Vec<_>>>();
        let front = Standing::Front;
        assert_eq!(standings, [vec![front, front], vec![front, front, Standing::Beaten]]);
    }
}
