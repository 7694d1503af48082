//! The simulated instrument with all its parts: effects, raw readings, and their reduction.

// Tests may fail loudly.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

mod cones;
mod contributions;
mod coverage;
mod flat;
mod limits;
mod raw;
mod support;
mod through;
