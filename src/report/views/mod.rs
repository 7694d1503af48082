//! What figures show, computed: curves in the plane of incidence, residuals in bins, covered directions, reflected light.

mod coverage;
mod energy;
mod peak;
mod predict;
mod residuals;
mod slices;
mod sweep;

pub use coverage::{Coverage, CoverageCell, coverage, coverage_figure, masked_figure};
pub use energy::{AlbedoCurve, albedo_curves, energy_figure};
pub use peak::{Peak, peak};
pub use predict::Predicted;
pub use residuals::{Binned, ResidualMaps, Statistic, residual_figure, residual_maps, residual_range};
pub use slices::{
    Curve, Shown, Slice, default_channel, described, incidences, polar_figure, scale_of, slice, slice_figure,
};
pub use sweep::{Interval, Law, Sweep, SweepCurve, SweepPlot, SweepSlope, TriedSetting};
