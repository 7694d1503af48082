//! `goniofit reduce`: raw readings to BRDF ± σ.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::failure::Failure;
use super::instrument::read_instrument;
use super::output::{
    check_folder, distinct_outputs, input_name, is_csv, keeps_inputs, output_format, read_text, stdout_is_free,
    write_measurement, write_text,
};
use super::simulation::finish;
use super::ui::Ui;
use crate::chain;
use crate::chain::ChainError;
use crate::control::counted;
use crate::gonio::{Instrument, Line, Raw, Reduction, Type};
use crate::measurement::Dimension;
use crate::measurement::formats::{flat_deg, push_number, spherical_deg};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit reduce raw.csv --out satin.csv --budget budget.csv
  goniofit reduce log.csv --instrument lab.toml --out sample.csv")]
pub(super) struct Args {
    /// Raw readings: a CSV with kind, time_s, exposure_s, repeat and signals (`-` is stdin)
    raw: PathBuf,
    /// What made them: a built-in instrument (see `goniofit instruments`), a simulation file whose [instrument] counts, or other raw
    /// readings that say what made them; else what this raw file says of it
    #[arg(long, value_name = "I")]
    instrument: Option<String>,
    /// Where to write the measurement; `-` is CSV on stdout
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Write what each component brings to each reading, as CSV (`-` is stdout); angles and values are written as in --out
    #[arg(long, value_name = "BUDGET.csv")]
    budget: Option<PathBuf>,
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let format = output_format(&args.out, None)?;
    let inputs = || [Some(args.raw.as_path()), args.instrument.as_deref().map(Path::new)].into_iter().flatten();
    for (option, out) in [("--out", Some(&args.out)), ("--budget", args.budget.as_ref())] {
        let Some(out) = out else { continue };
        keeps_inputs(option, out, inputs())?;
        check_folder(out)?;
        stdout_is_free(out, ui)?;
    }
    if let Some(budget) = &args.budget {
        distinct_outputs(("--out", &args.out), ("--budget", budget))?;
        is_csv("--budget", budget)?;
    }
    let input = input_name(&args.raw);
    let (raw, told) = Raw::from_csv(Path::new(&input), &read_text(&args.raw)?)?;
    let given = args.instrument.as_deref().map(read_instrument).transpose()?;
    let instrument = given.or(told).unwrap_or_else(Instrument::noiseless);
    let name = Path::new(&input).file_stem().map_or("reduced".into(), |s| s.to_string_lossy());
    let mut reduction =
        chain::reduced_until(&name, &raw, &instrument, ui.control().stop).map_err(|error| match error {
            // Messages call the file as it was typed.
            ChainError::Reduce { source, .. } => ChainError::Reduce { name: input.clone(), source },
            other => other,
        })?;
    reduction.measurement.notes.extend(reduction.unstated.clone());
    let table = &reduction.measurement;
    for note in &table.notes {
        ui.warn(note);
    }
    write_measurement(table, &args.out, format, ui)?;
    if let Some(path) = &args.budget {
        write_text(path, &by_reading(&raw, &reduction))?;
    }
    let valid = table.values.len() as u64 - table.masked.total();
    let object = {
        let lines: Vec<Line> = reduction.budget.lines.iter().map(unsigned).collect();
        json!({
            "out": args.out, "budget_file": args.budget, "readings": raw.readings.len(), "entries": table.len(), "valid": valid,
            "components": table.common.len(), "budget": lines, "origin": table.origin, "notes": table.notes,
        })
    };
    let text = summary(&args.out, &reduction, valid);
    let outputs = [Some(args.out.as_path()), args.budget.as_deref()];
    finish(table, Some(&raw), &instrument, (text, object), &outputs, ui)
}

/// Zero without a sign.
fn unsigned(line: &Line) -> Line {
    Line { rms: line.rms + 0.0, relative: line.relative + 0.0, ..line.clone() }
}

