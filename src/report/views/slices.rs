//! Reflectance in the plane of incidence, of a table and of its fits.
//!
//! Directions in the plane have signed angles: the light comes from −θi (drawn on the left), its mirror direction is +θi.

use glam::{DVec2, DVec3};

use super::{Peak, Predicted, peak};
use crate::brdf::Brdf;
use crate::geometry::angles::direction_deg;
use crate::geometry::theta_of;
use crate::measurement::{Dimension, Directions, Measurement, TableBrdf};
use crate::report::plot::{Axis, Chart, Figure, Heading, LegendPlace, Marks, Point, PolarChart, Scale, Series};
use crate::report::words::number;

/// How far a reading may lie out of the plane, and off the incidence asked for, as a direction cosine: about 0.06°.
const TOLERANCE: f64 = 1e-3;
/// Fewer readings in a plane are no curve.
const FEWEST: usize = 5;

/// Values over signed angles in the plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Whose.
    pub name: String,
    /// Whether they are readings, drawn as dots.
    pub readings: bool,
    /// Its colour, as [`Series::color`].
    pub color: usize,
    /// Angles, degrees, rising.
    pub theta_o_deg: Vec<f64>,
    /// Values, channel by channel, 1/sr (1/rad in the flat world); NaN where nothing is known.
    pub values: Vec<Vec<f64>>,
    /// 1 σ of the values, where known.
    pub sigma: Option<Vec<Vec<f64>>>,
}

/// All curves of an incidence.
#[derive(Debug, Clone, PartialEq)]
pub struct Slice {
    /// θi, degrees.
    pub incidence_deg: f64,
    /// The table's curve first, where it has one.
    pub curves: Vec<Curve>,
}

/// What a slice is taken of.
pub struct Shown<'a> {
    /// The table, and what interpolates it, where that can be.
    pub table: Option<(&'a Measurement, Option<&'a TableBrdf>)>,
    /// Materials with names and colours.
    pub materials: Vec<(String, &'a Predicted, usize)>,
}

/// Incidences to show: the table's own, at most `most`, evenly picked, or every 15° to 75°.
#[must_use]
pub fn incidences(table: Option<&Measurement>, most: usize) -> Vec<f64> {
    let own = table.and_then(|t| t.summary().incidences_deg).unwrap_or_default();
    let own: Vec<f64> = own.into_iter().filter(|t| *t < 85.0).collect();
    match own.len() {
        0 => vec![0.0, 15.0, 30.0, 45.0, 60.0, 75.0],
        n if n <= most => own,
        // First and last, and what lies evenly between.
        n => (0..most).map(|k| own[k * (n - 1) / (most - 1).max(1)]).collect(),
    }
}

/// The channel to show first: `g`, or the middle one.
#[must_use]
pub fn default_channel(channels: &[String]) -> usize {
    let green = channels.iter().position(|c| c.eq_ignore_ascii_case("g") || c.eq_ignore_ascii_case("green"));
    green.unwrap_or(channels.len().saturating_sub(1) / 2)
}

/// The curves at an incidence.
#[must_use]
pub fn slice(shown: &Shown<'_>, incidence_deg: f64) -> Slice {
    let flat = shown.table.is_some_and(|(t, _)| t.dimension == Dimension::Flat);
    let table = shown.table.and_then(|(table, brdf)| of_table(table, brdf, incidence_deg));
    let materials = shown.materials.iter().map(|(name, material, color)| {
        let angles = angles(incidence_deg);
        let pairs: Vec<_> = angles.iter().map(|t| pair(incidence_deg, *t)).collect();
        let flat = flat || material.material().is_flat();
        debug_assert!(flat == material.material().is_flat());
        Curve {
            name: name.clone(),
            readings: false,
            color: *color,
            values: material.values(&pairs),
            theta_o_deg: angles,
            sigma: None,
        }
    });
    Slice { incidence_deg, curves: table.into_iter().chain(materials).collect() }
}

/// (wi, wo) of a signed angle in the plane.
fn pair(incidence_deg: f64, theta_o_deg: f64) -> (DVec3, DVec3) {
    (direction_deg(-incidence_deg, 0.0), direction_deg(theta_o_deg, 0.0))
}

/// Angles of a curve: every degree, and closer where the mirror direction is, as sharp lobes need.
fn angles(incidence_deg: f64) -> Vec<f64> {
    let near = [0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.2, 1.5, 1.8, 2.2, 2.6, 3.2, 4.5];
    let near = near.iter().flat_map(|d| [incidence_deg - d, incidence_deg + d]).chain([incidence_deg]);
    let mut all: Vec<f64> = (-89..=89).map(f64::from).chain(near).filter(|t| t.abs() < 90.0).collect();
    all.sort_by(f64::total_cmp);
    all.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    all
}

