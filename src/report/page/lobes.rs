//! Lobes in the plane of incidence: frames that a script fills, filled for one incidence, and small pictures of all.

use serde_json::{Value, json};

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
    let mut shown =
        Shown { table: run.table.as_ref().ok().map(|t| (&t.measurement, t.brdf.as_ref().ok())), materials: Vec::new() };
    if let Some(truth) = &run.truth {
        shown.materials.push(("truth".into(), truth, usize::MAX));
    }
    let fits = run.fits.iter().zip(colors(run)).map(|(f, color)| (f.label.clone(), &f.predicted, color));
    shown.materials.extend(fits);
    let names = match (&run.table, run.fits.first()) {
        (Ok(table), _) => &table.measurement.channels,
        (Err(_), Some(fit)) => &fit.material().channels,
        (Err(_), None) => return None,
    };
    shown.materials.retain(|(_, m, _)| m.material().channels.len() == names.len());
    let angles = incidences(shown.table.map(|(t, _)| t), INCIDENCES);
    let slices: Vec<Slice> = angles.iter().map(|t| slice(&shown, *t)).filter(|s| !s.curves.is_empty()).collect();
    let first = slices.iter().position(|s| s.incidence_deg >= 29.0).unwrap_or(slices.len().saturating_sub(1));
    let start = slices.get(first)?;
    let unit = run.table.as_ref().map_or("1/sr", |t| t.unit());
    let chosen = shown_channels(names);
    let channel = default_channel(names);
    let log = is_wide(&slices, channel);
    let mut frames = Vec::new();
    for &c in &chosen {
        for on_log in [false, true] {
            let scale: Scale = scale_of(&slices, c, on_log);
            // Frames of other channels and scales are filled by the script.
            let is_shown = c == channel && on_log == log;
            let empty =
                Slice { incidence_deg: start.incidence_deg, curves: start.curves.iter().map(emptied).collect() };
            let of = if is_shown { start } else { &empty };
            frames.push(Frame {
                channel: c,
                log: on_log,
                polar: polar_figure(of, c, &names[c], scale, unit, false).inline(),
                slice: slice_figure(of, c, &names[c], scale, unit, false).inline(),
                shown: is_shown,
            });
        }
    }
    let scale = scale_of(&slices, channel, log);
    let small = |s: &Slice| {
        (
            format!("θi = {}°", number(s.incidence_deg)),
            polar_figure(s, channel, &names[channel], scale, unit, false).inline(),
        )
    };
    Some(Lobes {
        incidences: slices
            .iter()
            .enumerate()
            .map(|(k, s)| Choice { index: k, label: format!("{}°", number(s.incidence_deg)), chosen: k == first })
            .collect(),
        channels: chosen.iter().map(|&c| Choice { index: c, label: names[c].clone(), chosen: c == channel }).collect(),
        log,
        frames,
        all: slices.iter().map(small).collect(),
        data: json!({
            "unit": unit, "channels": names, "incidences": slices.iter().map(|s| s.incidence_deg).collect::<Vec<_>>(),
            "slices": slices.iter().map(|s| s.curves.iter().map(curve).collect::<Vec<_>>()).collect::<Vec<_>>(),
        }),
    })
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
    let mut values: Vec<f64> =
        slices.iter().flat_map(|s| &s.curves).filter_map(|c| c.values.get(channel)).flatten().copied().collect();
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
