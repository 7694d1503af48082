//! Where to measure: a scan that tells the parameters of a model as well as a budget of instrument hours allows.
//!
//! In: a model, a prior of its parameters, an instrument, a budget. Out: pairs of directions, each read as often as it is worth, and how precise they
//! and other scans make the parameters. The one decision to know: what counts is information per second of the instrument, averaged
//! over the prior (Bayesian D-optimality: Chaloner & Larntz 1989; Fedorov & Leonov 2013, ch. 5 on cost), of one channel, by readings' own noise. What
//! readings share, positions and the certificate, decides between that scan, the same with each pair's partner across the mirror direction, and an even
//! one, exchanges rows of the surest, and is in the errors that are stated.

mod candidates;
mod exchange;
mod information;
mod optimum;
mod pair;
mod planner;
mod precision;
mod prior;
mod rounding;

pub use planner::{Plan, Wish, plan};
pub use precision::{Precision, QUANTILES, precision, precisions};
pub use prior::{Prior, Range, Wrong};

/// Polar angles beyond this are not planned, degrees: a fit leaves them out too.
pub const MAX_ANGLE_DEG: f64 = 80.0;
