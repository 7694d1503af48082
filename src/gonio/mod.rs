//! The simulated gonioreflectometer.
//!
//! In: a true BRDF, an [`Instrument`], a [`Scan`], a seed. Out: a [`crate::measurement::Measurement`] in 1/sr with its σ. The one decision to
//! know: a reading's noise is keyed by (seed, channel, position in the scan), so it depends on neither threads nor order.

mod instrument;
mod scan;
mod simulate;
mod spec;

pub use instrument::Instrument;
pub use scan::{Scan, ScanError};
pub use simulate::{Truth, simulate};
pub use spec::{SimulationSpec, SpecError};
