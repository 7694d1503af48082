//! A sweep of `tradeoff`, as its file has it, and its plots: each error against the time, and against its size with the slope of theory beside it.

use std::path::PathBuf;

use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value;

use crate::control::counted;
use crate::report::plot::{Figure, Heading, LogLog, Marks, Point, Series, Slope, minus};
use crate::report::words::{digits, time as told};
use crate::tradeoff::Theory;

/// What `goniofit tradeoff` measured of a stage, as `tradeoff.json` has it; what is neither drawn nor listed is not read.
#[derive(Debug, Clone, Deserialize)]
pub struct Sweep {
    /// `fit`, `render`, `simulate` or `chain`.
    pub stage: String,
    /// What was fitted, rendered, measured.
    pub subject: String,
    measures: Vec<Measure>,
    /// The curves.
    pub curves: Vec<SweepCurve>,
    /// Where it was read.
    #[serde(skip)]
    pub file: PathBuf,
    /// The command that the settings' options go with, word by word; of a chain each option's own.
    #[serde(default)]
    pub commands: Vec<Vec<String>>,
    /// How it was asked for, as `run` in `numbers.json` says it; null where that is not known.
    #[serde(default)]
    pub run: Value,
    /// What errors are measured against, and how good that is.
    #[serde(default)]
    pub reference: Vec<String>,
    /// What a reader must know.
    #[serde(default)]
    pub notes: Vec<String>,
    /// Trials asked for of each setting.
    #[serde(default)]
    pub trials: u32,
    /// Key of all seeds.
    #[serde(default)]
    pub seed: u64,
    /// Why there are fewer trials than asked for, where that is so.
    #[serde(default)]
    pub ended: Option<String>,
}

#[derive(Debug, Clone, Deserialize)]
struct Measure {
    name: String,
}

/// Settings that differ in one knob.
#[derive(Debug, Clone, Deserialize)]
pub struct SweepCurve {
    /// What they share.
    pub name: String,
    #[serde(default)]
    knob: String,
    #[serde(default)]
    axis: String,
    #[serde(default)]
    cost: Cost,
    main: String,
    /// The commands that its settings' options go with, one each, where they are not the sweep's.
    #[serde(default)]
    pub commands: Vec<Vec<String>>,
    points: Vec<Setting>,
    /// Slopes in log-log.
    #[serde(default)]
    pub slopes: Vec<SweepSlope>,
}

/// Whose time is spent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Cost {
    #[default]
    Computer,
    Instrument,
    /// One after the other.
    Both,
}

impl Cost {
    /// Whose time a plot has on its axis: of both the instrument's, for that is by far the longer one.
    fn axis(self) -> Self {
        if self == Self::Both { Self::Instrument } else { self }
    }

    fn whose(self) -> &'static str {
        match self {
            Self::Computer => "the computer",
            Self::Instrument => "the instrument",
            Self::Both => "both",
        }
    }
}

#[derive(Debug, Clone, Deserialize)]
struct Setting {
    #[serde(rename = "setting", default)]
    typed: String,
    size: Option<f64>,
    seconds: Interval,
    instrument_s: Option<f64>,
    errors: Vec<Option<Interval>>,
    promise: Option<f64>,
    kept: Option<usize>,
    judged: Option<usize>,
    #[serde(default)]
    standing: Standing,
    #[serde(default)]
    trials: Vec<IgnoredAny>,
}

/// Where a setting stands among its rivals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Standing {
    Front,
    Undecided,
    Beaten,
    #[default]
    Unknown,
}

/// A setting that was tried.
#[derive(Debug, Clone, Copy)]
pub struct TriedSetting<'a> {
    /// `*` where no other beats it in both time and error, `~` where one does, within the 95 % intervals; else a space.
    pub mark: char,
    /// The curve that it is on.
    pub curve: &'a str,
    /// How it is typed.
    pub setting: &'a str,
    /// What it takes of the time that its curve spends, s.
    pub seconds: Option<f64>,
    /// Name of the error.
    pub measure: &'a str,
    /// The error.
    pub error: Interval,
    /// What it promises of that, in how many trials that was kept, and of how many.
    pub promise: Option<(f64, usize, usize)>,
}

/// A value with its 95 % interval; an end that is not known is none.
#[derive(Debug, Clone, Copy, Deserialize)]
pub struct Interval {
    /// The value.
    pub value: Option<f64>,
    /// Lower end.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
}

