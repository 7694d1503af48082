//! The hard cases of the fit: where other fits break, each with a test of its own.
#![allow(clippy::expect_used, clippy::panic)] // these are tests
#![allow(clippy::neg_cmp_op_on_partial_ord)] // a NaN must fail: !(off <= bound)

mod asked;
mod coverage;
mod degenerate;
#[allow(dead_code)] // the bench uses all of it
mod experiment;
mod hard;
mod invariance;
mod narrow;
mod optimum;
mod profile;
mod properties;
mod recovery;
mod reference;
mod robust;
mod said;
mod support;
