//! Residuals in bins of angles: where a fit is off, and which way.

use glam::DVec3;

use super::Predicted;
use crate::fit::{Datum, Loss};
use crate::geometry::{HalfDiff, theta_of};
use crate::image::ColorMap;
use crate::measurement::{Dimension, Directions, Measurement};
use crate::numeric::sum::map_blocks;
use crate::report::plot::{Figure, HeatMap, Scale};

/// Sums over the residuals of each cell of a grid over two angles.
#[derive(Debug, Clone, PartialEq)]
pub struct Binned {
    /// Borders of the columns, degrees.
    pub x_deg: Vec<f64>,
    /// Borders of the rows, degrees.
    pub y_deg: Vec<f64>,
    /// Values in each cell, row by row.
    pub count: Vec<u64>,
    /// Σ w.
    pub weight: Vec<f64>,
    /// Σ w r.
    pub sum: Vec<f64>,
    /// Σ w r².
    pub squares: Vec<f64>,
    /// Σ w² r²: the variance of Σ w r, were r nothing but independent noise.
    pub variance: Vec<f64>,
}

/// What a cell shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Statistic {
    /// Σ w r / Σ w: which way the fit is off.
    Mean,
    /// √(Σ w r² / Σ w): how far.
    Rms,
    /// Σ w r / √(Σ w² r²): the mean over its own error. Noise alone gives numbers like those of a normal distribution, about 1.
    OverNoise,
}

impl Statistic {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Mean, Self::Rms, Self::OverNoise];

    /// Its name in options and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::Rms => "rms",
            Self::OverNoise => "over-noise",
        }
    }
}

/// The residuals of a fit, over two pairs of angles.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualMaps {
    /// Over θh (columns) and θd; none in the flat world.
    pub half_diff: Option<Binned>,
    /// Over θi (columns) and θo, the latter positive on the mirror side.
    pub in_out: Binned,
    /// Values counted.
    pub count: u64,
    /// √(Σ w r² / Σ w) over all of them.
    pub rmse: f64,
    /// Unit of r, empty where it has none.
    pub unit: &'static str,
}

impl Binned {
    fn new(x_deg: Vec<f64>, y_deg: Vec<f64>) -> Self {
        let cells = (x_deg.len() - 1) * (y_deg.len() - 1);
        let zero = vec![0.0; cells];
        Self {
            x_deg,
            y_deg,
            count: vec![0; cells],
            weight: zero.clone(),
            sum: zero.clone(),
            squares: zero.clone(),
            variance: zero,
        }
    }

    fn cell(&self, x: f64, y: f64) -> Option<usize> {
        let find = |borders: &[f64], v: f64| {
            let k = borders.partition_point(|b| *b <= v);
            // The last border belongs to the last cell.
            let k = if k == borders.len() && v <= borders[k - 1] + 1e-9 { k - 1 } else { k };
            (k > 0 && k < borders.len()).then(|| k - 1)
        };
        Some(find(&self.y_deg, y)? * (self.x_deg.len() - 1) + find(&self.x_deg, x)?)
    }

    fn add(&mut self, cell: usize, weight: f64, r: f64) {
        self.count[cell] += 1;
        self.weight[cell] += weight;
        self.sum[cell] += weight * r;
        self.squares[cell] += weight * r * r;
        self.variance[cell] += (weight * r).powi(2);
    }

    fn join(&mut self, other: &Self) {
        self.count.iter_mut().zip(&other.count).for_each(|(a, b)| *a += b);
        for (a, b) in [
            (&mut self.weight, &other.weight),
            (&mut self.sum, &other.sum),
            (&mut self.squares, &other.squares),
            (&mut self.variance, &other.variance),
        ] {
            a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        }
    }

    /// What each cell shows; `None` where it is empty.
    #[must_use]
    pub fn values(&self, statistic: Statistic) -> Vec<Option<f64>> {
        let of = |i: usize| match statistic {
            Statistic::Mean => self.sum[i] / self.weight[i],
            Statistic::Rms => (self.squares[i] / self.weight[i]).sqrt(),
            Statistic::OverNoise if self.variance[i] > 0.0 => self.sum[i] / self.variance[i].sqrt(),
            Statistic::OverNoise => 0.0,
        };
        (0..self.count.len()).map(|i| (self.weight[i] > 0.0).then(|| of(i))).collect()
    }
}

