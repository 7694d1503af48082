//! `goniofit info`: what is in a measurement.

use std::fmt::Write;
use std::path::PathBuf;

use serde_json::json;

use super::failure::Failure;
use super::text::option;
use super::ui::Ui;
use crate::chain::{self, Scatter};
use crate::control::counted;
use crate::measurement::{Format, MerlAngles, Quantity, ReadOptions, Summary, formats};

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  goniofit info gold-metallic-paint.binary")]
pub(super) struct Args {
    /// The measurement; `-` is stdin
    file: PathBuf,
    #[command(flatten)]
    reading: Reading,
}

/// How to read measurements.
#[derive(Debug, Clone, Default, clap::Args)]
pub(super) struct Reading {
    /// Format of the input (default: by its content)
    #[arg(long, value_parser = parse_format, value_name = "merl|csv|alta|rgl|zemax|fred")]
    format: Option<Format>,
    /// What the values are (default: as the file says)
    #[arg(long, value_parser = parse_quantity, value_name = "brdf|brdf_cos")]
    quantity: Option<Quantity>,
    /// Where in its bin a MERL entry is read; for MERL tables only [default: center]
    #[arg(long, value_parser = parse_angles, value_name = "center|edge")]
    merl_angles: Option<MerlAngles>,
}

impl Reading {
    pub fn options(&self) -> ReadOptions {
        ReadOptions { format: self.format, quantity: self.quantity, merl_angles: self.merl_angles }
    }

    /// The words that it was typed in.
    pub(super) fn typed(&self) -> Vec<String> {
        let angles = self.merl_angles.map(|angles| if angles == MerlAngles::Edge { "edge" } else { "center" });
        let quantity = self.quantity.map(|q| if q == Quantity::BrdfCos { "brdf_cos" } else { "brdf" });
        let format = option("format", self.format.map(Format::name));
        [format, option("quantity", quantity), option("merl-angles", angles)].concat()
    }
}

fn parse_format(text: &str) -> Result<Format, String> {
    Format::from_name(text).ok_or_else(|| format!("known are {}", Format::ALL.map(Format::name).join(", ")))
}

fn parse_quantity(text: &str) -> Result<Quantity, String> {
    match text {
        "brdf" => Ok(Quantity::Brdf),
        "brdf_cos" => Ok(Quantity::BrdfCos),
        _ => Err("known are brdf, brdf_cos".into()),
    }
}

fn parse_angles(text: &str) -> Result<MerlAngles, String> {
    match text {
        "center" => Ok(MerlAngles::Center),
        "edge" => Ok(MerlAngles::Edge),
        _ => Err("known are center, edge".into()),
    }
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let table = formats::read(&args.file, &args.reading.options())?;
    let summary = table.summary();
    let scatter = chain::integrated_scatter(&table);
    let mut object = serde_json::to_value(&summary).map_err(|e| Failure::work(e.to_string()))?;
    object["integrated_scatter"] = match &scatter {
        Ok(list) => json!(list),
        Err(reason) => json!({ "unavailable": reason }),
    };
    ui.result(&describe(&summary, &scatter), &object);
    Ok(())
}

fn describe(s: &Summary, scatter: &Result<Vec<Scatter>, String>) -> String {
    let mut t = String::new();
    let unit = if s.dimension == 2 { "1/rad" } else { "1/sr" };
    let _ = writeln!(t, "{}: {}", s.name, s.origin);
    let _ = writeln!(t, "  entries       {} direction pairs, {} at or below the horizon", s.entries, s.below_horizon);
    let _ = writeln!(t, "  valid values  {} ({:.1} %)", s.valid, 100.0 * s.valid_share);
    if s.masked.total() > 0 {
        let first = s.masked.first_not_finite.as_ref().map_or(String::new(), |p| format!(", the first at {p}"));
        let _ =
            writeln!(t, "  masked        {} not measured, {} not finite{first}", s.masked.marked, s.masked.not_finite);
    }
    for (reason, pairs) in &s.mask_reasons {
        let _ = writeln!(t, "    {:11} {}", reason.name(), counted(*pairs as u64, "pair"));
    }
    let range = |r: Option<(f64, f64)>| r.map_or("none".into(), |(a, b)| format!("{a:.2}° to {b:.2}°"));
    let _ = writeln!(t, "  θi            {}", range(s.theta_i_deg));
    if let Some(list) = &s.incidences_deg {
        let angles: Vec<String> = list.iter().map(|a| format!("{}°", (a * 100.0).round() / 100.0)).collect();
        let _ = writeln!(t, "  incidences    {}", angles.join(", "));
    }
    let _ = writeln!(t, "  θo            {}", range(s.theta_o_deg));
    let _ = writeln!(t, "  weights       {}", s.weights);
    let _ = writeln!(t, "  channel       {:>12} {:>12} {:>9} {:>9}  [{unit}]", "min", "max", "decades", "negative");
    for c in &s.channels {
        let number = |v: Option<f64>| v.map_or("–".into(), |v| format!("{v:.5}"));
        let decades = c.dynamic_range_decades.map_or("–".into(), |d| format!("{d:.1}"));
        let _ = write!(t, "  {:13} {:>12} {:>12} {decades:>9} {:>9}", c.name, number(c.min), number(c.max), c.negative);
        let _ = match c.median_relative_sigma {
            Some(r) => writeln!(t, "  σ {:.2} % (median)", 100.0 * r),
            None => writeln!(t),
        };
    }
    match &s.reciprocity {
        Some(r) => {
            let percent = 100.0 * r.median_relative_difference;
            let _ = writeln!(t, "  reciprocity   median difference {percent:.2} % over {} swapped values", r.pairs);
        }
        None => t.push_str("  reciprocity   no swapped pairs to compare\n"),
    }
    for (theta, value) in &s.stated_scatter {
        let _ = writeln!(t, "  stated        integrated scatter {value} at θi {theta}°");
    }
    match scatter {
        Ok(list) => {
            let names: Vec<String> = s.channels.iter().map(|c| format!("{:>8}", c.name)).collect();
            let _ = writeln!(t, "  scatter       ∫ f cosθo dωo over what was measured  {}", names.join(" "));
            for row in list {
                let values: Vec<String> = row.scatter.iter().map(|v| format!("{v:>8.4}")).collect();
                let covered = 100.0 * row.covered;
                let (theta, values) = (row.theta_i_deg, values.join(" "));
                let _ =
                    writeln!(t, "                θi {theta:>5.1}°, {covered:>5.1} % of the hemisphere        {values}");
            }
        }
        Err(reason) => {
            let _ = writeln!(t, "  scatter       not integrated: {reason}");
        }
    }
    for note in &s.notes {
        let _ = writeln!(t, "  note: {note}");
    }
    t
}
