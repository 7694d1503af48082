//! The demo: a built-in glossy material is measured with noise, fitted twice, rendered and compared with the truth.

use std::path::Path;
use std::time::Instant;

use serde_json::json;

use super::error::ChainError;
use super::gallery::{Shown, write_gallery};
use super::library::BuiltInMaterial;
use super::measure::measure;
use super::output::write_bytes;
use super::pictures::{Stage, picture};
use super::source::{Source, render_material};
use crate::brdf::Material;
use crate::control::Control;
use crate::fit::{FitOptions, fit};
use crate::gonio::{Instrument, Scan};
use crate::image::Comparison;
use crate::measurement::{Format, Measurement, formats};
use crate::render::Options;

/// What the demo may be asked for.
#[derive(Debug, Clone)]
pub struct DemoOptions {
    /// Width and height of the pictures, pixels.
    pub size: u32,
    /// Samples per pixel.
    pub samples: u32,
    /// Seed of the noise and of the pictures.
    pub seed: u64,
}

impl Default for DemoOptions {
    fn default() -> Self {
        Self { size: 360, samples: 144, seed: 1 }
    }
}

/// One fit of the demo.
#[derive(Debug, Clone)]
pub struct DemoFit {
    /// The fitted material with its record.
    pub material: Material,
    /// Its picture against the truth's; none where the work was stopped before it.
    pub image: Option<Comparison>,
}

/// What the demo found.
#[derive(Debug, Clone)]
pub struct Demo {
    /// The material that was measured.
    pub truth: Material,
    /// Its name.
    pub name: &'static str,
    /// Direction pairs measured.
    pub pairs: usize,
    /// The fits, simplest first.
    pub fits: Vec<DemoFit>,
    /// Time of each stage, s.
    pub times: Vec<(String, f64)>,
    /// Whether the work was stopped before its end.
    pub stopped: bool,
}

const MATERIAL: &str = "glossy-paint";
const SCENE: &str = "sphere-on-plane";
const MODELS: [&str; 2] = ["lambert", "lambert+phong"];

/// Runs the chain and writes measurement, fits, pictures and numbers into `folder`.
///
/// # Errors
/// [`ChainError`] where the disk refuses.
pub fn demo(folder: &Path, options: &DemoOptions, control: Control<'_>) -> Result<Demo, ChainError> {
    std::fs::create_dir_all(folder).map_err(|e| ChainError::write(folder, e))?;
    let built_in = BuiltInMaterial::find(MATERIAL).ok_or_else(|| ChainError::Mismatch(MATERIAL.into()))?;
    let truth = built_in.material();
    let mut times = Vec::new();
    let mut clock = Instant::now();
    let mut lap = |label: &str| {
        times.push((label.to_owned(), clock.elapsed().as_secs_f64()));
        clock = Instant::now();
    };

    let scan = Scan::Hemisphere { step_deg: 5.0 };
    let source = Source::Fitted(Box::new(truth.clone()));
    let table = measure(MATERIAL, &source, &Instrument::default(), &scan, options.seed, control)?;
    lap("measure");
    write_csv(&folder.join("measurement.csv"), &table)?;
    lap("write CSV");

    let mut fitted = Vec::new();
    for model in MODELS {
        let spec = model.parse().map_err(|e: crate::brdf::SpecError| ChainError::Mismatch(e.to_string()))?;
        fitted.push(fit(&table, &FitOptions::new(spec))?.material);
        write_material(&folder.join(format!("{model}.json")), fitted.last().unwrap_or(&truth))?;
        lap(&format!("fit {model}"));
    }

    let stage = Stage::built_in(SCENE)?;
    let mut shown = Vec::new();
    let all = std::iter::once((&truth, "truth")).chain(fitted.iter().zip(MODELS));
    for (k, (material, name)) in all.enumerate() {
        if control.stop.requested() {
            break;
        }
        let settings = Options {
            width: options.size,
            height: options.size,
            samples: options.samples,
            seed: options.seed.wrapping_add(k as u64),
            ..Options::of(&stage.spec)
        };
        let subject = render_material(name, &Source::Fitted(Box::new(material.clone())), None)?;
        let image = picture(&stage, Some(subject), &settings, control)?;
        let label = if k == 0 { "truth".to_owned() } else { format!("fit: {name}") };
        shown.push(Shown { file: name.into(), difference_file: format!("difference-{name}"), label, image });
        lap(&format!("render {name}"));
    }
    shown.retain(|s| s.image.metadata.samples != Some(0));
    let title = format!("{MATERIAL}, measured and fitted");
    let subtitle =
        format!("{} direction pairs with shot and read noise; {SCENE} scene, {}² pixels", table.len(), options.size);
    let mut comparisons = Vec::new();
    if let Some((reference, others)) = shown.split_first() {
        comparisons = write_gallery(folder, &title, &subtitle, reference, others, None)?.comparisons;
        lap("compare and write");
    }
    let mut images = comparisons.into_iter().map(Some).chain(std::iter::repeat_with(|| None));
    let fits = fitted.into_iter().map(|material| DemoFit { material, image: images.next().flatten() }).collect();
    let stopped = control.stop.requested();
    let demo = Demo { truth, name: MATERIAL, pairs: table.len(), fits, times, stopped };
    write_numbers(&folder.join("numbers.json"), &demo)?;
    Ok(demo)
}

fn write_csv(path: &Path, table: &Measurement) -> Result<(), ChainError> {
    let mut bytes = Vec::new();
    formats::write(table, Format::Csv, path, &mut bytes)?;
    write_bytes(path, &bytes)
}

fn write_material(path: &Path, material: &Material) -> Result<(), ChainError> {
    let text = material.to_json().map_err(|source| ChainError::Material { path: path.into(), source })?;
    write_bytes(path, (text + "\n").as_bytes())
}

impl Demo {
    /// All numbers as one JSON value.
    #[must_use]
    pub fn numbers(&self) -> serde_json::Value {
        let file = |m: &Material| m.to_json().ok().and_then(|t| serde_json::from_str::<serde_json::Value>(&t).ok());
        let fit = |f: &DemoFit| json!({ "material": file(&f.material), "image": f.image });
        json!({
            "material": self.name,
            "pairs": self.pairs,
            "truth": file(&self.truth),
            "fits": self.fits.iter().map(fit).collect::<Vec<_>>(),
            "seconds": self.times,
            "stopped": self.stopped,
        })
    }
}

fn write_numbers(path: &Path, demo: &Demo) -> Result<(), ChainError> {
    let text = serde_json::to_string_pretty(&demo.numbers())
        .map_err(|e| ChainError::write(path, std::io::Error::other(e.to_string())))?;
    write_bytes(path, (text + "\n").as_bytes())
}