/// The readings in the plane, else the table interpolated.
fn of_table(table: &Measurement, brdf: Option<&TableBrdf>, incidence_deg: f64) -> Option<Curve> {
    readings(table, incidence_deg).or_else(|| interpolated(table, brdf?, incidence_deg))
}

fn readings(table: &Measurement, incidence_deg: f64) -> Option<Curve> {
    let Directions::List { wi, wo } = &table.directions else { return None };
    let mut found: Vec<(f64, usize)> = Vec::new();
    for (i, (wi, wo)) in wi.iter().zip(wo).enumerate() {
        let off = (theta_of(*wi) - incidence_deg.to_radians()).abs();
        if off < TOLERANCE
            && wo.z > 0.0
            && let Some(angle) = signed_angle(*wi, *wo)
        {
            found.push((angle.to_degrees(), i));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let channels = 0..table.channels.len();
    let known = found.iter().filter(|(_, i)| channels.clone().any(|c| table.value(c, *i).is_some())).count();
    if known < FEWEST {
        return None;
    }
    let column = |plane: &[f64]| found.iter().map(|(_, i)| plane[*i]).collect::<Vec<f64>>();
    Some(Curve {
        name: "readings".into(),
        readings: true,
        color: 0,
        theta_o_deg: found.iter().map(|(t, _)| *t).collect(),
        values: channels.clone().map(|c| column(table.plane(c))).collect(),
        sigma: channels.map(|c| table.sigma_plane(c).map(column)).collect(),
    })
}

/// The angle of `wo` (rad) in the plane of `wi` and the normal, positive on the mirror side; `None` out of the plane. At normal incidence the plane
/// is xz, and the light counts as from −x.
fn signed_angle(wi: DVec3, wo: DVec3) -> Option<f64> {
    let side = DVec2::new(wi.x, wi.y);
    let towards = if side.length() > TOLERANCE { side.normalize() } else { DVec2::new(-1.0, 0.0) };
    let across = DVec2::new(wo.x, wo.y);
    (towards.perp_dot(across).abs() < TOLERANCE).then(|| (-towards.dot(across)).atan2(wo.z))
}

fn interpolated(table: &Measurement, brdf: &TableBrdf, incidence_deg: f64) -> Option<Curve> {
    let angles = angles(incidence_deg);
    let channels = table.channels.len();
    let mut values = vec![vec![f64::NAN; angles.len()]; channels];
    let mut one = vec![0.0; channels];
    for (k, theta_o) in angles.iter().enumerate() {
        let (wi, wo) = pair(incidence_deg, *theta_o);
        if brdf.eval(wi, wo, &mut one) {
            values.iter_mut().zip(&one).for_each(|(list, v)| list[k] = *v);
        }
    }
    let any = values.iter().flatten().any(|v| !v.is_nan());
    any.then(|| Curve { name: "table".into(), readings: false, color: 0, theta_o_deg: angles, values, sigma: None })
}

/// A scale for all these slices of a channel: linear from 0, or logarithmic over at most five decades. Their peaks are counted, not stray readings below 0.
#[must_use]
pub fn scale_of(slices: &[Slice], channel: usize, log: bool) -> Scale {
    let values = slices.iter().flat_map(|s| &s.curves).filter_map(|c| c.values.get(channel)).flatten().copied();
    if log { Scale::log_around(values, 5.0) } else { Scale::around(values.map(|v| v.max(0.0))) }
}

/// Curves as a chart over θo.
#[must_use]
pub fn slice_figure(slice: &Slice, channel: usize, name: &str, y: Scale, unit: &str, titled: bool) -> Figure {
    let chart = Chart {
        heading: heading("BRDF over θo", slice, (channel, name), unit, titled),
        x: Axis::new("θo [°], positive on the mirror side", Scale::degrees(-90.0, 90.0)),
        y: Axis::new(format!("BRDF [{unit}]"), y),
        series: series(slice, channel),
        legend: LegendPlace::Below,
        ..Chart::default()
    };
    chart.figure()
}

/// Curves as a polar chart.
#[must_use]
pub fn polar_figure(slice: &Slice, channel: usize, name: &str, scale: Scale, unit: &str, titled: bool) -> Figure {
    let chart = PolarChart {
        heading: heading("Polar chart", slice, (channel, name), unit, titled),
        label: format!("BRDF [{unit}]"),
        scale,
        series: series(slice, channel),
        incidence_deg: Some(slice.incidence_deg),
        legend: true,
        width: 430.0,
    };
    chart.figure()
}

/// Which slice it is, and, for those who can't see the figure, what kind of one and the peak of each curve.
fn heading(kind: &str, slice: &Slice, (channel, name): (usize, &str), unit: &str, drawn: bool) -> Heading {
    let of = format!("θi = {}°, channel {name}", number(slice.incidence_deg));
    // Where it is drawn the kind is seen.
    let title = if drawn { of } else { format!("{kind}, {of}") };
    Heading { title, description: described(slice, channel, unit), drawn }
}

/// The peak of each curve of a channel, in words.
#[must_use]
pub fn described(slice: &Slice, channel: usize, unit: &str) -> String {
    let largest = |curve: &Curve| {
        let Peak { value, theta_o_deg, .. } = peak(curve, channel)?;
        let place = theta_o_deg.map_or_else(String::new, |theta| format!(" at {}°", number(theta)));
        Some(format!("{}: largest {} {unit}{place}", curve.name, number(value)))
    };
    slice.curves.iter().filter_map(largest).collect::<Vec<_>>().join("; ")
}

fn series(slice: &Slice, channel: usize) -> Vec<Series> {
    let of = |curve: &Curve| {
        let bar = |k: usize, y: f64| curve.sigma.as_ref().map(|s| (y - s[channel][k], y + s[channel][k]));
        let values = curve.theta_o_deg.iter().zip(&curve.values[channel]).enumerate();
        let points = values.map(|(k, (&x, &y))| Point { x, y, bar: bar(k, y) }).collect();
        let marks = if curve.readings { Marks::Dots } else { Marks::Line };
        Series { name: curve.name.clone(), marks, points, color: curve.color }
    };
    slice.curves.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::{LobeKind, Material};

    #[test]
    fn readings_out_of_the_plane_or_off_the_incidence_are_left_out_and_signs_are_right() {
        let mut wi = Vec::new();
        let mut wo = Vec::new();
        let mut values = Vec::new();
        // Incidence from azimuth 70°; the mirror side is at 250°.
        for (theta_i, theta_o, phi_o) in [
            (30.0, 30.0, 250.0),
            (30.0, 10.0, 250.0),
            (30.0, 0.0, 0.0),
            (30.0, 20.0, 70.0),
            (30.0, 60.0, 70.0),
            (30.0, 20.0, 75.0),
            (31.0, 20.0, 70.0),
        ] {
            wi.push(direction_deg(theta_i, 70.0));
            wo.push(direction_deg(theta_o, phi_o));
            values.push(theta_o);
        }
        let table = Measurement::new("t", Directions::List { wi, wo }, vec!["x".into()], values);
        let found = readings(&table, 30.0).expect("five readings");
        let want = [-60.0, -20.0, 0.0, 10.0, 30.0];
        assert_eq!(found.theta_o_deg.len(), want.len(), "{found:?}");
        for (angle, want) in found.theta_o_deg.iter().zip(want) {
            assert!((angle - want).abs() < 1e-9, "{angle} vs {want}");
        }
        assert_eq!(found.values[0], [60.0, 20.0, 0.0, 10.0, 30.0]);
        assert!(readings(&table, 31.0).is_none(), "one reading is no curve");
    }

    #[test]
    fn a_fits_curve_peaks_in_the_mirror_direction_with_its_own_value() {
        let material = Material::new(vec!["x".into()], vec![(LobeKind::Phong, vec![0.5], vec![20000.0])]);
        let predicted = Predicted::new(&material, None);
        let shown = Shown { table: None, materials: vec![("fit".into(), &predicted, 1)] };
        let found = slice(&shown, 40.0);
        let values = &found.curves[0].values[0];
        let k = (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b])).expect("some");
        assert!((found.curves[0].theta_o_deg[k] - 40.0).abs() < 1e-9);
        let (wi, wo) = pair(40.0, 40.0);
        assert!((values[k] - material.value(wi, wo)[0]).abs() < 1e-9 * values[k]);
    }

    #[test]
    fn the_tables_own_incidences_are_shown_where_they_are_few() {
        let wi: Vec<DVec3> = (0..18).map(|k| direction_deg(5.0 * f64::from(k), 0.0)).collect();
        let table = Measurement::new("t", Directions::List { wo: wi.clone(), wi }, vec!["x".into()], vec![1.0; 18]);
        assert_eq!(
            incidences(Some(&table), 6),
            [0.0, 15.0, 30.0, 45.0, 60.0, 80.0].map(|t: f64| if t == 45.0 { 45.0 } else { t })
        );
        assert_eq!(incidences(None, 6), [0.0, 15.0, 30.0, 45.0, 60.0, 75.0]);
    }
}
