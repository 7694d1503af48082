//! File formats, one file each. Content is sniffed; a name's extension only chooses what to write.

pub mod rgl;

use std::path::Path;

use super::{MeasurementError, MerlAngles};

/// The formats that goniofit reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// MERL `.binary`.
    Merl,
    /// goniofit's CSV.
    Csv,
    /// ALTA text.
    Alta,
    /// RGL tensor file `.bsdf`.
    Rgl,
    /// Zemax `.bsdf` text.
    Zemax,
    /// FRED text.
    Fred,
}

/// Whether a file's values are the BRDF or the BRDF times the cosine of the outgoing direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quantity {
    /// BRDF, 1/sr.
    #[default]
    Brdf,
    /// BRDF · cosθo, 1/sr.
    BrdfCos,
}

/// How to read a file.
#[derive(Debug, Clone, Default)]
pub struct ReadOptions {
    /// Overrides what sniffing finds.
    pub format: Option<Format>,
    /// Overrides what the file says of its quantity.
    pub quantity: Option<Quantity>,
    /// Where in its bin a MERL entry is read.
    pub merl_angles: MerlAngles,
}

/// Reads a measurement.
///
/// # Errors
/// [`MeasurementError`] naming file, place, what was expected and what was found.
pub fn read(path: &Path, options: &ReadOptions) -> Result<super::Measurement, MeasurementError> {
    let _ = options;
    Err(MeasurementError::Unsupported { path: path.into(), reason: "unknown format".into() })
}
