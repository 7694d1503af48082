//! The plots of a sweep: each error against its size with the slope of theory beside it, and against the time.

use crate::report::plot::{Figure, LogLog, Marks, Point, Series, Slope};
use crate::tradeoff::{Cost, Curve, Knob, Sweep};

/// A plot and the name of its files.
pub(super) struct Plot {
    pub name: String,
    pub figure: Figure,
}

/// All plots of a sweep that have at least two points on a curve.
pub(super) fn all(sweep: &Sweep) -> Vec<Plot> {
    let mut plots = Vec::new();
    for cost in [Cost::Computer, Cost::Instrument] {
        plots.extend(against_time(sweep, cost));
    }
    let mut knobs: Vec<Knob> = sweep.curves.iter().map(|c| c.knob).filter(|k| *k != Knob::Effects).collect();
    knobs.dedup();
    knobs.iter().enumerate().filter(|(i, k)| !knobs[..*i].contains(k)).for_each(|(_, knob)| {
        plots.extend(against_size(sweep, *knob));
    });
    plots
}

/// The main measure of all curves against the time that they spend.
fn against_time(sweep: &Sweep, cost: Cost) -> Vec<Plot> {
    let mut mains: Vec<&'static str> = Vec::new();
    for curve in sweep.curves.iter().filter(|c| c.cost == cost) {
        if !mains.contains(&curve.main) {
            mains.push(curve.main);
        }
    }
    let of = |main: &'static str| {
        let m = sweep.measure(main)?;
        let curves = sweep.curves.iter().filter(|c| c.cost == cost && c.main == main);
        let points = |c: &Curve| points(c, m, |p| p.cost(cost).map(|t| t.value));
        let series: Vec<Series> = named(curves.map(|c| (c.name.clone(), points(c), c.knob == Knob::Effects)));
        let what = if cost == Cost::Computer { "time of the computer [s]" } else { "time of the instrument [s]" };
        let name = if cost == Cost::Computer { format!("{main}-time") } else { format!("{main}-instrument-time") };
        chart(sweep, what, main, series, Vec::new()).map(|figure| Plot { name, figure })
    };
    mains.into_iter().filter_map(of).collect()
}

/// Every measure of the curves of a knob against its size.
fn against_size(sweep: &Sweep, knob: Knob) -> Vec<Plot> {
    let curves = || sweep.curves.iter().filter(move |c| c.knob == knob);
    let Some(axis) = curves().next().map(|c| c.axis) else { return Vec::new() };
    let of = |m: usize| {
        let measure = sweep.measures[m].name;
        let series = named(curves().map(|c| (c.name.clone(), points(c, m, |p| p.size), false)));
        let mut slopes: Vec<Slope> = Vec::new();
        for (beside, name) in series.iter().map(|s| s.name.clone()).enumerate() {
            let Some(curve) = curves().find(|c| c.name == name) else { continue };
            let found = curve.slopes.iter().find(|s| s.measure == measure).and_then(|s| s.law);
            let Some(law) = found else { continue };
            let slope = law.theory.slope();
            if !slopes.iter().any(|s| s.slope == slope) {
                slopes.push(Slope { name: format!("theory {slope}").replace('-', "−"), slope, beside });
            }
        }
        let name = format!("{measure}-{}", serde_json::to_value(knob).ok()?.as_str()?);
        chart(sweep, axis, measure, series, slopes).map(|figure| Plot { name, figure })
    };
    (0..sweep.measures.len()).filter_map(of).collect()
}

fn points(curve: &Curve, m: usize, x: impl Fn(&crate::tradeoff::Point) -> Option<f64>) -> Vec<Point> {
    let at = |p: &crate::tradeoff::Point| {
        let error = p.errors[m].filter(|e| e.value > 0.0 && e.low > 0.0)?;
        let bar = Some((error.low, error.high)).filter(|_| error.is_bounded() && error.high > error.low);
        Some(Point { x: x(p)?, y: error.value, bar })
    };
    curve.points.iter().filter_map(at).collect()
}

/// Series with colours of their own; those of single settings are dots.
fn named(curves: impl Iterator<Item = (String, Vec<Point>, bool)>) -> Vec<Series> {
    let filled = curves.filter(|(_, points, _)| !points.is_empty()).enumerate();
    filled
        .map(|(color, (name, points, alone))| {
            let marks = if alone { Marks::Dots } else { Marks::Both };
            Series { name, marks, points, color }
        })
        .collect()
}

fn chart(sweep: &Sweep, x: &str, y: &str, series: Vec<Series>, slopes: Vec<Slope>) -> Option<Figure> {
    if series.iter().all(|s| s.points.len() < 2) {
        return None;
    }
    let title = format!("{} {}: {y} against {x}", sweep.stage, sweep.subject);
    Some(LogLog { title, x_label: x.into(), y_label: y.into(), series, slopes, titled: false }.figure())
}
