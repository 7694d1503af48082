//! The demo: a built-in glossy material is measured, fitted, rendered and compared with the truth. By an instrument of one's own the readings are
//! reduced, and where it has an aperture the fit at face value stands beside the one through it.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use serde_json::json;

use super::error::ChainError;
use super::gallery::{Shown, write_gallery};
use super::library::BuiltInMaterial;
use super::measure::{measure, measure_raw, reduced};
use super::output::write_bytes;
use super::pictures::{Stage, picture};
use super::source::{Source, render_material};
use crate::brdf::{Material, Sight};
use crate::control::Control;
use crate::fit::{FitOptions, fit};
use crate::gonio::sight::Cones;
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
    /// What measures, and what it is called; a noisy detector alone where there is none.
    pub instrument: Option<(String, Instrument)>,
    /// How the run was asked for, to stand in `numbers.json`.
    pub run: Option<serde_json::Value>,
}

impl Default for DemoOptions {
    fn default() -> Self {
        Self { size: 360, samples: 144, seed: 1, instrument: None, run: None }
    }
}

/// One fit of the demo.
#[derive(Debug, Clone)]
pub struct DemoFit {
    /// Its model, and whether it was fitted through the instrument.
    pub label: String,
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
    /// The built-in scene of its pictures.
    pub scene: &'static str,
    /// Direction pairs measured.
    pub pairs: usize,
    /// What measured them.
    pub instrument: String,
    /// The fits, simplest first.
    pub fits: Vec<DemoFit>,
    /// Time of each stage, s.
    pub times: Vec<(String, f64)>,
    /// Whether the work was stopped before its end.
    pub stopped: bool,
    /// How the run was asked for.
    pub run: Option<serde_json::Value>,
}

const MATERIAL: &str = "glossy-paint";
const SCENE: &str = "sphere-on-plane";
const MODELS: [&str; 2] = ["lambert", "lambert+phong"];
/// What the demo calls its instrument where none was named.
pub const NOISY_DETECTOR: &str = "shot and read noise";

/// A fit that is to be made: what it is called, its model, what it sees through.
struct Wanted {
    label: String,
    model: &'static str,
    through: Option<Arc<dyn Sight>>,
}

/// The models, and the last of them once more through the instrument where that has an aperture.
fn wanted(instrument: &Instrument) -> Vec<Wanted> {
    let plain = MODELS.map(|model| Wanted { label: model.into(), model, through: None });
    let through = Cones::of(instrument).map(|cones| {
        let model = MODELS[MODELS.len() - 1];
        Wanted { label: format!("{model}-through"), model, through: Some(Arc::new(cones)) }
    });
    plain.into_iter().chain(through).collect()
}

/// Measures the demo's material; raw readings and what they are reduced from are written where the instrument has parts.
fn measured(
    folder: &Path,
    source: &Source,
    options: &DemoOptions,
    control: Control<'_>,
) -> Result<Measurement, ChainError> {
    let scan = Scan::Hemisphere { step_deg: 5.0 };
    let table = match &options.instrument {
        Some((_, instrument)) if !instrument.is_plain() => {
            let raw = measure_raw(MATERIAL, source, instrument, &scan, options.seed, control)?;
            write_bytes(&folder.join("raw.csv"), raw.to_csv(instrument).as_bytes())?;
            reduced(MATERIAL, &raw.as_written(), instrument)?.measurement
        }
        other => {
            let instrument = other.as_ref().map_or_else(Instrument::default, |(_, own)| own.clone());
            measure(MATERIAL, source, &instrument, &scan, options.seed, control)?
        }
    };
    write_csv(&folder.join("measurement.csv"), &table)?;
    Ok(table)
}

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

    let table = measured(folder, &Source::Fitted(Box::new(truth.clone())), options, control)?;
    lap("measure and write");

    let (name, instrument) =
        options.instrument.clone().unwrap_or_else(|| (NOISY_DETECTOR.into(), Instrument::default()));
    let mut fitted = Vec::new();
    for Wanted { label, model, through } in wanted(&instrument) {
        let spec = model.parse().map_err(|e: crate::brdf::SpecError| ChainError::Mismatch(e.to_string()))?;
        let mut material = fit(&table, &FitOptions { through, ..FitOptions::new(spec) })?.material;
        if let Some(record) = material.fit.as_mut().filter(|record| record.through.is_some()) {
            record.instrument = Some(name.clone());
        }
        write_material(&folder.join(format!("{label}.json")), &material)?;
        lap(&format!("fit {label}"));
        fitted.push((label, material));
    }

    let stage = Stage::built_in(SCENE)?;
    let mut shown = Vec::new();
    let all = std::iter::once((&truth, "truth")).chain(fitted.iter().map(|(label, material)| (material, &label[..])));
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
    let subtitle = format!("{} direction pairs, {name}; {SCENE} scene, {}² pixels", table.len(), options.size);
    let mut comparisons = Vec::new();
    if let Some((reference, others)) = shown.split_first() {
        comparisons = write_gallery(folder, &title, &subtitle, reference, others, None)?.comparisons;
        lap("compare and write");
    }
    let mut images = comparisons.into_iter().map(Some).chain(std::iter::repeat_with(|| None));
    let fits = fitted
        .into_iter()
        .map(|(label, material)| DemoFit { label, material, image: images.next().flatten() })
        .collect();
    let stopped = control.stop.requested();
    let demo = Demo {
        truth,
        name: MATERIAL,
        scene: SCENE,
        pairs: table.len(),
        instrument: name,
        fits,
        times,
        stopped,
        run: options.run.clone(),
    };
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
        let fit = |f: &DemoFit| json!({ "label": f.label, "material": file(&f.material), "image": f.image });
        let mut object = json!({
            "material": self.name,
            "pairs": self.pairs,
            "instrument": self.instrument,
            "truth": file(&self.truth),
            "fits": self.fits.iter().map(fit).collect::<Vec<_>>(),
            "seconds": self.times,
            "stopped": self.stopped,
        });
        if let Some(run) = &self.run {
            object["run"] = run.clone();
        }
        object
    }
}

fn write_numbers(path: &Path, demo: &Demo) -> Result<(), ChainError> {
    let text = serde_json::to_string_pretty(&demo.numbers())
        .map_err(|e| ChainError::write(path, std::io::Error::other(e.to_string())))?;
    write_bytes(path, (text + "\n").as_bytes())
}
