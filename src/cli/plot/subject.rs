//! What curves are drawn of: a measurement, and materials beside it.

use std::path::Path;

use crate::brdf::Material;
use crate::chain::{self, Source};
use crate::cli::failure::Failure;
use crate::measurement::{Dimension, Measurement, ReadOptions, TableBrdf};
use crate::report::views::{Predicted, Shown};

/// Files by what they hold.
pub(super) struct Subjects {
    pub table: Option<(Measurement, Option<TableBrdf>)>,
    pub materials: Vec<(String, Predicted)>,
}

impl Subjects {
    /// Reads the files: at most one measurement, any number of materials of the same channels.
    pub fn read(files: &[String], options: &ReadOptions) -> Result<Self, Failure> {
        let mut found = Self { table: None, materials: Vec::new() };
        for file in files {
            match chain::load(file, options)? {
                Source::Fitted(material) => found.materials.push((name_of(file), Predicted::new(&material, None))),
                Source::Measured(_) if found.table.is_some() => {
                    return Err(Failure::usage(format!(
                        "{file}: expected one measurement and fits of it, found another"
                    )));
                }
                Source::Measured(table) => {
                    let all: Vec<usize> = (0..table.channels.len()).collect();
                    // A table that can't be interpolated is shown by its readings alone.
                    let brdf =
                        if table.dimension == Dimension::Flat { None } else { TableBrdf::new(&table, &all).ok() };
                    found.table = Some((*table, brdf));
                }
            }
        }
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

/// What the legend calls a file.
fn name_of(file: &str) -> String {
    Path::new(file).file_stem().map_or_else(|| file.into(), |s| s.to_string_lossy().into_owned())
}
