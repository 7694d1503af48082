//! From the fit's numbers to the material and its record.

use super::energy;
use super::limits::{Ranges, TINY_SHAPE};
use super::missing;
use super::options::{FitOptions, WeightMode};
use super::part::Part;
use super::solver::Stop;
use crate::brdf::{
    BootstrapRecord, Correlation, FitRecord, LobeKind, LobeRecord, LobeTerm, Material, ModelSpec, PerChannel,
    ResidualRecord, SearchRecord, SubsetRecord,
};
use crate::measurement::Measurement;

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
}

/// An end of a range.
#[derive(Debug, Clone, Copy)]
enum End {
    Low,
    High,
}

/// A shape that ended at an end of its range.
#[derive(Debug, Clone, Copy)]
struct Ended {
    value: f64,
    end: End,
    /// Whether that end was asked for, else it is the end of what is searched.
    asked: bool,
    /// Whether the data determine it all the same.
    determined: bool,
    /// Whether it has an interval to one side.
    interval: bool,
}

impl Ended {
    /// What is told of the parameter called `name`.
    fn warning(self, name: &str) -> String {
        let (end, more) = match self.end {
            End::High => ("high", "a larger one"),
            End::Low => ("low", "a smaller one"),
        };
        let range = if self.asked { "was asked for" } else { "is searched" };
        let place = format!("{name} ended at {}, the {end} end of the range that {range}", brief(self.value));
        let wish = format!("{place}: the data ask for {more}, so there is no standard error");
        match (self.determined, self.interval) {
            (true, true) => format!("{wish}; an interval reaches from that end inwards"),
            (true, false) => wish,
            (false, _) => place,
        }
    }
}

/// Six digits at most, without zeros at the end.
fn brief(x: f64) -> String {
    let rounded: f64 = format!("{x:.5e}").parse().unwrap_or(x);
    if (1e-4..1e6).contains(&rounded) { rounded.to_string() } else { format!("{rounded:e}") }
}

/// Shape parameters of a lobe by name.
type Shapes<T> = Vec<(String, PerChannel<T>)>;

/// Correlations of more parameters than this are left out.
const MOST_CORRELATED: usize = 40;
/// Share of structure in the residuals' variance from which it is warned of.
const STRUCTURED: f64 = 0.25;

