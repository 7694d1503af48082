//! Files of a run's folder, read one by one.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{Made, Picture, ReportError, SWEEP};
use crate::report::views::Sweep;

/// The JSON in a file.
pub(super) fn json(path: &Path) -> Result<Value, ReportError> {
    let text = std::fs::read_to_string(path).map_err(|source| ReportError::Io { path: path.into(), source })?;
    serde_json::from_str(&text).map_err(|source| ReportError::Json { path: path.into(), source })
}

/// A file that was named in another folder than this: as it is, from the run's folder, beside the results.
pub(super) fn found(name: &str, made: &Made, folder: &Path) -> PathBuf {
    let path = PathBuf::from(name);
    let there = made.folder.iter().map(|f| f.join(&path));
    let beside = path.file_name().map(|f| folder.join(f));
    let places = there.chain([path.clone()]).chain(beside);
    places.into_iter().find(|p| p.is_file()).unwrap_or(path)
}

/// A picture of the folder, if it is there; one that can't be read becomes a note.
pub(super) fn picture(folder: &Path, file: &str, label: &str, notes: &mut Vec<String>) -> Option<Picture> {
    let path = folder.join(file);
    if !path.is_file() {
        return None;
    }
    match crate::image::read_exr(&path) {
        Ok(image) => Some(Picture { label: label.into(), file: file.into(), image }),
        Err(error) => {
            notes.push(format!(
                "The picture of {label} is left out: {error}. Make it again by the command that wrote it."
            ));
            None
        }
    }
}

/// Where sweeps lie, by name.
pub(super) fn sweeps(folder: &Path) -> Vec<PathBuf> {
    // A folder that does not tell what is in it may hold the run all the same.
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let within = entries.filter_map(Result::ok).map(|e| e.path().join(SWEEP));
    let mut found: Vec<PathBuf> = within.chain([folder.join(SWEEP)]).filter(|p| p.is_file()).collect();
    found.sort();
    found
}

/// A sweep as its file has it.
pub(super) fn sweep(path: &Path) -> Result<Sweep, ReportError> {
    let found = serde_json::from_value::<Sweep>(json(path)?);
    let mut found = found.map_err(|source| ReportError::Sweep { path: path.into(), source })?;
    found.file = path.into();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_found_where_the_run_was_made_or_beside_its_results() {
        let (there, results) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
        let made = Made { folder: Some(there.path().into()), ..Made::default() };
        assert_eq!(found("lab.csv", &made, results.path()), PathBuf::from("lab.csv"), "nowhere: as it was typed");
        std::fs::write(results.path().join("lab.csv"), "x").expect("writes");
        assert_eq!(found("data/lab.csv", &made, results.path()), results.path().join("lab.csv"));
        std::fs::write(there.path().join("lab.csv"), "x").expect("writes");
        assert_eq!(found("lab.csv", &made, results.path()), there.path().join("lab.csv"));
    }
}
