//! From the solver's numbers to the material and its record.

use super::covariance::Uncertainty;
use super::options::{FitOptions, WeightMode};
use super::solver::{Outcome, Stop};
use super::varpro::{Profile, Solution};
use crate::brdf::{FitRecord, LobeRecord, LobeTerm, Material, PerChannel};
use crate::measurement::Measurement;

/// All that a record is made of.
pub(super) struct Facts<'a> {
    pub measurement: &'a Measurement,
    pub options: &'a FitOptions,
    pub problem: &'a Profile<'a>,
    pub solution: &'a Solution,
    pub uncertainty: &'a Uncertainty,
    pub outcome: &'a Outcome,
    pub seconds: f64,
}

/// One lobe of the result, before lobes of one kind are put in order.
struct Row {
    term: LobeTerm,
    error: LobeRecord<Option<f64>>,
    interval: LobeRecord<Option<(f64, f64)>>,
}

/// The fitted material with its record.
pub(super) fn material(facts: &Facts<'_>) -> Material {
    let mut rows: Vec<Row> = (0..facts.problem.kinds.len()).map(|l| facts.row(l)).collect();
    sort_lobes_of_one_kind(&mut rows);
    let samples = facts.problem.samples;
    let mut record = FitRecord {
        status: facts.status().into(),
        loss: facts.options.loss.name().into(),
        weights: if samples.solid_angle { WeightMode::SolidAngle } else { WeightMode::Uniform }.name().into(),
        samples: samples.len() as u64,
        cost: facts.solution.cost * samples.scale * samples.scale,
        rmse: (facts.solution.cost / samples.residuals().max(1) as f64).sqrt() * samples.scale,
        iterations: facts.outcome.history.len().saturating_sub(1) as u64,
        seconds: facts.seconds,
        ..FitRecord::default()
    };
    let mut lobes = Vec::new();
    for row in rows {
        lobes.push(row.term);
        record.standard_error.push(row.error);
        record.interval_95.push(row.interval);
    }
    let mut material = Material { channels: facts.measurement.channels.clone(), lobes, fit: None };
    record.undetermined = undetermined(&material, &record.standard_error);
    record.warnings = facts.warnings(&record);
    record.warnings.extend(energy_warning(&material));
    material.fit = Some(record);
    material
}

impl Facts<'_> {
    fn row(&self, l: usize) -> Row {
        let kind = self.problem.kinds[l];
        let q = self.uncertainty.quantile;
        let unit = self.problem.samples.scale;
        let weight: Vec<f64> = self.solution.weights.iter().map(|x| x[l] * unit).collect();
        let dark = weight.iter().all(|w| *w == 0.0);
        let errors: Vec<Option<f64>> = self.uncertainty.weights.iter().map(|e| e[l].map(|e| e * unit)).collect();
        // A weight is never negative, so neither is its interval.
        let around = |(w, e): (&f64, &Option<f64>)| finite(e.map(|e| ((w - q * e).max(0.0), w + q * e)));
        let mut row = Row {
            error: LobeRecord { weight: errors.clone(), shape: Vec::new() },
            interval: LobeRecord { weight: weight.iter().zip(&errors).map(around).collect(), shape: Vec::new() },
            term: LobeTerm { kind, weight, shape: None },
        };
        let mut shape = Vec::new();
        for (i, (_, parameter)) in self.problem.layout.iter().enumerate().filter(|(_, (lobe, _))| *lobe == l) {
            let value = self.solution.t[i].exp();
            // An error wider than the whole range that is searched means that the data leave the shape open.
            let range = (parameter.bounds.1 / parameter.bounds.0).ln();
            let error = self.uncertainty.ln_shapes[i].filter(|e| !dark && *e < range);
            shape.push(PerChannel::Shared(value));
            row.error.shape.push((parameter.name.into(), PerChannel::Shared(error.map(|e| e * value))));
            let interval = finite(error.map(|e| (value * (-q * e).exp(), value * (q * e).exp())));
            row.interval.shape.push((parameter.name.into(), PerChannel::Shared(interval)));
        }
        if !dark || shape.is_empty() {
            row.term.shape = Some(shape);
        }
        row
    }

    fn status(&self) -> &'static str {
        let bounds = self.problem.bounds();
        let at_end = |i: usize| self.solution.t[i] <= bounds[i].0 || self.solution.t[i] >= bounds[i].1;
        let lit = |lobe: usize| self.solution.weights.iter().any(|x| x[lobe] > 0.0);
        match self.outcome.stop {
            Stop::MaxIterations => "max-iterations",
            _ if self.problem.layout.iter().enumerate().any(|(i, (lobe, _))| at_end(i) && lit(*lobe)) => "at-bound",
            _ => "converged",
        }
    }

    fn warnings(&self, record: &FitRecord) -> Vec<String> {
        let mut list = Vec::new();
        if !record.undetermined.is_empty() {
            list.push(format!("the data do not determine {}", record.undetermined.join(", ")));
        }
        if record.status == "at-bound" {
            list.push(
                "a shape parameter ended at the end of its range: the data ask for more than the model has".into(),
            );
        }
        if record.status == "max-iterations" {
            list.push("the search used up its steps before it converged".into());
        }
        if self.options.weights == WeightMode::SolidAngle && !self.problem.samples.solid_angle {
            list.push("the measurement has no grid, so every sample counts the same (uniform weights)".into());
        }
        for (channel, _) in self.measurement.channels.iter().zip(&self.problem.samples.counts).filter(|(_, n)| **n == 0)
        {
            list.push(format!("channel {channel} has no valid sample"));
        }
        list
    }
}

/// Says where the material reflects more than it receives. The directional albedo of every lobe is largest at normal incidence.
fn energy_warning(material: &Material) -> Option<String> {
    let albedo = material.directional_albedo(0.0)?;
    let (channel, most) = albedo.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    let name = &material.channels[channel];
    (*most > 1.0).then(|| {
        format!("the fit reflects {most:.3} of the light at normal incidence (channel {name}): more than it receives")
    })
}

/// An interval with both ends finite, else none: a file has no form for infinity.
fn finite(interval: Option<(f64, f64)>) -> Option<(f64, f64)> {
    interval.filter(|(low, high)| low.is_finite() && high.is_finite())
}

/// Lobes of one kind by ascending mean exponent, at the places that the model gives to their kind; dark ones last.
fn sort_lobes_of_one_kind(rows: &mut [Row]) {
    let key = |row: &Row| {
        let shape = row.term.shape_of(0).unwrap_or_else(|| vec![f64::INFINITY]);
        shape.first().copied().unwrap_or(0.0)
    };
    for i in 0..rows.len() {
        for j in i + 1..rows.len() {
            if rows[i].term.kind == rows[j].term.kind && key(&rows[j]) < key(&rows[i]) {
                rows.swap(i, j);
            }
        }
    }
}

/// Names of the parameters without a standard error: `phong.exponent`, `lambert.weight[g]`, `phong[1].exponent`.
fn undetermined(material: &Material, errors: &[LobeRecord<Option<f64>>]) -> Vec<String> {
    let mut names = Vec::new();
    for (l, error) in errors.iter().enumerate() {
        let lobe = material.lobe_name(l);
        let open = error.weight.iter().zip(&material.channels).filter(|(e, _)| e.is_none());
        names.extend(open.map(|(_, c)| format!("{lobe}.weight[{c}]")));
        let open = error.shape.iter().filter(|(_, e)| *e == PerChannel::Shared(None));
        names.extend(open.map(|(name, _)| format!("{lobe}.{name}")));
    }
    names
}
