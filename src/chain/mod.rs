//! The rooms joined: from what a user names to materials, from materials to measurements, from measurements and fits to
//! pictures and the numbers in which they differ.
//!
//! In: names, files, options. Out: files in one folder, and the numbers behind them. The one decision to know: pictures that are
//! compared use the same scene and samples but seeds of their own, so that their errors are independent and a test of their
//! difference means what it says.

mod demo;
mod error;
mod gallery;
mod lean;
mod library;
mod measure;
mod output;
mod pictures;
mod scatter;
mod scene_effects;
mod source;
mod surrogate;

pub use demo::{Demo, DemoFit, DemoOptions, NOISY_DETECTOR, demo};
pub use error::ChainError;
pub use gallery::{Gallery, Shown, write_gallery};
pub use library::{BuiltInMaterial, MATERIALS};
pub use measure::{measure, measure_raw, reduced, reduced_until, tabulate, with_job};
pub use pictures::{Stage, picture, picture_of, scene};
pub use scatter::{Scatter, integrated_scatter};
pub use scene_effects::{SceneEffect, SceneEffects, scene_effects, scene_plan};
pub use source::{Source, load, load_material, render_material, shown_channels};
