//! What accuracy costs in time: knobs of the fit, the tracer, the instrument and the whole chain are swept, and time and error measured.
//!
//! In: what is to be done (a table, a scene, a simulation) and the settings to try. Out: a [`Sweep`] of curves with 95 % intervals, their slopes
//! beside those of theory, the Pareto front, and [`advise`], which turns a curve into the setting for a wanted error or time. Times are in
//! seconds, errors are relative. The one decision to know: an error is always one against a reference that was made better than anything that
//! is measured with it, and how good the reference itself is stands in the result; a setting with a trial that comes near to that has no error.

mod advise;

pub mod chain;
mod csv;
mod curve;
mod design;
pub mod fit;
mod front;
mod knob;
pub mod render;
pub mod simulate;

mod sweep;

pub use advise::{Advice, Adviser, Forecast, NoAdvice, Wish, advise};
pub use csv::to_csv;
pub use curve::{Curve, Point, Slope, Sweep};
pub use design::{Cost, Law, Measure, Series, Setting, Theory};
pub use front::Standing;
pub use knob::Knob;
pub use sweep::{Effort, Trial};
