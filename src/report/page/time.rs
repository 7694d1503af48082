//! What accuracy took in time, as far as the run's files have it.

use crate::report::plot::{LogLog, Marks, Point, Series};
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
