//! What `--instrument` names: a built-in instrument, or a simulation file.

use std::path::Path;
use std::sync::Arc;

use super::failure::Failure;
use super::output::{input_name, read_text};
use crate::brdf::Sight;
use crate::gonio::sight::Cones;
use crate::gonio::{self, Instrument, PRESETS, Preset, SimulationSpec};

/// The built-in instrument of this name, else the `[instrument]` of this simulation file (`-` is stdin).
pub(super) fn read_instrument(text: &str) -> Result<Instrument, Failure> {
    if let Some(preset) = Preset::find(text) {
        return preset.spec().map(|spec| spec.instrument).map_err(|e| Failure::work(format!("{text}: {e}")));
    }
    let path = Path::new(text);
    if text != "-" && !path.exists() {
        return Err(unknown(text));
    }
    let text = read_text(path)?;
    // Raw readings may say what made them.
    match gonio::described(Path::new(&input_name(path)), &text)? {
        Some(instrument) => Ok(instrument),
        None if is_table(&text) => Err(Failure::usage(format!("{}: {TABLE}", input_name(path)))),
        None => Ok(spec_of(path, &text)?.instrument),
    }
}

/// What lobes are seen through by this instrument; one of points is refused.
pub(super) fn read_sight(name: &str) -> Result<Arc<dyn Sight>, Failure> {
    match Cones::of(&read_instrument(name)?) {
        Some(cones) => Ok(Arc::new(cones)),
        None => Err(Failure::usage(format!(
            "--through {name}: expected an instrument with an aperture (instrument.detector.aperture_deg) or a divergence \
             (instrument.source.divergence_deg), found points, through which a fit is the plain one"
        ))),
    }
}

/// Nothing of this name is built in, nor is it a file.
pub(super) fn unknown(name: &str) -> Failure {
    let known = PRESETS.map(|preset| preset.name).join(", ");
    Failure::usage(format!(
        "there is no built-in instrument \"{name}\" and no such file; known are {known}; a simulation file with an [instrument] does too"
    ))
}

/// A simulation file.
pub(super) fn read_spec(path: &Path) -> Result<SimulationSpec, Failure> {
    if path != Path::new("-") && !path.exists() && path.to_str().and_then(Preset::find).is_some() {
        let name = path.display();
        return Err(Failure::usage(format!(
            "{name}: there is no simulation file of this name; the built-in instrument is meant by --instrument {name}"
        )));
    }
    spec_of(path, &read_text(path)?)
}

fn spec_of(path: &Path, text: &str) -> Result<SimulationSpec, Failure> {
    let wrong = |e: &dyn std::fmt::Display| Failure::usage(format!("{}: {e}", input_name(path)));
    SimulationSpec::from_toml(text).map_err(|e| if is_scene(text) { wrong(&SCENE) } else { wrong(&e) })
}

const TABLE: &str = "expected a simulation file with an [instrument], or raw readings that say what made them (`# instrument: {…}`), found a \
                     table without that line";

/// Whether the first line that is no comment is the header of a CSV.
fn is_table(text: &str) -> bool {
    let first = text.lines().find(|l| !l.trim().is_empty() && !l.starts_with('#'));
    first.is_some_and(|l| l.contains(',') && !l.contains(['=', '[']))
}

const SCENE: &str = "expected a simulation file (version, material, scan, seed, [instrument]), found a scene";

fn is_scene(text: &str) -> bool {
    text.parse::<toml::Table>().is_ok_and(|table| table.contains_key("camera"))
}
