//! Residual maps of every fit.

use serde_json::{Value, json};

use super::data::{encoded, rounded};
use crate::report::run::Run;
use crate::report::views::{Binned, Statistic, residual_figure, residual_maps, residual_range};
use crate::report::words::number;

/// Readings beyond this are left out, as a fit does where nothing else is asked for, degrees.
const MAX_ANGLE: f64 = 80.0;

pub(super) struct Residuals {
    pub label: String,
    /// A map over (θh, θd), which the flat world does not have, and one over (θi, θo) of each statistic.
    pub maps: Vec<Map>,
    pub rmse: String,
    /// Where that is not the fit's own rmse, why.
    pub note: String,
    pub data: Value,
}

pub(super) struct Map {
    pub over: &'static str,
    /// What its cells show, by name and in words.
    pub statistic: &'static str,
    pub words: &'static str,
    pub svg: String,
}

pub(super) fn residuals(run: &Run) -> Vec<Residuals> {
    let Ok(table) = &run.table else { return Vec::new() };
    let mut found = Vec::new();
    for fit in run.fits.iter().filter(|f| f.material().channels.len() == table.measurement.channels.len()) {
        let maps = residual_maps(&table.measurement, &fit.predicted, MAX_ANGLE);
        let over: Vec<(&Binned, bool, &'static str)> =
            maps.half_diff.iter().map(|m| (m, true, "half")).chain([(&maps.in_out, false, "pair")]).collect();
        let mut drawn = Vec::new();
        for statistic in Statistic::ALL {
            let range = residual_range(&maps, statistic);
            for (map, over_half, over) in &over {
                let figure = residual_figure(map, *over_half, statistic, range, (&fit.label, maps.unit), false);
                drawn.push(Map { over, statistic: statistic.name(), words: words(statistic), svg: figure.inline() });
            }
        }
        let of_fit = fit.material().fit.as_ref().map_or(f64::NAN, |r| r.rmse);
        let same = (maps.rmse / of_fit - 1.0).abs() < 1e-3;
        let unit = if maps.unit.is_empty() { String::new() } else { format!(" {}", maps.unit) };
        let why = if fit.is_of_other {
            "it was not made of this measurement"
        } else {
            "it took other samples, weights or a robust loss"
        };
        let note = format!("The fit's own rmse is {}{unit}: {why}.", number(of_fit));
        found.push(Residuals {
            label: fit.label.clone(),
            maps: drawn,
            rmse: format!("{}{unit}", number(maps.rmse)),
            note: if same { String::new() } else { note },
            data: json!({ "label": fit.label, "unit": maps.unit, "maps": over.iter().map(|(m, _, o)| (*o, map_data(m))).collect::<std::collections::BTreeMap<_, _>>() }),
        });
    }
    found
}

fn words(statistic: Statistic) -> &'static str {
    match statistic {
        Statistic::Mean => "Which way",
        Statistic::Rms => "How far",
        Statistic::OverNoise => "Beyond noise",
    }
}

fn map_data(map: &Binned) -> Value {
    let borders = |list: &[f64]| list.iter().map(|b| rounded(*b)).collect::<Vec<_>>();
    let values = |s: Statistic| encoded(map.values(s).into_iter().map(|v| v.unwrap_or(f64::NAN) as f32));
    json!({
        "x": borders(&map.x_deg), "y": borders(&map.y_deg), "count": map.count,
        "mean": values(Statistic::Mean), "rms": values(Statistic::Rms), "noise": values(Statistic::OverNoise),
    })
}
