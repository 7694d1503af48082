//! How much of the light is reflected, by a table and by its fits.

use crate::brdf::Material;
use crate::chain::Scatter;
use crate::report::plot::{Axis, Chart, Figure, Heading, Marks, Point, Scale, Series};

/// Directional albedo of something, channel by channel.
#[derive(Debug, Clone, PartialEq)]
pub struct AlbedoCurve {
    /// Whose.
    pub name: String,
    /// Its colour, as [`Series::color`].
    pub color: usize,
    /// Whether it is measured, at the incidences of a table.
    pub measured: bool,
    /// Polar angles of incidence, degrees.
    pub theta_deg: Vec<f64>,
    /// Albedo there, channel by channel.
    pub albedo: Vec<Vec<f64>>,
}

/// The albedo of a table's incidences whose hemisphere is covered to at least 90 %, and of materials at every degree.
#[must_use]
pub fn albedo_curves(table: Option<&[Scatter]>, materials: &[(String, &Material, usize)]) -> Vec<AlbedoCurve> {
    let known: Vec<&Scatter> = table.into_iter().flatten().filter(|s| s.covered >= 0.9).collect();
    let channels = known.first().map_or(0, |s| s.scatter.len());
    let measured = AlbedoCurve {
        name: "table".into(),
        color: 0,
        measured: true,
        theta_deg: known.iter().map(|s| s.theta_i_deg).collect(),
        albedo: (0..channels).map(|c| known.iter().map(|s| s.scatter[c]).collect()).collect(),
    };
    let of = |(name, material, color): &(String, &Material, usize)| {
        let theta_deg: Vec<f64> = (0..90).map(f64::from).collect();
        let rows: Option<Vec<Vec<f64>>> =
            theta_deg.iter().map(|t| material.directional_albedo(t.to_radians())).collect();
        let rows = rows?;
        let albedo = (0..material.channels.len()).map(|c| rows.iter().map(|row| row[c]).collect()).collect();
        Some(AlbedoCurve { name: name.clone(), color: *color, measured: false, theta_deg, albedo })
    };
    let first = (!known.is_empty()).then_some(measured);
    first.into_iter().chain(materials.iter().filter_map(of)).collect()
}

/// The curves of a channel as a chart.
#[must_use]
pub fn energy_figure(curves: &[AlbedoCurve], channel: usize, name: &str, titled: bool) -> Figure {
    let of = |curve: &AlbedoCurve| {
        let values = curve.theta_deg.iter().zip(curve.albedo.get(channel).map_or(&[][..], Vec::as_slice));
        Series {
            name: curve.name.clone(),
            marks: if curve.measured { Marks::Dots } else { Marks::Line },
            points: values.map(|(x, y)| Point::new(*x, *y)).collect(),
            color: curve.color,
        }
    };
    let series: Vec<Series> = curves.iter().map(of).collect();
    let largest = series.iter().flat_map(|s| &s.points).map(|p| p.y).fold(0.0, f64::max);
    let chart = Chart {
        heading: Heading {
            title: format!("Reflected share, {name}"),
            description: format!("Directional albedo over the angle of incidence; the largest is {largest:.3}."),
            drawn: titled,
        },
        x: Axis::new("θi [°]", Scale::degrees(0.0, 90.0)),
        y: Axis::new("directional albedo", Scale::around(series.iter().flat_map(|s| &s.points).map(|p| p.y))),
        series,
        size: (430.0, 290.0),
        ..Chart::default()
    };
    chart.figure()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::LobeKind;

    #[test]
    fn a_diffuse_materials_curve_is_flat_and_uncovered_incidences_are_left_out() {
        let material = Material::new(vec!["x".into()], vec![(LobeKind::Lambert, vec![0.4], vec![])]);
        let scatter = |theta_i_deg: f64, covered: f64| Scatter { theta_i_deg, scatter: vec![0.39], covered };
        let table = [scatter(0.0, 0.99), scatter(30.0, 0.5), scatter(60.0, 0.95)];
        let curves = albedo_curves(Some(&table), &[("fit".into(), &material, 1)]);
        assert_eq!(curves[0].theta_deg, [0.0, 60.0]);
        assert!(curves[1].albedo[0].iter().all(|a| (a - 0.4).abs() < 1e-12));
    }
}
