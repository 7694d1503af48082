//! `goniofit simulate`: the simulated gonioreflectometer writes a measurement.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::failure::Failure;
use super::instrument::{read_instrument, read_spec};
use super::output::{check_folder, keeps_inputs, output_format, stdout_is_free, write_measurement, write_text};
use super::ui::{Ui, significant};
use crate::chain;
use crate::gonio::{self, Instrument, Scan};
use crate::measurement::{ReadOptions, formats};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit simulate --material glossy-paint --scan hemisphere:5 --seed 1 --out paint.csv
  goniofit simulate --material satin --instrument commercial --scan in-plane:5 --raw raw.csv --out satin.csv
  goniofit simulate --material gold.json --scan merl --noiseless --out gold.binary")]
pub(super) struct Args {
    /// A simulation file (`-` is stdin); options given beside it replace what it says
    spec: Option<PathBuf>,
    /// The truth: a built-in material (see `goniofit models`), a fitted .json or a measurement
    #[arg(long, value_name = "M")]
    material: Option<String>,
    /// Where to measure: in-plane[:STEP], hemisphere[:STEP], flat[:STEP] (degrees), merl, or list:FILE with the directions in a
    /// CSV or in another measurement [default: hemisphere:5]
    #[arg(long, value_name = "S")]
    scan: Option<String>,
    /// Seed of the noise [default: 0]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// The instrument: a built-in one (see `goniofit instruments`), or a simulation file whose [instrument] counts (see
    /// docs/instrument.md)
    #[arg(long, value_name = "I")]
    instrument: Option<String>,
    /// Write the raw readings too, as CSV
    #[arg(long, value_name = "RAW.csv")]
    raw: Option<PathBuf>,
    /// Photoelectrons in a reading of 1/sr at cosθo = 1 [default: 100000]; 0 is a detector without any noise
    #[arg(long, value_name = "E", allow_negative_numbers = true)]
    electrons: Option<f64>,
    /// Read noise, electrons [default: 10]
    #[arg(long, value_name = "E", allow_negative_numbers = true)]
    read_noise: Option<f64>,
    /// Readings averaged at each pair of directions [default: 1]
    #[arg(long, value_name = "N")]
    readings: Option<u32>,
    /// A detector without noise
    #[arg(long, conflicts_with_all = ["electrons", "read_noise", "readings"])]
    noiseless: bool,
    /// Where to write; the extension chooses the format (.csv, .binary); `-` is CSV on stdout
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let format = output_format(&args.out, None)?;
    check_folder(&args.out)?;
    if let Some(raw) = &args.raw {
        check_folder(raw)?;
        let inputs = [args.spec.as_deref(), args.instrument.as_deref().map(Path::new), Some(&args.out)];
        keeps_inputs("--raw", raw, inputs.into_iter().flatten())?;
    }
    stdout_is_free(&args.out, ui)?;
    let plan = Plan::new(args)?;
    let source = chain::load(&plan.material, &ReadOptions::default())?;
    let name = Path::new(&plan.material).file_stem().map_or("simulated".into(), |s| s.to_string_lossy());
    let table = match &args.raw {
        None => chain::measure(&name, &source, &plan.instrument, &plan.scan, plan.seed, ui.control())?,
        Some(path) => {
            let raw = chain::measure_raw(&name, &source, &plan.instrument, &plan.scan, plan.seed, ui.control())?;
            write_text(path, &raw.to_csv(&plan.instrument))?;
            chain::reduced(&name, &raw, &plan.instrument)?.measurement
        }
    };
    for note in &table.notes {
        ui.warn(note);
    }
    write_measurement(&table, &args.out, format, ui)?;
    let valid = table.values.len() as u64 - table.masked.total();
    if args.out.as_os_str() != "-" {
        let effects = gonio::plan(&plan.instrument, &table.channels);
        let hours = gonio::hours(&plan.instrument, &gonio::lit_rows(&table.directions, plan.scan.rows()));
        let on: Vec<&str> = effects.effects.iter().filter(|e| e.on).map(|e| e.name).collect();
        let text = format!(
            "{}: {} direction pairs, {valid} valid values, scan {}, seed {}, {} h of the instrument; effects: {}",
            args.out.display(),
            table.len(),
            plan.scan,
            plan.seed,
            significant(hours),
            if on.is_empty() { "none".into() } else { on.join(", ") }
        );
        let object = json!({ "out": args.out, "entries": table.len(), "valid": valid, "scan": plan.scan.to_string(), "seed": plan.seed, "instrument_hours": hours, "effects": effects.effects });
        ui.result(&text, &object);
    }
    Ok(())
}

