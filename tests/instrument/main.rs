//! The simulated instrument with all its parts: effects, raw readings, and their reduction.

// Tests may fail loudly.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

mod coverage;
mod limits;
mod plan;
mod planned;
mod raw;
mod support;
