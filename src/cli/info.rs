//! `goniofit info`: what is in a measurement.

use std::fmt::Write;
use std::path::PathBuf;

use serde_json::json;

use super::failure::Failure;
use super::text::{COLUMNS, indented, option};
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

/// Where what is said of a measurement begins, behind its names.
const COLUMN: usize = 16;

fn describe(s: &Summary, scatter: &Result<Vec<Scatter>, String>) -> String {
    let mut t = format!("{}\n", indented(&format!("{}: {}", s.name, s.origin), 2));
    let pairs = counted(s.entries as u64, "direction pair");
    fact(&mut t, "entries", &format!("{pairs}, {} at or below the horizon", s.below_horizon));
    fact(&mut t, "valid values", &format!("{} ({:.1} %)", s.valid, 100.0 * s.valid_share));
    masked(&mut t, s);
    let range = |r: Option<(f64, f64)>| r.map_or("none".into(), |(a, b)| format!("{a:.2}° to {b:.2}°"));
    fact(&mut t, "θi", &range(s.theta_i_deg));
    if let Some(list) = &s.incidences_deg {
        let angles: Vec<String> = list.iter().map(|a| format!("{}°", (a * 100.0).round() / 100.0)).collect();
        fact(&mut t, "incidences", &angles.join(", "));
    }
    fact(&mut t, "θo", &range(s.theta_o_deg));
    fact(&mut t, "weights", s.weights);
    channels(&mut t, s);
    let reciprocity = s.reciprocity.as_ref().map_or("no swapped pairs to compare".into(), |r| {
        let percent = 100.0 * r.median_relative_difference;
        format!("median difference {percent:.2} % over {} swapped values", r.pairs)
    });
    fact(&mut t, "reciprocity", &reciprocity);
    for (theta, value) in &s.stated_scatter {
        fact(&mut t, "stated", &format!("integrated scatter {value} at θi {theta}°"));
    }
    match scatter {
        Ok(list) => scattered(&mut t, s, list),
        Err(reason) => fact(&mut t, "scatter", &format!("not integrated: {reason}")),
    }
    for note in &s.notes {
        let _ = writeln!(t, "  note: {}", indented(note, 8));
    }
    t
}

/// A line of the summary, and more where it takes them.
fn fact(t: &mut String, name: &str, said: &str) {
    // Writing to a String can't fail.
    let _ = writeln!(t, "  {name:14}{}", indented(said, COLUMN));
}

/// Values that are left out, and why.
fn masked(t: &mut String, s: &Summary) {
    if s.masked.total() > 0 {
        let first = s.masked.first_not_finite.as_ref().map_or(String::new(), |p| format!(", the first at {p}"));
        let said = format!("{} not measured, {} not finite{first}", s.masked.marked, s.masked.not_finite);
        fact(t, "masked", &said);
    }
    for (reason, pairs) in &s.mask_reasons {
        let _ = writeln!(t, "    {:11} {}", reason.name(), counted(*pairs as u64, "pair"));
    }
}

/// A line a channel; σ where any has one.
fn channels(t: &mut String, s: &Summary) {
    let unit = if s.dimension == 2 { "1/rad" } else { "1/sr" };
    let has_sigma = s.channels.iter().any(|c| c.median_relative_sigma.is_some());
    let sigma = if has_sigma { "median σ" } else { "" };
    let mut line = |name: &str, [min, max, decades, negative, sigma]: [&str; 5]| {
        let row = format!("  {name:15}{min:>12} {max:>12} {decades:>8} {negative:>9} {sigma:>10}");
        let _ = writeln!(t, "{}", row.trim_end());
    };
    line(&format!("channel [{unit}]"), ["min", "max", "decades", "negative", sigma]);
    for c in &s.channels {
        let number = |v: Option<f64>| v.map_or("–".into(), |v| format!("{v:.5}"));
        let decades = c.dynamic_range_decades.map_or("–".into(), |d| format!("{d:.1}"));
        let sigma = c.median_relative_sigma.map_or(String::new(), |r| format!("{:.2} %", 100.0 * r));
        line(&c.name, [&number(c.min), &number(c.max), &decades, &c.negative.to_string(), &sigma]);
    }
}

/// Integrated scatter: a row an incidence, and as many channels side by side as there is room for.
fn scattered(t: &mut String, s: &Summary, list: &[Scatter]) {
    fact(t, "scatter", "∫ f cosθo dωo over what was measured");
    let names: Vec<&str> = s.channels.iter().map(|c| c.name.as_str()).collect();
    let width = names.iter().map(|name| name.chars().count() + 1).fold(9, usize::max);
    let lead = |theta: &str, covered: &str| format!("{theta:>COLUMN$}{covered:>9}");
    let beside = ((COLUMNS - COLUMN - 9) / width).max(1);
    for (k, group) in names.chunks(beside).enumerate() {
        let heads: Vec<String> = group.iter().map(|name| format!("{name:>width$}")).collect();
        let _ = writeln!(t, "{}{}", lead("θi", "covered"), heads.concat());
        for row in list {
            let own = row.scatter.iter().skip(k * beside).take(group.len());
            let values: Vec<String> = own.map(|v| format!("{v:>width$.4}")).collect();
            let (theta, covered) = (format!("{:.1}°", row.theta_i_deg), format!("{:.1} %", 100.0 * row.covered));
            let _ = writeln!(t, "{}{}", lead(&theta, &covered), values.concat());
        }
    }
}
