//! `goniofit fit`: an analytic model for each measurement.

mod args;
mod plan;
mod print;
mod run;
mod shared;

pub(super) use args::{Args, parse_loss, parse_share, parse_time, parse_tolerance};
pub(super) use print::plus_minus;
pub(super) use run::run;
pub(super) use shared::{MODEL, Shared};
