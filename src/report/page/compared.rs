//! Parameters against each other, and models against each other.

use crate::image::ColorMap;
use crate::report::plot::{hex, minus};
use crate::report::run::RunFit;
use crate::report::words::{count, number};

/// A coloured cell of a correlation matrix.
pub(super) struct Shade {
    pub text: String,
    pub style: String,
}

pub(super) struct Correlations {
    pub label: String,
    pub names: Vec<String>,
    pub rows: Vec<(String, Vec<Shade>)>,
    /// The strongest pair, in words.
    pub strongest: String,
}

/// Models that `--model auto` compared.
pub(super) struct Choice {
    pub label: String,
    pub reason: String,
    pub rows: Vec<ChoiceRow>,
}

pub(super) struct ChoiceRow {
    pub model: String,
    pub chosen: bool,
    pub cells: Vec<String>,
    /// Length of the bar of its held-out error, per cent of the worst.
    pub bar: f64,
}

pub(super) fn correlations(fit: &RunFit) -> Option<Correlations> {
    let c = fit.material().fit.as_ref()?.correlation.as_ref()?;
    let mut strongest: Option<(f64, usize, usize)> = None;
    for i in 0..c.parameters.len() {
        for j in 0..i {
            let Some(r) = c.matrix[i][j] else { continue };
            if strongest.is_none_or(|(most, ..)| r.abs() > most.abs()) {
                strongest = Some((r, i, j));
            }
        }
    }
    let (r, i, j) = strongest?;
    let row = |(name, values): (&String, &Vec<Option<f64>>)| (name.clone(), values.iter().map(|v| shade(*v)).collect());
    Some(Correlations {
        label: fit.label.clone(),
        names: c.parameters.clone(),
        rows: c.parameters.iter().zip(&c.matrix).map(row).collect(),
        strongest: format!("strongest: {} and {}, {}", c.parameters[i], c.parameters[j], minus(&format!("{r:+.2}"))),
    })
}

/// A coefficient in its colour, the text black or white as it reads better.
fn shade(value: Option<f64>) -> Shade {
    let Some(value) = value else { return Shade { text: "–".into(), style: String::new() } };
    let color = ColorMap::Diverging.color(0.5 + 0.5 * value);
    let [r, g, b] = color.map(|c| (f64::from(c) / 255.0).powf(2.2));
    let ink = if 0.2126 * r + 0.7152 * g + 0.0722 * b > 0.18 { "#111" } else { "#fff" };
    let text = if value == 1.0 { "1".into() } else { minus(&format!("{value:.2}")) };
    Shade { text, style: format!("background:{};color:{ink}", hex(color)) }
}

pub(super) fn choice(fit: &RunFit) -> Option<Choice> {
    let choice = fit.material().fit.as_ref()?.choice.as_ref()?;
    let worst = choice.candidates.iter().map(|c| c.held_out_rmse).fold(0.0, f64::max);
    let row = |c: &crate::brdf::ModelCandidate| ChoiceRow {
        model: c.model.clone(),
        chosen: c.model == choice.chosen,
        cells: vec![count(c.parameters), number(c.rmse), number(c.held_out_rmse), number(c.aicc), number(c.bic)],
        bar: (100.0 * c.held_out_rmse / worst).clamp(0.5, 100.0),
    };
    Some(Choice {
        label: fit.label.clone(),
        reason: choice.reason.clone(),
        rows: choice.candidates.iter().map(row).collect(),
    })
}
