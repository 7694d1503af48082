//! Which directions of the hemisphere were measured, and what is masked there.

use std::f64::consts::TAU;

use crate::geometry::grid::cos_difference;
use crate::geometry::{phi_of, theta_of};
use crate::measurement::{Dimension, Directions, Measurement};
use crate::numeric::sum::map_blocks;
use crate::report::plot::{Disc, DiscCell, Figure, Heading, Scale, Spacing};

/// Readings whose detector lay in one cell of the hemisphere, azimuth counted from the light's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoverageCell {
    /// Polar angles of its borders, degrees.
    pub theta_deg: (f64, f64),
    /// Azimuths of its borders from that of the light, degrees.
    pub phi_deg: (f64, f64),
    /// Valid values (readings × channels).
    pub valid: u64,
    /// Masked ones.
    pub masked: u64,
}

/// The hemisphere in cells.
#[derive(Debug, Clone, PartialEq)]
pub struct Coverage {
    /// All cells, empty ones too.
    pub cells: Vec<CoverageCell>,
    /// Share of the hemisphere's solid angle in cells with a valid value.
    pub covered: f64,
    /// Share of values that are masked, of directions above the horizon.
    pub masked: f64,
    /// Size of a cell, degrees of polar angle and of azimuth.
    pub step_deg: (f64, f64),
}

/// The coverage of a table, over all incidences together; `None` in the flat world.
#[must_use]
pub fn coverage(table: &Measurement) -> Option<Coverage> {
    if table.dimension == Dimension::Flat {
        return None;
    }
    let step = steps(table);
    let grid = cells(step);
    let (theta, columns) = (borders(step.0), turn(step.1).len());
    let counts = map_blocks(table.len(), |block| {
        let mut counts = vec![(0u64, 0u64); grid.len()];
        for i in block {
            let Some((t, p)) = place(table, i) else { continue };
            let row = theta.partition_point(|b| *b <= t).clamp(1, theta.len() - 1) - 1;
            let column = ((p + 0.5 * step.1).rem_euclid(360.0) / step.1) as usize;
            let cell = &mut counts[if row == 0 { 0 } else { 1 + (row - 1) * columns + column.min(columns - 1) }];
            for c in 0..table.channels.len() {
                if table.value(c, i).is_some() { cell.0 += 1 } else { cell.1 += 1 }
            }
        }
        counts
    });
    let mut cells = grid;
    for part in counts {
        for (cell, (valid, masked)) in cells.iter_mut().zip(part) {
            (cell.valid, cell.masked) = (cell.valid + valid, cell.masked + masked);
        }
    }
    let covered = cells.iter().filter(|c| c.valid > 0).map(CoverageCell::solid_angle).sum::<f64>() / TAU;
    let (valid, masked) = cells.iter().fold((0, 0), |(v, m), c| (v + c.valid, m + c.masked));
    Some(Coverage { cells, covered, masked: masked as f64 / (valid + masked).max(1) as f64, step_deg: step })
}

/// Empty cells: the cap about the normal, where azimuth says nothing, then ring by ring.
fn cells((theta, phi): (f64, f64)) -> Vec<CoverageCell> {
    let empty = |theta_deg, phi_deg| CoverageCell { theta_deg, phi_deg, valid: 0, masked: 0 };
    let rings = borders(theta);
    let cap = empty((0.0, rings[1]), (0.0, 360.0));
    let others = rings[1..].windows(2).flat_map(|ring| turn(phi).into_iter().map(|phi| empty((ring[0], ring[1]), phi)));
    std::iter::once(cap).chain(others).collect()
}

impl CoverageCell {
    /// Its solid angle, sr.
    #[must_use]
    pub fn solid_angle(&self) -> f64 {
        let ring = cos_difference(self.theta_deg.0.to_radians(), self.theta_deg.1.to_radians());
        ring * (self.phi_deg.1 - self.phi_deg.0).to_radians()
    }
}

/// (θo, azimuth from that of the light) of an entry above the horizon, degrees; at normal incidence the light counts as from azimuth 180°.
fn place(table: &Measurement, i: usize) -> Option<(f64, f64)> {
    let (wi, wo) = table.directions.pair(i);
    if !(wi.z > 0.0 && wo.z > 0.0) {
        return None;
    }
    let light = if theta_of(wi) < 1e-9 { std::f64::consts::PI } else { phi_of(wi) };
    Some((theta_of(wo).to_degrees(), (phi_of(wo) - light).to_degrees().rem_euclid(360.0)))
}

/// Steps of polar angle and azimuth, degrees: those of the scan where it is regular, else 5° and 10°.
fn steps(table: &Measurement) -> (f64, f64) {
    let Directions::List { .. } = &table.directions else { return (5.0, 10.0) };
    let places: Vec<(f64, f64)> = (0..table.len()).filter_map(|i| place(table, i)).collect();
    let own = |pick: fn(&(f64, f64)) -> f64| {
        let mut angles: Vec<i64> = places.iter().map(|p| (pick(p) * 1e3).round() as i64).collect();
        angles.sort_unstable();
        angles.dedup();
        let mut gaps: Vec<i64> = angles.windows(2).map(|p| p[1] - p[0]).collect();
        gaps.sort_unstable();
        (angles.len() <= 80).then(|| gaps.get(gaps.len() / 2).map(|g| *g as f64 * 1e-3)).flatten()
    };
    let polar = own(|p| p.0).unwrap_or(5.0).clamp(4.0, 15.0);
    // An azimuth's cells divide the turn.
    let azimuth = own(|p| p.1).unwrap_or(10.0).clamp(5.0, 30.0);
    (polar, 360.0 / (360.0 / azimuth).round())
}

