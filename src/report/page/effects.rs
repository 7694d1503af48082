//! The plan of effects: what was simulated, and because of what.

use serde_json::Value;

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
    /// Why there is no list of the instrument's, where there should be one.
    pub missing: Option<String>,
}

pub(super) fn effects(run: &Run) -> Effects {
    let (instrument, missing) = match instrument(run) {
        None => (None, None),
        Some(Ok(list)) => (Some(list), None),
        Some(Err(reason)) => (None, Some(reason)),
    };
    Effects { lists: instrument.into_iter().chain(scene(run)).collect(), missing }
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

/// Of a simulated measurement; the reason where its instrument is not at hand.
fn instrument(run: &Run) -> Option<Result<Listed, String>> {
    if run.kind != Kind::Demo {
        return None;
    }
    let name = run.instrument.as_deref()?;
    let truth = run.truth.as_ref()?.material();
    let mut words = vec!["goniofit", "effects", "--material", &run.title];
    let own = name == NOISY_DETECTOR;
    if !own {
        words.extend(["--instrument", name]);
    }
    let command = typed(&words);
    let known = if own { Some(Instrument::default()) } else { known_instrument(name, &run.folders()) };
    Some(match known {
        Some(known) => {
            let effects = plain(gonio::plan(&known, &truth.channels));
            Ok(Listed::new(format!("The instrument, {name}"), effects, false, command))
        }
        None => Err(format!(
            "What the instrument {name} simulates is not known here: it is neither built in, nor can its file be read where the run was made. Where it is: {command}"
        )),
    })
}

/// Of the scene, with what `effects.json` says of it.
fn scene(run: &Run) -> Option<Listed> {
    let name = run.scene.as_deref()?;
    let found = run.effects.as_ref().filter(|e| e["scene"] == name);
    let effects = if let Some(found) = found {
        found["effects"].as_array()?.iter().map(told).collect()
    } else {
        let truth = run.truth.as_ref().map(Predicted::material);
        let material = run.fits.last().map(RunFit::material).or(truth)?;
        plain(scene_plan(&Stage::built_in(name).ok()?, material).ok()?)
    };
    let out = run.folder.join("effects.json").display().to_string();
    let mut words: Vec<String> = ["goniofit", "effects", "--scene", name].map(String::from).to_vec();
    if run.kind == Kind::Demo {
        words.extend(["--material".into(), run.title.clone()]);
    }
    if let Some(found) = found {
        let size = format!("{}x{}", found["width"], found["height"]);
        words.extend(["--size".into(), size, "--samples".into(), found["samples"].to_string()]);
        words.extend(["--seed".into(), found["seed"].to_string()]);
    }
    let command = format!("{} --json > {}", typed(&words), typed(&[&out]));
    Some(Listed::new(format!("The scene, {name}"), effects, found.is_some(), command))
}

impl Listed {
    fn new(title: String, effects: Vec<Effect>, measured: bool, command: String) -> Self {
        let (on, off): (Vec<Effect>, Vec<Effect>) = effects.into_iter().partition(|e| e.on);
        let names_off = off.iter().map(|e| e.name.as_str()).collect::<Vec<_>>().join(", ");
        Self { title, on, off, names_off, measured, command }
    }
}

fn told(effect: &Value) -> Effect {
    let share = |key: &str| effect[key].as_f64().map_or("–".into(), percent);
    Effect {
        name: effect["effect"].as_str().unwrap_or_default().into(),
        on: effect["on"] == true,
        why: effect["why"].as_str().unwrap_or_default().into(),
        share: share("share"),
        off_by: share("off_by"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::{LobeKind, Material};

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
}