/// What to simulate, checked.
struct Plan {
    material: String,
    scan: Scan,
    seed: u64,
    instrument: Instrument,
}

impl Plan {
    fn new(args: &Args) -> Result<Self, Failure> {
        keeps_inputs("--out", &args.out, args.spec.as_deref())?;
        let spec = args.spec.as_deref().map(read_spec).transpose()?;
        let base = args.spec.as_deref().and_then(Path::parent).unwrap_or_else(|| Path::new(""));
        let of_spec = spec.as_ref();
        let material = match (&args.material, of_spec.and_then(|s| s.material.as_ref())) {
            (Some(typed), _) => typed.clone(),
            (None, Some(written)) => relative_to(base, written),
            (None, None) => {
                return Err(Failure::usage("--material: say what to measure, for example --material glossy-paint"));
            }
        };
        let scan = match (&args.scan, of_spec.and_then(|s| s.scan.as_ref())) {
            (Some(typed), _) => Some(typed.clone()),
            (None, Some(written)) => Some(match written.strip_prefix("list:") {
                Some(file) => format!("list:{}", relative_to(base, file)),
                None => written.clone(),
            }),
            (None, None) => None,
        };
        let list = scan.as_ref().and_then(|s| s.strip_prefix("list:"));
        keeps_inputs("--out", &args.out, [Some(&material[..]), list].into_iter().flatten().map(Path::new))?;
        let scan = scan.map_or(Ok(Scan::Hemisphere { step_deg: 5.0 }), |text| parse_scan(&text))?.merged();
        let of_file = args.instrument.as_deref().map(read_instrument).transpose()?;
        let of_spec_file = || of_spec.map_or_else(Instrument::default, |s| s.instrument.clone());
        let mut instrument = of_file.unwrap_or_else(of_spec_file);
        if args.noiseless {
            (instrument.electrons, instrument.read_noise) = (0.0, 0.0);
        }
        instrument.electrons = args.electrons.unwrap_or(instrument.electrons);
        instrument.read_noise = args.read_noise.unwrap_or(instrument.read_noise);
        instrument.readings = args.readings.unwrap_or(instrument.readings);
        if let Some(fault) = instrument.fault() {
            return Err(Failure::usage(fault));
        }
        let seed = args.seed.or(of_spec.and_then(|s| s.seed)).unwrap_or(0);
        Ok(Self { material, scan, seed, instrument })
    }
}

/// A file that a simulation file names stands beside it; a built-in material's name stays.
fn relative_to(base: &Path, name: &str) -> String {
    let beside = base.join(name);
    if beside.exists() { beside.to_string_lossy().into_owned() } else { name.to_owned() }
}

/// A scan as typed; `list:FILE` takes the directions and weights of that measurement.
pub(super) fn parse_scan(text: &str) -> Result<Scan, Failure> {
    if let Some(file) = text.strip_prefix("list:") {
        let (directions, weights, dimension) = formats::read_directions(Path::new(file), &ReadOptions::default())?;
        return Ok(Scan::List { name: file.into(), directions, weights, dimension, rows: Vec::new() });
    }
    text.parse().map_err(|e: crate::gonio::ScanError| Failure::usage(e.to_string()))
}
