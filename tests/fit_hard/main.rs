//! The hard cases of the fit: where other fits break, each with a test of its own.
#![allow(clippy::expect_used, clippy::panic)] // these are tests

mod asked;
mod coverage;
mod degenerate;
mod experiment;
mod hard;
mod invariance;
mod optimum;
mod properties;
mod recovery;
mod reference;
mod support;