/// How an error falls with the size.
#[derive(Debug, Clone, Deserialize)]
pub struct SweepSlope {
    /// Which error.
    pub measure: String,
    /// d ln error / d ln size.
    pub slope: Interval,
    /// What theory says.
    pub law: Option<Law>,
}

/// What theory says of a slope, and why.
#[derive(Debug, Clone, Deserialize)]
pub struct Law {
    /// The exponent, if there is one.
    pub theory: Theory,
    /// Why.
    pub why: String,
}

/// A plot of a sweep.
#[derive(Debug)]
pub struct SweepPlot {
    /// The name of its files: what is drawn, and against what.
    pub name: String,
    /// What it shows.
    pub shows: String,
    /// The drawing.
    pub figure: Figure,
    /// The numbers in it.
    pub series: Vec<Series>,
}

impl Sweep {
    /// All plots that have at least two points on a curve.
    #[must_use]
    pub fn plots(&self) -> Vec<SweepPlot> {
        let mut plots = self.against_time();
        plots.extend(self.knobs().into_iter().flat_map(|knob| self.against_size(knob, |_| true)));
        plots
    }

    /// The errors of which theory knows a slope against the size, that of theory and the measured one beside them.
    #[must_use]
    pub fn beside_theory(&self) -> Vec<SweepPlot> {
        let known = |knob: &str, measure: &str| {
            self.curves.iter().any(|c| c.knob == knob && c.main == measure && !c.theory(measure).is_empty())
        };
        let of = |knob| self.against_size(knob, |measure| known(knob, measure));
        self.knobs().into_iter().flat_map(of).collect()
    }

