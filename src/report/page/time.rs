//! What accuracy took in time, as far as the run's files have it.

use serde_json::Value;

use crate::report::plot::{LogLog, Marks, Point, Series, minus};
use crate::report::run::Run;
use crate::report::words::{count, number, percent, time as told};

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
    /// Charts of error against time, with what they show.
    pub charts: Vec<(String, String)>,
    pub slopes: Vec<SlopeRow>,
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

/// Time and rmse of the fits, a point each.
fn fits(run: &Run) -> Option<String> {
    let colors = super::lobes::colors(run);
    let of = |(fit, color): (&crate::report::run::RunFit, usize)| {
        let record = fit.material().fit.as_ref()?;
        let point = Point::new(record.seconds, record.rmse);
        Some(Series { name: fit.label.clone(), marks: Marks::Dots, points: vec![point], color })
    };
    let series: Vec<Series> = run.fits.iter().zip(colors).filter_map(of).collect();
    let chart = LogLog {
        title: "Time and rmse of the fits".into(),
        x_label: "time of the fit [s]".into(),
        y_label: "rmse".into(),
        series,
        ..LogLog::default()
    };
    (chart.series.len() > 1).then(|| chart.figure().inline())
}

/// Charts and slopes of a `tradeoff.json`.
fn sweep(found: &Value) -> Sweep {
    let text = |v: &Value| v.as_str().unwrap_or_default().to_owned();
    let curves: Vec<&Value> = found["curves"].as_array().into_iter().flatten().collect();
    // Curves of one error that spend one kind of time share a chart.
    let mut kinds: Vec<(String, bool)> = Vec::new();
    for curve in &curves {
        let kind = (text(&curve["main"]), is_instruments(curve));
        if !kinds.contains(&kind) {
            kinds.push(kind);
        }
    }
    let chart = |(main, instrument): &(String, bool)| {
        let svg = against_time(found, &curves, main, *instrument)?;
        let whose = if *instrument { "the simulated instrument" } else { "the computer" };
        Some((format!("{main} against the time of {whose}; bars are 95 % intervals."), svg))
    };
    let slopes = curves.iter().flat_map(|c| {
        let of_law = c["slopes"].as_array().into_iter().flatten().filter(|s| s["law"].is_object());
        of_law.map(|s| slope(&text(&c["name"]), s))
    });
    Sweep {
        title: format!("{}: {}", text(&found["stage"]), text(&found["subject"])),
        charts: kinds.iter().filter_map(chart).collect(),
        slopes: slopes.collect(),
    }
}

fn is_instruments(curve: &Value) -> bool {
    curve["cost"] == "instrument"
}

/// The curves whose main error this is, over their time.
fn against_time(found: &Value, curves: &[&Value], main: &str, instrument: bool) -> Option<String> {
    let measure = found["measures"].as_array()?.iter().position(|m| m["name"] == main)?;
    let point = |p: &Value| {
        let error = &p["errors"][measure];
        let bar = error["low"].as_f64().zip(error["high"].as_f64()).filter(|(low, high)| *low > 0.0 && high > low);
        let seconds = if instrument { &p["instrument_s"] } else { &p["seconds"]["value"] };
        Some(Point { x: seconds.as_f64()?, y: error["value"].as_f64()?, bar })
    };
    let of = |(color, curve): (usize, &&Value)| Series {
        name: curve["name"].as_str().unwrap_or_default().into(),
        marks: Marks::Both,
        points: curve["points"].as_array().into_iter().flatten().filter_map(point).collect(),
        color,
    };
    let shown = curves.iter().filter(|c| c["main"] == main && is_instruments(c) == instrument);
    let chart = LogLog {
        title: format!("{main} against time"),
        x_label: "time [s]".into(),
        y_label: main.into(),
        series: shown.enumerate().map(of).collect(),
        ..LogLog::default()
    };
    chart.series.iter().any(|s| s.points.len() > 1).then(|| chart.figure().inline())
}

fn slope(curve: &str, found: &Value) -> SlopeRow {
    let of = |v: &Value| v.as_f64().map(|x| minus(&format!("{x:.3}")));
    let theory = of(&found["law"]["theory"]["slope"]).unwrap_or_else(|| "–".into());
    let steeper = if found["law"]["theory"]["kind"] == "at-most" { " or steeper" } else { "" };
    let ends = of(&found["slope"]["low"]).zip(of(&found["slope"]["high"]));
    SlopeRow {
        curve: curve.into(),
        measure: found["measure"].as_str().unwrap_or_default().into(),
        slope: of(&found["slope"]["value"]).unwrap_or_else(|| "–".into()),
        interval: ends.map_or_else(|| "–".into(), |(low, high)| format!("{low} to {high}")),
        theory: theory + steeper,
        why: found["law"]["why"].as_str().unwrap_or_default().into(),
    }
}
