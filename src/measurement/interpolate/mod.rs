//! A measured table as a BRDF to render.
//!
//! In: a [`Measurement`] and the channels to show. Out: [`TableBrdf`], which evaluates between the measured directions and
//! draws directions in proportion to what the table reflects. The one decision to know: beyond the measured directions nothing
//! is extrapolated. There [`Brdf::eval`] answers `false` with zeros, and the caller shows the place as unmeasured.
//!
//! - A MERL grid is interpolated linearly in index space (`merl`).
//! - A file with an evaluation of its own (RGL) keeps it, its sampling included. Between the stored incidences that evaluation
//!   fills the gaps which the file marks as not measured.
//! - Listed isotropic samples are interpolated per incidence over a triangulation, and linearly between incidences at a
//!   constant offset from the mirror direction (`scattered`, `mesh`). Tables that can't carry that are refused, with the
//!   reason.
//! - Drawing directions: a tabulated density over two charts of the light's direction (`chart`, `sampler`), good for any
//!   table. Directional albedo: a quadrature over the same charts ([`directional_albedo`]).

mod albedo;
mod anchor;
mod chart;
mod merl;
mod mesh;
mod sampler;
mod scattered;

use std::sync::Arc;

use glam::DVec3;

use super::{Directions, Measurement, MeasurementError};
use crate::brdf::{Brdf, Sample};
use merl::MerlTable;
use sampler::Sampler;
use scattered::Scattered;

pub use albedo::{Albedo, directional_albedo};

/// A measurement, or some of its channels, as a BRDF (1/sr).
///
/// `eval` answers `false` with zeros where nothing was measured, and where `wi` or `wo` is not above the horizon. Values
/// are the measurement's own: noise below 0 stays below 0.
pub struct TableBrdf {
    table: Table,
    channels: usize,
    notes: Vec<String>,
}

/// How the values between the measured directions are found, and how directions are drawn.
enum Table {
    Merl(MerlTable, Sampler),
    Scattered(Scattered, Sampler),
    Evaluator(Selected),
}

impl TableBrdf {
    /// The channels with these indices, in this order: three for colour (red, green, blue), one for grey.
    ///
    /// Directions are drawn in proportion to the mean of the channels, times the cosine at the surface.
    ///
    /// # Errors
    /// [`MeasurementError::Unsupported`], whose `path` is the measurement's name, when no channel or one that does not exist
    /// is asked for, and when the directions can't be interpolated: flat world, one plane or one line of directions, fewer
    /// than two incidences, no incidence that repeats, an anisotropic list. The reason says what would work.
    pub fn new(measurement: &Measurement, channels: &[usize]) -> Result<Self, MeasurementError> {
        Self::build(measurement, channels)
            .map_err(|reason| MeasurementError::Unsupported { path: measurement.name.clone().into(), reason })
    }

    fn build(measurement: &Measurement, channels: &[usize]) -> Result<Self, String> {
        check_channels(measurement, channels)?;
        let mut notes = Vec::new();
        let table = if let Some(evaluator) = &measurement.evaluator {
            Table::Evaluator(Selected::new(Arc::clone(evaluator), channels)?)
        } else {
            match &measurement.directions {
                Directions::Merl(grid) => {
                    let table = MerlTable::new(measurement, *grid, channels);
                    let sampler = Sampler::new(channels.len(), &[], |wi, wo, out| table.eval(wi, wo, out));
                    Table::Merl(table, sampler)
                }
                Directions::List { wi, wo } => {
                    let table = Scattered::new(measurement, wi, wo, channels, &mut notes)?;
                    let sampler = Sampler::new(channels.len(), &table.breaks(), |wi, wo, out| table.eval(wi, wo, out));
                    Table::Scattered(table, sampler)
                }
            }
        };
        Ok(Self { table, channels: channels.len(), notes })
    }

