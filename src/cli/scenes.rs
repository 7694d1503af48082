//! `goniofit scenes`: the built-in scenes.

use std::fmt::Write;

use serde_json::json;

use super::failure::Failure;
use super::ui::Ui;
use crate::render::scene::{BUILT_IN, builtin};

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  goniofit scenes cornell --toml > my-scene.toml")]
pub(super) struct Args {
    /// A scene to show
    name: Option<String>,
    /// Print the scene as a file to start from
    #[arg(long, requires = "name")]
    toml: bool,
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    let Some(name) = &args.name else {
        let mut text = String::from("Built-in scenes (`goniofit scenes NAME --toml` prints one):\n");
        let mut list = Vec::new();
        for scene in &BUILT_IN {
            let description = builtin(scene.name)?.description;
            let _ = writeln!(text, "  {:16} {description}", scene.name);
            list.push(json!({ "name": scene.name, "description": description }));
        }
        ui.result(&text, &json!({ "scenes": list }));
        return Ok(());
    };
    let spec = builtin(name)?;
    let toml = BUILT_IN.iter().find(|s| s.name == name).map_or("", |s| s.toml);
    let text = if args.toml { toml.to_owned() } else { format!("{}: {}", spec.name, spec.description) };
    ui.result(&text, &json!({ "name": spec.name, "description": spec.description, "toml": toml }));
    Ok(())
}
