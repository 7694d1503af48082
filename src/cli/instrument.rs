//! What `--instrument` names: a built-in instrument, or a simulation file.

use std::path::Path;

use super::failure::Failure;
use super::output::read_text;
use crate::gonio::{Instrument, PRESETS, Preset, SimulationSpec};

/// The built-in instrument of this name, else the `[instrument]` of this simulation file (`-` is stdin).
pub(super) fn read_instrument(text: &str) -> Result<Instrument, Failure> {
    if let Some(preset) = Preset::find(text) {
        return preset.spec().map(|spec| spec.instrument).map_err(|e| Failure::work(format!("{text}: {e}")));
    }
    let path = Path::new(text);
    if text != "-" && !path.exists() {
        return Err(unknown(text));
    }
    Ok(read_spec(path)?.instrument)
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
    let text = read_text(path)?;
    let wrong = |e: &dyn std::fmt::Display| Failure::usage(format!("{}: {e}", path.display()));
    SimulationSpec::from_toml(&text).map_err(|e| if is_scene(&text) { wrong(&SCENE) } else { wrong(&e) })
}

const SCENE: &str = "expected a simulation file (version, material, scan, seed, [instrument]), found a scene";

fn is_scene(text: &str) -> bool {
    text.parse::<toml::Table>().is_ok_and(|table| table.contains_key("camera"))
}
