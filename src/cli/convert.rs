//! `goniofit convert`: between measurement formats; a fit is sampled onto the format's grid.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::failure::Failure;
use super::info::Reading;
use super::output::{check_folder, keeps_inputs, output_format, stdout_is_free, write_measurement};
use super::simulation::parse_scan;
use super::ui::Ui;
use crate::chain::{self, Source};
use crate::gonio::Scan;
use crate::measurement::{Dimension, Directions, Format, MerlAngles, MerlGrid, Weights, formats};

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  goniofit convert gold.binary gold.csv\n  goniofit convert gold.json gold-fit.binary"
)]
pub(super) struct Args {
    /// A measurement, or a fitted material (.json); `-` is stdin
    input: String,
    /// Where to write; the extension chooses the format; `-` is stdout
    out: PathBuf,
    /// Format to write (default: by the extension)
    #[arg(long, value_parser = parse_written, value_name = "merl|csv")]
    to: Option<Format>,
    /// Grid to sample a fit on (default: merl for MERL, else hemisphere:5)
    #[arg(long, value_name = "SCAN")]
    scan: Option<String>,
    #[command(flatten)]
    reading: Reading,
}

fn parse_written(text: &str) -> Result<Format, String> {
    Format::from_name(text).filter(|f| f.is_written()).ok_or_else(|| "known are merl, csv".into())
}

/// The MERL grid, read where the user says.
fn merl_grid(angles: MerlAngles) -> Scan {
    Scan::List {
        name: "merl".into(),
        directions: Directions::Merl(MerlGrid { angles }),
        weights: Weights::Merl,
        dimension: Dimension::Space,
        rows: Vec::new(),
    }
}

/// The grid that a fit is sampled on.
fn scan_of(args: &Args, format: Format, flat: bool, angles: Option<MerlAngles>) -> Result<Scan, Failure> {
    let asked = args.scan.as_deref().map(parse_scan).transpose()?;
    match asked {
        Some(Scan::Merl) => Ok(merl_grid(angles.unwrap_or_default())),
        None if format == Format::Merl => Ok(merl_grid(angles.unwrap_or_default())),
        _ if angles.is_some() => Err(Failure::usage("--merl-angles: only a MERL grid has bins; use --scan merl")),
        Some(other) => Ok(other),
        None if flat => Ok(Scan::Flat { step_deg: 1.0 }),
        None => Ok(Scan::Hemisphere { step_deg: 5.0 }),
    }
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let format = output_format(&args.out, args.to)?;
    check_folder(&args.out)?;
    keeps_inputs("OUT", &args.out, [Path::new(&args.input)])?;
    stdout_is_free(&args.out, ui)?;
    let options = args.reading.options();
    let table = match chain::load(&args.input, &options)? {
        Source::Measured(table) => {
            if args.scan.is_some() {
                return Err(Failure::usage("--scan: a measurement keeps its own directions; only a fit is sampled"));
            }
            *table
        }
        Source::Fitted(material) => {
            formats::check_channels(&material.channels, format, &args.out)?;
            let scan = scan_of(args, format, material.is_flat(), options.merl_angles)?;
            chain::tabulate(&args.input, &material, &scan, ui.control())?
        }
    };
    for note in &table.notes {
        ui.note(&format!("note: {note}"));
    }
    write_measurement(&table, &args.out, format, ui)?;
    if args.out.as_os_str() != "-" {
        let text = format!("{}: {} direction pairs as {}", args.out.display(), table.len(), format.description());
        ui.result(&text, &json!({ "out": args.out, "entries": table.len(), "format": format.name() }));
    }
    Ok(())
}