/// Bins the residuals of a fit over all valid readings with both angles up to `max_angle_deg`, weighted as the fit's `weights` say (`solid-angle`,
/// else alike), each channel counting alike. The loss is that of the fit's record; a robust fit's outliers count in full.
#[must_use]
pub fn residual_maps(table: &Measurement, fit: &Predicted, max_angle_deg: f64) -> ResidualMaps {
    let record = fit.material().fit.clone().unwrap_or_default();
    let loss = Loss::from_name(&record.loss).unwrap_or_default();
    let judge = Judge {
        table,
        fit,
        loss,
        epsilon: &record.relative_epsilon,
        max_angle_deg,
        by_area: record.weights != "uniform",
    };
    let bins = Bins::of(table);
    let parts = map_blocks(table.len(), |block| judge.bin(block, &bins));
    let (mut maps, mut totals) = (bins.empty(table.channels.len()), Totals::default());
    for (part, found) in parts {
        maps.iter_mut().zip(&part).for_each(|(all, part)| all.join(part));
        totals.join(found);
    }
    let [half_diff, in_out] = joined(maps, table.channels.len(), &totals);
    let squares: f64 = in_out.squares.iter().sum();
    let weight: f64 = in_out.weight.iter().sum();
    ResidualMaps {
        half_diff: (table.dimension == Dimension::Space).then_some(half_diff),
        count: in_out.count.iter().sum(),
        in_out,
        rmse: (squares / weight).sqrt(),
        unit: loss.unit(table.dimension),
    }
}

/// Σw and count, channel by channel.
#[derive(Default)]
struct Totals(Vec<(f64, u64)>);

impl Totals {
    fn join(&mut self, other: Self) {
        if self.0.is_empty() {
            self.0 = other.0;
            return;
        }
        self.0.iter_mut().zip(other.0).for_each(|(a, b)| *a = (a.0 + b.0, a.1 + b.1));
    }
}

/// The channels' maps as one, Σw of each being its number of values.
fn joined(maps: Vec<Binned>, channels: usize, totals: &Totals) -> [Binned; 2] {
    let mut all: Option<[Binned; 2]> = None;
    let mut maps = maps.into_iter();
    for c in 0..channels {
        let (weight, count) = totals.0.get(c).copied().unwrap_or_default();
        let factor = if weight > 0.0 { count as f64 / weight } else { 0.0 };
        let scaled = |mut map: Binned| {
            for list in [&mut map.weight, &mut map.sum, &mut map.squares] {
                list.iter_mut().for_each(|x| *x *= factor);
            }
            map.variance.iter_mut().for_each(|x| *x *= factor * factor);
            map
        };
        let (Some(first), Some(second)) = (maps.next(), maps.next()) else { break };
        let pair = [scaled(first), scaled(second)];
        match &mut all {
            None => all = Some(pair),
            Some(all) => all.iter_mut().zip(&pair).for_each(|(a, b)| a.join(b)),
        }
    }
    all.unwrap_or_else(|| {
        [Binned::new(vec![0.0, 90.0], vec![0.0, 90.0]), Binned::new(vec![0.0, 90.0], vec![-90.0, 90.0])]
    })
}

/// Borders of the cells.
struct Bins {
    half: Vec<f64>,
    difference: Vec<f64>,
    theta_i: Vec<f64>,
    theta_o: Vec<f64>,
}

impl Bins {
    /// As many as the readings fill. Where polar angles repeat they stand in the middle of cells, so that rounding does not
    /// split them; θh is finer towards 0, where lobes are.
    fn of(table: &Measurement) -> Self {
        let count = ((table.len() as f64).sqrt() / 6.0).clamp(10.0, 45.0) as usize;
        let even = |n: usize| (0..=n).map(|k| 90.0 * k as f64 / n as f64).collect::<Vec<f64>>();
        let half = even(count).iter().map(|x| x * x / 90.0).collect();
        let step = |pick: fn(&(DVec3, DVec3)) -> DVec3| repeated_step(table, pick);
        let polar = |step: Option<f64>| step.map_or_else(|| even(count), centred);
        let theta_o = polar(step(|p| p.1));
        let mut signed: Vec<f64> = theta_o.iter().skip(1).rev().map(|t| -t).collect();
        // A cell about 0 is one, not two.
        signed.extend(if theta_o[1] < theta_o[2] - theta_o[1] - 1e-9 { &theta_o[1..] } else { &theta_o[..] });
        Self { half, difference: even(count), theta_i: polar(step(|p| p.0)), theta_o: signed }
    }

