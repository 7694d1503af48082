//! The effects of a scene.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::{Args, share};
use crate::chain::{SceneEffect, SceneEffects, Stage, load, render_material, scene_effects};
use crate::cli::failure::Failure;
use crate::cli::text::indented;
use crate::cli::ui::Ui;
use crate::measurement::ReadOptions;
use crate::render::Options;

/// Longer side of the pictures, pixels, and samples of a pixel, where none is asked for.
const SIDE: u32 = 128;
const SAMPLES: u32 = 64;
/// Where the reason begins.
const WHY: usize = 42;

pub(super) fn run(stage: &Stage, args: &Args, ui: &Ui) -> Result<(), Failure> {
    let asked = [
        ("--scan", args.what.scan.is_some()),
        ("--instrument", args.what.instrument.is_some()),
        ("--electrons", args.what.electrons.is_some()),
        ("--read-noise", args.what.read_noise.is_some()),
        ("--readings", args.what.readings.is_some()),
        ("--noiseless", args.what.noiseless),
    ];
    if let Some((option, _)) = asked.iter().find(|(_, given)| *given) {
        return Err(Failure::usage(format!("{option} is for simulations, and {} is a scene", stage.spec.name)));
    }
    let subject = match &args.what.material {
        Some(name) => Some(render_material(name, &load(name, &ReadOptions::default())?, None)?),
        None => None,
    };
    let [width, height] = stage.spec.film.resolution;
    let small = |side: u32| {
        (f64::from(side) * (f64::from(SIDE) / f64::from(width.max(height))).min(1.0)).round().max(1.0) as u32
    };
    let (width, height) = args.size.unwrap_or_else(|| (small(width), small(height)));
    let (samples, seed) = (args.samples.unwrap_or(SAMPLES), args.what.seed.unwrap_or(0));
    let options = Options { width, height, samples, seed, ..Options::default() };
    let found = scene_effects(stage, subject, &options, ui.control())?;
    let object = object((&stage.spec.name, args.what.material.as_deref()), &options, &found);
    ui.result(&table(&stage.spec.name, &options, &found), &object);
    Ok(())
}

/// As `--json` prints it, and a report reads it; the material is null where the scene's own is kept.
pub(in crate::cli) fn object((name, material): (&str, Option<&str>), options: &Options, found: &SceneEffects) -> Value {
    let Options { width, height, samples, seed, .. } = options;
    json!({
        "scene": name, "material": material, "width": width, "height": height, "samples": samples, "seed": seed, "seconds": found.seconds,
        "seconds_full": found.seconds_full, "full_off_by": found.full_off_by, "noise": found.noise, "effects": found.effects,
    })
}

/// Effects that are on with their numbers, then those that are off with the reason.
fn table(name: &str, options: &Options, found: &SceneEffects) -> String {
    let Options { width, height, samples, .. } = options;
    let mut text = format!(
        "{name}, {width}×{height}, {samples} samples a pixel: {:.3} s\n\n{:20} {:>8} {:>10}  because of",
        found.seconds, "without it", "time", "off by"
    );
    let (on, off): (Vec<&SceneEffect>, Vec<&SceneEffect>) = found.effects.iter().partition(|e| e.on);
    for effect in &on {
        let time = effect.share.map_or("–".into(), |share| format!("{:+.0} %", -100.0 * share));
        let off_by = effect.off_by.map_or("–".into(), share);
        let _ = write!(text, "\n{:20} {time:>8} {off_by:>10}  ", effect.effect);
        text.push_str(&indented(&effect.why, WHY));
    }
    text.push_str("\n\noff:");
    for effect in off {
        let _ = write!(text, "\n{:20} ", effect.effect);
        text.push_str(&indented(&effect.why, 21));
    }
    let _ = write!(
        text,
        "\n\nTwo pictures that differ by noise alone are {} off each other. Everything\non, one path at a time: {:.3} s, {} off this picture.",
        share(found.noise),
        found.seconds_full,
        share(found.full_off_by)
    );
    text
}