/// Borders about the multiples of a step, so that these stand in the middle of cells.
fn borders(step: f64) -> Vec<f64> {
    let inner = (0..).map(|k| (f64::from(k) + 0.5) * step).take_while(|t| *t < 90.0 - 1e-9);
    std::iter::once(0.0).chain(inner).chain(std::iter::once(90.0)).collect()
}

fn turn(step: f64) -> Vec<(f64, f64)> {
    let count = (360.0 / step).round() as usize;
    (0..count).map(|k| ((k as f64 - 0.5) * step, (k as f64 + 0.5) * step)).collect()
}

/// Where values are masked, as a figure: their share in each cell, per cent.
#[must_use]
pub fn masked_figure(coverage: &Coverage, titled: bool) -> Figure {
    let cell = |c: &CoverageCell| DiscCell {
        theta_deg: c.theta_deg,
        phi_deg: (c.phi_deg.0 + 180.0, c.phi_deg.1 + 180.0),
        value: 100.0 * c.masked as f64 / (c.valid + c.masked) as f64,
    };
    let disc = Disc {
        heading: Heading {
            title: "Masked values".into(),
            description: format!("{:.3} % of the values above the horizon are masked.", 100.0 * coverage.masked),
            drawn: titled,
        },
        cells: coverage.cells.iter().filter(|c| c.valid + c.masked > 0).map(cell).collect(),
        scale: Scale::linear(0.0, 100.0),
        color_label: "masked [%]".into(),
        incidences_deg: Vec::new(),
        width: 420.0,
    };
    disc.figure()
}

/// The coverage as a figure: how many valid values each cell has, on a logarithmic scale. The light comes from the left.
#[must_use]
pub fn coverage_figure(coverage: &Coverage, incidences_deg: &[f64], titled: bool) -> Figure {
    let counts = || coverage.cells.iter().map(|c| c.valid).filter(|n| *n > 0);
    let (least, most) = (counts().min().unwrap_or(1) as f64, counts().max().unwrap_or(1) as f64);
    // Counts that hardly differ look alike.
    let (least, most) = if most < 2.0 * least { (least / 3.0, most * 3.0) } else { (least, most) };
    let cells = coverage.cells.iter().filter(|c| c.valid > 0);
    let cell = |c: &CoverageCell| DiscCell {
        theta_deg: c.theta_deg,
        // The light's own side, azimuth 0 from it, is drawn on the left.
        phi_deg: (c.phi_deg.0 + 180.0, c.phi_deg.1 + 180.0),
        value: c.valid as f64,
    };
    let disc = Disc {
        heading: Heading {
            title: "Where the detector stood".into(),
            description: format!(
                "Directions seen from above, the light from the left, each cell as large as its solid angle: {:.1} % of the hemisphere has valid \
                 readings.",
                100.0 * coverage.covered
            ),
            drawn: titled,
        },
        cells: cells.map(cell).collect(),
        scale: Scale { low: least, high: most, spacing: Spacing::Log },
        color_label: "values".into(),
        incidences_deg: incidences_deg.to_vec(),
        width: 420.0,
    };
    disc.figure()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::direction_deg;

    fn listed(pairs: impl Iterator<Item = (f64, f64, f64)>) -> Measurement {
        let (wi, wo): (Vec<_>, Vec<_>) =
            pairs.map(|(ti, to, po)| (direction_deg(ti, 180.0), direction_deg(to, po))).unzip();
        let values = vec![1.0; wi.len()];
        Measurement::new("t", Directions::List { wi, wo }, vec!["x".into()], values)
    }

    #[test]
    fn cells_add_up_to_the_hemisphere_and_a_cap_covers_its_share() {
        let all = (0..=17).flat_map(|t| (0..36).map(move |p| (30.0, 5.0 * f64::from(t), 10.0 * f64::from(p))));
        let cover = coverage(&listed(all.clone())).expect("of space");
        let total: f64 = cover.cells.iter().map(CoverageCell::solid_angle).sum();
        assert!((total / TAU - 1.0).abs() < 1e-12, "{total}");
        // 85° ± 2.5° is the last ring: nothing lies in the one from 87.5°.
        let want = 1.0 - 87.5f64.to_radians().cos();
        assert!((cover.covered - want).abs() < 1e-9, "{} vs {want}", cover.covered);
        let cap = coverage(&listed(all.filter(|(_, t, _)| *t <= 30.0))).expect("of space");
        let want = 1.0 - 32.5f64.to_radians().cos();
        assert!((cap.covered - want).abs() < 1e-9, "{} vs {want}", cap.covered);
    }

    #[test]
    fn masked_values_are_counted_where_they_are() {
        let mut table =
            listed([(30.0, 0.0, 0.0), (30.0, 40.0, 0.0), (30.0, 40.0, 90.0), (30.0, 95.0, 0.0)].into_iter());
        table.values[1] = f64::NAN;
        let cover = coverage(&table).expect("of space");
        assert!((cover.masked - 1.0 / 3.0).abs() < 1e-12, "{}", cover.masked);
        let masked: Vec<_> = cover.cells.iter().filter(|c| c.masked > 0).collect();
        assert_eq!(masked.len(), 1);
        // Azimuth 0 from a light at 180° is the mirror side, 180° away.
        assert!(masked[0].phi_deg.0 < 180.0 && masked[0].phi_deg.1 > 180.0, "{masked:?}");
    }
}
