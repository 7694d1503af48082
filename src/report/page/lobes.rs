//! Lobes in the plane of incidence: frames that a script fills, filled for one incidence, and small pictures of all.

use serde_json::{Value, json};

use crate::measurement::Dimension;
use crate::report::plot::{Scale, dot_class, line_class};
use crate::report::run::Run;
use crate::report::views::{
    Curve, Shown, Slice, default_channel, incidences, polar_figure, scale_of, slice, slice_figure,
};
use crate::report::words::number;

/// Most incidences and channels to choose from.
const INCIDENCES: usize = 7;
const CHANNELS: usize = 6;
/// A linear scale hides what is this much smaller than the peak.
const WIDE: f64 = 100.0;

/// A polar chart and a slice of one channel on one scale.
pub(super) struct Frame {
    pub channel: usize,
    pub log: bool,
    pub polar: String,
    pub slice: String,
    pub shown: bool,
}

/// A button.
pub(super) struct Choice {
    pub index: usize,
    pub label: String,
    pub chosen: bool,
}

pub(super) struct Lobes {
    pub incidences: Vec<Choice>,
    pub channels: Vec<Choice>,
    pub log: bool,
    pub frames: Vec<Frame>,
    /// A small polar chart of each incidence.
    pub all: Vec<(String, String)>,
    pub data: Value,
}

/// Colours of the fits: one alone is blue and solid.
pub(super) fn colors(run: &Run) -> Vec<usize> {
    if run.fits.len() == 1 { vec![2] } else { (1..=run.fits.len()).collect() }
}

pub(super) fn lobes(run: &Run) -> Option<Lobes> {
    let (shown, names) = subjects(run)?;
    let angles = incidences(shown.table.map(|(t, _)| t), INCIDENCES);
    let slices: Vec<Slice> = angles.iter().map(|t| slice(&shown, *t)).filter(|s| !s.curves.is_empty()).collect();
    let first = slices.iter().position(|s| s.incidence_deg >= 29.0).unwrap_or(slices.len().saturating_sub(1));
    let start = slices.get(first)?;
    let unit = if is_flat(run) { "1/rad" } else { "1/sr" };
    let (chosen, channel) = (shown_channels(names), default_channel(names));
    let log = is_wide(&slices, channel);
    let both = chosen.iter().flat_map(|&c| [false, true].map(|on_log| (c, on_log)));
    let frames = both.map(|(c, on_log)| {
        let scale = scale_of(&slices, c, on_log);
        let is_shown = c == channel && on_log == log;
        frame(start, (c, &names[c]), (scale, on_log), unit, is_shown)
    });
    let scale = scale_of(&slices, channel, log);
    let small = |s: &Slice| {
        let svg = polar_figure(s, channel, &names[channel], scale, unit, false).inline();
        (format!("θi = {}°", number(s.incidence_deg)), svg)
    };
    let incidence = |(k, s): (usize, &Slice)| Choice {
        index: k,
        label: format!("{}°", number(s.incidence_deg)),
        chosen: k == first,
    };
    Some(Lobes {
        incidences: slices.iter().enumerate().map(incidence).collect(),
        channels: chosen.iter().map(|&c| Choice { index: c, label: names[c].clone(), chosen: c == channel }).collect(),
        log,
        frames: frames.collect(),
        all: slices.iter().map(small).collect(),
        data: json!({
            "unit": unit, "channels": names, "incidences": slices.iter().map(|s| s.incidence_deg).collect::<Vec<_>>(),
            "slices": slices.iter().map(|s| s.curves.iter().map(curve).collect::<Vec<_>>()).collect::<Vec<_>>(),
        }),
    })
}

/// Table, truth and fits of the same channels, and the channels' names.
fn subjects(run: &Run) -> Option<(Shown<'_>, &[String])> {
    let table = run.table.as_ref().ok().map(|t| (&t.measurement, t.brdf.as_ref().ok()));
    let names = match (table, run.fits.first()) {
        (Some((table, _)), _) => &table.channels,
        (None, Some(fit)) => &fit.material().channels,
        (None, None) => return None,
    };
    let truth = run.truth.iter().map(|truth| ("truth".to_owned(), truth, usize::MAX));
    let fits = run.fits.iter().zip(colors(run)).map(|(f, color)| (f.label.clone(), &f.predicted, color));
    let materials = truth.chain(fits).filter(|(_, m, _)| m.material().channels.len() == names.len());
    Some((Shown { table, materials: materials.collect() }, names))
}

fn is_flat(run: &Run) -> bool {
    let of_fit = || run.fits.first().is_some_and(|f| f.material().is_flat());
    run.table.as_ref().map_or_else(|_| of_fit(), |t| t.measurement.dimension == Dimension::Flat)
}

/// The frame of a channel and scale; the script fills those that are not shown at first.
fn frame(start: &Slice, (c, name): (usize, &str), (scale, log): (Scale, bool), unit: &str, shown: bool) -> Frame {
    let empty = Slice { incidence_deg: start.incidence_deg, curves: start.curves.iter().map(emptied).collect() };
    let of = if shown { start } else { &empty };
    let polar = polar_figure(of, c, name, scale, unit, false).inline();
    let slice = slice_figure(of, c, name, scale, unit, false).inline();
    Frame { channel: c, log, polar, slice, shown }
}

/// At most so many channels, the first and the last among them.
fn shown_channels(names: &[String]) -> Vec<usize> {
    let n = names.len();
    if n <= CHANNELS {
        return (0..n).collect();
    }
    let mut chosen: Vec<usize> = (0..CHANNELS).map(|k| k * (n - 1) / (CHANNELS - 1)).collect();
    chosen.push(default_channel(names));
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}

/// Whether a linear scale would hide most of the curves.
fn is_wide(slices: &[Slice], channel: usize) -> bool {
    // The table's own curve decides, where there is one.
    let curves = slices.iter().filter_map(|s| s.curves.first());
    let mut values: Vec<f64> = curves.filter_map(|c| c.values.get(channel)).flatten().copied().collect();
    values.retain(|v| *v > 0.0);
    values.sort_by(f64::total_cmp);
    let (Some(most), Some(middle)) = (values.last(), values.get(values.len() / 2)) else { return false };
    most / middle > WIDE
}

fn emptied(curve: &Curve) -> Curve {
    let none = curve.values.iter().map(|_| Vec::new()).collect();
    Curve { theta_o_deg: Vec::new(), values: none, sigma: None, ..curve.clone() }
}

/// A curve for the script; five digits are more than a screen shows.
fn curve(curve: &Curve) -> Value {
    let rounded = |list: &[f64]| list.iter().map(|v| super::data::rounded(*v)).collect::<Vec<_>>();
    json!({
        "name": curve.name, "readings": curve.readings,
        "class": if curve.readings { dot_class(curve.color) } else { line_class(curve.color) },
        "theta": rounded(&curve.theta_o_deg),
        "values": curve.values.iter().map(|v| rounded(v)).collect::<Vec<_>>(),
        "sigma": curve.sigma.as_ref().map(|s| s.iter().map(|v| rounded(v)).collect::<Vec<_>>()),
    })
}
