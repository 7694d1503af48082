//! `goniofit instruments`: the built-in instruments.

use std::fmt::Write;

use serde_json::json;

use super::failure::Failure;
use super::instrument::unknown;
use super::ui::Ui;
use crate::gonio::{PRESETS, Preset, SimulationSpec, plan};

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  goniofit instruments commercial --toml > my-instrument.toml")]
pub(super) struct Args {
    /// An instrument to show
    name: Option<String>,
    /// Print the instrument as a file to start from, with the source of each figure
    #[arg(long, requires = "name")]
    toml: bool,
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let Some(name) = &args.name else { return list(ui) };
    let preset = Preset::find(name).ok_or_else(|| unknown(name))?;
    let (spec, description) = read(preset)?;
    let effects = plan(&spec.instrument, &[]);
    let on: Vec<&str> = effects.effects.iter().filter(|e| e.on).map(|e| e.name).collect();
    let said = if on.is_empty() { "none".into() } else { on.join(", ") };
    let text = if args.toml { preset.toml.to_owned() } else { format!("{name}: {description}\n  effects: {said}") };
    let object = json!({ "name": name, "description": description, "effects": on, "instrument": spec.instrument, "toml": preset.toml });
    ui.result(&text, &object);
    Ok(())
}

fn list(ui: &Ui) -> Result<(), Failure> {
    let mut text = String::from(
        "Built-in instruments (for --instrument; `goniofit instruments NAME --toml` prints one with the source of each figure):\n",
    );
    let mut list = Vec::new();
    for preset in &PRESETS {
        let (_, description) = read(preset)?;
        let _ = writeln!(text, "  {:14} {description}", preset.name);
        list.push(json!({ "name": preset.name, "description": description }));
    }
    ui.result(&text, &json!({ "instruments": list }));
    Ok(())
}

fn read(preset: &Preset) -> Result<(SimulationSpec, String), Failure> {
    let spec = preset.spec().map_err(|e| Failure::work(format!("{}: {e}", preset.name)))?;
    let description = spec.description.clone().unwrap_or_default();
    Ok((spec, description))
}