    /// The settings, curve by curve, those whose error is known.
    #[must_use]
    pub fn settings(&self) -> Vec<TriedSetting<'_>> {
        self.curves.iter().flat_map(|curve| curve.points.iter().filter_map(|p| self.tried(curve, p))).collect()
    }

    fn tried<'a>(&'a self, curve: &'a SweepCurve, point: &'a Setting) -> Option<TriedSetting<'a>> {
        let measure = self.measures.iter().position(|m| m.name == curve.main)?;
        Some(TriedSetting {
            mark: match point.standing {
                Standing::Front => '*',
                Standing::Undecided => '~',
                Standing::Beaten | Standing::Unknown => ' ',
            },
            curve: &curve.name,
            setting: &point.typed,
            seconds: point.time(curve.cost),
            measure: &curve.main,
            error: point.errors.get(measure).copied().flatten()?,
            promise: point.promise.zip(point.kept).zip(point.judged).map(|((most, kept), of)| (most, kept, of)),
        })
    }

    /// How many trials each setting has: what was asked for, or how many there are where the sweep ended before all were made.
    #[must_use]
    pub fn trials_said(&self) -> String {
        let asked = counted(self.trials.into(), "trial");
        if self.ended.is_none() {
            return format!("{asked} of each setting");
        }
        match self.fewest_and_most() {
            Some((fewest, most)) if fewest == most => format!("of {asked} asked for, each setting shown has {most}"),
            Some((fewest, most)) => format!("of {asked} asked for, each setting shown has {fewest} to {most}"),
            None => format!("{asked} of each setting were asked for, and not all were made"),
        }
    }

    /// The smallest and the largest number of trials that a setting has, where the file has them.
    fn fewest_and_most(&self) -> Option<(u64, u64)> {
        let made = || self.curves.iter().flat_map(|c| &c.points).map(|p| p.trials.len() as u64);
        made().min().zip(made().max()).filter(|(_, most)| *most > 0)
    }

    /// The warning that the sweep ended before all trials were made, where it did.
    #[must_use]
    pub fn cut_short(&self) -> Option<String> {
        let why = match self.ended.as_deref()? {
            "stopped" => "was stopped early".to_owned(),
            "the time ended it" => "ran out of its time".to_owned(),
            other => format!("ended early ({other})"),
        };
        Some(format!(
            "The sweep {}: {} {why}: {}. Settings without a whole trial are left out.",
            self.stage,
            self.subject,
            self.trials_said()
        ))
    }

    fn knobs(&self) -> Vec<&str> {
        let mut knobs: Vec<&str> = Vec::new();
        for curve in self.curves.iter().filter(|c| !c.is_of_effects()) {
            if !knobs.contains(&curve.knob.as_str()) {
                knobs.push(&curve.knob);
            }
        }
        knobs
    }

    /// The main error of all curves against the time that they spend: the computer's, then the instrument's. Effects left
    /// out have a plot of their own, for what they are measured against is another.
    #[must_use]
    pub fn against_time(&self) -> Vec<SweepPlot> {
        let mut groups: Vec<(Cost, &str, bool)> = Vec::new();
        for cost in [Cost::Computer, Cost::Instrument] {
            for curve in self.curves.iter().filter(|c| c.cost.axis() == cost) {
                let group = (cost, curve.main.as_str(), curve.is_of_effects());
                if !groups.contains(&group) {
                    groups.push(group);
                }
            }
        }
        groups.into_iter().filter_map(|group| self.of_time(group)).collect()
    }

    fn of_time(&self, (cost, main, of_effects): (Cost, &str, bool)) -> Option<SweepPlot> {
        let measure = self.measures.iter().position(|m| m.name == main)?;
        let own = |c: &&SweepCurve| c.cost.axis() == cost && c.main == main && c.is_of_effects() == of_effects;
        let curves = || self.curves.iter().filter(own);
        let time = |p: &Setting| p.time(cost);
        let series = series(curves().map(|c| (c, c.points(measure, time), of_effects)));
        // A chain's are compared by the time of both, and stand here by the instrument's.
        let compared = || curves().filter(|c| c.cost == cost);
        let front = [Standing::Front, Standing::Undecided].map(|standing| {
            let of = |c| SweepCurve::places(c, measure, time).filter(|(s, _)| s.standing == standing).map(|of| of.1);
            compared().flat_map(of).collect()
        });
        let tips = tips(curves(), measure, time);
        let name = match (cost, of_effects) {
            (Cost::Computer, true) => format!("{main}-effects-time"),
            (Cost::Computer, false) => format!("{main}-time"),
            _ => format!("{main}-instrument-time"),
        };
        let chart = LogLog { series, front, tips, ..LogLog::default() };
        self.plot(name, (&format!("time of {} [s]", cost.whose()), main), chart)
    }

    /// Errors of the curves of a knob against its size, those measures that are `wanted`.
    fn against_size(&self, knob: &str, wanted: impl Fn(&str) -> bool) -> Vec<SweepPlot> {
        let curves = || self.curves.iter().filter(move |c| c.knob == knob);
        let axis = curves().next().map_or("", |c| &c.axis);
        let of = |(m, measure): (usize, &Measure)| {
            let mut series = series(curves().map(|c| (c, c.points(m, |p| p.size), false)));
            let mut slopes: Vec<Slope> = Vec::new();
            for (beside, of) in series.iter_mut().enumerate() {
                let Some(curve) = curves().find(|c| c.name == of.name) else { continue };
                if let Some(slope) = curve.slope(&measure.name).and_then(|s| s.slope.value) {
                    of.name = format!("{}, slope {}", of.name, minus(&format!("{slope:.2}")));
                }
                for (name, slope) in curve.theory(&measure.name) {
                    if !slopes.iter().any(|s| s.slope == slope) {
                        slopes.push(Slope { name: format!("theory {name}"), slope, beside });
                    }
                }
            }
            let chart = LogLog { series, slopes, tips: tips(curves(), m, |p| p.size), ..LogLog::default() };
            self.plot(format!("{}-{knob}", measure.name), (axis, &measure.name), chart)
        };
        self.measures.iter().enumerate().filter(|(_, measure)| wanted(&measure.name)).filter_map(of).collect()
    }

    fn plot(&self, name: String, (x, y): (&str, &str), chart: LogLog) -> Option<SweepPlot> {
        if chart.series.iter().all(|s| s.points.len() < 2) {
            return None;
        }
        let title = format!("{} {}: {y} against {x}", self.stage, self.subject);
        let heading = Heading { title, ..Heading::default() };
        let chart = LogLog { heading, x_label: x.into(), y_label: y.into(), ..chart };
        let shows = format!("{y} against {}", x.trim_end_matches(" [s]"));
        Some(SweepPlot { name, shows, figure: chart.figure(), series: chart.series })
    }
}

impl Setting {
    /// What of its time is spent, s.
    fn time(&self, cost: Cost) -> Option<f64> {
        match cost {
            Cost::Computer => self.seconds.value,
            Cost::Instrument => self.instrument_s,
            Cost::Both => Some(self.seconds.value? + self.instrument_s?),
        }
    }
}

impl SweepCurve {
    /// Whether its settings are effects left out, which no line joins.
    fn is_of_effects(&self) -> bool {
        self.knob == "effects"
    }

    fn slope(&self, measure: &str) -> Option<&SweepSlope> {
        self.slopes.iter().find(|s| s.measure == measure)
    }

