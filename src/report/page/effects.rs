//! The plan of effects: what was simulated, and because of what.

use serde_json::Value;

use crate::chain::{Stage, scene_plan};
use crate::control::Plan;
use crate::gonio::{self, Instrument};
use crate::report::run::{Kind, Run};
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
    pub effects: Vec<Effect>,
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
    let (instrument, typed) = match known {
        Some(instrument) => (instrument, format!(" --instrument {name}")),
        None => (Instrument::default(), String::new()),
    };
    Some(Listed {
        title: format!("Of the instrument: {name}"),
        effects: plain(gonio::plan(&instrument, &truth.channels)),
        measured: false,
        command: format!("goniofit effects --material {}{typed}", run.title),
    })
}

/// Of the scene, with what `effects.json` says of it.
fn scene(run: &Run) -> Option<Listed> {
    let name = run.scene.as_deref()?;
    let measured = run.effects.as_ref().filter(|e| e["scene"] == name);
    let effects = match measured {
        Some(found) => found["effects"].as_array()?.iter().map(told).collect(),
        None => {
            let fit = run
                .fits
                .last()
                .map(crate::report::run::RunFit::material)
                .or(run.truth.as_ref().map(|t| t.material()))?;
            plain(scene_plan(&Stage::built_in(name).ok()?, fit).ok()?)
        }
    };
    let folder = run.folder.display();
    Some(Listed {
        title: format!("Of the scene: {name}"),
        effects,
        measured: measured.is_some(),
        command: format!("goniofit effects --scene {name} --json > {folder}/effects.json"),
    })
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
