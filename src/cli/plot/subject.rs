//! What curves are drawn of: a measurement, and materials beside it.

use std::path::Path;

use crate::brdf::Material;
use crate::chain::{self, Source};
use crate::cli::failure::Failure;
use crate::cli::ui::Ui;
use crate::measurement::{Dimension, Measurement, ReadOptions, TableBrdf};
use crate::report::run::fitted_through;
use crate::report::views::{Predicted, Shown};

/// Files by what they hold.
pub(super) struct Subjects {
    pub table: Option<(Measurement, Option<TableBrdf>)>,
    pub materials: Vec<(String, Predicted)>,
}

impl Subjects {
    /// Reads the files: at most one measurement, any number of materials of the same channels. Beside a measurement, fits that were made through an
    /// instrument are drawn through it.
    pub fn read(files: &[String], options: &ReadOptions, ui: &Ui) -> Result<Self, Failure> {
        let (mut table, mut materials) = (None, Vec::new());
        for file in files {
            match chain::load(file, options)? {
                Source::Fitted(material) => materials.push((file, material)),
                Source::Measured(_) if table.is_some() => {
                    return Err(Failure::usage(format!(
                        "{file}: expected one measurement and fits of it, found another"
                    )));
                }
                Source::Measured(measured) => {
                    let all: Vec<usize> = (0..measured.channels.len()).collect();
                    // A table that can't be interpolated is shown by its readings alone.
                    let brdf =
                        if measured.dimension == Dimension::Flat { None } else { TableBrdf::new(&measured, &all).ok() };
                    table = Some((*measured, brdf));
                }
            }
        }
        let beside = table.is_some();
        let predicted = |(file, material): (&String, Box<Material>)| {
            let plain = || Predicted::new(&material, None);
            (name_of(file), if beside { seen(&material, file, ui) } else { plain() })
        };
        let found = Self { table, materials: materials.into_iter().map(predicted).collect() };
        found.agree(files)?;
        Ok(found)
    }

    /// Channels of all of them.
    pub fn channels(&self) -> &[String] {
        let first = || self.materials.first().map_or(&[][..], |(_, m)| &m.material().channels);
        self.table.as_ref().map_or_else(first, |(t, _)| &t.channels)
    }

    pub fn is_flat(&self) -> bool {
        let first = || self.materials.first().is_some_and(|(_, m)| m.material().is_flat());
        self.table.as_ref().map_or_else(first, |(t, _)| t.dimension == Dimension::Flat)
    }

    pub fn shown(&self) -> Shown<'_> {
        let materials = self.materials.iter().enumerate().map(|(k, (name, m))| (name.clone(), m, k + 1));
        Shown { table: self.table.as_ref().map(|(t, b)| (t, b.as_ref())), materials: materials.collect() }
    }

    fn agree(&self, files: &[String]) -> Result<(), Failure> {
        let (channels, flat) = (self.channels(), self.is_flat());
        let differs = |m: &Material| m.channels != channels || m.is_flat() != flat;
        match self.materials.iter().find(|(_, m)| differs(m.material())) {
            None => Ok(()),
            Some((name, m)) => Err(Failure::usage(format!(
                "{name}: expected the channels {} of {}, found {}{}",
                channels.join(", "),
                files[0],
                m.material().channels.join(", "),
                if m.material().is_flat() == flat { "" } else { " in the other world (flat or space)" }
            ))),
        }
    }
}

/// A fit as it is compared with readings: through the instrument that it was made through, where that is known.
pub(super) fn seen(material: &Material, file: &str, ui: &Ui) -> Predicted {
    let beside = Path::new(file).parent().unwrap_or(Path::new(""));
    let sight = match fitted_through(material, None, &[Path::new(""), beside]) {
        Ok(None) => None,
        Ok(Some((name, sight))) => {
            ui.note(&format!("{file}: drawn as {name} sees it, through which it was fitted"));
            sight
        }
        Err(unknown) => {
            ui.warn(&format!(
                "{file}: fitted through {unknown}; it is drawn as the surface, not as the readings see it"
            ));
            None
        }
    };
    Predicted::new(material, sight)
}

/// What the legend calls a file.
fn name_of(file: &str) -> String {
    Path::new(file).file_stem().map_or_else(|| file.into(), |s| s.to_string_lossy().into_owned())
}
