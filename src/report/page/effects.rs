//! The plan of effects: what was simulated, and because of what.

use std::path::Path;

use serde_json::Value;

use super::reproduce::as_typed;
use crate::chain::{NOISY_DETECTOR, Stage, scene_plan};
use crate::control::Plan;
use crate::gonio::{self, Instrument};
use crate::report::run::{Kind, Run, RunFit, known_instrument};
use crate::report::typed;
use crate::report::views::Predicted;
use crate::report::words::percent;

pub(super) struct Effect {
    pub name: String,
    pub on: bool,
    pub why: String,
    /// What it takes, and how far off the result is without it, where that is known.
    pub share: String,
    pub off_by: String,
}

pub(super) struct Listed {
    pub title: String,
    pub on: Vec<Effect>,
    pub off: Vec<Effect>,
    /// Names of what is off.
    pub names_off: String,
    /// Whether shares and errors are known.
    pub measured: bool,
    pub command: String,
}

pub(super) struct Effects {
    pub lists: Vec<Listed>,
    /// Why there is no list of an instrument's, where there should be one.
    pub missing: Option<String>,
}

pub(super) fn effects(run: &Run) -> Effects {
    let (mut lists, mut missing) = (Vec::new(), Vec::new());
    for found in instruments(run) {
        match found {
            Ok(list) => lists.push(list),
            Err(reason) => missing.push(reason),
        }
    }
    lists.extend(scene(run));
    Effects { lists, missing: (!missing.is_empty()).then(|| missing.join(" ")) }
}

fn plain(plan: Plan) -> Vec<Effect> {
    let one = |e: crate::control::Effect| Effect {
        name: e.name.into(),
        on: e.on,
        why: e.why,
        share: String::new(),
        off_by: String::new(),
    };
    plan.effects.into_iter().map(one).collect()
}

/// Of the instrument that simulated readings, or of those that fits were made through; the reason where one is not at hand.
fn instruments(run: &Run) -> Vec<Result<Listed, String>> {
    if run.kind == Kind::Demo {
        return simulated(run).into_iter().collect();
    }
    let mut found: Vec<(&str, Result<Listed, String>)> = Vec::new();
    for fit in &run.fits {
        let Some(record) = fit.material().fit.as_ref().filter(|record| record.through.is_some()) else { continue };
        // What the fit says, or what it was typed as.
        let Some(name) = fit.through.as_deref().or(record.instrument.as_deref()) else { continue };
        if found.iter().all(|(known, _)| *known != name) {
            found.push((name, seen_through(run, fit, name)));
        }
    }
    found.into_iter().map(|(_, list)| list).collect()
}

/// Of the instrument that a demo simulated.
fn simulated(run: &Run) -> Option<Result<Listed, String>> {
    let name = run.instrument.as_deref()?;
    let truth = run.truth.as_ref()?.material();
    let mut words = vec!["goniofit", "effects", "--material", &run.title];
    let own = name == NOISY_DETECTOR;
    if !own {
        words.extend(["--instrument", name]);
    }
    let known = if own { Some(Instrument::default()) } else { known_instrument(name, &run.folders()) };
    Some(listed(run, known.as_ref(), (name, &run.title, format!("The instrument, {name}")), &truth.channels, &words))
}

/// Of the instrument that a fit was made through, where it is what it was then.
fn seen_through(run: &Run, fit: &RunFit, name: &str) -> Result<Listed, String> {
    let words = ["goniofit", "effects", "--material", &fit.file, "--instrument", name];
    let known = fit.through.as_ref().and_then(|_| known_instrument(name, &fit_folders(run, fit)));
    let title = format!("The instrument, {name}, through which {} is a fit", fit.label);
    listed(run, known.as_ref(), (name, &fit.file, title), &fit.material().channels, &words)
}

/// Where a fit's instrument may lie: as the run's files, and beside the fit.
fn fit_folders<'a>(run: &'a Run, fit: &'a RunFit) -> Vec<&'a Path> {
    let beside = Path::new(&fit.file).parent().unwrap_or(Path::new(""));
    run.folders().into_iter().chain([beside]).collect()
}

fn listed(
    run: &Run,
    known: Option<&Instrument>,
    (name, material, title): (&str, &str, String),
    channels: &[String],
    words: &[&str],
) -> Result<Listed, String> {
    let command = typed(words);
    let Some(known) = known else {
        return Err(format!(
            "What the instrument {name} simulates is not known here: it is neither built in, nor can its file be read where the run was made. Where it is: {command}"
        ));
    };
    // What effects are worth depends on the material as much as on the instrument.
    let is_of = |e: &&Value| e["instrument"] == name && e["material"].as_str().is_some_and(|m| is_same(m, material));
    let measured = run.effects.as_ref().filter(is_of);
    let title = measured.map_or(title.clone(), |found| {
        let [material, scan] = ["material", "scan"].map(|key| found[key].as_str().unwrap_or("not said"));
        format!("{title}; figures are of {material}, scan {scan}")
    });
    let effects = match measured.and_then(|found| found["effects"].as_array()) {
        Some(found) => found.iter().map(told).collect(),
        None => plain(gonio::plan(known, channels)),
    };
    Ok(Listed::new(title, effects, measured.is_some(), command))
}

