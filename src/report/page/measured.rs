//! What was measured, and how well.

use crate::measurement::Directions;
use crate::report::run::{Run, Table};
use crate::report::views::{albedo_curves, coverage, coverage_figure, default_channel, energy_figure, masked_figure};
use crate::report::words::{count, number, percent};

/// A fact and its value.
pub(super) struct Fact {
    pub name: &'static str,
    pub value: String,
}

/// A channel's numbers, as text.
pub(super) struct Channel {
    pub name: String,
    pub cells: Vec<String>,
}

/// Reflected light at an incidence.
pub(super) struct ScatterRow {
    pub theta: String,
    pub covered: String,
    pub values: Vec<String>,
}

pub(super) struct Measured {
    pub facts: Vec<Fact>,
    pub unit: &'static str,
    pub channels: Vec<Channel>,
    /// SVG of the hemisphere, and what it says.
    pub coverage: Option<(String, String)>,
    /// The same of masked values, where there are any.
    pub masked: Option<String>,
    pub energy: Option<String>,
    pub energy_channel: String,
    pub scatter: Vec<ScatterRow>,
    pub no_scatter: Option<String>,
    pub names: Vec<String>,
}

pub(super) fn measured(run: &Run) -> Option<Measured> {
    let table = run.table.as_ref().ok()?;
    let s = &table.summary;
    let cover = coverage(&table.measurement);
    let own = s.incidences_deg.clone().unwrap_or_default();
    let drawn = cover.as_ref().map(|c| {
        let symmetric = if is_merl(table) { " The format has the other azimuths follow by symmetry." } else { "" };
        let said = format!(
            "{} of the hemisphere's solid angle has valid readings, over all incidences together.{symmetric}",
            percent(c.covered)
        );
        (coverage_figure(c, &own, false).inline(), said)
    });
    let masked = cover.as_ref().filter(|c| c.masked > 5e-4).map(|c| masked_figure(c, false).inline());
    let channel = default_channel(&table.measurement.channels);
    let row = |r: &crate::chain::Scatter| ScatterRow {
        theta: number(r.theta_i_deg),
        covered: percent(r.covered),
        values: r.scatter.iter().map(|v| number(*v)).collect(),
    };
    Some(Measured {
        facts: facts(run),
        unit: table.unit(),
        channels: s.channels.iter().map(row_of).collect(),
        coverage: drawn,
        masked,
        energy: energy(run, channel),
        energy_channel: table.measurement.channels[channel].clone(),
        scatter: table.scatter.iter().flatten().map(row).collect(),
        no_scatter: table.scatter.as_ref().err().cloned(),
        names: table.measurement.channels.clone(),
    })
}

/// Whether entries stand for a pair of directions, the swapped pair and their mirror images, as MERL's do.
fn is_merl(table: &Table) -> bool {
    matches!(table.measurement.directions, Directions::Merl(_))
}

fn facts(run: &Run) -> Vec<Fact> {
    let Ok(table) = &run.table else { return Vec::new() };
    let s = &table.summary;
    let mut facts = Vec::new();
    let mut fact = |name, value| facts.push(Fact { name, value });
    fact("File", table.path.display().to_string());
    fact("Kind", s.origin.clone());
    if let Some(instrument) = &run.instrument {
        fact("Instrument", instrument.clone());
    }
    fact(
        "Direction pairs",
        format!("{}, {} at or below the horizon", count(s.entries as u64), count(s.below_horizon as u64)),
    );
    fact("Valid values", format!("{} ({})", count(s.valid as u64), percent(s.valid_share)));
    let masked = &s.masked;
    fact(
        "Masked values",
        match masked.total() {
            0 => "none".into(),
            n => {
                let first = masked.first_not_finite.as_ref().map_or(String::new(), |p| format!(", the first at {p}"));
                format!(
                    "{} ({} not measured, {} not finite{first})",
                    count(n),
                    count(masked.marked),
                    count(masked.not_finite)
                )
            }
        },
    );
    for (reason, pairs) in &s.mask_reasons {
        fact("Masked pairs", format!("{}: {}", count(*pairs as u64), reason.said()));
    }
    let range = |r: Option<(f64, f64)>| r.map_or("–".into(), |(a, b)| format!("{}° to {}°", number(a), number(b)));
    fact("θi", range(s.theta_i_deg));
    fact("θo", range(s.theta_o_deg));
    fact(
        "Reciprocity",
        match &s.reciprocity {
            Some(r) => format!(
                "median difference {} over {} swapped pairs of values",
                percent(r.median_relative_difference),
                count(r.pairs as u64)
            ),
            None if is_merl(table) => "by the format: an entry stands for both directions".into(),
            None => "no swapped pairs to compare".into(),
        },
    );
    fact("Weights", s.weights.into());
    if let Ok(brdf) = &table.brdf {
        brdf.notes().iter().for_each(|note| fact("As a BRDF", note.clone()));
    }
    facts
}

fn row_of(c: &crate::measurement::summary::ChannelSummary) -> Channel {
    let of = |v: Option<f64>| v.map_or("–".into(), number);
    Channel {
        name: c.name.clone(),
        cells: vec![
            of(c.min),
            of(c.max),
            of(c.dynamic_range_decades.map(|d| (10.0 * d).round() / 10.0)),
            count(c.negative as u64),
            c.median_relative_sigma.map_or("–".into(), percent),
        ],
    }
}

/// The reflected share of table and fits.
fn energy(run: &Run, channel: usize) -> Option<String> {
    let table = run.table.as_ref().ok()?;
    let colors = super::lobes::colors(run);
    let fits = run.fits.iter().zip(colors).map(|(f, color)| (f.label.clone(), f.material(), color));
    let curves = albedo_curves(table.scatter.as_deref().ok(), &fits.collect::<Vec<_>>());
    let name = table.measurement.channels.get(channel)?;
    (!curves.is_empty()).then(|| energy_figure(&curves, channel, name, false).inline())
}
