//! `goniofit effects`: which effects a simulation or a scene calls for, why, what each costs, and how far the result would be off without it.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::json;

pub(super) mod of_scene;

use super::failure::Failure;
use super::output::read_text;
use super::render::{parse_size, stage_of};
use super::simulation::{Plan, What};
use super::text::indented;
use super::ui::Ui;
use crate::chain::{self, Stage};
use crate::gonio::{ACCURACY, Change, Contribution, Contributions};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  goniofit effects lab.toml --material satin --scan in-plane:5
  goniofit effects --instrument lab.toml --material gold.json --json
  goniofit effects my-scene.toml
  goniofit effects --scene cornell --material gold.json")]
pub(super) struct Args {
    #[command(flatten)]
    what: What,
    /// A built-in scene (see `goniofit scenes`); a SPEC that has a camera is a scene too
    #[arg(long, value_name = "NAME", conflicts_with_all = ["spec", "scan", "instrument", "electrons", "read_noise", "readings", "noiseless"])]
    scene: Option<String>,
    /// Size of a scene's pictures in pixels, WIDTHxHEIGHT or one number for both [default: 128 at most, in the scene's proportions]
    #[arg(long, value_parser = parse_size, value_name = "SIZE")]
    size: Option<(u32, u32)>,
    /// Samples per pixel of a scene's pictures [default: 64]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1 << 24))]
    samples: Option<u32>,
}

pub(super) fn run(args: &Args, ui: &Ui) -> Result<(), Failure> {
    if let Some(stage) = scene(args)? {
        return of_scene::run(&stage, args, ui);
    }
    let plan = Plan::new(&args.what, None)?;
    let (source, name) = plan.load()?;
    let found = chain::with_job(&name, &source, &plan.instrument, &plan.scan, plan.seed, ui.control(), |job| {
        job.contributions(ui.control())
    })?;
    if found.quadrature_error > ACCURACY {
        let error = found.quadrature_error;
        ui.warn(&format!(
            "means over cones are good to {error:.1e} at worst, not to {ACCURACY:e}: their orders end there"
        ));
    }
    let spec = || args.what.spec.as_ref().map(|spec| spec.display().to_string());
    let instrument = args.what.instrument.clone().or_else(spec);
    let object = json!({
        "instrument": instrument, "material": plan.material, "scan": plan.scan.to_string(), "seed": plan.seed, "readings": found.readings,
        "seconds": found.seconds, "quadrature_error": found.quadrature_error, "effects": found.effects,
    });
    ui.result(&table(&plan, &found), &object);
    Ok(())
}

/// The scene, if it is one.
fn scene(args: &Args) -> Result<Option<Stage>, Failure> {
    if let Some(name) = &args.scene {
        return Ok(Some(Stage::built_in(name)?));
    }
    let Some(path) = &args.what.spec else { return Ok(None) };
    if path == Path::new("-") {
        return Ok(None); // a simulation: stdin can be read only once
    }
    let text = read_text(path)?;
    let is_scene = text.parse::<toml::Table>().is_ok_and(|table| table.contains_key("camera"));
    if is_scene { Ok(Some(stage_of(&text, path)?)) } else { Ok(None) }
}

/// Effects that are on with their numbers, then those that are off with the reason; no wider than tables may be.
fn table(plan: &Plan, found: &Contributions) -> String {
    let mut text = format!(
        "{} along {}, seed {}: {} readings, {:.3} s of processor time",
        plan.material, plan.scan, plan.seed, found.readings, found.seconds
    );
    if found.quadrature_error > 0.0 {
        let _ = write!(text, ", means over cones to {:.1e}", found.quadrature_error);
    }
    let (on, off): (Vec<&Contribution>, Vec<&Contribution>) = found.effects.iter().partition(|e| e.on);
    let _ = write!(
        text,
        "\n\n{:17} {:>6} {:^16} {:^16} because of\n{:17} {:>6} {:>8} {:>7} {:>8} {:>7}",
        "without it", "time", "readings change by", "reduced, by", "", "", "largest", "rms", "largest", "rms"
    );
    for effect in &on {
        row(&mut text, effect);
    }
    if on.is_empty() {
        text.push_str("\n(none)");
    }
    text.push_str("\n\noff:");
    for effect in off {
        let _ = write!(text, "\n{:18} {}", effect.effect, indented(&effect.why, 19));
    }
    text
}

fn row(text: &mut String, effect: &Contribution) {
    let numbers = |change: Option<Change>| {
        change.map_or([String::from("–"), "–".into()], |c| [share(c.largest), share(c.rms)])
    };
    let [largest, rms] = numbers(effect.reading);
    let [of_reduced, rms_reduced] = numbers(effect.reduced);
    let time = format!("{:.1} %", 100.0 * effect.share);
    let mut why = match effect.masked {
        0 => effect.why.clone(),
        n => format!("{} ({n} values masked)", effect.why),
    };
    if effect.noise {
        why = format!("σ: {why}");
    }
    let _ = write!(
        text,
        "\n{:17} {time:>6} {largest:>8} {rms:>7} {of_reduced:>8} {rms_reduced:>7} {}",
        effect.effect,
        indented(&why, WHY)
    );
}

/// Where the reason begins.
const WHY: usize = 59;

/// A share in per cent.
fn share(of: f64) -> String {
    match 100.0 * of {
        0.0 => "0".into(),
        p if p < 0.001 => format!("{p:.0e} %"),
        p if p < 10.0 => format!("{p:.3} %"),
        p => format!("{p:.1} %"),
    }
}
