//! The simulated instrument with all its parts: effects, raw readings, and their reduction.

// Tests may fail loudly.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

mod adaptive;
mod bends;
mod budget;
mod cancels;
mod cones;
mod contributions;
mod coverage;
#[allow(dead_code)] // its study prints more than tests judge
mod experiment;
mod flat;
mod hard;
mod limits;
mod plan;
mod planned;
mod presets;
mod raw;
mod repeats;
mod rows;
mod spot;
mod support;
mod through;
