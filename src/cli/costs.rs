//! What accuracy costs in a run, small enough to be measured for every report: the curves of fit and picture, and what each effect of the scene is worth.

use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::Value;

use super::effects::of_scene;
use super::failure::Failure;
use super::output::{make_folder, write_text};
use super::ui::{self, Ui};
use crate::brdf::ModelSpec;
use crate::chain::{self, Demo, Stage};
use crate::fit::{FitOptions, Loss};
use crate::measurement::{ReadOptions, formats};
use crate::render::Options;
use crate::tradeoff::fit::FitSweep;
use crate::tradeoff::render::{RenderSweep, Way};
use crate::tradeoff::{Effort, Sweep, fit, render};

/// Time of a curve at most: what would end later is not begun.
const TIME: Duration = Duration::from_secs(5);
const TRIALS: u32 = 4;
/// Pictures' longer side, pixels, and samples of a pixel.
const SIDE: u32 = 64;
const SAMPLES: [u32; 6] = [4, 8, 16, 32, 64, 128];
/// Every how many-th direction is fitted.
const PARTS: [usize; 6] = [112, 56, 28, 14, 7, 1];
/// Shares by which a fit's rmse may exceed the least one.
const TARGETS: [f64; 3] = [0.1, 0.01, 0.001];

/// Measures a demo's and writes them where its report looks for them; nothing where the work was stopped.
pub(super) fn of_demo(folder: &Path, demo: &Demo, seed: u64, ui: &Ui) -> Result<(), Failure> {
    let work: [&dyn Fn() -> Result<(), Failure>; 3] =
        [&|| of_fit(folder, seed, ui), &|| of_picture(folder, demo, seed, ui), &|| of_effects(folder, demo, seed, ui)];
    work.iter().take_while(|_| !ui::stop().requested()).try_for_each(|measure| measure())
}

fn effort(seed: u64) -> Effort {
    Effort { trials: TRIALS, seed, deadline: Some(Instant::now() + TIME) }
}

/// Directions used, against what the fit is off.
fn of_fit(folder: &Path, seed: u64, ui: &Ui) -> Result<(), Failure> {
    let file = folder.join("measurement.csv");
    let table = formats::read(&file, &ReadOptions::default())?;
    let model: ModelSpec = "lambert+phong".parse().map_err(|e| Failure::work(format!("{e}")))?;
    let what = FitSweep {
        options: FitOptions::new(model.clone()),
        parts: PARTS.to_vec(),
        strides: Vec::new(),
        targets: TARGETS.to_vec(),
        losses: vec![Loss::default()],
        models: vec![model],
    };
    let found = fit::sweep(&table, &what, &effort(seed), ui.control())?;
    write(folder, "accuracy-fit", &Sweep { command: format!("goniofit fit {}", file.display()), ..found })
}

/// Samples of a pixel, against what the picture is off; by the scene's plan, and by the integrator that has everything on.
fn of_picture(folder: &Path, demo: &Demo, seed: u64, ui: &Ui) -> Result<(), Failure> {
    let stage = Stage::built_in(demo.scene)?;
    let subject = chain::render_material(demo.name, &chain::load(demo.name, &ReadOptions::default())?, None)?;
    let what = RenderSweep {
        size: (SIDE, SIDE),
        samples: SAMPLES.to_vec(),
        targets: Vec::new(),
        ways: vec![Way::Scene, Way::Full],
        reference: None,
    };
    let found = render::sweep(&stage, Some(&subject), &what, &effort(seed), ui.control())?;
    let command =
        format!("goniofit render --scene {} --material {} --size {SIDE}x{SIDE} --out OUT.exr", demo.scene, demo.name);
    write(folder, "accuracy-render", &Sweep { command, ..found })
}

/// What each effect of the scene takes, and by how much the picture is off without it.
fn of_effects(folder: &Path, demo: &Demo, seed: u64, ui: &Ui) -> Result<(), Failure> {
    let stage = Stage::built_in(demo.scene)?;
    let subject = chain::render_material(demo.name, &chain::load(demo.name, &ReadOptions::default())?, None)?;
    let options = Options { width: SIDE, height: SIDE, samples: SAMPLES[4], seed, ..Options::default() };
    let found = chain::scene_effects(&stage, Some(subject), &options, ui.control())?;
    let object = of_scene::object(demo.scene, &options, &found);
    write_text(&folder.join("effects.json"), &pretty(&object)?)
}

/// Writes a curve into a folder of its own; nothing where no trial was over in time.
fn write(folder: &Path, name: &str, sweep: &Sweep) -> Result<(), Failure> {
    if sweep.curves.is_empty() {
        return Ok(());
    }
    let folder = folder.join(name);
    make_folder("--out", &folder)?;
    let object = serde_json::to_value(sweep).map_err(|e| Failure::work(e.to_string()))?;
    write_text(&folder.join("tradeoff.json"), &pretty(&object)?)
}

fn pretty(object: &Value) -> Result<String, Failure> {
    serde_json::to_string_pretty(object).map(|text| text + "\n").map_err(|e| Failure::work(e.to_string()))
}
