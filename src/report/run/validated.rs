//! What `validate` left.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{Kind, Made, Run, RunFit, RunOptions, Table, compared, found, picture, stopped};
use crate::chain::load_material;

pub(super) fn read(folder: &Path, numbers: &Value, options: &RunOptions) -> Run {
    let made = Made::of(&numbers["run"]);
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let typed = text(&numbers["measurement"]);
    let path = options.measurement.clone().unwrap_or_else(|| found(&typed, &made, folder));
    let reference = text(&numbers["reference"]);
    let of_table = reference == "table.exr";
    let mut notes: Vec<String> = stopped(numbers).into_iter().collect();
    let mut pictures = Vec::new();
    if of_table {
        pictures.extend(picture(folder, &reference, "table", &mut notes));
    }
    if let Some(reason) = numbers["table_not_rendered"].as_str() {
        notes.push(format!(
            "The table itself could not be rendered ({reason}); pictures are of the fits, each compared with the first."
        ));
    }
    // Fits that were given, but not rendered before the run was stopped, have readings to be judged by all the same.
    let [rendered, others] = ["fits", "not_rendered"].map(|key| numbers[key].as_array().into_iter().flatten());
    let is_rendered = rendered.clone().map(|_| true).chain(std::iter::repeat(false));
    let entries: Vec<&Value> = rendered.chain(others).collect();
    let models: Vec<String> = entries.iter().map(|e| text(&e["model"])).collect();
    let first = entries.first().map(|e| label(&text(&e["fit"]), &models[0], &models)).unwrap_or_default();
    let mut fits = Vec::new();
    for ((entry, model), is_rendered) in entries.iter().zip(&models).zip(is_rendered) {
        let name = text(&entry["fit"]);
        let label = label(&name, model, &models);
        if !is_rendered {
            notes.push(format!("{label} was not rendered: the run was stopped before."));
        }
        pictures.extend(picture(folder, &text(&entry["picture"]), &label, &mut notes));
        let file = found(&name, &made, folder);
        match load_material(&file.to_string_lossy()) {
            Ok(material) => {
                let image = (!entry["image"].is_null()).then(|| entry["image"].clone());
                let fit = compared(&material, (&label, file.display().to_string()), None, &made, &mut notes);
                fits.push(RunFit { image, ..fit });
            }
            Err(error) => notes.push(format!("A fit is missing: {error}.")),
        }
    }
    let table = Table::read(&path, &options.reading);
    let stem = || PathBuf::from(&typed).file_stem().map(|s| s.to_string_lossy().into_owned());
    let title = table.as_ref().ok().map(|t| t.measurement.name.clone()).or_else(stem);
    Run {
        kind: Kind::Validate,
        folder: folder.into(),
        title: title.unwrap_or_else(|| "validation".into()),
        table,
        fits,
        pictures,
        reference: if of_table { "table".into() } else { first },
        exposure: numbers["exposure"].as_f64(),
        scene: numbers["scene"].as_str().map(str::to_owned),
        seed: numbers["seed"].as_u64(),
        made,
        notes,
        ..Run::empty()
    }
}

/// A fit's model; its file besides where another has the same.
fn label(file: &str, model: &str, models: &[String]) -> String {
    let stem = Path::new(file).file_stem().map_or_else(|| file.into(), |s| s.to_string_lossy());
    if models.iter().filter(|m| *m == model).count() > 1 { format!("{stem}: {model}") } else { model.into() }
}
