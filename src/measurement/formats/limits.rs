//! The range of the angles of a file. What lies outside is a wrong unit or a wrong column; as an angle it would silently turn
//! into another direction.

use std::f64::consts::{PI, TAU};

use super::text::Line;
use crate::measurement::MeasurementError;

/// The largest magnitude of an angle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limit {
    /// The limit with room for its rounding in single precision.
    with_rounding: f64,
    /// The range, in words.
    range: &'static str,
}

/// θ in degrees; a negative one means θ > 0 at φ + 180°.
pub(super) const POLAR_DEG: Limit = Limit { with_rounding: 180.0001, range: "an angle from −180 to 180 degrees" };
/// φ in degrees, as a difference of azimuths too.
pub(super) const AZIMUTH_DEG: Limit = Limit { with_rounding: 360.0001, range: "an azimuth from −360 to 360 degrees" };
/// θ of the flat world in degrees.
pub(super) const FLAT_POLAR_DEG: Limit = Limit { with_rounding: 90.0, range: "an angle between −90 and 90 degrees" };
/// θ in radians.
pub(super) const POLAR_RAD: Limit = Limit { with_rounding: PI + 1e-5, range: "an angle from −π to π radians" };
/// φ in radians, as a difference of azimuths too.
pub(super) const AZIMUTH_RAD: Limit =
    Limit { with_rounding: TAU + 2e-5, range: "an azimuth from −2π to 2π radians" };

impl Limit {
    /// `angle`, if it lies within the limit; `column` names its place.
    pub(super) fn check(
        self,
        line: Line<'_>,
        column: impl FnOnce() -> String,
        angle: f64,
    ) -> Result<f64, MeasurementError> {
        if angle.abs() <= self.with_rounding {
            return Ok(angle);
        }
        Err(line.invalid(&column(), self.range, angle.to_string()))
    }
}