    /// What the user should know of how the table is read: which symmetry was used, what was left out.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Directional albedo ∫ f(wi, wo) cosθi dωi of every channel, over what was measured: see [`directional_albedo`].
    #[must_use]
    pub fn directional_albedo(&self, wo: DVec3) -> Albedo {
        directional_albedo(self, wo)
    }
}

fn check_channels(measurement: &Measurement, channels: &[usize]) -> Result<(), String> {
    let count = measurement.channels.len();
    if channels.is_empty() {
        return Err("no channel was chosen to render; choose one (grey) or three (red, green, blue)".into());
    }
    match channels.iter().find(|&&c| c >= count) {
        Some(c) => Err(format!("channel {c} was asked for; there are {count}, counted from 0")),
        None => Ok(()),
    }
}

impl Brdf for TableBrdf {
    fn channels(&self) -> usize {
        self.channels
    }

    fn eval(&self, wi: DVec3, wo: DVec3, out: &mut [f64]) -> bool {
        let above = wi.z > 0.0 && wo.z > 0.0;
        let known = above
            && match &self.table {
                Table::Merl(table, _) => table.eval(wi, wo, out),
                Table::Scattered(table, _) => table.eval(wi, wo, out),
                Table::Evaluator(table) => table.eval(wi, wo, out),
            };
        if !known {
            out.fill(0.0);
        }
        known
    }

    fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<Sample> {
        match &self.table {
            Table::Merl(_, sampler) | Table::Scattered(_, sampler) => sampler.sample(wo, u),
            Table::Evaluator(table) => table.brdf.sample(wo, u),
        }
    }

    fn pdf(&self, wi: DVec3, wo: DVec3) -> f64 {
        match &self.table {
            Table::Merl(_, sampler) | Table::Scattered(_, sampler) => sampler.pdf(wi, wo),
            Table::Evaluator(table) => table.brdf.pdf(wi, wo),
        }
    }
}

impl std::fmt::Debug for TableBrdf {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let kind = match &self.table {
            Table::Merl(..) => "MERL grid",
            Table::Scattered(..) => "listed incidences",
            Table::Evaluator(_) => "the format's own evaluation",
        };
        f.debug_struct("TableBrdf")
            .field("kind", &kind)
            .field("channels", &self.channels)
            .field("notes", &self.notes)
            .finish_non_exhaustive()
    }
}

/// Chosen channels of another BRDF.
struct Selected {
    brdf: Arc<dyn Brdf>,
    channels: Vec<usize>,
    /// The chosen channels are all there are, in order: no copy is needed.
    identity: bool,
}

/// Channels that are evaluated without an allocation.
const STACK_CHANNELS: usize = 64;

impl Selected {
    fn new(brdf: Arc<dyn Brdf>, channels: &[usize]) -> Result<Self, String> {
        let count = brdf.channels();
        if let Some(c) = channels.iter().find(|&&c| c >= count) {
            return Err(format!("channel {c} was asked for; the file's own evaluation gives {count}, counted from 0"));
        }
        let identity = channels.len() == count && channels.iter().enumerate().all(|(i, &c)| i == c);
        Ok(Self { brdf, channels: channels.to_vec(), identity })
    }

    fn eval(&self, wi: DVec3, wo: DVec3, out: &mut [f64]) -> bool {
        if self.identity {
            return self.brdf.eval(wi, wo, out);
        }
        let count = self.brdf.channels();
        if count <= STACK_CHANNELS {
            self.eval_through(&mut [0.0; STACK_CHANNELS][..count], wi, wo, out)
        } else {
            self.eval_through(&mut vec![0.0; count], wi, wo, out)
        }
    }

    fn eval_through(&self, all: &mut [f64], wi: DVec3, wo: DVec3, out: &mut [f64]) -> bool {
        let known = self.brdf.eval(wi, wo, all);
        for (value, &c) in out.iter_mut().zip(&self.channels) {
            *value = all[c];
        }
        known
    }
}
