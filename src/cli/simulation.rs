//! What is simulated: a simulation file, and options beside it, to a checked plan.

use std::path::{Path, PathBuf};

use super::failure::Failure;
use super::instrument::{read_instrument, read_spec};
use super::output::keeps_inputs;
use super::ui::Ui;
use crate::chain::{self, Source};
use crate::control::counted;
use crate::gonio::{Instrument, Raw, Scan, SimulationSpec};
use crate::measurement::{Measurement, ReadOptions, formats};

/// Options that say what is simulated.
#[derive(Debug, clap::Args)]
pub(super) struct What {
    /// A simulation file (`-` is stdin); options given beside it replace what it says
    pub spec: Option<PathBuf>,
    /// The truth: a built-in material (see `goniofit models`), a fitted .json or a measurement
    #[arg(long, value_name = "M")]
    pub material: Option<String>,
    /// Where to measure: in-plane[:STEP], hemisphere[:STEP], flat[:STEP] (degrees), merl, adaptive[:N] (N pairs in the plane of
    /// incidence, 500 if not said, denser where readings bend), or list:FILE with the directions in a CSV or in another measurement
    /// [default: hemisphere:5]
    #[arg(long, value_name = "S")]
    pub scan: Option<String>,
    /// Seed of the noise [default: 0]
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// The instrument: a built-in one (see `goniofit instruments`), a simulation file whose [instrument] counts (see
    /// docs/instrument.md), or raw readings that say what made them
    #[arg(long, value_name = "I")]
    pub instrument: Option<String>,
    /// Photoelectrons a second (in a reading, where no exposures are given) of 1/sr at cosθo = 1, 1e-3 to 1e15 [default: 100000]; 0 is a detector without any noise
    #[arg(long, value_name = "E", allow_negative_numbers = true)]
    pub electrons: Option<f64>,
    /// Read noise, electrons [default: 10]
    #[arg(long, value_name = "E", allow_negative_numbers = true)]
    pub read_noise: Option<f64>,
    /// Readings averaged at each pair of directions [default: 1]
    #[arg(long, value_name = "N")]
    pub readings: Option<u32>,
    /// A detector without noise
    #[arg(long, conflicts_with_all = ["electrons", "read_noise", "readings"])]
    pub noiseless: bool,
}

impl What {
    /// The files that are named, so far as these are files.
    pub fn inputs(&self) -> Vec<&Path> {
        let listed = self.scan.as_deref().and_then(|scan| scan.strip_prefix("list:"));
        let named = [self.material.as_deref(), self.instrument.as_deref(), listed];
        self.spec.as_deref().into_iter().chain(named.into_iter().flatten().map(Path::new)).collect()
    }
}

/// What to simulate, checked.
pub(super) struct Plan {
    pub material: String,
    pub scan: Scan,
    pub seed: u64,
    pub instrument: Instrument,
}

impl Plan {
    /// From what was typed; nothing that is read may be `out`.
    pub fn new(what: &What, out: Option<&Path>) -> Result<Self, Failure> {
        let keeps = |inputs: &[Option<&Path>]| match out {
            Some(out) => keeps_inputs("--out", out, inputs.iter().copied().flatten()),
            None => Ok(()),
        };
        keeps(&[what.spec.as_deref()])?;
        let spec = what.spec.as_deref().map(read_spec).transpose()?;
        let base = what.spec.as_deref().and_then(Path::parent).unwrap_or_else(|| Path::new(""));
        let of_spec = spec.as_ref();
        let material = match (&what.material, of_spec.and_then(|s| s.material.as_ref())) {
            (Some(typed), _) => typed.clone(),
            (None, Some(written)) => relative_to(base, written),
            (None, None) => {
                return Err(Failure::usage("--material: say what to measure, for example --material glossy-paint"));
            }
        };
        let scan = match (&what.scan, of_spec.and_then(|s| s.scan.as_ref())) {
            (Some(typed), _) => Some(typed.clone()),
            (None, Some(written)) => Some(match written.strip_prefix("list:") {
                Some(file) if !file.is_empty() => format!("list:{}", relative_to(base, file)),
                _ => written.clone(),
            }),
            (None, None) => None,
        };
        let list = scan.as_ref().and_then(|s| s.strip_prefix("list:"));
        keeps(&[Some(Path::new(&material)), list.map(Path::new)])?;
        let scan = scan.map_or(Ok(Scan::Hemisphere { step_deg: 5.0 }), |text| parse_scan(&text))?.merged();
        let seed = what.seed.or(of_spec.and_then(|s| s.seed)).unwrap_or(0);
        Ok(Self { material, scan, seed, instrument: instrument(what, of_spec)? })
    }

