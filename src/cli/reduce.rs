//! `goniofit reduce`: raw readings to BRDF ± σ.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::failure::Failure;
use super::output::{
    check_folder, keeps_inputs, output_format, read_text, stdout_is_free, write_measurement, write_text,
};
use super::simulation::read_spec;
use super::ui::Ui;
use crate::chain;
use crate::geometry::angles::{phi_of, theta_of};
use crate::gonio::{Instrument, Raw, Reduction};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit reduce raw.csv --out satin.csv --budget budget.csv
  goniofit reduce log.csv --instrument lab.toml --out sample.csv")]
pub(super) struct Args {
    /// Raw readings: a CSV with kind, time_s, exposure_s, repeat and signals (`-` is stdin)
    raw: PathBuf,
    /// What made them: a simulation file whose [instrument] counts; else what the raw file says of it
    #[arg(long, value_name = "I")]
    instrument: Option<PathBuf>,
    /// Where to write the measurement; `-` is CSV on stdout
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Write what each component brings to each reading, as CSV
    #[arg(long, value_name = "BUDGET.csv")]
    budget: Option<PathBuf>,
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let format = output_format(&args.out, None)?;
    let inputs = || [Some(&args.raw), args.instrument.as_ref()].into_iter().flatten().map(PathBuf::as_path);
    for (option, out) in [("--out", Some(&args.out)), ("--budget", args.budget.as_ref())] {
        let Some(out) = out else { continue };
        keeps_inputs(option, out, inputs())?;
        check_folder(out)?;
    }
    stdout_is_free(&args.out, ui)?;
    let (raw, told) = Raw::from_csv(&args.raw, &read_text(&args.raw)?)?;
    let given = args.instrument.as_deref().map(read_spec).transpose()?.map(|spec| spec.instrument);
    let instrument = given.or(told).unwrap_or_else(Instrument::noiseless);
    let name = args.raw.file_stem().map_or("reduced".into(), |s| s.to_string_lossy());
    let reduction = chain::reduced(&name, &raw, &instrument)?;
    let table = &reduction.measurement;
    for note in &table.notes {
        ui.warn(note);
    }
    write_measurement(table, &args.out, format, ui)?;
    if let Some(path) = &args.budget {
        write_text(path, &by_reading(&raw, &reduction))?;
    }
    let valid = table.values.len() as u64 - table.masked.total();
    if args.out != Path::new("-") {
        let object = json!({
            "out": args.out, "budget_file": args.budget, "readings": raw.readings.len(), "entries": table.len(), "valid": valid,
            "components": table.common.len(), "budget": reduction.budget.lines, "notes": table.notes,
        });
        ui.result(&summary(&args.out, &raw, &reduction, valid), &object);
    }
    Ok(())
}

/// The budget as text.
fn summary(out: &Path, raw: &Raw, reduction: &Reduction, valid: u64) -> String {
    let table = &reduction.measurement;
    let mut text = format!(
        "{}: {} readings of {} pairs of directions, {valid} valid values, {} shared components",
        out.display(),
        raw.readings.len(),
        table.len(),
        table.common.len()
    );
    // Writing to a String can't fail.
    let _ = write!(text, "\n  {:<34} type   rms [1/sr]   of a reading (median)", "component, one σ");
    for line in &reduction.budget.lines {
        let kind = if line.name == TOTAL { "" } else { line.kind.name() };
        let _ = write!(text, "\n  {:<34} {kind:<4} {:>12.3e}   {:>8.3} %", line.name, line.rms, 100.0 * line.relative);
    }
    text
}

const TOTAL: &str = "all together";

/// What each component brings to each reading.
fn by_reading(raw: &Raw, reduction: &Reduction) -> String {
    let (table, lines) = (&reduction.measurement, &reduction.budget.lines);
    let parts = &lines[..lines.len() - 1];
    let mut text = String::from("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,channel,value");
    for line in parts {
        let _ = write!(text, ",{} ({}) [1/sr]", line.name, line.kind.name());
    }
    text.push_str(",all together [1/sr]\n");
    for i in 0..table.len() {
        let (wi, wo) = raw.directions.pair(i);
        for (c, channel) in table.channels.iter().enumerate() {
            let Some(value) = table.value(c, i) else { continue };
            let degrees =
                [theta_of(wi), phi_of(wi), theta_of(wo), phi_of(wo)].map(|a| format!("{:.6}", a.to_degrees()));
            let _ = write!(text, "{},{channel},{value:e}", degrees.join(","));
            let place = c * table.len() + i;
            let of: Vec<f64> = (0..parts.len()).map(|k| reduction.budget.contribution(k, place)).collect();
            of.iter().for_each(|u| {
                let _ = write!(text, ",{u:e}");
            });
            let _ = writeln!(text, ",{:e}", of.iter().map(|u| u * u).sum::<f64>().sqrt());
        }
    }
    text
}