/// Whether two names of a material are of one: the same words, or the same file.
fn is_same(a: &str, b: &str) -> bool {
    let file = |name: &str| std::fs::canonicalize(name).ok();
    a == b || file(a).is_some_and(|own| file(b) == Some(own))
}

/// Of the scene, with what `effects.json` says of it where that is of a material of this page.
fn scene(run: &Run) -> Option<Listed> {
    let name = run.scene.as_deref()?;
    let own = materials(run);
    let material = |e: &Value| e["material"].as_str().filter(|m| own.iter().any(|o| is_same(m, o))).map(str::to_owned);
    let found = run.effects.as_ref().filter(|e| e["scene"] == name);
    let found = found.and_then(|e| Some((e, material(e)?)));
    let (effects, title) = if let Some((found, material)) = &found {
        let effects = found["effects"].as_array()?.iter().map(told).collect();
        (effects, format!("The scene, {name}; figures are of {material}"))
    } else {
        let truth = run.truth.as_ref().map(Predicted::material);
        let material = run.fits.last().map(RunFit::material).or(truth)?;
        (plain(scene_plan(&Stage::built_in(name).ok()?, material).ok()?), format!("The scene, {name}"))
    };
    let of = found.as_ref().map(|(_, material)| material).or(own.first());
    let command = command_of_scene(run, name, of, found.as_ref().map(|(found, _)| *found));
    Some(Listed::new(title, effects, found.is_some(), command))
}

/// What writes `effects.json` of the scene with a material, as it was found where it is there.
fn command_of_scene(run: &Run, scene: &str, material: Option<&String>, found: Option<&Value>) -> String {
    let mut words: Vec<String> = ["goniofit", "effects", "--scene", scene].map(String::from).to_vec();
    if let Some(material) = material {
        words.extend(["--material".into(), material.clone()]);
    }
    if let Some(found) = found {
        let size = format!("{}x{}", found["width"], found["height"]);
        words.extend(["--size".into(), size, "--samples".into(), found["samples"].to_string()]);
        words.extend(["--seed".into(), found["seed"].to_string()]);
    }
    let out = run.folder.join("effects.json").display().to_string();
    format!("{} --json > {}", typed(&words), typed(&[&out]))
}

/// The page's materials, as they may be typed, the one whose effects are asked for first: a demo's truth, then the last fit, as the plan is of.
fn materials(run: &Run) -> Vec<String> {
    let truth = (run.kind == Kind::Demo).then(|| run.title.clone());
    let fits = run.fits.iter().rev().flat_map(|fit| [as_typed(run, &fit.file), fit.file.as_str()]).map(str::to_owned);
    let table = run.table.as_ref().ok().map(|table| table.path.display().to_string());
    truth.into_iter().chain(fits).chain(table).collect()
}

impl Listed {
    fn new(title: String, effects: Vec<Effect>, measured: bool, command: String) -> Self {
        let (on, off): (Vec<Effect>, Vec<Effect>) = effects.into_iter().partition(|e| e.on);
        let names_off = off.iter().map(|e| e.name.as_str()).collect::<Vec<_>>().join(", ");
        Self { title, on, off, names_off, measured, command }
    }
}