    /// The material, and what the measurement of it is called.
    pub fn load(&self) -> Result<(Source, String), Failure> {
        let source = chain::load(&self.material, &ReadOptions::default())?;
        let stem = Path::new(&self.material).file_stem();
        Ok((source, stem.map_or("simulated".into(), |s| s.to_string_lossy().into_owned())))
    }
}

/// The instrument: a file's, else the simulation file's, with the numbers that were typed.
fn instrument(what: &What, of_spec: Option<&SimulationSpec>) -> Result<Instrument, Failure> {
    let of_file = what.instrument.as_deref().map(read_instrument).transpose()?;
    let of_spec_file = || of_spec.map_or_else(Instrument::default, |s| s.instrument.clone());
    let mut instrument = of_file.unwrap_or_else(of_spec_file);
    if what.noiseless {
        (instrument.electrons, instrument.read_noise) = (0.0, 0.0);
    }
    instrument.electrons = what.electrons.unwrap_or(instrument.electrons);
    instrument.read_noise = what.read_noise.unwrap_or(instrument.read_noise);
    instrument.readings = what.readings.unwrap_or(instrument.readings);
    instrument.fault().map_or(Ok(instrument), |fault| Err(Failure::usage(fault)))
}

/// A file that a simulation file names stands beside it; a built-in material's name stays.
fn relative_to(base: &Path, name: &str) -> String {
    let beside = base.join(name);
    if beside.exists() { beside.to_string_lossy().into_owned() } else { name.to_owned() }
}

/// A scan as typed; `list:FILE` takes the directions and weights of that measurement.
pub(super) fn parse_scan(text: &str) -> Result<Scan, Failure> {
    if let Some(file) = text.strip_prefix("list:") {
        if file.is_empty() {
            return Err(Failure::usage(
                "scan \"list:\": expected list:FILE, FILE being a CSV or another measurement with the directions, found no name",
            ));
        }
        let (directions, weights, dimension) = formats::read_directions(Path::new(file), &ReadOptions::default())?;
        return Ok(Scan::List { name: file.into(), directions, weights, dimension, rows: Vec::new() });
    }
    text.parse().map_err(|e: crate::gonio::ScanError| Failure::usage(e.to_string()))
}

/// The end of a command that wrote the measurement `table`, made from `raw` where that is at hand: its result, unless an output has stdout. A
/// measurement without any valid value is a failure, for whose reason it says what is known.
pub(super) fn finish(
    table: &Measurement,
    raw: Option<&Raw>,
    instrument: &Instrument,
    result: (String, serde_json::Value),
    outputs: &[Option<&Path>],
    ui: &Ui,
) -> Result<(), Failure> {
    let is_stdout_free = outputs.iter().flatten().all(|out| *out != Path::new("-"));
    let values = table.values.len() as u64;
    if table.masked.total() < values || ui.control().stop.requested() {
        if is_stdout_free {
            ui.result(&result.0, &result.1);
        }
        return Ok(());
    }
    let mut reasons = table.notes.clone();
    if raw.is_some_and(|raw| raw.reference_saturates(instrument)) {
        reasons.push("every exposure of the reference saturates".into());
    }
    if reasons.is_empty() {
        reasons.push("the material is known in none of these directions".into());
    }
    let failure = Failure::work(format!(
        "none of {} is valid: {}; the file says where (empty cells)",
        counted(values, "value"),
        reasons.join("; ")
    ));
    Err(if is_stdout_free { failure.beside(result.0, result.1) } else { failure })
}