    /// Two maps a channel.
    fn empty(&self, channels: usize) -> Vec<Binned> {
        let pair = [
            Binned::new(self.half.clone(), self.difference.clone()),
            Binned::new(self.theta_i.clone(), self.theta_o.clone()),
        ];
        (0..channels).flat_map(|_| pair.clone()).collect()
    }
}

/// The step between the polar angles of a list, where there are at most 60 of them; degrees, at least 2°.
fn repeated_step(table: &Measurement, pick: fn(&(DVec3, DVec3)) -> DVec3) -> Option<f64> {
    let Directions::List { .. } = &table.directions else { return None };
    let angle = |i: usize| (theta_of(pick(&table.directions.pair(i))).to_degrees() * 1e4).round() as i64;
    let mut angles: Vec<i64> = (0..table.len()).map(angle).collect();
    angles.sort_unstable();
    angles.dedup();
    let mut steps: Vec<i64> = angles.windows(2).map(|p| p[1] - p[0]).collect();
    steps.sort_unstable();
    let middle = *steps.get(steps.len() / 2)? as f64 * 1e-4;
    (angles.len() <= 60).then_some(middle.clamp(2.0, 30.0))
}

/// Cells about the multiples of a step, over 0° to 90°.
fn centred(step: f64) -> Vec<f64> {
    let inner = (0..).map(|k| (f64::from(k) + 0.5) * step).take_while(|t| *t < 90.0 - 1e-9);
    std::iter::once(0.0).chain(inner).chain(std::iter::once(90.0)).collect()
}

/// What decides which values count, and finds their residuals.
struct Judge<'a> {
    table: &'a Measurement,
    fit: &'a Predicted,
    loss: Loss,
    epsilon: &'a [f64],
    max_angle_deg: f64,
    by_area: bool,
}

impl Judge<'_> {
    fn bin(&self, block: std::ops::Range<usize>, bins: &Bins) -> (Vec<Binned>, Totals) {
        let channels = self.table.channels.len();
        // Inclusive whatever the rounding of a direction.
        let least = self.max_angle_deg.to_radians().cos() - 1e-12;
        let is_in = |(wi, wo): &(DVec3, DVec3)| wi.z > 0.0 && wo.z > 0.0 && wi.z >= least && wo.z >= least;
        let kept = block.map(|i| (i, self.table.directions.pair(i))).filter(|(_, pair)| is_in(pair));
        let (index, pairs): (Vec<usize>, Vec<_>) = kept.unzip();
        let values = self.fit.values(&pairs);
        let (mut maps, mut totals) = (bins.empty(channels), Totals(vec![(0.0, 0); channels]));
        for (k, (&i, (wi, wo))) in index.iter().zip(&pairs).enumerate() {
            let weight = if self.by_area { self.table.weights.get(i) } else { 1.0 };
            let cells = cells(&maps, *wi, *wo);
            for c in 0..channels {
                let (Some(value), f) = (self.table.value(c, i), values[c][k]) else { continue };
                let datum = Datum { value, cos_i: wi.z, epsilon: self.epsilon.get(c).copied().unwrap_or(1e-12) };
                if f.is_nan() || weight <= 0.0 || !self.loss.accepts(datum) {
                    continue;
                }
                let r = self.loss.residual(f, datum);
                totals.0[c] = (totals.0[c].0 + weight, totals.0[c].1 + 1);
                for (map, cell) in maps[2 * c..2 * c + 2].iter_mut().zip(cells) {
                    if let Some(cell) = cell {
                        map.add(cell, weight, r);
                    }
                }
            }
        }
        (maps, totals)
    }
}

