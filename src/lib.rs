//! goniofit: a toolkit for measured BRDFs.
//!
//! The rooms stand in the order in which data flow.

pub mod brdf;
pub mod chain;
pub mod cli;
pub mod control;
pub mod fit;
pub mod geometry;
pub mod gonio;
pub mod image;
pub mod measurement;
pub mod numeric;
pub mod radiometry;
pub mod render;
pub mod report;
pub mod tradeoff;
