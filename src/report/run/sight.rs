//! The instruments that a run and its fits name, and what fits are seen through beside readings.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Through;
use crate::brdf::Material;
use crate::gonio::sight::Cones;
use crate::gonio::{Instrument, Preset, SimulationSpec, described};

/// The instrument of this name, where it is built in, or its file still lies in one of these folders: as it was typed there, or by its own name.
#[must_use]
pub fn known_instrument(name: &str, folders: &[&Path]) -> Option<Instrument> {
    if let Some(preset) = Preset::find(name) {
        return preset.spec().ok().map(|spec| spec.instrument);
    }
    let own = Path::new(name).file_name()?;
    let places = folders.iter().flat_map(|folder| [folder.join(name), folder.join(own)]);
    places.filter(|path| path.is_file()).find_map(|path| in_file(&path))
}

/// Of a simulation file, or of raw readings that say what made them.
fn in_file(path: &PathBuf) -> Option<Instrument> {
    let text = std::fs::read_to_string(path).ok()?;
    let of_raw = || described(path, &text).ok().flatten();
    SimulationSpec::from_toml(&text).map(|spec| spec.instrument).ok().or_else(of_raw)
}

/// The instrument that a fit was made through, with its name: nothing for a fit at face value; `otherwise` is its name where the fit does not say it.
///
/// # Errors
/// Why it is not known, in words.
pub fn fitted_through(
    material: &Material,
    otherwise: Option<&str>,
    folders: &[&Path],
) -> Result<Option<(String, Through)>, String> {
    let Some(record) = &material.fit else { return Ok(None) };
    let Some(through) = &record.through else { return Ok(None) };
    let Some(name) = record.instrument.as_deref().or(otherwise) else {
        return Err(format!("an instrument ({through}) that its file does not name"));
    };
    let cones = known_instrument(name, folders).and_then(|instrument| Cones::of(&instrument)).map(Arc::new);
    let cones = cones.ok_or_else(|| format!("the instrument {name} ({through}), whose file is not at hand"))?;
    let now = crate::brdf::Sight::describe(&*cones);
    if now == *through {
        Ok(Some((name.into(), Some(cones))))
    } else {
        Err(format!("the instrument {name} as it was then ({through}); now it has {now}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::{FitRecord, LobeKind};

    const WIDE: &str = "version = 1\n[instrument]\nelectrons = 1e6\n[instrument.detector]\naperture_deg = 4.0\n";

    #[test]
    fn a_fit_is_seen_through_what_it_was_made_through_or_not_at_all() {
        let (there, here) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
        let instrument = SimulationSpec::from_toml(WIDE).expect("valid").instrument;
        let through = Cones::of(&instrument).map(|cones| crate::brdf::Sight::describe(&cones));
        let mut material = Material::new(vec!["x".into()], vec![(LobeKind::Lambert, vec![0.5], vec![])]);
        let mut fitted = |through: Option<String>, instrument: Option<&str>| {
            let instrument = instrument.map(str::to_owned);
            material.fit = Some(FitRecord { through, instrument, ..FitRecord::default() });
            fitted_through(&material, None, &[there.path(), here.path()])
        };
        assert!(fitted(None, None).is_ok_and(|seen| seen.is_none()), "at face value");
        let not_named = fitted(through.clone(), None).expect_err("not named");
        assert!(not_named.contains("4.000°") && not_named.contains("does not name"), "{not_named}");
        assert!(fitted(through.clone(), Some("lab/wide.toml")).is_err_and(|e| e.contains("not at hand")));
        // Beside the results, though it was typed elsewhere.
        std::fs::write(here.path().join("wide.toml"), WIDE).expect("writes");
        let (name, sight) = fitted(through.clone(), Some("lab/wide.toml")).expect("known").expect("an instrument");
        assert_eq!((name.as_str(), sight.is_some()), ("lab/wide.toml", true));
        std::fs::write(here.path().join("wide.toml"), WIDE.replace("4.0", "2.0")).expect("writes");
        assert!(fitted(through, Some("wide.toml")).is_err_and(|e| e.contains("4.000°") && e.contains("2.000°")));
    }
}
