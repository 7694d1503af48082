//! `goniofit models`: the lobes and the built-in materials.

use std::fmt::Write;

use serde_json::json;

use super::failure::Failure;
use super::ui::Ui;
use crate::brdf::LobeKind;
use crate::chain::{BuiltInMaterial, MATERIALS};

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  goniofit models glossy-paint > paint.json")]
pub(super) struct Args {
    /// A built-in material to print as a material file, or a lobe to describe
    name: Option<String>,
    /// Print a material as it is written in a scene file
    #[arg(long, requires = "name")]
    toml: bool,
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    if let Some(name) = &args.name {
        if let Some(kind) = LobeKind::from_name(name) {
            ui.result(&describe(kind), &lobe_object(kind));
            return Ok(());
        }
        let Some(built_in) = BuiltInMaterial::find(name) else {
            let known = MATERIALS.map(|m| m.name).join(", ");
            return Err(Failure::usage(format!("there is no built-in material \"{name}\"; known are {known}")));
        };
        if args.toml {
            let text = built_in.toml();
            ui.result(&text, &json!({ "name": name, "toml": text }));
            return Ok(());
        }
        let text = built_in.material().to_json().map_err(|e| Failure::work(e.to_string()))?;
        let value = serde_json::from_str(&text).map_err(|e| Failure::work(e.to_string()))?;
        ui.result(&text, &value);
        return Ok(());
    }
    let mut text = String::from("Lobes, joined by + (lambert, phong, lambert+phong):\n");
    for kind in LobeKind::ALL {
        text.push_str(&describe(kind));
    }
    text.push_str("\nBuilt-in materials (for --material; `goniofit models NAME` prints one):\n");
    for m in &MATERIALS {
        let _ = writeln!(text, "  {:14} {}", m.name, m.summary);
    }
    let lobes: Vec<_> = LobeKind::ALL.into_iter().map(lobe_object).collect();
    let materials: Vec<_> = MATERIALS.iter().map(|m| json!({ "name": m.name, "summary": m.summary })).collect();
    ui.result(&text, &json!({ "lobes": lobes, "materials": materials }));
    Ok(())
}

fn describe(kind: LobeKind) -> String {
    let mut text = format!("  {:14} {}\n", kind.name(), kind.summary());
    for p in kind.lobe().parameters() {
        let _ = writeln!(text, "  {:14}   {} from {} to {:e}", "", p.name, p.bounds.0, p.bounds.1);
    }
    text
}

fn lobe_object(kind: LobeKind) -> serde_json::Value {
    let parameters: Vec<_> = (kind.lobe().parameters().iter())
        .map(|p| json!({ "name": p.name, "unit": p.unit, "bounds": [p.bounds.0, p.bounds.1] }))
        .collect();
    json!({ "name": kind.name(), "summary": kind.summary(), "parameters": parameters })
}
