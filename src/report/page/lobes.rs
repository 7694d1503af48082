//! Lobes in the plane of incidence: frames that a script fills, filled for one incidence, and small pictures of all.

use std::collections::BTreeSet;

use serde_json::{Value, json};

use super::peaks::{Peaks, peaks};
use crate::measurement::Dimension;
use crate::report::plot::{Scale, dot_class, line_class};
use crate::report::run::Run;
use crate::report::views::{
    Curve, Shown, Slice, default_channel, described, incidences, polar_figure, scale_of, slice, slice_figure,
};
use crate::report::words::number;

/// Most incidences and channels to choose from.
const INCIDENCES: usize = 7;
const CHANNELS: usize = 6;
/// Of more readings in a plane so many are shown, and the largest of each channel.
const READINGS: usize = 500;
/// A linear scale hides what is this much smaller than the peak.
const WIDE: f64 = 100.0;

/// A polar chart and a slice of one channel, counted among those shown, on one scale.
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
    /// Peaks of the channel that is shown first.
    pub peaks: Peaks,
    pub peaks_of: String,
    pub unit: &'static str,
    /// Whether readings have error bars.
    pub has_sigma: bool,
    /// That not all readings are shown, where that is so.
    pub note: String,
    pub data: Value,
}

/// Colours of the fits: one alone is blue and solid.
pub(super) fn colors(run: &Run) -> Vec<usize> {
    if run.fits.len() == 1 { vec![2] } else { (1..=run.fits.len()).collect() }
}

pub(super) fn lobes(run: &Run) -> Option<Lobes> {
    let (shown, names) = subjects(run)?;
    let angles = incidences(shown.table.map(|(t, _)| t), INCIDENCES);
    let (picked, first_channel) = (shown_channels(names), default_channel(names));
    // From here on channels are counted among those shown.
    let names: Vec<&str> = picked.iter().map(|&c| names[c].as_str()).collect();
    let channel = picked.iter().position(|&c| c == first_channel).unwrap_or_default();
    let whole = angles.iter().map(|t| of_channels(slice(&shown, *t), &picked)).filter(|s| !s.curves.is_empty());
    let (slices, thinned): (Vec<Slice>, Vec<bool>) = whole.map(thinned).unzip();
    let first = slices.iter().position(|s| s.incidence_deg >= 29.0).unwrap_or(slices.len().saturating_sub(1));
    let start = slices.get(first)?;
    let unit = if is_flat(run) { "1/rad" } else { "1/sr" };
    let log = is_wide(&slices, channel);
    let both = (0..names.len()).flat_map(|c| [false, true].map(|on_log| (c, on_log)));
    let frames = both.map(|(c, on_log)| {
        let scale = scale_of(&slices, c, on_log);
        let is_shown = c == channel && on_log == log;
        frame(start, (c, names[c]), (scale, on_log), unit, is_shown)
    });
    let scale = scale_of(&slices, channel, log);
    let small = |s: &Slice| {
        let svg = polar_figure(s, channel, names[channel], scale, unit, false).inline();
        (format!("θi = {}°", number(s.incidence_deg)), svg)
    };
    let incidence = |(k, s): (usize, &Slice)| Choice {
        index: k,
        label: format!("{}°", number(s.incidence_deg)),
        chosen: k == first,
    };
    let choice = |(c, name): (usize, &&str)| Choice { index: c, label: (*name).into(), chosen: c == channel };
    let said = |s: &Slice| (0..names.len()).map(|c| described(s, c, unit)).collect::<Vec<_>>();
    Some(Lobes {
        incidences: slices.iter().enumerate().map(incidence).collect(),
        channels: names.iter().enumerate().map(choice).collect(),
        log,
        frames: frames.collect(),
        all: slices.iter().map(small).collect(),
        peaks: peaks(&slices, channel),
        peaks_of: names[channel].to_owned(),
        unit,
        has_sigma: slices.iter().flat_map(|s| &s.curves).any(|c| c.sigma.is_some()),
        note: if thinned.contains(&true) { thinned_note() } else { String::new() },
        data: json!({
            "unit": unit, "channels": names, "incidences": slices.iter().map(|s| s.incidence_deg).collect::<Vec<_>>(),
            "described": slices.iter().map(said).collect::<Vec<_>>(),
            "slices": slices.iter().map(|s| s.curves.iter().map(curve).collect::<Vec<_>>()).collect::<Vec<_>>(),
        }),
    })
}

