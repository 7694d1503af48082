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
    /// The command that the settings' options go with.
    pub command: String,
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
    /// The settings, as they were tried.
    pub points: Vec<Point>,
    /// Slopes in log-log, for measures that have enough points.
    pub slopes: Vec<Slope>,
    /// All of what sizes are a part of.
    #[serde(skip)]
    pub whole: f64,
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
    /// Root mean squares over the trials, measure by measure.
    pub errors: Vec<Option<Estimate>>,
    /// What the setting promises of the main measure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub promise: Option<f64>,
    /// In how many trials that was kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kept: Option<usize>,
    /// Where it stands among the settings that spend the same time for the same measure.
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
    /// What the time of a series is, of those two.
    #[must_use]
    pub fn cost(&self, cost: Cost) -> Option<Estimate> {
        match cost {
            Cost::Computer => Some(self.seconds),
            Cost::Instrument => self.instrument_s.map(Estimate::exact),
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

/// The curves of the series. Settings without a whole trial are left out, and series without any setting.
pub(super) fn curves<S>(
    series: &[Series],
    settings: &[Setting<S>],
    measures: &[Measure],
    runs: &Runs,
    more: &dyn Fn(usize, usize) -> Option<Estimate>,
) -> Vec<Curve> {
    let mut points: Vec<Option<Point>> = (0..settings.len())
        .map(|i| point(&settings[i], &series[settings[i].series], &runs.trials[i], measures.len(), &|m| more(i, m)))
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
            points,
            slopes,
            whole: series.whole,
        }
    };
    series.iter().enumerate().map(of_series).filter(|curve| !curve.points.is_empty()).collect()
}

fn point<S>(
    setting: &Setting<S>,
    series: &Series,
    trials: &[Trial],
    measures: usize,
    more: &dyn Fn(usize) -> Option<Estimate>,
) -> Option<Point> {
    let seconds = median(&trials.iter().map(|t| t.seconds).collect::<Vec<_>>())?;
    let of_trials = |m: usize| {
        let told: Vec<f64> = trials.iter().map(|t| t.errors[m]).filter(|e| !e.is_nan()).collect();
        root_mean_square(&told).filter(|_| 2 * told.len() > trials.len())
    };
    let kept = |promise: f64| trials.iter().filter(|t| t.errors[series.main] <= promise).count();
    Some(Point {
        setting: setting.text.clone(),
        size: setting.size,
        effective: setting.effective.or(setting.size),
        seconds,
        instrument_s: setting.instrument_s,
        errors: (0..measures).map(|m| more(m).or_else(|| of_trials(m))).collect(),
        promise: setting.promise,
        kept: setting.promise.map(kept),
        standing: Standing::Unknown,
        trials: trials.to_vec(),
    })
}

/// Settings compete that spend the same time for the same measure.
fn stand<S>(series: &[Series], settings: &[Setting<S>], points: &mut [Option<Point>]) {
    let class = |i: usize| (series[settings[i].series].cost, series[settings[i].series].main);
    let of = |i: usize, (cost, main)| {
        let point = points[i].as_ref().filter(|_| class(i) == (cost, main))?;
        point.cost(cost).zip(point.errors[main])
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

/// The parts of a sweep that only its stage knows.
pub(super) struct About {
    pub stage: &'static str,
    pub subject: String,
    pub command: String,
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
        let Self { stage, subject, command, reference, notes } = self;
        Sweep {
            stage,
            subject,
            command,
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
