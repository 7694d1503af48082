//! A listed table under construction: rows go in one by one, values that can't be a BRDF are masked and counted.

use glam::DVec3;

use super::Quantity;
use crate::measurement::{Dimension, Directions, Masked, Measurement};

/// A direction with |cosθ| up to this counts as on the horizon: 90° written with 15 digits, or as the hypotenuse of two
/// angles, is off by some 10⁻¹⁶ to 10⁻¹⁵ rad, and no goniometer is set to 10⁻¹² rad.
const HORIZON: f64 = 1e-12;

/// Rows of a listed table.
#[derive(Debug)]
pub(super) struct Rows {
    dimension: Dimension,
    quantity: Quantity,
    wi: Vec<DVec3>,
    wo: Vec<DVec3>,
    columns: Vec<Vec<f64>>,
    masked: Masked,
    horizon: Horizon,
}

/// What was masked because a direction is at or below the horizon.
#[derive(Debug, Default)]
struct Horizon {
    values: u64,
    first: Option<String>,
}

/// What a row's stored numbers are divided by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Divisor {
    /// Stored numbers are values.
    One,
    /// cosθo of a quantity BRDF·cosθo.
    Cosine(f64),
    /// At or below the horizon: no BRDF value follows from what is stored.
    None,
}

impl Divisor {
    /// What a row of `quantity` with these directions is divided by.
    pub(super) fn of(quantity: Quantity, wi: DVec3, wo: DVec3) -> Self {
        match quantity {
            _ if wi.z < -HORIZON || wo.z < -HORIZON => Self::None,
            Quantity::Brdf => Self::One,
            Quantity::BrdfCos if wo.z <= HORIZON => Self::None,
            Quantity::BrdfCos => Self::Cosine(wo.z),
        }
    }

    /// `stored` as a BRDF value (1/sr); NaN where none follows.
    pub(super) fn apply(self, stored: f64) -> f64 {
        match self {
            Self::One => stored,
            Self::Cosine(cos_o) => stored / cos_o,
            Self::None => f64::NAN,
        }
    }
}

impl Rows {
    /// No rows yet, `channels` values each, of space.
    pub(super) fn new(channels: usize, quantity: Quantity) -> Self {
        Self::of_world(Dimension::Space, channels, quantity)
    }

    /// No rows yet, `channels` values each. In the flat world the horizon itself is masked: its directions end there.
    pub(super) fn of_world(dimension: Dimension, channels: usize, quantity: Quantity) -> Self {
        Self {
            dimension,
            quantity,
            wi: Vec::new(),
            wo: Vec::new(),
            columns: vec![Vec::new(); channels],
            masked: Masked::default(),
            horizon: Horizon::default(),
        }
    }

    /// Number of rows.
    pub(super) fn len(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// Adds the directions of a row whose values follow, and returns what they are to be divided by.
    pub(super) fn directions(&mut self, wi: DVec3, wo: DVec3) -> Divisor {
        self.wi.push(wi);
        self.wo.push(wo);
        let horizon = self.dimension == Dimension::Flat && (wi.z <= HORIZON || wo.z <= HORIZON);
        if horizon { Divisor::None } else { Divisor::of(self.quantity, wi, wo) }
    }

    /// Adds a value to `channel`: `None` where the file marks it as not measured. `place` is asked for where the value can't
    /// be used.
    pub(super) fn value(
        &mut self,
        channel: usize,
        divisor: Divisor,
        stored: Option<f64>,
        place: impl FnOnce() -> String,
    ) {
        let value = match stored {
            None => {
                self.masked.marked += 1;
                f64::NAN
            }
            Some(stored) if !stored.is_finite() => {
                self.masked.count_not_finite(place);
                f64::NAN
            }
            Some(_) if divisor == Divisor::None => {
                self.masked.marked += 1;
                self.horizon.values += 1;
                self.horizon.first.get_or_insert_with(place);
                f64::NAN
            }
            Some(stored) => divisor.apply(stored),
        };
        if let Some(column) = self.columns.get_mut(channel) {
            column.push(value);
        }
    }

    /// The finished table, its directions listed.
    pub(super) fn finish(mut self, name: String, channels: Vec<String>) -> Measurement {
        let list = Directions::List { wi: std::mem::take(&mut self.wi), wo: std::mem::take(&mut self.wo) };
        self.finish_with(name, channels, list)
    }

    /// The finished table with these `directions`.
    pub(super) fn finish_with(self, name: String, channels: Vec<String>, directions: Directions) -> Measurement {
        let mut measurement = Measurement::new(name, directions, channels, concat(self.columns));
        measurement.dimension = self.dimension;
        measurement.masked = self.masked;
        measurement.notes.extend(self.horizon.first.map(|first| {
            let what = match self.quantity {
                _ if self.dimension == Dimension::Flat => "at the horizon",
                Quantity::Brdf => "below the horizon",
                Quantity::BrdfCos => "at or below the horizon, where BRDF·cosθo gives no BRDF",
            };
            format!("masked as {what}: {} of the values, the first at {first}", self.horizon.values)
        }));
        measurement
    }
}

/// The columns one after the other, with little more memory than they hold.
pub(super) fn concat(columns: Vec<Vec<f64>>) -> Vec<f64> {
    let len: usize = columns.iter().map(Vec::len).sum();
    let mut rest = columns.into_iter();
    let mut all = rest.next().unwrap_or_default();
    all.reserve_exact(len - all.len());
    for column in rest {
        all.extend_from_slice(&column);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::direction_deg;

    #[test]
    fn masks_say_why_and_cosines_are_divided_out() {
        let mut rows = Rows::new(1, Quantity::BrdfCos);
        for (theta_o, stored) in
            [(60.0, Some(0.1)), (90.0, Some(0.1)), (100.0, Some(0.1)), (0.0, Some(f64::INFINITY)), (0.0, None)]
        {
            let divisor = rows.directions(DVec3::Z, direction_deg(theta_o, 0.0));
            rows.value(0, divisor, stored, || format!("θo {theta_o}"));
        }
        let table = rows.finish("t".into(), vec!["value".into()]);
        assert!((table.value(0, 0).expect("valid") - 0.2).abs() < 1e-15);
        assert!((1..5).all(|i| table.value(0, i).is_none()));
        assert_eq!((table.masked.marked, table.masked.not_finite), (3, 1));
        assert_eq!(table.masked.first_not_finite.as_deref(), Some("θo 0"));
        assert_eq!(table.notes.len(), 1);
        assert!(table.notes[0].ends_with(": 2 of the values, the first at θo 90"), "{}", table.notes[0]);
    }

    #[test]
    fn rounding_puts_no_direction_below_the_horizon() {
        let wo = DVec3::new(1.0, 0.0, -1e-16);
        assert_eq!(Divisor::of(Quantity::Brdf, DVec3::Z, wo), Divisor::One);
        assert_eq!(Divisor::of(Quantity::BrdfCos, DVec3::Z, wo), Divisor::None);
        assert_eq!(Divisor::of(Quantity::Brdf, direction_deg(91.0, 0.0), DVec3::Z), Divisor::None);
    }
}