/// Where a pair of directions stands in both maps.
fn cells(maps: &[Binned], wi: DVec3, wo: DVec3) -> [Option<usize>; 2] {
    let degrees = |w: DVec3| theta_of(w).to_degrees();
    let half = HalfDiff::from_pair(wi, wo);
    let half = half.and_then(|h| maps[0].cell(h.theta_h.to_degrees(), h.theta_d.to_degrees()));
    // The mirror side is where the horizontal parts oppose each other.
    let mirror_side = wi.x * wo.x + wi.y * wo.y <= 0.0;
    let theta_o = if mirror_side { degrees(wo) } else { -degrees(wo) };
    [half, maps[1].cell(degrees(wi), theta_o)]
}

/// Where colours of means over their error end: what noise alone reaches in one of millions of cells.
const NOISE_RANGE: f64 = 5.0;

/// Where the colours of both maps end: of means over their error at 5, else the 99th percentile of their cells' sizes, rounded up to 1, 2 or 5 times a power of ten; 1 where all are 0.
#[must_use]
pub fn residual_range(maps: &ResidualMaps, statistic: Statistic) -> f64 {
    if statistic == Statistic::OverNoise {
        return NOISE_RANGE;
    }
    let cells = maps.half_diff.iter().chain([&maps.in_out]).flat_map(|m| m.values(statistic));
    let mut sizes: Vec<f64> = cells.flatten().map(f64::abs).filter(|v| *v > 0.0 && v.is_finite()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len().saturating_sub(1) * 99 / 100).map_or(1.0, |most| Scale::around([*most]).high)
}

/// A map as a figure; `range` is where the colours end.
#[must_use]
pub fn residual_figure(
    map: &Binned,
    over_half: bool,
    statistic: Statistic,
    range: f64,
    (title, unit): (&str, &str),
    titled: bool,
) -> Figure {
    let degrees = |list: &[f64]| (list[0], list[list.len() - 1]);
    let ((x0, x1), (y0, y1)) = (degrees(&map.x_deg), degrees(&map.y_deg));
    let (x_label, y_label, x) = if over_half {
        ("θh [°]", "θd [°]", Scale::root(x0, x1))
    } else {
        ("θi [°]", "θo [°], + mirror side", Scale::degrees(x0, x1))
    };
    let (name, colors, low) = match statistic {
        Statistic::Mean => ("mean residual", ColorMap::Diverging, -range),
        Statistic::Rms => ("rms residual", ColorMap::Sequential, 0.0),
        Statistic::OverNoise => ("mean residual over its error", ColorMap::Diverging, -range),
    };
    let map = HeatMap {
        title: format!("{title}, {name}"),
        description: format!("{name} in {} cells, colours from {} to {}", map.count.len(), low, range),
        titled,
        x_label: x_label.into(),
        y_label: y_label.into(),
        x,
        y: Scale::degrees(y0, y1),
        x_borders: map.x_deg.clone(),
        y_borders: map.y_deg.clone(),
        values: map.values(statistic),
        map: colors,
        range: (low, range),
        color_label: if statistic == Statistic::OverNoise {
            "σ".into()
        } else if unit.is_empty() {
            "r".into()
        } else {
            format!("r [{}]", unit_text(unit))
        },
        width: 400.0,
    };
    map.figure()
}