/// The fitted material with its record.
pub(super) fn material(facts: &Facts<'_>) -> Material {
    let mut rows: Vec<Row> = (0..facts.model.lobes().len()).map(|l| facts.row(l)).collect();
    let order = order_of(&rows, &facts.ranges.limited);
    let mut material = Material { channels: facts.measurement.channels.clone(), lobes: Vec::new(), fit: None };
    let mut record = facts.numbers();
    let structured = record.residual.as_ref().is_some_and(|r| r.structured_share > STRUCTURED);
    let (mut redrawn, mut at_end) = (Vec::new(), Vec::new());
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
        let mut row = Row {
            term: LobeTerm { kind, weight: channels.clone().map(weight).collect(), shape: None },
            error: LobeRecord { weight: channels.clone().map(error).collect(), shape: Vec::new() },
            interval: LobeRecord { weight: channels.clone().map(interval).collect(), shape: Vec::new() },
            model_error: LobeRecord { weight: channels.clone().map(model_error).collect(), shape: Vec::new() },
            bootstrap: LobeRecord { weight: channels.map(redrawn).collect(), shape: Vec::new() },
            at_end: Vec::new(),
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

    fn status(&self) -> &'static str {
        let at_bound = |p: &Part| {
            let t = &p.solution.t;
            let ends = |i: usize| {
                let (low, high) = p.bounds[i];
                low < high && (t[i] <= low || t[i] >= high)
            };
            p.layout.iter().enumerate().any(|(i, (lobe, _))| ends(i) && p.lit(*lobe))
        };
        if self.parts.iter().any(|p| p.subset.is_some_and(|s| s.out_of_time)) {
            "budget"
        } else if self.parts.iter().any(|p| matches!(p.stop, Stop::MaxIterations)) {
            "max-iterations"
        } else if self.parts.iter().any(at_bound) {
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

    fn warnings(&self, material: &Material, record: &FitRecord, at_end: &[(String, Ended)]) -> Vec<String> {
        let mut list = Vec::new();
        if !record.undetermined.is_empty() {
            list.push(format!("the data do not determine {}", record.undetermined.join(", ")));
        }
        list.extend(at_end.iter().map(|(name, ended)| ended.warning(name)));
        if record.status == "max-iterations" {
            list.push("the search used up its steps before it converged".into());
        }
        if self.options.weights == WeightMode::SolidAngle && self.parts[0].weighting == WeightMode::Uniform.name() {
            list.push("the measurement has no grid, so every sample counts the same (uniform weights)".into());
        }
        for (c, channel) in self.measurement.channels.iter().enumerate() {
            let (part, own) = self.of_channel(c);
            if part.counts[own] == 0 {
                list.push(format!("channel {channel} has no valid sample"));
            }
        }
        let refused: usize = self.parts.iter().map(|p| p.refused).sum();
        let whole = !self.options.use_sigma && self.parts.iter().all(|p| p.subset.is_none());
        let valid = whole.then(|| self.parts.iter().flat_map(|p| &p.counts).sum::<usize>() + refused);
        list.extend(missing::warnings(self.measurement, self.options, valid));
        if refused > 0 {
            list.push(format!("{refused} values are too negative for the logarithm of the loss and were left out"));
        }
        if let Some(subset) = record.subset.as_ref().filter(|_| record.status == "budget") {
            list.push(format!(
                "the time ended at {} of about {} directions: the rmse over all is expected to be {:.2} % above the best, and at most \
                 {:.2} % with 95 % confidence",
                subset.samples,
                subset.of,
                100.0 * subset.rmse_excess,
                100.0 * subset.rmse_excess_95
            ));
        }
        list.extend(self.structure_warning(record));
        list.extend(self.noise_warnings(record));
        let capped: Vec<&str> = self.capped().map(|c| self.measurement.channels[c].as_str()).collect();
        if !capped.is_empty() {
            let plural = if capped.len() > 1 { "s" } else { "" };
            list.push(format!(
                "the energy limit decides: the weights of channel{plural} {} add up to 1, the most they may",
                capped.join(", ")
            ));
        }
        list.extend(record.energy.as_ref().and_then(|e| energy::warning(material, e)));
        list
    }

    /// Channels whose weights the energy limit decides.
    fn capped(&self) -> impl Iterator<Item = usize> {
        (0..self.measurement.channels.len()).filter(|&c| {
            let (part, own) = self.of_channel(c);
            part.capped[own]
        })
    }

    /// What the noise does to the fit, or what can't be said of it.
    fn noise_warnings(&self, record: &FitRecord) -> Vec<String> {
        let mut list = Vec::new();
        let structured = record.residual.as_ref().is_some_and(|r| r.structured_share > STRUCTURED);
        // Of other losses the stated noise is a guess where it is not small beside the value.
        let linear = matches!(self.options.loss, super::loss::Loss::L2 | super::loss::Loss::CosineL2);
        let off = self.parts.iter().filter_map(|p| p.offset).fold(0.0, f64::max);
        if off > 0.0 && !structured {
            let cause = if self.parts[0].weighting == "sigma" {
                "weights that follow the noise pull"
            } else {
                "this loss pulls"
            };
            let misfit = record.residual.as_ref().is_some_and(|r| r.model_rmse > 0.0);
            let or = if misfit { " (or the model's own error, weighed differently, does)" } else { "" };
            list.push(format!(
                "the fit is off the mean of the data by {off:.0} times what chance allows: with noise as large as here {cause} it away{or}, and \
                 neither standard errors nor intervals cover that; `--loss cosine-l2` without `--use-sigma` follows the mean"
            ));
        }
        if let Some(residual) = record
            .residual
            .as_ref()
            .filter(|r| linear && r.noise_from == "sigma" && record.rmse < OVERSTATED * r.noise_rmse)
        {
            list.push(format!(
                "the residuals are {:.1} times smaller than the stated σ: it may be overstated, and the standard errors with it",
                residual.noise_rmse / record.rmse
            ));
        }
        if let Some(left) = self.parts.iter().filter_map(|p| p.unsettled).max_by(|a, b| a.abs().total_cmp(&b.abs())) {
            list.push(unsettled_warning(left));
        }
        if self.parts.iter().any(|p| p.unjudged) {
            list.push(
                "whether the residuals are noise or model error can't be told: among the samples that were used too few are \
                 neighbours, and no σ is stated for all of them"
                    .into(),
            );
        }
        list
    }

    /// Says in plain words that the model can't bend as the material does.
    fn structure_warning(&self, record: &FitRecord) -> Option<String> {
        let residual = record.residual.as_ref().filter(|r| r.structured_share > STRUCTURED)?;
        let unit = match self.options.loss.unit(self.measurement.dimension) {
            "" => String::new(),
            unit => format!(" {unit}"),
        };
        Some(format!(
            "the model does not describe these data: {:.0} % of the residuals' variance is structure, not noise (model error \
             {:.3e}{unit}, noise {:.1e}{unit}); the standard errors are of noise alone, `model_error` says how far the model's own error \
             moves the parameters",
            100.0 * residual.structured_share,
            residual.model_rmse,
            residual.noise_rmse,
        ))
    }
}

/// The robust scale and the parameters have not met: ln(scale asked for / scale used) is `left`.
fn unsettled_warning(left: f64) -> String {
    format!(
        "the robust scale has not settled: the residuals ask for one that differs by {:.1e} % from the one that was used, and the \
         parameters are those of the latter",
        100.0 * left.exp_m1().abs()
    )
}

/// Residuals below this share of the stated σ are worth a word.
const OVERSTATED: f64 = 0.7;

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
        let interval = self.intervals[place].filter(|_| known).map(|(low, high)| (low.exp(), high.exp()));
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

/// What lobe `l` of these kinds is called: `phong`, `phong[1]` for the second of the kind.
fn lobe_name(kinds: &[LobeKind], l: usize) -> String {
    match kinds[..l].iter().filter(|k| **k == kinds[l]).count() {
        0 => kinds[l].name().into(),
        k => format!("{}[{k}]", kinds[l].name()),
    }
}

/// Names of the parameters without a standard error: `phong.exponent`, `lambert.weight[g]`, `phong[1].exponent`.
fn without_error(material: &Material, errors: &[LobeRecord<Option<f64>>]) -> Vec<String> {
    let mut names = Vec::new();
    for (l, error) in errors.iter().enumerate() {
        let lobe = material.lobe_name(l);
        let open = error.weight.iter().zip(&material.channels).filter(|(e, _)| e.is_none());
        names.extend(open.map(|(_, c)| format!("{lobe}.weight[{c}]")));
        let open = shape_names(material, l, &error.shape, |e| e.is_none().then_some(()));
        names.extend(open.into_iter().map(|(name, ())| name));
    }
    names
}

/// The shapes that ended at an end of their range, by name.
fn ended(material: &Material, at_end: &[Shapes<Option<Ended>>]) -> Vec<(String, Ended)> {
    let of_lobe = |(l, shapes)| shape_names(material, l, shapes, |ended: &Option<Ended>| *ended);
    at_end.iter().enumerate().flat_map(of_lobe).collect()
}

/// What there is to tell of the shapes of lobe `l`, by name.
fn shape_names<T, U>(
    material: &Material,
    l: usize,
    shapes: &Shapes<T>,
    tell: impl Fn(&T) -> Option<U>,
) -> Vec<(String, U)> {
    let lobe = material.lobe_name(l);
    let mut told = Vec::new();
    for (name, value) in shapes {
        match value {
            PerChannel::Shared(value) => told.extend(tell(value).map(|t| (format!("{lobe}.{name}"), t))),
            PerChannel::Each(list) => {
                let each = list.iter().zip(&material.channels);
                told.extend(each.filter_map(|(value, c)| tell(value).map(|t| (format!("{lobe}.{name}[{c}]"), t))));
            }
        }
    }
    told
}
