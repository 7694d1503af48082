//! From the fit's numbers to the material and its record.

mod names;
mod warnings;

use super::covariance::STRUCTURED;
use super::energy;
use super::limits::{Ranges, TINY_SHAPE};
use super::options::FitOptions;
use super::part::Part;
use super::solver::Stop;
use crate::brdf::{
    BootstrapRecord, Correlation, FitRecord, LobeKind, LobeRecord, LobeTerm, Material, ModelSpec, PerChannel,
    ResidualRecord, SearchRecord, SubsetRecord,
};
use crate::measurement::Measurement;
use names::{ended, lobe_name, weights, without_error};
use warnings::{End, Ended};

/// All that a record is made of: one part for all channels, or one a channel.
pub(super) struct Facts<'a> {
    pub measurement: &'a Measurement,
    pub options: &'a FitOptions,
    pub model: &'a ModelSpec,
    pub ranges: &'a Ranges,
    pub parts: &'a [Part],
    /// Directions that count in at least one channel.
    pub samples: usize,
}

/// One lobe of the result, before lobes of one kind are put in order.
struct Row {
    term: LobeTerm,
    error: LobeRecord<Option<f64>>,
    interval: LobeRecord<Option<(f64, f64)>>,
    model_error: LobeRecord<Option<f64>>,
    bootstrap: LobeRecord<Option<f64>>,
    /// Where a shape ended at an end of its range.
    at_end: Shapes<Option<Ended>>,
    /// Channels in which its weight's error is that of other samples' noise.
    by_others: Vec<bool>,
    /// Channels in which its weight ended at an end of the range that was asked for.
    limited: Vec<bool>,
}

/// Shape parameters of a lobe by name.
type Shapes<T> = Vec<(String, PerChannel<T>)>;

/// Correlations of more parameters than this are left out.
const MOST_CORRELATED: usize = 40;
/// The fitted material with its record.
pub(super) fn material(facts: &Facts<'_>) -> Material {
    let mut rows: Vec<Row> = (0..facts.model.lobes().len()).map(|l| facts.row(l)).collect();
    let order = order_of(&rows, &facts.ranges.limited);
    let mut material = Material { channels: facts.measurement.channels.clone(), lobes: Vec::new(), fit: None };
    let mut record = facts.numbers();
    let structured = record.residual.as_ref().is_some_and(|r| r.structured_share > STRUCTURED);
    let (mut redrawn, mut at_end) = (Vec::new(), Vec::new());
    let (mut by_others, mut limited) = (Vec::new(), Vec::new());
    let mut sorted: Vec<Option<Row>> = rows.drain(..).map(Some).collect();
    for row in order.iter().filter_map(|&l| sorted[l].take()) {
        material.lobes.push(row.term);
        record.standard_error.push(row.error);
        record.interval_95.push(row.interval);
        if structured {
            record.model_error.push(row.model_error);
        }
        redrawn.push(row.bootstrap);
        at_end.push(row.at_end);
        by_others.push(row.by_others);
        limited.push(row.limited);
    }
    record.bootstrap = facts
        .options
        .bootstrap
        .map(|b| BootstrapRecord { replicates: u64::from(b.replicates), standard_error: redrawn });
    let at_end = ended(&material, &at_end);
    record.undetermined = without_error(&material, &record.standard_error);
    let known = |name: &String| at_end.iter().any(|(of, ended)| of == name && ended.determined);
    record.undetermined.retain(|name| !known(name));
    record.correlation = facts.correlation(&order);
    record.energy = energy::energy(&material, facts.options.conserve_energy);
    record.warnings = facts.warnings(&material, &record, &at_end);
    record.warnings.extend(warnings::of_weights(&weights(&material, &by_others), &weights(&material, &limited)));
    material.fit = Some(record);
    material
}

