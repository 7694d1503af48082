//! Integrated scatter of a table: what share of the light from an incidence it sends anywhere.

use serde::Serialize;

use crate::geometry::direction;
use crate::measurement::interpolate::TableBrdf;
use crate::measurement::{Dimension, Measurement};

/// Integrated scatter at one incidence.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scatter {
    /// θi, degrees.
    pub theta_i_deg: f64,
    /// ∫ f cosθo dωo over what was measured, channel by channel.
    pub scatter: Vec<f64>,
    /// The measured share of the hemisphere, ∫ cosθo dωo / π.
    pub covered: f64,
}

/// Incidences looked at on a grid that has its own everywhere.
const INCIDENCES_DEG: [f64; 6] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0];

/// Incidences above this are left out, degrees: f grows like 1/cosθ there, and few tables are good for it.
const GRAZING_DEG: f64 = 85.0;

/// Integrated scatter at the table's own incidences (at most 8 of them, evenly picked), or every 15° on a grid.
///
/// # Errors
/// The reason, where the table can't be interpolated over the hemisphere.
pub fn integrated_scatter(table: &Measurement) -> Result<Vec<Scatter>, String> {
    if table.dimension == Dimension::Flat {
        return Err("a measurement of the flat world has no hemisphere".into());
    }
    let all: Vec<usize> = (0..table.channels.len()).collect();
    let brdf = TableBrdf::new(table, &all).map_err(|e| match e {
        crate::measurement::MeasurementError::Unsupported { reason, .. } => reason,
        other => other.to_string(),
    })?;
    let own = table.summary().incidences_deg.unwrap_or_else(|| INCIDENCES_DEG.to_vec());
    let step = own.len().div_ceil(8).max(1);
    let at = |theta_deg: &f64| {
        let albedo = brdf.directional_albedo(direction(theta_deg.to_radians(), 0.0));
        Scatter { theta_i_deg: *theta_deg, scatter: albedo.per_channel, covered: albedo.covered }
    };
    Ok(own.iter().step_by(step).filter(|t| **t <= GRAZING_DEG).map(at).collect())
}
