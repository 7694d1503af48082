//! Measurements: the table, its weights and masks, its file formats, its use as a BRDF.
//!
//! In: files, or readings reduced by [`crate::gonio`]. Out: [`Measurement`], with directions in the local frame and values in
//! 1/sr (1/rad in the flat world). The one decision to know: a masked value is stored as NaN, in its own channel; what a file
//! masks is counted in [`Masked`], why an instrument's reduction does stands in `reasons`; whoever reads values asks [`Measurement::value`], which returns an `Option`.

pub mod error;
pub mod formats;
pub mod interpolate;
pub mod merl_grid;
pub mod reason;
pub mod summary;
pub mod table;

/// How the note begins that says that a measurement ends before its scan does; unlike other notes it is kept in CSV files (`# note:`).
pub const STOPPED: &str = "stopped after ";

pub use error::MeasurementError;
pub use formats::{Format, Quantity, ReadOptions};
pub use interpolate::{Albedo, TableBrdf, directional_albedo};
pub use merl_grid::{MerlAngles, MerlGrid};
pub use reason::MaskReason;
pub use summary::Summary;
pub use table::{Dimension, Directions, Masked, Measurement, Weights};
