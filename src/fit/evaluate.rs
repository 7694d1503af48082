//! The rmse of a material that is given, over all samples that a fit of its model would be of.

use nalgebra::DVector;

use super::limits::Ranges;
use super::options::{FitError, FitOptions};
use super::passes::{self, Saturation, ShapedLobe, Want};
use super::reduced::Problem;
use super::samples::{Samples, Thin};
use crate::brdf::{LobeKind, LobeTerm, Material, ModelSpec, SpecError};
use crate::measurement::Measurement;

/// √(Σ w r²/Σ w) of a material as it is, in the unit of r, over the samples that a fit with these options takes; `options.model` and limits are not looked at.
/// Under a robust loss Σ w s² ρ(r²/s²) stands in for the sum, with the s of `scales`: one for all channels, or one each where they are fitted apart, as a
/// fit's `robust_scale` has them. Fits compare at one s, not each at its own.
///
/// # Errors
/// [`FitError`] where the channels are not the measurement's, the options are wrong, nothing valid is left, or there are not as many `scales` as are
/// needed.
pub fn rmse_of(
    measurement: &Measurement,
    material: &Material,
    options: &FitOptions,
    scales: &[f64],
) -> Result<f64, FitError> {
    judged(measurement, material, options, scales).map(|(rmse, _)| rmse)
}

/// The same, and the directions that it is over: as many as a fit's record would say.
pub(crate) fn judged(
    measurement: &Measurement,
    material: &Material,
    options: &FitOptions,
    scales: &[f64],
) -> Result<(f64, usize), FitError> {
    let wrong = |e: SpecError| FitError::Solver { reason: e.to_string() };
    same_channels(measurement, material)?;
    let model: ModelSpec = material.model().parse().map_err(wrong)?;
    let options = FitOptions { model, limits: Vec::new(), ..options.clone() };
    options.validate(measurement)?;
    let model = options.model_for(measurement)?;
    let ranges = Ranges::new(&model, &measurement.channels, &[])?;
    let all: Vec<usize> = (0..measurement.channels.len()).collect();
    let (mut cost, mut residuals, mut directions, mut dark) = (0.0, 0, 0, None);
    for (g, group) in options.groups(&all).into_iter().enumerate() {
        let thin = Thin { step: options.part, run: 1 };
        let (samples, _) = match Samples::gather(measurement, &model, &options, group, thin) {
            Err(error @ FitError::NothingToFit { .. }) => {
                dark = Some(error); // another channel may have some
                continue;
            }
            gathered => gathered?,
        };
        let unit = options.loss.cost_unit(samples.scale);
        let loss = saturation(&options, scales.get(g).map(|s| s / unit.sqrt()))?;
        let problem = Problem::new(&samples, &model, &ranges, false);
        let (lobes, weights) = (shaped(&problem, material, group[0]), weights(material, group, samples.scale));
        let sums = passes::sums(&samples, &lobes, &weights, loss, Want::Gradient);
        cost += unit * sums.iter().map(|s| s.cost).sum::<f64>();
        residuals += samples.residuals();
        directions = directions.max(samples.len());
    }
    match dark.filter(|_| residuals == 0) {
        Some(error) => Err(error),
        None => Ok(((cost / residuals as f64).sqrt(), directions)),
    }
}

/// Channels go by place: they must have the same names in the same order.
fn same_channels(measurement: &Measurement, material: &Material) -> Result<(), FitError> {
    if material.channels == measurement.channels {
        return Ok(());
    }
    let [own, others] = [&material.channels, &measurement.channels].map(|names| names.join(", "));
    Err(FitError::Channels { material: own, measurement: others })
}

/// The robust loss with its s, in the fit's scale.
fn saturation(options: &FitOptions, scale: Option<f64>) -> Result<Saturation, FitError> {
    match (options.robust, scale) {
        (None, _) => Ok(None),
        (Some(robust), Some(s)) => Ok(Some((robust.kind, s))),
        (Some(_), None) => Err(FitError::Option {
            field: "robust",
            expected: "a scale for each group of channels",
            found: "fewer".into(),
        }),
    }
}

/// The lobes as they are in a channel; one without weight in all, which has no shape, may have any.
fn shaped(problem: &Problem<'_>, material: &Material, channel: usize) -> Vec<ShapedLobe> {
    let any = |kind: LobeKind| vec![1.0; kind.lobe().parameters().len()];
    let of = |(kind, term): (&LobeKind, &LobeTerm)| ShapedLobe {
        kind: *kind,
        shape: term.shape_of(channel).unwrap_or_else(|| any(*kind)),
    };
    problem.kinds.iter().zip(&material.lobes).map(of).collect()
}

/// The weights of each of these channels, in the fit's scale.
fn weights(material: &Material, channels: &[usize], scale: f64) -> Vec<DVector<f64>> {
    let of =
        |c: &usize| DVector::from_iterator(material.lobes.len(), material.lobes.iter().map(|l| l.weight[*c] / scale));
    channels.iter().map(of).collect()
}
