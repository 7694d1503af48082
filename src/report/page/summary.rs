//! The first screen: what was measured, how well it is described, what to be careful of.

use crate::report::run::{Kind, Run, RunFit};
use crate::report::words::{count, number, percent, time};

/// A number that stands out.
pub(super) struct Card {
    pub label: String,
    pub value: String,
    pub unit: &'static str,
    pub note: String,
}

/// A warning in plain words.
pub(super) struct Warning {
    /// What it is about.
    pub of: String,
    pub text: String,
}

pub(super) struct Summary {
    pub subtitle: String,
    /// What was found, in sentences.
    pub verdict: Vec<String>,
    pub cards: Vec<Card>,
    pub warnings: Vec<Warning>,
    /// A small picture with its alternative text.
    pub picture: Option<(String, String)>,
}

pub(super) fn summary(run: &Run) -> Summary {
    Summary {
        picture: super::pictures::cover(run),
        subtitle: subtitle(run),
        verdict: verdict(run),
        cards: cards(run),
        warnings: warnings(run),
    }
}

fn subtitle(run: &Run) -> String {
    if run.is_of_sweeps() {
        let stages: Vec<&str> = run.sweeps.iter().map(|sweep| sweep.stage.as_str()).collect();
        return format!("measured by tradeoff {}", stages.join(", "));
    }
    let origin = match (&run.instrument, &run.table) {
        (Some(instrument), _) => format!("measured by simulation ({instrument})"),
        (None, Ok(table)) => table.summary.origin.clone(),
        (None, Err(_)) => "measurement not at hand".into(),
    };
    let fits = match run.fits.len() {
        0 => "not fitted".to_owned(),
        1 => "one fit".to_owned(),
        n => format!("{n} fits"),
    };
    let pictures = match (&run.scene, run.pictures.is_empty()) {
        (Some(scene), false) => format!("rendered in the scene {scene}"),
        _ => "not rendered".into(),
    };
    [origin, fits, pictures].join(" · ")
}

/// The fit with the smallest rmse, of those that were made of the run's measurement where there are any; none where fits are of different ones.
fn best(run: &Run) -> Option<&RunFit> {
    if run.are_unlike {
        return None;
    }
    let rmse = |f: &RunFit| f.material().fit.as_ref().map_or(f64::INFINITY, |r| r.rmse);
    let order = |a: &&RunFit, b: &&RunFit| a.is_of_other.cmp(&b.is_of_other).then(rmse(a).total_cmp(&rmse(b)));
    run.fits.iter().min_by(order)
}

fn verdict(run: &Run) -> Vec<String> {
    if run.is_of_sweeps() {
        return vec![
            "What each setting takes in time, and how far it is off, by trials with seeds of their own.".into(),
        ];
    }
    let mut said = Vec::new();
    let Some(fit) = best(run) else { return vec![not_judged(run).into()] };
    if fit.is_of_other {
        said.push(format!(
            "{} was not made of this measurement: what its file says of noise and residuals is not of these readings.",
            fit.label
        ));
    } else if let Some(residual) = fit.material().fit.as_ref().and_then(|r| r.residual.as_ref()) {
        let known = if residual.noise_from == "sigma" { "stated noise" } else { "noise between neighbours" };
        let share = match residual.structured_share {
            share if share > 0.995 => "nearly all".into(),
            share => percent(share),
        };
        said.push(if residual.structured_share <= 0.05 {
            format!("{} describes the readings to within their {known}.", fit.label)
        } else if residual.structured_share <= 0.5 {
            format!(
                "{} describes the readings to little more than their {known}: {share} of the residuals' variance is structure, the model's or of errors that \
                 readings share.",
                fit.label
            )
        } else {
            format!(
                "{} comes closest, but cannot bend as the material does: {share} of the residuals' variance is structure, not noise.",
                fit.label
            )
        });
    }
    let reference = &run.reference;
    if let Some(s) = fit.image.as_ref().map(|image| &image["significance"]).filter(|s| s.is_object()) {
        let (differing, pixels) = (s["pixels_differing"].as_u64().unwrap_or(0), s["pixels"].as_u64().unwrap_or(0));
        said.push(match differing {
            0 => format!("No pixel of its picture differs from the {reference}'s by more than the pictures' noise."),
            n => format!(
                "{} of its picture's pixels differ from the {reference}'s by more than the pictures' noise.",
                percent(n as f64 / pixels.max(1) as f64)
            ),
        });
    }
    said
}

/// Why no fit is called the best.
fn not_judged(run: &Run) -> &'static str {
    if run.are_unlike {
        "The fits are of different measurements, or took different samples: which is the best can't be told from their files."
    } else {
        "There is no fit to judge."
    }
}

fn cards(run: &Run) -> Vec<Card> {
    let mut cards = Vec::new();
    let mut card = |label: &str, value: String, unit: &'static str, note: String| {
        cards.push(Card { label: label.into(), value, unit, note });
    };
    if let Ok(table) = &run.table {
        let s = &table.summary;
        let note = format!("{} of the values valid", percent(s.valid_share));
        card("direction pairs", count(s.entries as u64), "", note);
    }
    if let Some(fit) = best(run)
        && let Some(record) = &fit.material().fit
    {
        let of_other = if fit.is_of_other { ", of another measurement" } else { "" };
        let note = format!("{}, {}{of_other}", fit.label, record.status);
        card("rmse of the best fit", number(record.rmse), super::fits::unit_of(fit, record), note);
        let looks = fit.image.as_ref().and_then(|i| i["appearance"]["flip"]["mean"].as_f64());
        if let Some(flip) = looks {
            card("ꟻLIP of its picture", number(flip), "", "0: looks the same, 1: as different as can be".into());
        }
        if let Some(energy) = &record.energy {
            let note = if energy.conserved { "energy is conserved" } else { "more than comes in" };
            card("reflects at most", percent(energy.largest), "", note.into());
        }
    }
    if run.kind == Kind::Demo {
        let seconds: f64 = run.times.iter().map(|(_, s)| s).sum();
        card("the whole chain took", time(seconds), "", "measure, fit, render, compare".into());
    }
    cards
}

fn warnings(run: &Run) -> Vec<Warning> {
    let mut all = Vec::new();
    let mut push = |of: &str, text: &str| all.push(Warning { of: of.into(), text: text.replace('`', "") });
    for note in &run.notes {
        push("run", note);
    }
    if let Ok(table) = &run.table {
        table.measurement.notes.iter().for_each(|note| push("measurement", note));
        if table.summary.masked.total() > 0 {
            let masked = &table.summary.masked;
            push(
                "measurement",
                &format!(
                    "{} values are masked: {} marked as not measured, {} not finite. They take no part in anything.",
                    count(masked.total()),
                    count(masked.marked),
                    count(masked.not_finite)
                ),
            );
        }
    }
    for fit in &run.fits {
        let warnings = fit.material().fit.iter().flat_map(|r| &r.warnings);
        warnings.for_each(|text| push(&fit.label, text));
        if let Some(image) = &fit.image {
            if let Some(note) = image["note"].as_str() {
                push(&fit.label, note);
            }
            let masked = image["masked"].as_u64().unwrap_or(0);
            if masked > 0 {
                push(
                    &fit.label,
                    &format!(
                        "{} pixels show directions that were not measured; they are grey, and left out of the numbers.",
                        count(masked)
                    ),
                );
            }
        }
    }
    all
}
