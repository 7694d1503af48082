//! The measurement of a run.

use std::path::{Path, PathBuf};

use crate::chain::{Scatter, integrated_scatter};
use crate::measurement::{Dimension, Measurement, ReadOptions, Summary, TableBrdf, formats};

/// A measurement with what is computed of it once.
#[derive(Debug)]
pub struct Table {
    /// Its file, as one would type it.
    pub path: PathBuf,
    /// The measurement.
    pub measurement: Measurement,
    /// What interpolates it, or why nothing does.
    pub brdf: Result<TableBrdf, String>,
    /// What is in it.
    pub summary: Summary,
    /// Integrated scatter by incidence, or why there is none.
    pub scatter: Result<Vec<Scatter>, String>,
}

impl Table {
    /// A measurement that was read from `path`.
    #[must_use]
    pub fn new(path: &Path, measurement: Measurement) -> Self {
        let all: Vec<usize> = (0..measurement.channels.len()).collect();
        let brdf = match measurement.dimension {
            Dimension::Flat => Err("it is of the flat world".into()),
            Dimension::Space => TableBrdf::new(&measurement, &all).map_err(|e| e.to_string()),
        };
        let (summary, scatter) = (measurement.summary(), integrated_scatter(&measurement));
        Self { path: path.into(), measurement, brdf, summary, scatter }
    }

    /// Reads it; the reason as text where it can't be read, for the rest can be shown without it.
    pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Self, String> {
        let measurement = formats::read(path, options).map_err(|e| e.to_string())?;
        Ok(Self::new(path, measurement))
    }

    /// Unit of its values.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        if self.measurement.dimension == Dimension::Flat { "1/rad" } else { "1/sr" }
    }
}
