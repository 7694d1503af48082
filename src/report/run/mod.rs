//! What a run left in its folder, read back.

mod demo;
mod error;
mod files;
mod loose;
mod mismatch;
mod sight;
mod table;
mod validated;

use std::path::{Path, PathBuf};

use serde_json::Value;

pub use error::ReportError;
use files::{found, json, picture, sweep, sweeps};
pub use sight::fitted_through;
pub(in crate::report) use sight::known_instrument;
pub use table::Table;

use super::views::{Predicted, Sweep};
use crate::brdf::Material;
use crate::image::Image;
use crate::measurement::{Measurement, ReadOptions};

/// Which command left the files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// `demo`
    Demo,
    /// `validate`
    Validate,
    /// `fit`, or a folder with fits in it.
    Fit,
    /// `tradeoff` alone.
    Sweeps,
}

/// A fit of a run.
#[derive(Debug)]
pub struct RunFit {
    /// What it is called: its model, or its file where there are several of one model.
    pub label: String,
    /// Its file, as one would type it.
    pub file: String,
    /// The material, and what it is seen through beside readings.
    pub predicted: Predicted,
    /// The name of that instrument.
    pub through: Option<String>,
    /// How its picture differs from the reference's, as `numbers.json` has it; none where there is no such picture.
    pub image: Option<Value>,
    /// Whether it was made of another measurement than the run's, as far as that can be told.
    pub is_of_other: bool,
}

impl RunFit {
    /// The material.
    #[must_use]
    pub fn material(&self) -> &Material {
        self.predicted.material()
    }
}

/// A picture of a run.
#[derive(Debug)]
pub struct Picture {
    /// What it shows.
    pub label: String,
    /// Its file in the folder.
    pub file: String,
    /// Linear radiance.
    pub image: Image,
}

/// How a run was asked for.
#[derive(Debug, Clone, Default)]
pub struct Made {
    /// Program and version.
    pub program: Option<String>,
    /// The command as it would be typed, the program's name first.
    pub command: Vec<String>,
    /// The folder that it was typed in.
    pub folder: Option<PathBuf>,
}

/// A run: its files, read.
#[derive(Debug)]
pub struct Run {
    /// Which command left it.
    pub kind: Kind,
    /// The folder.
    pub folder: PathBuf,
    /// What was measured.
    pub title: String,
    /// The measurement, or why there is none.
    pub table: Result<Table, String>,
    /// What was measured, where that is known: a simulation's truth.
    pub truth: Option<Predicted>,
    /// The fits.
    pub fits: Vec<RunFit>,
    /// Whether they are not all of one measurement, as far as that can be told.
    pub are_unlike: bool,
    /// Pictures, the one that others are compared with first, if it can be read.
    pub pictures: Vec<Picture>,
    /// What that one shows.
    pub reference: String,
    /// Exposure of the previews, stops.
    pub exposure: Option<f64>,
    /// Time of each stage, s.
    pub times: Vec<(String, f64)>,
    /// The instrument's name, of a simulation.
    pub instrument: Option<String>,
    /// The scene's name.
    pub scene: Option<String>,
    /// Seed of noise and pictures.
    pub seed: Option<u64>,
    /// How the run was asked for.
    pub made: Made,
    /// What the reader must know besides the fits' own warnings.
    pub notes: Vec<String>,
    /// What `goniofit effects --json` found, where its output lies in the folder as `effects.json`.
    pub effects: Option<Value>,
    /// What `goniofit tradeoff` measured: every `tradeoff.json` in the folder, or in a folder within it.
    pub sweeps: Vec<Sweep>,
}

/// What `numbers.json` does not say.
#[derive(Debug, Clone, Default)]
pub struct RunOptions {
    /// The measurement, where it lies elsewhere than the folder says.
    pub measurement: Option<PathBuf>,
    /// How to read it.
    pub reading: ReadOptions,
}

impl Run {
    /// Reads a folder.
    ///
    /// # Errors
    /// [`ReportError`] where there is nothing to report, or a file that it can't do without can't be read; others become notes.
    pub fn read(folder: &Path, options: &RunOptions) -> Result<Self, ReportError> {
        let path = folder.join("numbers.json");
        if folder.is_file() {
            return Err(ReportError::NotFolder { path: folder.into() });
        }
        if !folder.is_dir() {
            return Err(ReportError::NoFolder { path: folder.into() });
        }
        let mut run = if path.is_file() {
            let numbers = json(&path)?;
            if numbers.get("truth").is_some() {
                demo::read(folder, &numbers, options)?
            } else if numbers.get("reference").is_some() {
                validated::read(folder, &numbers, options)
            } else {
                return Err(ReportError::Numbers { path });
            }
        } else {
            loose::read(folder, options)?
        };
        run.add_extras();
        run.tell_others();
        run.notes.extend(run.sweeps.iter().filter_map(Sweep::cut_short));
        Ok(run)
    }

    /// Adds what other commands left in the folder; what can't be read becomes a note.
    fn add_extras(&mut self) {
        let effects = self.folder.join(EFFECTS);
        if effects.is_file() {
            let known = |value: Value| if value["effects"].is_array() { Ok(value) } else { Err("no list `effects`") };
            self.effects = self.extra(&effects, known);
        }
        // A folder of sweeps alone has them already.
        let more = if self.is_of_sweeps() { Vec::new() } else { sweeps(&self.folder) };
        for path in more {
            match sweep(&path) {
                Ok(sweep) => self.sweeps.push(sweep),
                Err(error) => self.notes.push(left_out(&error.to_string())),
            }
        }
    }