    /// The slopes that theory names for a measure, one that is a bound as such; none where it names none.
    fn theory(&self, measure: &str) -> Vec<(String, f64)> {
        let told = |slope: f64| minus(&slope.to_string());
        let Some(theory) = self.slope(measure).and_then(|s| s.law.as_ref()).map(|law| law.theory) else {
            return Vec::new();
        };
        match theory.slopes()[..] {
            [slope] => vec![(theory.said(told), slope)],
            ref ends => ends.iter().map(|&slope| (told(slope), slope)).collect(),
        }
    }

    /// The settings whose error is known to be more than 0, and where they stand in a plot.
    fn places(&self, measure: usize, x: impl Fn(&Setting) -> Option<f64>) -> impl Iterator<Item = (&Setting, Point)> {
        self.points.iter().filter_map(move |p| {
            let error = p.errors.get(measure).copied().flatten()?;
            let (y, low) = (error.value.filter(|v| *v > 0.0)?, error.low.filter(|v| *v > 0.0)?);
            let bar = error.high.filter(|high| *high > low).map(|high| (low, high));
            Some((p, Point { x: x(p)?, y, bar }))
        })
    }

    fn points(&self, measure: usize, x: impl Fn(&Setting) -> Option<f64>) -> Vec<Point> {
        self.places(measure, x).map(|of| of.1).collect()
    }
}

/// What each setting of these curves is, is off by and takes, where it stands in a plot.
fn tips<'a>(
    curves: impl Iterator<Item = &'a SweepCurve>,
    measure: usize,
    x: impl Fn(&Setting) -> Option<f64> + Copy,
) -> Vec<(Point, String)> {
    let of_curve = |curve: &'a SweepCurve| {
        curve.places(measure, x).map(move |(setting, point)| {
            let interval = point
                .bar
                .map_or_else(String::new, |(low, high)| format!(" ({} to {})", digits(low, 3), digits(high, 3)));
            let took = setting
                .time(curve.cost)
                .map_or_else(String::new, |s| format!(", {} of {}", told(s), curve.cost.whose()));
            (point, format!("{}: {}: {}{interval}{took}", curve.name, setting.typed, digits(point.y, 3)))
        })
    };
    curves.flat_map(of_curve).collect()
}

/// Series with colours of their own; those of single settings are dots.
fn series<'a>(curves: impl Iterator<Item = (&'a SweepCurve, Vec<Point>, bool)>) -> Vec<Series> {
    let filled = curves.filter(|(_, points, _)| !points.is_empty()).enumerate();
    filled
        .map(|(color, (curve, points, alone))| {
            let marks = if alone { Marks::Dots } else { Marks::Both };
            Series { name: curve.name.clone(), marks, points, color }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// A sweep whose settings have so many trials of the 8 that were asked for.
    fn swept(made: &[usize], ended: Option<&str>) -> Sweep {
        let point = |n: &usize| json!({"seconds": {"value": 1.0}, "errors": [], "trials": vec![json!({"seconds": 1.0, "errors": [0.1]}); *n]});
        let points: Vec<Value> = made.iter().map(point).collect();
        let mut value = json!({
            "stage": "fit", "subject": "paint", "measures": [], "trials": 8, "seed": 1,
            "curves": [{"name": "parts", "main": "excess", "points": points}],
        });
        if let Some(why) = ended {
            value["ended"] = json!(why);
        }
        serde_json::from_value(value).expect("a sweep")
    }

    #[test]
    fn a_sweep_that_ended_early_says_how_many_trials_there_are() {
        let whole = swept(&[8, 8], None);
        assert_eq!((whole.trials_said().as_str(), whole.cut_short()), ("8 trials of each setting", None));
        let stopped = swept(&[3, 2], Some("stopped"));
        assert_eq!(stopped.trials_said(), "of 8 trials asked for, each setting shown has 2 to 3");
        let said = stopped.cut_short().expect("it was stopped");
        assert!(
            said.starts_with("The sweep fit: paint was stopped early: of 8 trials asked for, each setting shown has 2"),
            "{said}"
        );
        let late = swept(&[1, 1], Some("the time ended it"));
        assert_eq!(late.trials_said(), "of 8 trials asked for, each setting shown has 1");
        assert!(late.cut_short().is_some_and(|said| said.contains("ran out of its time")));
        let untold = swept(&[0, 0], Some("stopped"));
        assert!(untold.trials_said().ends_with("not all were made"), "a file without its trials");
    }
}