/// A unit as it is set: its power raised.
fn unit_text(unit: &str) -> String {
    unit.replace("^(-1/3)", "^{−1/3}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::{LobeKind, Material};
    use crate::chain::{BuiltInMaterial, Source, measure};
    use crate::control::Control;
    use crate::fit::{FitOptions, fit};
    use crate::gonio::{Instrument, Scan};

    fn paint() -> Measurement {
        let material = BuiltInMaterial::find("glossy-paint").expect("built in").material();
        let scan = Scan::Hemisphere { step_deg: 10.0 };
        let instrument = Instrument::default();
        measure("paint", &Source::Fitted(Box::new(material)), &instrument, &scan, 1, Control::silent())
            .expect("measures")
    }

    #[test]
    fn the_cells_together_are_the_fits_own_cost() {
        let table = paint();
        for model in ["lambert", "lambert+phong"] {
            for loss in Loss::ALL {
                let options = FitOptions { loss, ..FitOptions::new(model.parse().expect("a model")) };
                let material = fit(&table, &options).expect("fits").material;
                let record = material.fit.clone().expect("a record");
                let maps = residual_maps(&table, &Predicted::new(&material, None), 80.0);
                assert!(
                    (maps.rmse / record.rmse - 1.0).abs() < 1e-6,
                    "{model} {loss:?}: {} vs {}",
                    maps.rmse,
                    record.rmse
                );
                for map in [maps.half_diff.as_ref().expect("of space"), &maps.in_out] {
                    let (count, squares): (u64, f64) = (map.count.iter().sum(), map.squares.iter().sum());
                    assert_eq!(count, maps.count);
                    assert!(
                        (squares / record.cost - 1.0).abs() < 1e-6,
                        "{model} {loss:?}: {squares} vs {}",
                        record.cost
                    );
                }
            }
        }
    }

    #[test]
    fn means_over_their_error_are_normal_where_only_noise_is_left_and_not_where_the_model_is_wrong() {
        let table = paint();
        let of = |model: &str| {
            let material = fit(&table, &FitOptions::new(model.parse().expect("a model"))).expect("fits").material;
            let maps = residual_maps(&table, &Predicted::new(&material, None), 80.0);
            let cells: Vec<(f64, u64)> = maps
                .in_out
                .values(Statistic::OverNoise)
                .into_iter()
                .zip(&maps.in_out.count)
                .filter_map(|(z, n)| Some((z?, *n)))
                .collect();
            cells.into_iter().filter(|(_, n)| *n >= 30).map(|(z, _)| z).collect::<Vec<f64>>()
        };
        let mean_square = |z: &[f64]| z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64;
        let right = of("lambert+phong");
        // z² has mean 1 and variance below 2: five standard errors of its mean over the cells.
        let room = 5.0 * (2.0 / right.len() as f64).sqrt();
        assert!((mean_square(&right) - 1.0).abs() < room, "{} of {} cells", mean_square(&right), right.len());
        let wrong = of("lambert");
        assert!(mean_square(&wrong) > 10.0, "{}", mean_square(&wrong));
    }

    #[test]
    fn a_cell_holds_the_direct_sum_over_its_readings() {
        let table = paint();
        let material = Material::new(
            ["r", "g", "b"].map(str::to_owned).to_vec(),
            vec![(LobeKind::Lambert, vec![0.3, 0.1, 0.1], vec![])],
        );
        let maps = residual_maps(&table, &Predicted::new(&material, None), 80.0);
        let map = &maps.in_out;
        let columns = map.x_deg.len() - 1;
        let (column, row) =
            (map.x_deg.partition_point(|b| *b <= 30.0) - 1, map.y_deg.partition_point(|b| *b <= -20.0) - 1);
        let (mut sum, mut squares, mut weights, mut count) = ([0.0; 3], [0.0; 3], [0.0; 3], 0);
        let mut totals = [(0.0, 0.0); 3];
        for i in 0..table.len() {
            let (wi, wo) = table.directions.pair(i);
            if theta_of(wi).to_degrees() > 80.0 + 1e-6 || theta_of(wo).to_degrees() > 80.0 + 1e-6 {
                continue;
            }
            let inside = (theta_of(wi).to_degrees() - 30.0).abs() < 5.0
                && (theta_of(wo).to_degrees() - 20.0).abs() < 5.0
                && wi.x * wo.x + wi.y * wo.y > 0.0;
            for c in 0..3 {
                let Some(y) = table.value(c, i) else { continue };
                let w = table.weights.get(i);
                totals[c] = (totals[c].0 + w, totals[c].1 + 1.0);
                if inside {
                    let r = wi.z * (material.value(wi, wo)[c] - y);
                    sum[c] += w * r;
                    squares[c] += w * r * r;
                    weights[c] += w;
                    count += 1;
                }
            }
        }
        let all = |list: [f64; 3]| (0..3).map(|c| list[c] * totals[c].1 / totals[c].0).sum::<f64>();
        let cell = row * columns + column;
        assert_eq!(map.count[cell], count);
        for (found, want) in
            [(map.sum[cell], all(sum)), (map.squares[cell], all(squares)), (map.weight[cell], all(weights))]
        {
            assert!((found / want - 1.0).abs() < 1e-10, "{found} vs {want}");
        }
        let mean = map.values(Statistic::Mean)[cell].expect("filled");
        assert!((mean - all(sum) / all(weights)).abs() < 1e-12);
    }
}