impl Facts<'_> {
    fn numbers(&self) -> FitRecord {
        let unit = |p: &Part| self.options.loss.cost_unit(p.scale);
        let residuals: usize = self.parts.iter().flat_map(|p| &p.counts).sum();
        let cost: f64 = self.parts.iter().map(|p| p.solution.cost * unit(p)).sum();
        let epsilon = |p: &Part| p.epsilon.iter().map(|e| e * p.scale).collect::<Vec<f64>>();
        let relative = self.options.loss == super::Loss::Relative;
        FitRecord {
            status: self.status().into(),
            loss: self.options.loss.name().into(),
            weights: self.parts[0].weighting.into(),
            through: self.options.through.as_ref().map(|sight| sight.describe()),
            robust: self.options.robust.map(|r| r.to_string()),
            robust_scale: self.parts.iter().filter_map(|p| p.saturation.map(|(_, s)| s * unit(p).sqrt())).collect(),
            relative_epsilon: if relative { self.parts.iter().flat_map(epsilon).collect() } else { Vec::new() },
            limits: self.options.limits.iter().map(ToString::to_string).collect(),
            samples: self.samples as u64,
            cost,
            rmse: (cost / residuals.max(1) as f64).sqrt(),
            iterations: self.parts.iter().map(|p| p.history.len().saturating_sub(1) as u64).sum(),
            residual: self.residual(),
            search: Some(self.search()),
            subset: self.subset(),
            ..FitRecord::default()
        }
    }

    fn residual(&self) -> Option<ResidualRecord> {
        let lit = self.parts.iter().filter(|p| p.samples > 0);
        let all = lit.map(|p| p.structure.map(|s| (p, s))).collect::<Option<Vec<_>>>()?;
        let total = |of: &dyn Fn(&Part, &super::structure::Structure) -> f64| -> f64 {
            let residuals: f64 = all.iter().flat_map(|(p, _)| &p.counts).map(|n| *n as f64).sum();
            let sum: f64 = all.iter().map(|(p, s)| of(p, s) * p.counts.iter().sum::<usize>() as f64).sum();
            sum / residuals
        };
        let unit = |p: &Part| self.options.loss.cost_unit(p.scale);
        let noise = total(&|p, s| s.noise * s.noise * unit(p)).sqrt();
        let model = total(&|p, s| s.model * s.model * unit(p)).sqrt();
        let both = noise * noise + model * model;
        Some(ResidualRecord {
            noise_rmse: noise,
            model_rmse: model,
            structured_share: if both > 0.0 { model * model / both } else { 0.0 },
            noise_from: if all[0].1.from_sigma { "sigma" } else { "neighbours" }.into(),
            effective_samples: all.iter().map(|(_, s)| s.effective_samples).sum(),
        })
    }

    fn subset(&self) -> Option<SubsetRecord> {
        let parts = self.parts.iter().filter_map(|p| p.subset.map(|s| (p.samples, s)));
        // Channels fitted apart may have ended at different parts; the least sure one is told.
        let (samples, subset) = parts.max_by(|a, b| a.1.excess_95.total_cmp(&b.1.excess_95))?;
        Some(SubsetRecord {
            samples: samples as u64,
            of: subset.of as u64,
            rmse_excess: subset.excess,
            rmse_excess_95: subset.excess_95,
        })
    }

    fn search(&self) -> SearchRecord {
        let largest = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (Some(a), Some(b)) => Some(a.max(b)),
            (a, b) => a.or(b),
        };
        let least = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
        let start = SearchRecord { starts: 0, reached: 0, minima: 0, runner_up_excess: None, unseen_chance: None };
        self.parts.iter().map(|p| &p.report).fold(start, |sum, r| SearchRecord {
            starts: sum.starts + r.starts as u64,
            reached: sum.reached + r.reached as u64,
            minima: sum.minima.max(r.minima as u64),
            runner_up_excess: least(sum.runner_up_excess, r.runner_up_excess),
            unseen_chance: largest(sum.unseen_chance, r.unseen),
        })
    }

    /// The part that fitted a channel, and the channel's place in it.
    fn of_channel(&self, channel: usize) -> (&Part, usize) {
        let find = |p: &Part| p.channels.iter().position(|c| *c == channel);
        let found = self.parts.iter().find_map(|p| find(p).map(|c| (p, c)));
        found.unwrap_or((&self.parts[0], 0))
    }

    fn row(&self, l: usize) -> Row {
        let (kind, lobes) = (self.model.lobes()[l], self.model.lobes().len());
        let channels = 0..self.measurement.channels.len();
        let weight = |c: usize| {
            let (part, c) = self.of_channel(c);
            part.solution.weights[c][l] * part.scale
        };
        let at = |c: usize| {
            let (part, c) = self.of_channel(c);
            (part, c * lobes + l, part.scale)
        };
        let error = |c: usize| {
            let (part, i, unit) = at(c);
            part.uncertainty.errors[i].map(|e| e * unit)
        };
        let interval = |c: usize| {
            let (part, i, unit) = at(c);
            finite(part.intervals[i].map(|(low, high)| (low * unit, high * unit)))
        };
        let model_error = |c: usize| {
            let (part, i, unit) = at(c);
            part.uncertainty.errors[i].map(|_| part.uncertainty.structured[i] * unit)
        };
        let redrawn = |c: usize| {
            let (part, i, unit) = at(c);
            part.bootstrap.as_ref().map(|b| b[i] * unit)
        };
        let by_others = |c: usize| {
            let (part, i, _) = at(c);
            part.uncertainty.by_others.contains(&i)
        };
        let mut row = Row {
            term: LobeTerm { kind, weight: channels.clone().map(weight).collect(), shape: None },
            error: LobeRecord { weight: channels.clone().map(error).collect(), shape: Vec::new() },
            interval: LobeRecord { weight: channels.clone().map(interval).collect(), shape: Vec::new() },
            model_error: LobeRecord { weight: channels.clone().map(model_error).collect(), shape: Vec::new() },
            bootstrap: LobeRecord { weight: channels.clone().map(redrawn).collect(), shape: Vec::new() },
            at_end: Vec::new(),
            by_others: channels.clone().map(by_others).collect(),
            limited: channels.clone().map(|c| self.is_limited(c, l)).collect(),
        };
        let dark = row.term.weight.iter().all(|w| *w == 0.0);
        let mut shape = Vec::new();
        for (own, parameter) in kind.lobe().parameters().iter().enumerate() {
            let of_part = |p: &Part| p.shape_value(l, own, &self.ranges.shapes, parameter.bounds);
            let values: Vec<ShapeValue> = self.parts.iter().map(of_part).collect();
            shape.push(shared(&values, |v| v.value));
            let name = || parameter.name.to_owned();
            row.error.shape.push((name(), shared(&values, |v| v.error)));
            row.interval.shape.push((name(), shared(&values, |v| v.interval)));
            row.model_error.shape.push((name(), shared(&values, |v| v.model_error)));
            row.bootstrap.shape.push((name(), shared(&values, |v| v.bootstrap)));
            row.at_end.push((name(), shared(&values, |v| v.at_end)));
        }
        if !dark || shape.is_empty() {
            row.term.shape = Some(shape);
        }
        row
    }

    fn has_limited(&self) -> bool {
        let lobes = 0..self.model.lobes().len();
        lobes.into_iter().any(|l| (0..self.measurement.channels.len()).any(|c| self.is_limited(c, l)))
    }

    /// Whether a weight ended at an end of a range that was asked for; that none is negative goes without saying.
    fn is_limited(&self, channel: usize, lobe: usize) -> bool {
        let (part, c) = self.of_channel(channel);
        let (low, high) = self.ranges.weights[channel][lobe];
        let x = part.solution.weights[c][lobe] * part.scale;
        let near = |end: f64| end.is_finite() && (x - end).abs() <= 1e-12 * end.abs();
        low < high && part.counts[c] > 0 && (low != 0.0 && near(low) || near(high))
    }

    fn status(&self) -> &'static str {
        let at_bound = |p: &Part| {
            let t = &p.solution.t;
            let ends = |i: usize| {
                let (low, high) = p.bounds[i];
                low < high && (t[i] <= low || t[i] >= high)
            };
            p.layout.iter().enumerate().any(|(i, (lobe, _))| ends(i) && p.lit(*lobe))
        };
        if self.parts.iter().any(|p| p.is_cut() || p.subset.is_some_and(|s| s.out_of_time)) {
            "budget"
        } else if self.parts.iter().any(|p| matches!(p.stop, Stop::MaxIterations)) {
            "max-iterations"
        } else if self.parts.iter().any(at_bound) || self.has_limited() {
            "at-bound"
        } else {
            "converged"
        }
    }

    /// Correlations, the lobes in the order of the result.
    fn correlation(&self, order: &[usize]) -> Option<Correlation> {
        let [part] = self.parts else { return None };
        let lobes = self.model.lobes();
        if part.uncertainty.errors.len() > MOST_CORRELATED {
            return None;
        }
        let sorted: Vec<LobeKind> = order.iter().map(|&l| lobes[l]).collect();
        let name = |place: usize| lobe_name(&sorted, place);
        let (mut parameters, mut index) = (Vec::new(), Vec::new());
        for (place, &l) in order.iter().enumerate() {
            for (c, channel) in self.measurement.channels.iter().enumerate() {
                parameters.push(format!("{}.weight[{channel}]", name(place)));
                index.push(c * lobes.len() + l);
            }
            for (i, (_, parameter)) in part.layout.iter().enumerate().filter(|(_, (lobe, _))| *lobe == l) {
                parameters.push(format!("{}.{}", name(place), parameter.name));
                index.push(self.measurement.channels.len() * lobes.len() + i);
            }
        }
        let known = |i: usize| part.uncertainty.errors[i].filter(|e| *e > 0.0);
        let entry = |&i: &usize, &j: &usize| {
            let (a, b) = (known(i)?, known(j)?);
            Some(if i == j { 1.0 } else { (part.uncertainty.covariance[(i, j)] / (a * b)).clamp(-1.0, 1.0) })
        };
        let matrix = index.iter().map(|i| index.iter().map(|j| entry(i, j)).collect()).collect();
        Some(Correlation { parameters, matrix })
    }
}

