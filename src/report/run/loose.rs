//! A folder with fits in it, as `fit --out-dir` leaves one; or with sweeps alone, as `tradeoff --out` does.

use std::path::{Path, PathBuf};

use super::{
    EFFECTS, Kind, Made, ReportError, Run, RunFit, RunOptions, SWEEP, Table, compared, json, left_out, sweep, sweeps,
};
use crate::brdf::Material;

/// Names that a measurement beside its fits may have.
const MEASUREMENTS: [&str; 2] = ["csv", "binary"];
/// JSON that is no fit by its name.
const OTHERS: [&str; 2] = [EFFECTS, SWEEP];

pub(super) fn read(folder: &Path, options: &RunOptions) -> Result<Run, ReportError> {
    let mut notes = Vec::new();
    let (fits, refused) = fits(folder, &mut notes)?;
    if fits.is_empty() {
        return of_sweeps(folder, refused);
    }
    let path = options.measurement.clone().or_else(|| only_measurement(folder));
    let unknown = "which measurement the fits are of is not known";
    let table = path.map_or_else(|| Err(unknown.into()), |path| Table::read(&path, &options.reading));
    let title = table.as_ref().map(|t| t.measurement.name.clone()).ok().or(name(folder));
    Ok(Run {
        kind: Kind::Fit,
        folder: folder.into(),
        title: title.unwrap_or_else(|| "fits".into()),
        table,
        fits,
        notes: refused.iter().map(|error| left_out(&error.to_string())).chain(notes).collect(),
        ..Run::empty()
    })
}

/// A folder without fits: its sweeps, if any can be read.
fn of_sweeps(folder: &Path, mut refused: Vec<ReportError>) -> Result<Run, ReportError> {
    let mut found = Vec::new();
    for path in sweeps(folder) {
        match sweep(&path) {
            Ok(sweep) => found.push(sweep),
            Err(error) => refused.push(error),
        }
    }
    if found.is_empty() {
        let nothing = ReportError::Nothing { path: folder.into() };
        return Err(if refused.is_empty() { nothing } else { refused.swap_remove(0) });
    }
    // One alone says how all of it was made.
    let only = if let [only] = &found[..] { Some(only) } else { None };
    let of = only.map(|sweep| sweep.subject.clone()).or_else(|| name(folder));
    Ok(Run {
        kind: Kind::Sweeps,
        folder: folder.into(),
        title: of.map_or_else(|| "accuracy for time".into(), |of| format!("{of}: accuracy for time")),
        seed: only.map(|sweep| sweep.seed),
        made: only.map_or_else(Made::default, |sweep| Made::of(&sweep.run)),
        notes: refused.iter().map(|error| left_out(&error.to_string())).collect(),
        sweeps: found,
        ..Run::empty()
    })
}

/// The folder's own name.
fn name(folder: &Path) -> Option<String> {
    let folder = folder.canonicalize().ok()?;
    folder.file_name().map(|name| name.to_string_lossy().into_owned())
}

/// Every material in the folder, by name, and what can't be read.
fn fits(folder: &Path, notes: &mut Vec<String>) -> Result<(Vec<RunFit>, Vec<ReportError>), ReportError> {
    let is_fit = |p: &PathBuf| p.extension().is_some_and(|e| e == "json") && !OTHERS.iter().any(|o| p.ends_with(o));
    let (mut found, mut refused) = (Vec::new(), Vec::new());
    for path in files(folder)?.into_iter().filter(is_fit) {
        let value = match json(&path) {
            Ok(value) => value,
            Err(error) => {
                refused.push(error);
                continue;
            }
        };
        // Other JSON may lie there too.
        let Ok(material) = Material::from_json(&value.to_string()) else { continue };
        let stem = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        let file = path.display().to_string();
        found.push(compared(&material, (&stem, file), None, &Made::default(), notes));
    }
    Ok((found, refused))
}

/// The folder's files by name.
fn files(folder: &Path) -> Result<Vec<PathBuf>, ReportError> {
    let refused = |source| ReportError::Io { path: folder.into(), source };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(refused)? {
        files.push(entry.map_err(refused)?.path());
    }
    files.retain(|path| path.is_file());
    files.sort();
    Ok(files)
}

/// The measurement in the folder, if there is just one file that may be one.
fn only_measurement(folder: &Path) -> Option<PathBuf> {
    let is_one = |p: &PathBuf| p.extension().is_some_and(|e| MEASUREMENTS.iter().any(|m| e == *m));
    let mut found = files(folder).ok()?.into_iter().filter(is_one);
    let only = found.next()?;
    found.next().is_none().then_some(only)
}
