//! The figures, and the numbers in them.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::subject::{Subjects, seen};
use super::{Drawn, OutputArgs};
use crate::chain;
use crate::cli::failure::Failure;
use crate::cli::info::Reading;
use crate::cli::instrument::read_sight;
use crate::cli::ui::Ui;
use crate::measurement::{Measurement, formats};
use crate::report::plot::Figure;
use crate::report::views::{
    Binned, Predicted, Slice, Statistic, coverage as covered, coverage_figure, default_channel, incidences,
    polar_figure, residual_figure, residual_maps, residual_range, scale_of, slice, slice_figure,
};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit plot polar gold.binary gold.json --incidence 15,45,75 --out lobes.svg
  goniofit plot slice lab.csv lab.json --incidence 30 --log --out slice.png")]
pub(super) struct CurveArgs {
    /// A measurement, fits of it, built-in materials: at most one measurement
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<String>,
    /// Polar angles of incidence, degrees [default: up to four of the table's own, or 0,30,60]
    #[arg(long, value_name = "DEG,…", value_delimiter = ',', value_parser = parse_incidence)]
    incidence: Vec<f64>,
    /// Channel to show [default: g, or the middle one]
    #[arg(long, value_name = "NAME")]
    channel: Option<String>,
    /// Logarithmic values, five decades at most
    #[arg(long)]
    log: bool,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  goniofit plot residuals lab.csv lab.json --statistic rms --out residuals.svg")]
pub(super) struct ResidualArgs {
    /// The measurement
    pub measurement: PathBuf,
    /// A fit of it
    #[arg(value_name = "FIT.json")]
    pub fit: String,
    /// What a cell shows: which way the fit is off (mean), how far (rms), or the mean over its own error, which noise alone keeps near 1
    #[arg(long, default_value = "mean", value_parser = parse_statistic, value_name = "mean|rms|over-noise")]
    statistic: Statistic,
    /// Leave out readings with θi or θo above this, degrees, as the fit did
    #[arg(long, default_value_t = 80.0, value_name = "DEG", value_parser = parse_incidence)]
    max_angle: f64,
    /// The instrument that the fit was made through [default: the one that it names]
    #[arg(long, value_name = "INSTRUMENT")]
    through: Option<String>,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

/// Degrees from the normal.
fn parse_incidence(text: &str) -> Result<f64, String> {
    let value = text.trim().parse::<f64>().ok().filter(|v| (0.0..=90.0).contains(v));
    value.ok_or_else(|| "expected degrees from 0 to 90".into())
}

fn parse_statistic(text: &str) -> Result<Statistic, String> {
    let known = Statistic::ALL.into_iter().find(|s| s.name() == text);
    known.ok_or_else(|| format!("known are {}", Statistic::ALL.map(Statistic::name).join(", ")))
}

/// Polar lobes, or slices: a panel an incidence.
pub(super) fn curves(args: &CurveArgs, polar: bool, ui: &Ui) -> Result<Drawn, Failure> {
    let subjects = Subjects::read(&args.files, &args.output.reading.options(), ui)?;
    let channels = subjects.channels();
    let channel = match &args.channel {
        None => default_channel(channels),
        Some(name) => channels.iter().position(|c| c == name).ok_or_else(|| {
            Failure::usage(format!("--channel: expected one of {}, found {name}", channels.join(", ")))
        })?,
    };
    let shown = subjects.shown();
    let own = incidences(subjects.table.as_ref().map(|(t, _)| t), 4);
    let angles = match (&args.incidence[..], &subjects.table) {
        ([], None) => vec![0.0, 30.0, 60.0],
        ([], Some(_)) => own,
        (asked, _) => asked.to_vec(),
    };
    let slices: Vec<Slice> = angles.iter().map(|t| slice(&shown, *t)).collect();
    if slices.iter().all(|s| s.curves.is_empty()) {
        let known = incidences(subjects.table.as_ref().map(|(t, _)| t), 32);
        let known: Vec<String> = known.iter().map(|t| format!("{t}")).collect();
        return Err(Failure::usage(format!(
            "--incidence: the table has no readings in the plane there, nor can it be interpolated; its incidences are {}°",
            known.join("°, ")
        )));
    }
    let scale = scale_of(&slices, channel, args.log);
    let (name, unit) = (&channels[channel], if subjects.is_flat() { "1/rad" } else { "1/sr" });
    let draw = if polar { polar_figure } else { slice_figure };
    let panels: Vec<Figure> = slices.iter().map(|s| draw(s, channel, name, scale, unit, true)).collect();
    let title = format!("{} in the plane of incidence", args.files.join(", "));
    let object = json!({ "channel": name, "unit": unit, "slices": slices.iter().map(|s| slice_json(s, channel)).collect::<Vec<_>>() });
    Ok((Figure::grid(&panels, 2, &title), object))
}

fn slice_json(slice: &Slice, channel: usize) -> Value {
    let curve = |c: &crate::report::views::Curve| {
        json!({
            "name": c.name, "theta_o_deg": c.theta_o_deg, "value": c.values[channel],
            "sigma": c.sigma.as_ref().map(|s| &s[channel]),
        })
    };
    json!({ "theta_i_deg": slice.incidence_deg, "curves": slice.curves.iter().map(curve).collect::<Vec<_>>() })
}

/// Residual maps of a fit.
pub(super) fn residuals(args: &ResidualArgs, ui: &Ui) -> Result<Drawn, Failure> {
    let table = formats::read(&args.measurement, &args.output.reading.options())?;
    let material = chain::load_material(&args.fit)?;
    if material.channels != table.channels {
        return Err(Failure::usage(format!(
            "{}: expected the channels {} of {}, found {}",
            args.fit,
            table.channels.join(", "),
            args.measurement.display(),
            material.channels.join(", ")
        )));
    }
    let predicted = match &args.through {
        Some(name) => Predicted::new(&material, Some(read_sight(name)?)),
        None => seen(&material, &args.fit, ui),
    };
    let maps = residual_maps(&table, &predicted, args.max_angle);
    let statistic = args.statistic;
    let all: Vec<(&Binned, bool)> = maps.half_diff.iter().map(|m| (m, true)).chain([(&maps.in_out, false)]).collect();
    let range = residual_range(&maps, statistic);
    let draw = |(map, over_half): &(&Binned, bool)| {
        residual_figure(map, *over_half, statistic, range, (&material.model(), maps.unit), true)
    };
    let panels: Vec<Figure> = all.iter().map(draw).collect();
    let of = |(map, over_half): &(&Binned, bool)| {
        json!({
            "over": if *over_half { ["theta_h", "theta_d"] } else { ["theta_i", "theta_o"] },
            "columns_deg": map.x_deg, "rows_deg": map.y_deg, "count": map.count, "value": map.values(statistic),
        })
    };
    let object = json!({
        "values": maps.count, "rmse": maps.rmse, "unit": maps.unit,
        "statistic": statistic.name(), "maps": all.iter().map(of).collect::<Vec<_>>(),
    });
    let title = format!("residuals of {} in {}", material.model(), args.measurement.display());
    Ok((Figure::grid(&panels, 2, &title), object))
}

/// Where readings were taken.
pub(super) fn coverage(measurement: &Path, reading: &Reading) -> Result<Drawn, Failure> {
    let table: Measurement = formats::read(measurement, &reading.options())?;
    let Some(found) = covered(&table) else {
        return Err(Failure::usage(format!(
            "{}: expected a measurement of space, found one of the flat world, which has no hemisphere",
            measurement.display()
        )));
    };
    let own = table.summary().incidences_deg.unwrap_or_default();
    let object = json!({
        "covered": found.covered, "masked": found.masked, "cell_deg": found.step_deg, "incidences_deg": own,
    });
    Ok((coverage_figure(&found, &own, true), object))
}