/// A shape parameter of one part, in natural units.
#[derive(Default)]
struct ShapeValue {
    value: f64,
    error: Option<f64>,
    interval: Option<(f64, f64)>,
    model_error: Option<f64>,
    bootstrap: Option<f64>,
    at_end: Option<Ended>,
}

impl Part {
    fn lit(&self, lobe: usize) -> bool {
        self.solution.weights.iter().any(|x| x[lobe] > 0.0)
    }

    /// Parameter `own` of lobe `l`, whose own range is `searched`.
    fn shape_value(&self, l: usize, own: usize, ranges: &[(f64, f64)], searched: (f64, f64)) -> ShapeValue {
        let of_lobe = self.layout.iter().enumerate().filter(|(_, (lobe, _))| *lobe == l).map(|(i, _)| i);
        let Some(i) = of_lobe.clone().nth(own) else {
            return ShapeValue { value: f64::NAN, ..ShapeValue::default() };
        };
        let value = self.solution.t[i].exp();
        let place = self.solution.weights.len() * self.solution.lobes.len() + i;
        let (low, high) = self.bounds[i];
        if low == high {
            // As it was asked for, not by way of its logarithm.
            let value = if value <= 2.0 * TINY_SHAPE { 0.0 } else { ranges[i].0 };
            let nothing = Some(0.0);
            let interval = Some((value, value));
            let at_end = None;
            return ShapeValue { value, error: nothing, interval, model_error: nothing, bootstrap: nothing, at_end };
        }
        // An error wider than the whole range that is searched means that the data leave the shape open.
        let error = self.uncertainty.errors[place].filter(|e| self.lit(l) && *e < high - low);
        let known = error.is_some() || self.at_end[i];
        // An end of the range as it was asked for, not by way of its logarithm.
        let lower = |t: f64| if t <= low { ranges[i].0 } else { t.exp() };
        let upper = |t: f64| if t >= high { ranges[i].1 } else { t.exp() };
        let interval = self.intervals[place].filter(|_| known).map(|(a, b)| (lower(a), upper(b)));
        let model_error = error.map(|_| self.uncertainty.structured[place] * value);
        let bootstrap = error.and(self.bootstrap.as_ref()).map(|b| b[place] * value);
        let interval = finite(interval);
        let at_end = self.ended(l, i, ranges[i], searched).map(|ended| Ended { interval: interval.is_some(), ..ended });
        ShapeValue { value, error: error.map(|e| e * value), interval, model_error, bootstrap, at_end }
    }

