//! The plan of effects: what was simulated, and because of what.

use serde_json::Value;

use super::reproduce::typed;
use crate::chain::{Stage, scene_plan};
use crate::control::Plan;
use crate::gonio;
use crate::report::run::{Kind, Run, RunFit};
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
}

pub(super) fn effects(run: &Run) -> Effects {
    Effects { lists: instrument(run).into_iter().chain(scene(run)).collect() }
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

/// Of a simulated measurement.
fn instrument(run: &Run) -> Option<Listed> {
    if run.kind != Kind::Demo {
        return None;
    }
    let name = run.instrument.as_deref()?;
    let truth = run.truth.as_ref()?.material();
    let known = crate::report::run::instrument(name, run.made.folder.as_deref());
    let mut words = vec!["goniofit", "effects", "--material", &run.title];
    if known.is_some() {
        words.extend(["--instrument", name]);
    }
    let effects = plain(gonio::plan(&known.unwrap_or_default(), &truth.channels));
    Some(Listed::new(format!("The instrument, {name}"), effects, false, typed(&words)))
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
    let command = format!("{} > {}", typed(&["goniofit", "effects", "--scene", name, "--json"]), typed(&[&out]));
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
