//! What accuracy costs in a run, small enough to be measured for every report: the curves of fit and picture, and what each effect of the scene is worth.

use std::path::Path;

use super::effects::of_scene;
use super::failure::Failure;
use super::output::{make_folder, write_json};
use super::report::made;
use super::text::command;
use super::ui::{self, Ui};
use crate::brdf::ModelSpec;
use crate::chain::{self, Demo, Source, Stage};
use crate::fit::{FitOptions, Loss};
use crate::measurement::{ReadOptions, formats};
use crate::render::{Material, Options};
use crate::report::run::{EFFECTS, SWEEP};
use crate::tradeoff::fit::FitSweep;
use crate::tradeoff::render::{RenderSweep, Tables, Way};
use crate::tradeoff::{Effort, Sweep, fit, render};

/// Trials of each setting, of the fit and of the picture, which takes ten times as long.
const TRIALS: [u32; 2] = [16, 4];
/// One of every so many directions is fitted; few enough in five of them that slopes are well known.
const PARTS: [usize; 7] = [224, 112, 56, 28, 14, 7, 1];
/// Width and height of the pictures, pixels, and samples of a pixel.
const SIDE: u32 = 64;
const SAMPLES: [u32; 6] = [4, 8, 16, 32, 64, 128];
/// Shares by which a fit's rmse may exceed the least one.
const TARGETS: [f64; 3] = [0.1, 0.01, 0.001];
/// The curves' folders in the run's.
const OF_FIT: &str = "accuracy-fit";
const OF_PICTURE: &str = "accuracy-render";

/// Measures a demo's and writes them where its report looks for them. What can't be measured, and what was stopped, is said and left out: the run is
/// whole without.
pub(super) fn of_demo(folder: &Path, demo: &Demo, seed: u64, ui: &Ui) {
    // An earlier run's are not this one's.
    for old in [folder.join(OF_FIT).join(SWEEP), folder.join(OF_PICTURE).join(SWEEP), folder.join(EFFECTS)] {
        let _ = std::fs::remove_file(old);
    }
    let measured = measure(folder, demo, seed, ui);
    if let Err(failure) = measured {
        ui.warn(&format!("what accuracy costs is not on the page: {}", failure.message));
    } else if ui::stop().requested() {
        ui.warn("stopped: what accuracy costs is not on the page, or not all of it");
    }
}

fn measure(folder: &Path, demo: &Demo, seed: u64, ui: &Ui) -> Result<(), Failure> {
    let effort = |trials| Effort { trials, seed, deadline: None };
    of_fit(folder, &effort(TRIALS[0]), ui)?;
    let stage = Stage::built_in(demo.scene)?;
    let subject = chain::render_material(demo.name, &Source::Fitted(Box::new(demo.truth.clone())), None)?;
    of_picture(folder, (demo, &stage, &subject), &effort(TRIALS[1]), ui)?;
    of_effects(folder, (demo, &stage, subject), seed, ui)
}

/// Directions used, against what the fit is off.
fn of_fit(folder: &Path, effort: &Effort, ui: &Ui) -> Result<(), Failure> {
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
    let found = fit::sweep(&table, &what, effort, ui.control())?;
    let base = command(&["goniofit", "fit", &file.to_string_lossy()], []);
    write(&folder.join(OF_FIT), &Sweep { commands: vec![base], ..found })
}

/// Samples of a pixel, against what the picture is off; by the scene's plan, and by the integrator that has everything on.
fn of_picture(
    folder: &Path,
    (demo, stage, subject): (&Demo, &Stage, &Material),
    effort: &Effort,
    ui: &Ui,
) -> Result<(), Failure> {
    let what = RenderSweep {
        size: (SIDE, SIDE),
        samples: SAMPLES.to_vec(),
        targets: Vec::new(),
        ways: vec![Way::Scene, Way::Full],
        reference: None,
        tables: Tables::default(),
    };
    let found = render::sweep(stage, Some(subject), &what, effort, ui.control())?;
    let Demo { scene, name, .. } = demo;
    let size = format!("{SIDE}x{SIDE}");
    let base = ["goniofit", "render", "--scene", scene, "--material", name, "--size", &size, "--out", "OUT.exr"];
    write(&folder.join(OF_PICTURE), &Sweep { commands: vec![command(&base, [])], ..found })
}

/// What each effect of the scene takes, and by how much the picture is off without it; nothing where it was stopped.
fn of_effects(
    folder: &Path,
    (demo, stage, subject): (&Demo, &Stage, Material),
    seed: u64,
    ui: &Ui,
) -> Result<(), Failure> {
    // Large enough that what an effect takes is not the clock's noise.
    let options = Options { width: 2 * SIDE, height: 2 * SIDE, samples: SAMPLES[5], seed, ..Options::default() };
    let found = chain::scene_effects(stage, Some(subject), &options, ui.control())?;
    if ui::stop().requested() {
        return Ok(());
    }
    let object = of_scene::object((&stage.spec.name, Some(demo.name)), &options, &found);
    write_json(&folder.join(EFFECTS), &object)
}

/// Writes a curve into a folder of its own; nothing where no trial was over before the work was stopped.
fn write(folder: &Path, sweep: &Sweep) -> Result<(), Failure> {
    if sweep.curves.is_empty() {
        return Ok(());
    }
    make_folder("--out", folder)?;
    let mut object = serde_json::to_value(sweep).map_err(|e| Failure::work(e.to_string()))?;
    object["run"] = made();
    write_json(&folder.join(SWEEP), &object)
}
