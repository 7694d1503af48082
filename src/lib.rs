//! goniofit: a toolkit for measured BRDFs.
//!
//! The rooms stand in the order in which data flow.

pub mod brdf;
pub mod control;
pub mod geometry;
pub mod measurement;
pub mod numeric;
pub mod radiometry;
