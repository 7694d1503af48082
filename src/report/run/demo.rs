//! What `demo` left.

use std::path::Path;
use std::sync::Arc;

use serde_json::Value;

use super::{Kind, Made, ReportError, Run, RunFit, RunOptions, Table, compared, known_instrument, picture, stopped};
use crate::brdf::Material;
use crate::chain::ChainError;
use crate::gonio::sight::Cones;
use crate::report::views::Predicted;

pub(super) fn read(folder: &Path, numbers: &Value, options: &RunOptions) -> Result<Run, ReportError> {
    let path = options.measurement.clone().unwrap_or_else(|| folder.join("measurement.csv"));
    let name = numbers["instrument"].as_str();
    let made = Made::of(&numbers["run"]);
    let truth = material(folder, &numbers["truth"])?;
    let mut notes: Vec<String> = stopped(numbers).into_iter().collect();
    let mut fits = Vec::new();
    let mut pictures = Vec::from_iter(picture(folder, "truth.exr", "truth", &mut notes));
    for entry in numbers["fits"].as_array().into_iter().flatten() {
        let label = entry["label"].as_str().unwrap_or_default();
        let file = folder.join(format!("{label}.json")).display().to_string();
        let fit = compared(&material(folder, &entry["material"])?, (label, file), name, &made, &mut notes);
        pictures.extend(picture(folder, &format!("{label}.exr"), label, &mut notes));
        fits.push(RunFit { image: (!entry["image"].is_null()).then(|| entry["image"].clone()), ..fit });
    }
    let times = numbers["seconds"].as_array().into_iter().flatten();
    let first = |p: &super::Picture| p.image.metadata.clone();
    let metadata = pictures.first().map(first).unwrap_or_default();
    let mut run = Run {
        kind: Kind::Demo,
        folder: folder.into(),
        title: numbers["material"].as_str().unwrap_or("demo").into(),
        table: Table::read(&path, &options.reading),
        fits,
        pictures,
        reference: "truth".into(),
        times: times.filter_map(|t| Some((t[0].as_str()?.to_owned(), t[1].as_f64()?))).collect(),
        instrument: name.map(str::to_owned),
        scene: metadata.scene,
        seed: metadata.seed,
        made,
        notes,
        ..Run::empty()
    };
    // Readings are compared with the truth as the instrument sees it.
    let own = name.and_then(|name| known_instrument(name, &run.folders()));
    run.truth = Some(Predicted::new(&truth, own.and_then(|i| Cones::of(&i)).map(|c| Arc::new(c) as _)));
    Ok(run)
}

/// A material within the numbers.
fn material(folder: &Path, value: &Value) -> Result<Material, ReportError> {
    let path = folder.join("numbers.json");
    Ok(Material::from_json(&value.to_string()).map_err(|source| ChainError::Material { path, source })?)
}
