//! The page: a run as one HTML file.

mod compared;
mod data;
mod effects;
mod fits;
mod lobes;
mod measured;
mod peaks;
mod pictures;
mod pixels;
mod reproduce;
mod residuals;
mod summary;
mod time;

use askama::Template;

use super::plot::{DARK, LIGHT, page_css};
use super::run::{Kind, ReportError, Run};
use super::typed;

/// What a page was made of.
#[derive(Debug, Clone)]
pub struct Written {
    /// The page.
    pub html: String,
    /// What is missing, and which command writes it.
    pub missing: Vec<String>,
    /// Warnings that it shows.
    pub warnings: usize,
}

#[derive(Template)]
#[template(path = "page.html", config = "src/report/askama.toml")]
struct Page<'a> {
    run: &'a Run,
    summary: summary::Summary,
    measured: Option<measured::Measured>,
    fits: fits::Fits,
    lobes: Option<lobes::Lobes>,
    residuals: Vec<residuals::Residuals>,
    pictures: Option<pictures::Pictures>,
    time: time::Time,
    effects: effects::Effects,
    reproduce: reproduce::Reproduce,
    missing: Missing,
    /// Which fits are drawn through an instrument.
    seen: String,
    data: String,
    css: String,
}

/// What each part lacks; empty where it lacks nothing.
#[derive(Default)]
struct Missing {
    measured: String,
    fits: String,
    lobes: String,
    residuals: String,
    pictures: String,
    tradeoff: String,
    effects: String,
}

impl Missing {
    fn list(&self) -> Vec<String> {
        let first = [&self.measured, &self.fits, &self.lobes, &self.residuals];
        let all = first.into_iter().chain([&self.pictures, &self.tradeoff, &self.effects]);
        all.filter(|m| !m.is_empty()).cloned().collect()
    }
}

/// Puts the page together.
///
/// # Errors
/// [`ReportError`] where a picture can't be encoded.
pub fn page(run: &Run) -> Result<Written, ReportError> {
    let lobes = lobes::lobes(run);
    let residuals = residuals::residuals(run);
    let pictures = pictures::pictures(run)?;
    let mut missing = missing(run, lobes.is_some(), pictures.is_some());
    let mut effects = effects::effects(run);
    missing.effects = effects.missing.take().unwrap_or_default();
    let data = data::json(lobes.as_ref(), &residuals, pictures.as_ref());
    let summary = summary::summary(run);
    let warnings = summary.warnings.len();
    let page = Page {
        run,
        measured: measured::measured(run),
        fits: fits::fits(run),
        time: time::time(run),
        effects,
        reproduce: reproduce::reproduce(run),
        css: css(),
        summary,
        lobes,
        residuals,
        pictures,
        missing,
        seen: seen(run),
        data,
    };
    let html = page.render().map_err(|e| ReportError::Page(e.to_string()))?;
    Ok(Written { html, missing: page.missing.list(), warnings })
}

/// What a reader must know of fits that are compared with readings as an instrument sees them.
fn seen(run: &Run) -> String {
    let one = |f: &super::run::RunFit| f.through.as_ref().map(|name| format!("{} as {name} sees it", f.label));
    let all: Vec<String> = run.fits.iter().filter_map(one).collect();
    if all.is_empty() { String::new() } else { format!("Like the readings, {}.", all.join(", ")) }
}

fn missing(run: &Run, has_lobes: bool, has_pictures: bool) -> Missing {
    let mut missing = Missing::default();
    if run.is_of_sweeps() {
        return missing; // which have a part of their own alone
    }
    if let Err(reason) = &run.table {
        let folder = run.folder.display().to_string();
        let command = typed(&["goniofit", "report", &folder, "--measurement", "FILE"]);
        missing.measured = format!("The measurement is not at hand: {reason}. Name it: {command}");
        missing.residuals = "Residuals need the measurement and a fit of it.".into();
    }
    if run.fits.is_empty() {
        missing.fits = if run.kind == Kind::Validate {
            "The fits that were given are not here: the run was stopped before one was rendered, or their files can't be read.".into()
        } else {
            "There is no fit. Make one: goniofit fit FILE --out FIT.json".into()
        };
        missing.residuals = "Residuals need a fit.".into();
    }
    if !has_lobes {
        missing.lobes = "Neither readings in a plane of incidence nor a fit to draw lobes of.".into();
    }
    if !has_pictures {
        missing.pictures = format!("There are no pictures here. {}", validation(run));
    }
    if run.sweeps.is_empty() {
        let folder = run.folder.join("tradeoff").display().to_string();
        let table = run.table.as_ref().map_or_else(|_| "FILE".into(), |t| t.path.display().to_string());
        let command = typed(&["goniofit", "tradeoff", "fit", &table, "--out", &folder]);
        missing.tradeoff = format!("How much accuracy another second buys is not measured here: {command}");
    }
    missing
}

/// How to get pictures: the command that renders measurement and fits; of different measurements each fit has its own.
fn validation(run: &Run) -> String {
    let command = |table: &str, fits: &[&str]| {
        typed(&[&["goniofit", "validate", table], fits, &["--out", "DIR", "--report"]].concat())
    };
    if run.are_unlike {
        return format!("Render each fit beside its own measurement: {}", command("FILE", &["FIT.json"]));
    }
    let table = run.table.as_ref().map_or_else(|_| "FILE".into(), |t| t.path.display().to_string());
    let files: Vec<&str> = run.fits.iter().map(|f| reproduce::as_typed(run, &f.file)).collect();
    format!("Render table and fits under the same light: {}", command(&table, &files))
}

/// The page's style: colours for both themes, then the rules.
fn css() -> String {
    let variables = super::plot::variables;
    let dark = variables(&DARK);
    format!(
        ":root{{{}}}@media screen and (prefers-color-scheme:dark){{:root:not([data-theme=light]){{{dark}}}}}\
         @media screen{{:root[data-theme=dark]{{{dark}}}}}\n{}\n{}",
        variables(&LIGHT),
        include_str!("../templates/page.css"),
        page_css()
    )
}