fn thinned_note() -> String {
    format!(
        "Of more than {READINGS} readings in a plane about {READINGS} are drawn, evenly picked, the largest among them."
    )
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

/// At most so many channels: the first, the last, the one shown first, and what lies evenly between.
fn shown_channels(names: &[String]) -> Vec<usize> {
    let n = names.len();
    if n <= CHANNELS {
        return (0..n).collect();
    }
    let mut chosen: Vec<usize> = (0..CHANNELS).map(|k| k * (n - 1) / (CHANNELS - 1)).collect();
    let default = default_channel(names);
    if !chosen.contains(&default)
        && let Some(nearest) = chosen[1..CHANNELS - 1].iter_mut().min_by_key(|c| c.abs_diff(default))
    {
        *nearest = default;
    }
    chosen
}

/// The curves of these channels alone.
fn of_channels(slice: Slice, channels: &[usize]) -> Slice {
    let only = |planes: &[Vec<f64>]| channels.iter().map(|&c| planes[c].clone()).collect();
    let curve = |c: Curve| Curve { values: only(&c.values), sigma: c.sigma.as_deref().map(only), ..c };
    Slice { curves: slice.curves.into_iter().map(curve).collect(), ..slice }
}

/// The slice with about so many readings as a page shows, and whether there were more.
fn thinned(slice: Slice) -> (Slice, bool) {
    let is_long = |c: &Curve| c.readings && c.theta_o_deg.len() > READINGS;
    let any = slice.curves.iter().any(is_long);
    let curve = |c: Curve| {
        if !is_long(&c) {
            return c;
        }
        let n = c.theta_o_deg.len();
        let largest = |plane: &Vec<f64>| {
            let known = plane.iter().enumerate().filter(|(_, v)| !v.is_nan());
            known.max_by(|a, b| a.1.total_cmp(b.1)).map(|(k, _)| k)
        };
        let even = (0..READINGS).map(|k| k * (n - 1) / (READINGS - 1));
        let kept: BTreeSet<usize> = even.chain(c.values.iter().filter_map(largest)).collect();
        let of = |plane: &Vec<f64>| kept.iter().map(|&k| plane[k]).collect::<Vec<f64>>();
        let all = |planes: &Vec<Vec<f64>>| planes.iter().map(of).collect();
        Curve { theta_o_deg: of(&c.theta_o_deg), values: all(&c.values), sigma: c.sigma.as_ref().map(all), ..c }
    };
    (Slice { curves: slice.curves.into_iter().map(curve).collect(), ..slice }, any)
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::brdf::{LobeKind, Material};
    use crate::geometry::angles::direction_deg;
    use crate::measurement::{Directions, Measurement};
    use crate::report::run::Made;

    fn named(n: usize) -> Vec<String> {
        (0..n).map(|c| format!("{} nm", 400 + 2 * c)).collect()
    }

    #[test]
    fn six_channels_are_shown_of_many_and_the_default_is_one_of_them() {
        assert_eq!(shown_channels(&named(3)), [0, 1, 2]);
        for n in 7..200 {
            let names = named(n);
            let shown = shown_channels(&names);
            assert_eq!(shown.len(), CHANNELS, "{n}");
            assert!(shown.is_sorted_by(|a, b| a < b), "{n}: {shown:?}");
            assert_eq!((shown[0], shown[CHANNELS - 1]), (0, n - 1));
            assert!(shown.contains(&default_channel(&names)), "{n}: {shown:?}");
        }
        // Green, wherever it stands.
        for at in 0..12 {
            let mut names = named(12);
            names[at] = "g".into();
            let shown = shown_channels(&names);
            assert!(shown.len() == CHANNELS && shown.is_sorted_by(|a, b| a < b) && shown.contains(&at), "{shown:?}");
        }
    }

    /// A spectral list with `n` readings in the plane of 30°; a reading's value tells its channel and place.
    fn spectral(channels: usize, n: usize) -> Run {
        let wi = vec![direction_deg(30.0, 180.0); n];
        let angle = |k: usize| 1.0 + 80.0 * k as f64 / n as f64;
        let wo = (0..n).map(|k| direction_deg(angle(k), 0.0)).collect();
        let values = (0..channels).flat_map(|c| (0..n).map(move |k| value(c, k))).collect();
        let table = Measurement::new("spectra", Directions::List { wi, wo }, named(channels), values);
        let material = Material::new(named(channels), vec![(LobeKind::Lambert, vec![0.5; channels], vec![])]);
        Run::of_fit(Path::new("t.csv"), table, "t.json", &material, None, Made::default())
    }

    /// Largest at a place that no even choice hits.
    fn value(c: usize, k: usize) -> f64 {
        if k == 777 { 5000.0 } else { (10 * c) as f64 + k as f64 / 1000.0 }
    }

    #[test]
    fn the_script_reads_the_channels_that_can_be_chosen_and_no_more_readings_than_a_screen_shows() {
        let (channels, n) = (195, 1500);
        let run = spectral(channels, n);
        let found = lobes(&run).expect("a plane");
        assert!(!found.note.is_empty());
        assert_eq!((found.channels.len(), found.frames.len()), (CHANNELS, 2 * CHANNELS));
        let size = found.data.to_string().len();
        assert!(size < 200_000, "{size} bytes of JSON");
        let readings = &found.data["slices"][0][0];
        let angles = readings["theta"].as_array().expect("angles");
        assert!((READINGS..=READINGS + CHANNELS).contains(&angles.len()), "{}", angles.len());
        let names = named(channels);
        for (choice, plane) in found.channels.iter().zip(readings["values"].as_array().expect("channels")) {
            assert_eq!(found.data["channels"][choice.index], choice.label.as_str());
            let c = names.iter().position(|name| *name == choice.label).expect("a channel");
            let plane: Vec<f64> =
                plane.as_array().expect("values").iter().filter_map(serde_json::Value::as_f64).collect();
            assert_eq!((plane.len(), plane[0]), (angles.len(), (10 * c) as f64), "{}", choice.label);
            assert!(plane.contains(&5000.0), "the peak is kept");
        }
        let chosen = found.channels.iter().find(|c| c.chosen).expect("one");
        assert_eq!(chosen.label, names[default_channel(&names)]);
        assert!(found.frames.iter().any(|f| f.shown && f.channel == chosen.index));
        assert!(lobes(&spectral(3, 200)).expect("a plane").note.is_empty(), "all of them are there");
    }
}