    /// Marks fits of different measurements, and those of another one than that at hand, and says so before all else.
    fn tell_others(&mut self) {
        // Those of a demo or a validation were given together.
        let is_loose = self.kind == Kind::Fit;
        let mut notes = if is_loose { Vec::from_iter(mismatch::unlike(&self.fits)) } else { Vec::new() };
        self.are_unlike = !notes.is_empty();
        if let Ok(table) = &self.table {
            let path = table.path.display();
            for fit in &mut self.fits {
                if let Some(why) = mismatch::mismatch(&table.measurement, fit) {
                    fit.is_of_other = true;
                    notes.push(format!("{}: the fit was not made of this measurement, {path}: {why}.", fit.label));
                }
            }
        }
        self.notes.splice(0..0, notes);
    }

    /// Whether nothing else is there to be shown.
    pub(in crate::report) fn is_of_sweeps(&self) -> bool {
        self.kind == Kind::Sweeps
    }

    /// What `understood` makes of a file's JSON.
    fn extra<T, E: std::fmt::Display>(&mut self, path: &Path, understood: impl Fn(Value) -> Result<T, E>) -> Option<T> {
        let reason = match json(path).map(understood) {
            Ok(Ok(found)) => return Some(found),
            Ok(Err(error)) => format!("{}: expected what goniofit wrote there, found {error}", path.display()),
            Err(error) => error.to_string(),
        };
        self.notes.push(left_out(&reason));
        None
    }

    /// A measurement and one fit of it, as `fit` has them at hand.
    #[must_use]
    pub fn of_fit(
        path: &Path,
        measurement: Measurement,
        file: &str,
        material: &Material,
        through: Option<(String, Through)>,
        made: Made,
    ) -> Self {
        let (name, sight) = through.map_or((None, None), |(name, sight)| (Some(name), sight));
        let label = material.model();
        let table = Table::new(path, measurement);
        Self {
            kind: Kind::Fit,
            folder: path.parent().map(Path::to_path_buf).unwrap_or_default(),
            title: table.measurement.name.clone(),
            table: Ok(table),
            fits: vec![RunFit {
                label,
                file: file.into(),
                predicted: Predicted::new(material, sight),
                through: name,
                image: None,
                is_of_other: false,
            }],
            made,
            ..Self::empty()
        }
    }

    /// Where files that the run names may lie.
    pub(in crate::report) fn folders(&self) -> Vec<&Path> {
        self.made.folder.as_deref().into_iter().chain([Path::new(""), &self.folder]).collect()
    }

    pub(in crate::report) fn empty() -> Self {
        Self {
            kind: Kind::Fit,
            folder: PathBuf::new(),
            title: String::new(),
            table: Err(String::new()),
            truth: None,
            fits: Vec::new(),
            are_unlike: false,
            pictures: Vec::new(),
            reference: String::new(),
            exposure: None,
            times: Vec::new(),
            instrument: None,
            scene: None,
            seed: None,
            made: Made::default(),
            notes: Vec::new(),
            effects: None,
            sweeps: Vec::new(),
        }
    }
}

/// What `goniofit effects` wrote.
pub const EFFECTS: &str = "effects.json";
/// What `goniofit tradeoff` wrote.
pub const SWEEP: &str = "tradeoff.json";

/// The note on a file of the folder that is no part of the report.
fn left_out(reason: &str) -> String {
    format!("A file is left out: {reason}.")
}

/// What lobes are seen through.
pub type Through = Option<std::sync::Arc<dyn crate::brdf::Sight>>;

impl Made {
    /// As `run` in `numbers.json` says it.
    #[must_use]
    pub fn of(run: &Value) -> Self {
        let words = run["command"].as_array().into_iter().flatten();
        Self {
            program: run["program"].as_str().map(str::to_owned),
            command: words.filter_map(|w| w.as_str().map(str::to_owned)).collect(),
            folder: run["folder"].as_str().map(PathBuf::from),
        }
    }
}

/// A fit as it is compared with the run's readings: through the instrument that it was made through, where that is known; else a note says that it is not.
fn compared(
    material: &Material,
    (label, file): (&str, String),
    otherwise: Option<&str>,
    made: &Made,
    notes: &mut Vec<String>,
) -> RunFit {
    let beside = Path::new(&file).parent().unwrap_or(Path::new(""));
    let folders: Vec<&Path> = made.folder.as_deref().into_iter().chain([Path::new(""), beside]).collect();
    let (through, sight) = match fitted_through(material, otherwise, &folders) {
        Ok(seen) => seen.map_or((None, None), |(name, sight)| (Some(name), sight)),
        Err(unknown) => {
            notes.push(format!(
                "{label} was fitted through {unknown}. Here it is drawn as the surface, while the table is what the instrument saw: about sharp \
                 highlights part of their difference is the instrument's own blur."
            ));
            (None, None)
        }
    };
    RunFit {
        label: label.into(),
        file,
        predicted: Predicted::new(material, sight),
        through,
        image: None,
        is_of_other: false,
    }
}

/// The note on a run that was ended early.
fn stopped(numbers: &Value) -> Option<String> {
    let is_stopped = numbers["stopped"] == true;
    is_stopped.then(|| "The run was stopped early: pictures are missing or have fewer samples than asked for.".into())
}
