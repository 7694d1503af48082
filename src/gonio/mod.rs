//! The simulated gonioreflectometer.
//!
//! In: a true BRDF, an [`Instrument`], a [`Scan`], a seed. Out: a [`crate::measurement::Measurement`] in 1/sr with its σ, by way of [`Raw`]
//! readings where the instrument has more to it than a noisy detector ([`Job`], [`reduce`]). The one decision to know: a reading's noise is keyed by
//! (seed, channel, position in the scan), so it depends on neither threads nor order; an instrument's own errors are keyed by the seed.

mod actual;
mod adaptive;
mod afford;
mod contribution;
mod cost;
pub mod design;
mod effects;
mod forward;
mod idle;
mod instrument;
pub mod parts;
mod presets;
mod raw;
mod raw_file;
mod reading;
mod reduce;
mod scan;
mod scan_name;
mod series;
pub mod sight;
mod simulate;
mod spare;
mod spec;
mod spot;
mod travel;

pub use actual::Actual;
pub use adaptive::{Adaptive, Look, adapt, least_step_deg};
pub use afford::{Affordable, Deadline};
pub use contribution::{Change, Contribution, Contributions};
pub use cost::{hours, seconds};
pub(crate) use effects::tilt::frame as lean;
pub use effects::{means, plan};
pub use forward::{ACCURACY, Job, MOST_ORDER, lit_rows};
pub use idle::idle;
pub use instrument::Instrument;
pub use presets::{PRESETS, Preset};
pub use raw::Raw;
pub use raw_file::described;
pub use reading::{Kind, Reading};
pub use reduce::{Budget, Line, ReduceError, Reduction, Type, reduce};
pub use scan::{MOST_ENTRIES, Scan, hemisphere_pairs};
pub use scan_name::ScanError;
pub use series::{MOST_READINGS, readings, series, too_many};
pub use simulate::{Truth, simulate};
pub use spare::Spared;
pub use spec::{SimulationSpec, SpecError};