    /// Where shape `i`, of lobe `l`, ended at an end of its range; `searched` is what that is where nothing is asked for.
    fn ended(&self, l: usize, i: usize, range: (f64, f64), searched: (f64, f64)) -> Option<Ended> {
        let (t, (low, high)) = (self.solution.t[i], self.bounds[i]);
        if !(low < high && self.lit(l) && (t <= low || t >= high)) {
            return None;
        }
        let (end, value, last) =
            if t >= high { (End::High, range.1, searched.1) } else { (End::Low, range.0, searched.0) };
        Some(Ended { value, end, asked: value != last, determined: self.at_end[i], interval: false })
    }
}

/// One value for all channels, or one a channel.
fn shared<T: Copy>(values: &[ShapeValue], of: impl Fn(&ShapeValue) -> T) -> PerChannel<T> {
    match values {
        [one] => PerChannel::Shared(of(one)),
        many => PerChannel::Each(many.iter().map(of).collect()),
    }
}

/// An interval with both ends finite, else none: a file has no form for infinity.
fn finite(interval: Option<(f64, f64)>) -> Option<(f64, f64)> {
    interval.filter(|(low, high)| low.is_finite() && high.is_finite())
}

/// The lobes' order in the result: those of one kind by ascending mean exponent, at the places that the model gives to their kind; dark ones
/// last. Lobes with limits of their own keep their places.
fn order_of(rows: &[Row], limited: &[LobeKind]) -> Vec<usize> {
    let key = |l: usize| {
        let Some(shape) = &rows[l].term.shape else { return f64::INFINITY };
        match shape.first() {
            None => 0.0,
            Some(PerChannel::Shared(x)) => *x,
            Some(PerChannel::Each(list)) => list.iter().sum::<f64>() / list.len() as f64,
        }
    };
    let mut order: Vec<usize> = (0..rows.len()).collect();
    for i in 0..order.len() {
        for j in i + 1..order.len() {
            let (a, b) = (order[i], order[j]);
            let kind = rows[a].term.kind;
            if kind == rows[b].term.kind && !limited.contains(&kind) && key(b) < key(a) {
                order.swap(i, j);
            }
        }
    }
    order
}
