//! What `demo` left.

use std::path::Path;
use std::sync::Arc;

use serde_json::Value;

use super::{Kind, Made, ReportError, Run, RunFit, RunOptions, Table, Through, picture, stopped};
use crate::brdf::Material;
use crate::chain::ChainError;
use crate::gonio::sight::Cones;
use crate::gonio::{Instrument, Preset, SimulationSpec};
use crate::report::views::Predicted;

/// What `numbers.json` calls the instrument of a demo that none was named for.
pub(in crate::report) const DEMO_INSTRUMENT: &str = "shot and read noise";

pub(super) fn read(folder: &Path, numbers: &Value, options: &RunOptions) -> Result<Run, ReportError> {
    let path = options.measurement.clone().unwrap_or_else(|| folder.join("measurement.csv"));
    let instrument = numbers["instrument"].as_str().map(str::to_owned);
    let made = Made::of(&numbers["run"]);
    let own = instrument.as_deref().and_then(|name| find(name, made.folder.as_deref()));
    let truth = material(folder, &numbers["truth"])?;
    let mut fits = Vec::new();
    let mut pictures = Vec::from_iter(picture(folder, "truth.exr", "truth")?);
    for entry in numbers["fits"].as_array().into_iter().flatten() {
        let label = entry["label"].as_str().unwrap_or_default().to_owned();
        let material = material(folder, &entry["material"])?;
        let sight = sight(&material, own.as_ref());
        let file = folder.join(format!("{label}.json")).display().to_string();
        pictures.extend(picture(folder, &format!("{label}.exr"), &label)?);
        let image = (!entry["image"].is_null()).then(|| entry["image"].clone());
        fits.push(RunFit { label, file, predicted: Predicted::new(&material, sight), image });
    }
    let mut notes: Vec<String> = stopped(numbers).into_iter().collect();
    if let (Some(name), None) = (&instrument, &own)
        && name != DEMO_INSTRUMENT
        && fits.iter().any(|f| f.material().fit.as_ref().is_some_and(|record| record.through.is_some()))
    {
        notes.push(format!(
            "The instrument {name} is neither built in, nor can its file be read where the run was made; here the fit made through it takes readings \
             at face value."
        ));
    }
    let times = numbers["seconds"].as_array().into_iter().flatten();
    let first = |p: &super::Picture| p.image.metadata.clone();
    let metadata = pictures.first().map(first).unwrap_or_default();
    Ok(Run {
        kind: Kind::Demo,
        folder: folder.into(),
        title: numbers["material"].as_str().unwrap_or("demo").into(),
        table: Table::read(&path, &options.reading),
        truth: Some(Predicted::new(&truth, own.and_then(|i| Cones::of(&i)).map(|c| Arc::new(c) as _))),
        fits,
        pictures,
        times: times.filter_map(|t| Some((t[0].as_str()?.to_owned(), t[1].as_f64()?))).collect(),
        instrument,
        scene: metadata.scene,
        seed: metadata.seed,
        made,
        notes,
        ..Run::empty()
    })
}

/// A material within the numbers.
pub(super) fn material(folder: &Path, value: &Value) -> Result<Material, ReportError> {
    let path = folder.join("numbers.json");
    Ok(Material::from_json(&value.to_string()).map_err(|source| ChainError::Material { path, source })?)
}

/// What a fit that says it was made through an instrument was made through.
fn sight(material: &Material, instrument: Option<&Instrument>) -> Through {
    material.fit.as_ref()?.through.as_ref()?;
    Some(Arc::new(Cones::of(instrument?)?))
}

/// The instrument of this name, where it is built in or its file is still there.
pub(in crate::report) fn find(name: &str, typed_in: Option<&Path>) -> Option<Instrument> {
    if let Some(preset) = Preset::find(name) {
        return preset.spec().ok().map(|spec| spec.instrument);
    }
    let path = typed_in.map_or_else(|| Path::new(name).to_path_buf(), |folder| folder.join(name));
    SimulationSpec::from_toml(&std::fs::read_to_string(path).ok()?).ok().map(|spec| spec.instrument)
}
