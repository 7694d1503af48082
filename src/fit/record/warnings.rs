//! What a fit says of itself in words.

use super::Facts;
use crate::brdf::{FitRecord, LobeRecord, Material, PerChannel};
use crate::fit::covariance::STRUCTURED;
use crate::fit::loss::Loss;
use crate::fit::options::WeightMode;
use crate::fit::outliers::Traits;
use crate::fit::{energy, missing};

/// An end of a range.
#[derive(Debug, Clone, Copy)]
pub(super) enum End {
    Low,
    High,
}

/// A shape that ended at an end of its range.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ended {
    pub value: f64,
    pub end: End,
    /// Whether that end was asked for, else it is the end of what is searched.
    pub asked: bool,
    /// Whether the data determine it all the same.
    pub determined: bool,
    /// Whether it has an interval to one side.
    pub interval: bool,
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

impl Facts<'_> {
    /// All that there is to say of the fit.
    pub(super) fn warnings(&self, material: &Material, record: &FitRecord, at_end: &[(String, Ended)]) -> Vec<String> {
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
        let whole = !self.options.use_sigma && self.options.part == 1 && self.parts.iter().all(|p| p.subset.is_none());
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
        let linear = matches!(self.options.loss, Loss::L2 | Loss::CosineL2);
        let off = self.parts.iter().filter_map(|p| p.uncertainty.offset).fold(0.0, f64::max);
        if off > 0.0 && !structured {
            let cause = if linear { "weights that follow the noise pull" } else { "this loss pulls" };
            let follows = match self.options.robust {
                Some(_) => "`--loss cosine-l2` without `--use-sigma` and `--robust`",
                None => "`--loss cosine-l2` without `--use-sigma`",
            };
            let misfit = record.residual.as_ref().is_some_and(|r| r.model_rmse > 0.0);
            let or = if misfit { " (or the model's own error, weighed differently, does)" } else { "" };
            list.push(format!(
                "with noise as large as here {cause} the fit off the mean of the data, by up to {off:.1} standard errors{or}; the intervals allow for \
                 that, the standard errors do not; {follows} follows the mean"
            ));
        }
        if let Some(residual) = record
            .residual
            .as_ref()
            .filter(|r| linear && r.noise_from == "sigma" && record.rmse < OVERSTATED * r.noise_rmse)
        {
            list.push(format!(
                "the residuals are {:.1} times smaller than the stated σ: it may be overstated{}",
                residual.noise_rmse / record.rmse,
                of_errors(record, ", and the standard errors with it")
            ));
        }
        list.extend(self.outlier_warnings());
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

    /// What gross outliers tell and do.
    fn outlier_warnings(&self) -> Vec<String> {
        let counted = |of: fn(&Traits) -> bool| {
            let traits = self.parts.iter().map(|p| &p.uncertainty.outliers).filter(|t| of(t));
            traits.fold((0, 0), |(count, all), t| (count + t.count, all + t.of))
        };
        let mut list = Vec::new();
        let (count, of) = counted(|t| t.stand_together);
        if count > 0 {
            list.push(format!(
                "{count} of {of} values are gross outliers and stand side by side, which stray readings do not: the model does not describe \
                 these data there, or a part of the scan is wrong; the standard errors do not cover that"
            ));
        }
        let (count, _) = counted(|t| t.lean);
        if count > 0 {
            list.push(format!(
                "{count} values are gross outliers and lean to one side: what they still pull is in the standard errors as one shared error"
            ));
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
             {:.3e}{unit}, noise {:.1e}{unit}){}",
            100.0 * residual.structured_share,
            residual.model_rmse,
            residual.noise_rmse,
            of_errors(
                record,
                "; the standard errors are of noise alone, `model_error` says how far the model's own error moves the parameters"
            )
        ))
    }
}

/// Weights of which there is something to say, by name: those whose error is that of other samples' noise, and those at an end of a range that
/// was asked for.
pub(super) fn of_weights(by_others: &[String], limited: &[String]) -> Vec<String> {
    let mut list = Vec::new();
    if !by_others.is_empty() {
        list.push(format!(
            "so few samples decide {} that their residuals say nothing of the noise: that of the others counts in its place",
            by_others.join(", ")
        ));
    }
    if !limited.is_empty() {
        list.push(format!(
            "{} ended at an end of the range that was asked for: the data ask for a value beyond it, and the standard error is of a weight that \
             is free",
            limited.join(", ")
        ));
    }
    list
}

/// The robust scale and the parameters have not met: ln(scale asked for / scale used) is `left`.
fn unsettled_warning(left: f64) -> String {
    format!(
        "the robust scale has not settled: the residuals ask for one that differs by {:.1e} % from the one that was used, and the \
         parameters are those of the latter",
        100.0 * left.exp_m1().abs()
    )
}

/// What is said of standard errors, nothing where all parameters are held and have none.
fn of_errors<'a>(record: &FitRecord, clause: &'a str) -> &'a str {
    let held = |error: &Option<f64>| *error == Some(0.0);
    let shape = |of: &PerChannel<Option<f64>>| match of {
        PerChannel::Shared(error) => held(error),
        PerChannel::Each(list) => list.iter().all(held),
    };
    let all =
        |lobe: &LobeRecord<Option<f64>>| lobe.weight.iter().all(held) && lobe.shape.iter().all(|(_, of)| shape(of));
    if record.standard_error.iter().all(all) { "" } else { clause }
}

/// Residuals below this share of the stated σ are worth a word.
const OVERSTATED: f64 = 0.7;