/// The budget as text.
fn summary(out: &Path, reduction: &Reduction, valid: u64) -> String {
    let table = &reduction.measurement;
    let mut text = format!(
        "{}: {}; {} of directions, {}, {}",
        out.display(),
        table.origin,
        counted(table.len() as u64, "pair"),
        counted(valid, "valid value"),
        counted(table.common.len() as u64, "shared component")
    );
    // Writing to a String can't fail.
    let rms = format!("rms [{}]", unit(table.dimension));
    let _ = write!(
        text,
        "\n  {:<28} {:>16}  {:>11}  {rms:>10}  {:>7}",
        "component, type", "one σ", "sensitivity", "median"
    );
    for line in reduction.budget.lines.iter().map(unsigned) {
        let kind = if line.name == TOTAL { "" } else { line.kind.name() };
        let name = format!("{:<28} {kind:<1}", line.name);
        let u = line.u.map_or_else(String::new, |u| format!("{u:.2e} {:<6}", line.unit));
        let sensitivity = line.sensitivity.map_or_else(String::new, |c| format!("{c:.2e}"));
        let _ =
            write!(text, "\n  {name}  {u:>15}  {sensitivity:>9}  {:>10.2e}  {:>6.3}%", line.rms, 100.0 * line.relative);
    }
    if table.sigma.is_none() {
        text.push_str("\n  without noise, which is not known");
    }
    let _ = write!(text, "\n  one σ of a rate is in signals a second; median is of a reading's value");
    text
}

const TOTAL: &str = "all together";

/// The BRDF's unit.
fn unit(dimension: Dimension) -> &'static str {
    if dimension == Dimension::Flat { "1/rad" } else { "1/sr" }
}

/// What each component brings to each reading.
fn by_reading(raw: &Raw, reduction: &Reduction) -> String {
    let (table, lines) = (&reduction.measurement, &reduction.budget.lines);
    let parts = &lines[..lines.len() - 1];
    let is_flat = table.dimension == Dimension::Flat;
    let angles = if is_flat { "theta_i_deg,theta_o_deg" } else { "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg" };
    let mut text = format!("{angles},channel,value");
    for line in parts {
        let _ = write!(text, ",{} ({}) [{}]", line.name, line.kind.name(), unit(table.dimension));
    }
    let _ = write!(text, ",all together [{}]", unit(table.dimension));
    // Of noise one σ is another in each reading, so there is no one coefficient.
    let described: Vec<(usize, f64)> =
        parts.iter().enumerate().filter(|(_, l)| l.kind == Type::B).filter_map(|(k, l)| Some((k, l.u?))).collect();
    for (k, _) in &described {
        let by = Some(parts[*k].unit).filter(|u| !u.is_empty()).map_or_else(String::new, |u| format!(" by {u}"));
        let _ = write!(text, ",sensitivity to {} [{}{by}]", parts[*k].name, unit(table.dimension));
    }
    text.push('\n');
    for i in 0..table.len() {
        let (wi, wo) = raw.directions.pair(i);
        for (c, channel) in table.channels.iter().enumerate() {
            let Some(value) = table.value(c, i) else { continue };
            // The same text as in the measurement's own file.
            if is_flat {
                [wi, wo].into_iter().for_each(|w| push_number(&mut text, flat_deg(w)));
            } else {
                [spherical_deg(wi), spherical_deg(wo)].into_iter().flatten().for_each(|a| push_number(&mut text, a));
            }
            let _ = write!(text, "{channel},");
            push_number(&mut text, value);
            let place = c * table.len() + i;
            // Adding 0 takes the sign of −0.
            let of: Vec<f64> = (0..parts.len()).map(|k| reduction.budget.contribution(k, place) + 0.0).collect();
            of.iter().for_each(|u| push_number(&mut text, *u));
            push_number(&mut text, of.iter().map(|u| u * u).fold(0.0, |a, b| a + b).sqrt());
            described.iter().for_each(|(k, u)| push_number(&mut text, of[*k] / u));
            text.pop(); // the last comma
            text.push('\n');
        }
    }
    text
}