/// As `effects --json` says it: a scene's picture is off by one number, an instrument's readings by the root of their mean square.
fn told(effect: &Value) -> Effect {
    let share = |value: &Value| value.as_f64().map_or("–".into(), percent);
    let off_by = if effect["off_by"].is_null() { &effect["reading"]["rms"] } else { &effect["off_by"] };
    Effect {
        name: effect["effect"].as_str().unwrap_or_default().into(),
        on: effect["on"] == true,
        why: effect["why"].as_str().unwrap_or_default().into(),
        share: share(&effect["share"]),
        off_by: share(off_by),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::brdf::{FitRecord, LobeKind, Material};

    fn measured_by(name: &str) -> Run {
        let truth = Material::new(vec!["x".into()], vec![(LobeKind::Lambert, vec![0.5], vec![])]);
        Run {
            kind: Kind::Demo,
            title: "glossy-paint".into(),
            instrument: Some(name.into()),
            truth: Some(Predicted::new(&truth, None)),
            ..Run::empty()
        }
    }

    #[test]
    fn effects_are_those_of_the_runs_instrument_or_none() {
        let found = effects(&measured_by(NOISY_DETECTOR));
        assert_eq!((found.lists.len(), found.missing), (1, None));
        assert!(!found.lists[0].command.contains("--instrument"), "{}", found.lists[0].command);

        let found = effects(&measured_by("commercial"));
        assert!(found.missing.is_none() && found.lists[0].command.ends_with("--instrument commercial"));
        assert!(found.lists[0].on.len() > 2, "an instrument with parts");

        let folder = tempfile::tempdir().expect("a folder");
        let mut run = measured_by("mine.toml");
        run.made.folder = Some(folder.path().into());
        let found = effects(&run);
        assert!(found.lists.is_empty(), "another instrument's effects under its name");
        assert!(found.missing.is_some_and(|said| said.contains("mine.toml")));
    }

    #[test]
    fn a_scenes_figures_are_of_the_pages_material_or_not_shown() {
        let material = Material::new(vec!["x".into()], vec![(LobeKind::Lambert, vec![0.5], vec![])]);
        let fit = RunFit {
            label: "lambert".into(),
            file: "lab/fit.json".into(),
            predicted: Predicted::new(&material, None),
            through: None,
            image: None,
            is_of_other: false,
        };
        let mut run = Run {
            kind: Kind::Validate,
            scene: Some("sphere-on-plane".into()),
            folder: "v".into(),
            fits: vec![fit],
            ..Run::empty()
        };
        let list = scene(&run).expect("a plan");
        let command = "goniofit effects --scene sphere-on-plane --material lab/fit.json";
        assert_eq!((list.measured, list.command), (false, format!("{command} --json > v/effects.json")));
        let shadows = json!({"effect": "shadows", "on": true, "why": "a plane", "share": 0.5, "off_by": 0.25});
        let of = |material: Value| json!({"scene": "sphere-on-plane", "material": material, "width": 16, "height": 8, "samples": 4, "seed": 1, "effects": [shadows]});
        run.effects = Some(of(json!("lab/fit.json")));
        let list = scene(&run).expect("a list");
        assert!(list.measured && list.title.ends_with("figures are of lab/fit.json"), "{}", list.title);
        assert!(list.command.starts_with(&format!("{command} --size 16x8 --samples 4 --seed 1")), "{}", list.command);
        // Of another material, of the scene's own, or of one that an older file does not name.
        for other in [json!("satin"), Value::Null] {
            run.effects = Some(of(other));
            assert!(scene(&run).is_some_and(|list| !list.measured && list.command.contains("--material lab/fit.json")));
        }
    }

    const WIDE: &str = "version = 1\n[instrument]\nelectrons = 1e6\n[instrument.detector]\naperture_deg = 4.0\n";

    /// A fit through `wide.toml`, which lies where the run was made, or does not.
    fn fitted_through_wide(folder: &std::path::Path, is_there: bool) -> Run {
        let mut material = Material::new(vec!["x".into()], vec![(LobeKind::Lambert, vec![0.5], vec![])]);
        let record = FitRecord {
            through: Some("an aperture of 4.000°".into()),
            instrument: Some("wide.toml".into()),
            ..FitRecord::default()
        };
        material.fit = Some(record);
        if is_there {
            std::fs::write(folder.join("wide.toml"), WIDE).expect("writes");
        }
        let fit = RunFit {
            label: "lambert".into(),
            file: folder.join("fit.json").display().to_string(),
            predicted: Predicted::new(&material, None),
            through: is_there.then(|| "wide.toml".into()),
            image: None,
            is_of_other: false,
        };
        Run { fits: vec![fit], ..Run::empty() }
    }

    #[test]
    fn a_fit_through_an_instrument_has_that_instruments_effects() {
        let folder = tempfile::tempdir().expect("a folder");
        let found = effects(&fitted_through_wide(folder.path(), false));
        assert!(found.lists.is_empty() && found.missing.is_some_and(|said| said.contains("wide.toml")));
        let mut run = fitted_through_wide(folder.path(), true);
        let names = |list: &Listed| list.on.iter().map(|e| e.name.clone()).collect::<Vec<_>>();
        let found = effects(&run);
        let list = &found.lists[0];
        assert_eq!((found.lists.len(), found.missing.as_ref(), list.measured), (1, None, false));
        assert_eq!(names(list), ["detector aperture", "shot noise", "read noise"]);
        assert!(
            list.title.contains("wide.toml") && list.command.ends_with("--instrument wide.toml"),
            "{}",
            list.command
        );
        // With what each is worth, where that was measured of this instrument and this fit, and not of others.
        let own = run.fits[0].file.clone();
        let mut measured = |instrument: &str, material: &str| {
            let aperture = json!({"effect": "detector aperture", "on": true, "why": "4", "share": 0.5, "reading": {"largest": 0.5, "rms": 0.25}});
            run.effects =
                Some(json!({"instrument": instrument, "material": material, "scan": "merl", "effects": [aperture]}));
            let list = effects(&run).lists.swap_remove(0);
            assert_eq!(list.title.ends_with(&format!("figures are of {material}, scan merl")), list.measured);
            (list.measured, list.on[0].off_by.clone(), list.on.len())
        };
        assert_eq!(measured("wide.toml", &own), (true, percent(0.25), 1));
        assert_eq!(measured("other.toml", &own), (false, String::new(), 3));
        assert_eq!(measured("wide.toml", "satin"), (false, String::new(), 3));
        // Of a plain fit there is nothing to list.
        let mut plain = fitted_through_wide(folder.path(), true);
        let material = Material { fit: None, ..plain.fits[0].material().clone() };
        plain.fits[0].predicted = Predicted::new(&material, None);
        let found = effects(&plain);
        assert!(found.lists.is_empty() && found.missing.is_none());
    }
}
