//! What accuracy took in time, as far as the run's files have it.

use crate::report::plot::{Heading, LogLog, Marks, Point, Series, minus};
use crate::report::run::{Made, Run};
use crate::report::typed;
use crate::report::views::{self, Interval, SweepSlope, TriedSetting};
use crate::report::words::{count, digits, number, percent, time as told};

/// A stage and its time.
pub(super) struct Stage {
    pub name: String,
    pub time: String,
    /// Length of its bar, per cent of the longest.
    pub bar: f64,
}

/// A picture's time and error.
pub(super) struct Render {
    pub label: String,
    pub cells: Vec<String>,
}

pub(super) struct Time {
    pub stages: Vec<Stage>,
    pub renders: Vec<Render>,
    /// Fits: time against rmse, where there are several.
    pub fits: Option<String>,
    pub sweeps: Vec<Sweep>,
}

/// What `tradeoff` measured of a stage.
pub(super) struct Sweep {
    pub title: String,
    /// How it was measured, and what else one must know.
    pub said: String,
    /// The program and the command that made it, where they are known.
    pub made: Option<(String, String)>,
    /// Charts of error against time and size, with what they show.
    pub charts: Vec<(String, String)>,
    /// Settings that no other beats, and all of them.
    pub front: Vec<SettingRow>,
    pub settings: Vec<SettingRow>,
    pub slopes: Vec<SlopeRow>,
}

/// A setting that was tried.
#[derive(Clone)]
pub(super) struct SettingRow {
    pub mark: char,
    pub setting: String,
    pub curve: String,
    pub time: String,
    pub error: String,
    pub interval: String,
    pub promise: String,
}

/// A slope beside that of theory.
pub(super) struct SlopeRow {
    pub curve: String,
    pub measure: String,
    pub slope: String,
    pub interval: String,
    pub theory: String,
    pub why: String,
}

pub(super) fn time(run: &Run) -> Time {
    let longest = run.times.iter().map(|(_, s)| *s).fold(0.0, f64::max);
    let stage = |(name, s): &(String, f64)| Stage {
        name: name.clone(),
        time: told(*s),
        bar: (100.0 * s / longest).clamp(0.3, 100.0),
    };
    let render = |p: &crate::report::run::Picture| {
        let m = &p.image.metadata;
        let error = m
            .relative_error
            .map_or("–".into(), |[expected, at_most]| format!("{} (95 %: {})", percent(expected), percent(at_most)));
        let samples = m.mean_samples.map_or_else(|| m.samples.map_or("–".into(), |s| count(s.into())), number);
        Render { label: p.label.clone(), cells: vec![samples, m.seconds.map_or("–".into(), told), error] }
    };
    Time {
        stages: run.times.iter().map(stage).collect(),
        renders: run.pictures.iter().map(render).collect(),
        fits: fits(run),
        sweeps: run.sweeps.iter().map(sweep).collect(),
    }
}

/// Time and rmse of the fits, a point each, where they compare.
fn fits(run: &Run) -> Option<String> {
    if run.are_unlike {
        return None;
    }
    let colors = super::lobes::colors(run);
    let of = |(fit, color): (&crate::report::run::RunFit, usize)| {
        let record = fit.material().fit.as_ref()?;
        let point = Point::new(record.seconds, record.rmse);
        Some(Series { name: fit.label.clone(), marks: Marks::Dots, points: vec![point], color })
    };
    let series: Vec<Series> = run.fits.iter().zip(colors).filter_map(of).collect();
    let chart = LogLog {
        heading: Heading { title: "Time and rmse of the fits".into(), ..Heading::default() },
        x_label: "time of the fit [s]".into(),
        y_label: "rmse".into(),
        series,
        ..LogLog::default()
    };
    (chart.series.len() > 1).then(|| chart.figure().inline())
}

/// Charts and slopes of a `tradeoff.json`.
fn sweep(found: &views::Sweep) -> Sweep {
    let chart = |plot: views::SweepPlot| {
        (
            format!(
                "{}; bars are 95 % intervals, and a point says what it is where a pointer rests on it.",
                plot.shows
            ),
            plot.figure.inline(),
        )
    };
    let slopes = found.curves.iter().flat_map(|c| c.slopes.iter().filter_map(|s| slope(&c.name, s)));
    let rows = found.settings().iter().map(row).collect::<Vec<_>>();
    let trials = format!("{}, seed {}", found.trials_said(), found.seed);
    let settings = options_of("settings", &found.commands);
    let others = found.curves.iter().filter_map(|c| options_of(&format!("settings of {}", c.name), &c.commands));
    let said =
        std::iter::once(trials).chain(settings).chain(others).chain(found.reference.clone()).chain(found.notes.clone());
    let said = said.map(|line| sentence(&line));
    Sweep {
        title: format!("{}: {}", found.stage, found.subject),
        said: said.collect::<Vec<_>>().join(" "),
        made: made(&Made::of(&found.run)),
        front: rows.iter().filter(|row| row.mark != ' ').cloned().collect(),
        settings: rows,
        charts: found.against_time().into_iter().chain(found.beside_theory()).map(chart).collect(),
        slopes: slopes.collect(),
    }
}

/// Which commands settings are options of; nothing where none are known.
fn options_of(settings: &str, commands: &[Vec<String>]) -> Option<String> {
    let all: Vec<String> = commands.iter().map(|words| typed(words)).collect();
    (!all.is_empty()).then(|| format!("{settings} are options of: {}", all.join(" && ")))
}

fn made(made: &Made) -> Option<(String, String)> {
    made.program.clone().filter(|_| !made.command.is_empty()).map(|program| (program, typed(&made.command)))
}

/// A setting with its numbers.
fn row(found: &TriedSetting<'_>) -> SettingRow {
    let three = |x: Option<f64>| x.map_or_else(|| "–".into(), |x| digits(x, 3));
    let Interval { value, low, high } = found.error;
    let kept = |(most, kept, of): (f64, usize, usize)| format!("{} in {kept} of {of}", number(most));
    SettingRow {
        mark: found.mark,
        setting: found.setting.into(),
        curve: found.curve.into(),
        time: found.seconds.map_or_else(|| "–".into(), told),
        error: format!("{} {}", found.measure, three(value)),
        interval: low.zip(high).map_or_else(|| "–".into(), |_| format!("{} to {}", three(low), three(high))),
        promise: found.promise.map_or_else(|| "–".into(), kept),
    }
}

/// With a capital letter and a full stop.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| format!("{}{}.", first.to_uppercase(), letters.as_str()))
}

/// A slope that there is theory of, or a reason why there is none.
fn slope(curve: &str, found: &SweepSlope) -> Option<SlopeRow> {
    let told = |x: f64| minus(&format!("{x:.3}"));
    let law = found.law.as_ref()?;
    let ends = found.slope.low.zip(found.slope.high);
    let unknown = || "–".to_owned();
    Some(SlopeRow {
        curve: curve.into(),
        measure: found.measure.clone(),
        slope: found.slope.value.map_or_else(unknown, told),
        interval: ends.map_or_else(unknown, |(low, high)| format!("{} to {}", told(low), told(high))),
        theory: law.theory.said(told),
        why: law.why.clone(),
    })
}
