//! How well a scan tells the parameters of a model, over a prior of them.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::MAX_ANGLE_DEG;
use super::candidates::Pair;
use super::information::{Model, Noise};
use super::optimum::information;
use super::prior::Prior;
use crate::geometry::angles::theta_of;
use crate::gonio::cost::hours;
use crate::gonio::effects::shadow::may_be_shadowed;
use crate::gonio::instrument::Instrument;
use crate::measurement::Directions;

/// What a scan costs and tells.
#[derive(Debug, Clone, PartialEq)]
pub struct Precision {
    /// Instrument hours.
    pub hours: f64,
    /// Stops of the axes at pairs of directions.
    pub stops: usize,
    /// Readings, repeats of the instrument's own not counted.
    pub rows: usize,
    /// Relative standard errors by readings' own noise, parameter by parameter, at the 10 %, 50 % and 90 % quantiles of the prior; infinite where the
    /// scan does not tell the parameter.
    pub errors: Vec<[f64; 3]>,
    /// Mean over the prior of ln det of the information on ln(parameter); −∞ where the scan leaves a parameter open anywhere in the prior.
    pub mean_ln_det: f64,
}

/// Quantiles of the prior that errors are given at.
pub const QUANTILES: [f64; 3] = [0.1, 0.5, 0.9];

/// The precision of a scan whose rows are read in this order, over the prior's draws.
#[must_use]
pub fn precision(prior: &Prior, instrument: &Instrument, directions: &Directions, rows: &[u32]) -> Precision {
    let of = |row: u32| directions.pair(row as usize);
    let stops = stops(instrument, rows);
    let told: Vec<(Pair, usize)> =
        stops.iter().map(|(row, n)| (of(*row), *n)).filter(|(p, _)| counts(*p, instrument)).collect();
    let (model, noise) = (Model::of(prior), Noise::of(instrument));
    let draws = prior.draws();
    let each: Vec<DMatrix<f64>> = draws.par_iter().map(|draw| at(&model, &noise, draw, &told)).collect();
    let errors: Vec<Vec<f64>> = each.iter().map(relative_errors).collect();
    let quantiles = |a: usize| {
        let mut list: Vec<f64> = errors.iter().map(|e| e[a]).collect();
        list.sort_by(f64::total_cmp);
        QUANTILES.map(|q| list[(q * (list.len() - 1) as f64).round() as usize])
    };
    let ln_det = |m: &DMatrix<f64>| {
        m.clone()
            .cholesky()
            .map_or(f64::NEG_INFINITY, |c| 2.0 * c.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>())
    };
    Precision {
        hours: hours(instrument, directions, rows),
        stops: stops.len(),
        rows: rows.len(),
        errors: (0..model.parameters()).map(quantiles).collect(),
        mean_ln_det: each.iter().map(ln_det).sum::<f64>() / each.len() as f64,
    }
}

/// Rows that are one stop: which, and how many.
fn stops(instrument: &Instrument, rows: &[u32]) -> Vec<(u32, usize)> {
    let blocks = rows.chunks(instrument.protocol.block as usize);
    blocks.flat_map(|block| block.chunk_by(|a, b| a == b).map(|same| (same[0], same.len()))).collect()
}

/// Whether a fit has it: no angle beyond the limit, not in the shadow.
fn counts((wi, wo): Pair, instrument: &Instrument) -> bool {
    let most = MAX_ANGLE_DEG.to_radians() + 1e-9;
    theta_of(wi) <= most && theta_of(wo) <= most && !may_be_shadowed(wi, wo, instrument)
}

/// The information of all stops at one draw of the parameters.
fn at(model: &Model, noise: &Noise<'_>, draw: &[f64], stops: &[(Pair, usize)]) -> DMatrix<f64> {
    let p = model.parameters();
    let (mut list, mut weights) = (Vec::with_capacity(stops.len() * p), Vec::with_capacity(stops.len()));
    let mut gradient = vec![0.0; p];
    for (pair, rows) in stops {
        let f = model.value(draw, *pair, &mut gradient);
        let Some(own) = noise.variance(f, *pair) else { continue };
        list.extend_from_slice(&gradient);
        weights.push(1.0 / (own / *rows as f64 + noise.jitter(model, draw, f, *pair)));
    }
    information(p, &list, &weights)
}

/// √ of the diagonal of the inverse; infinite where the information is singular.
fn relative_errors(m: &DMatrix<f64>) -> Vec<f64> {
    let diagonal: Vec<f64> = m.diagonal().iter().map(|d| d.sqrt()).collect();
    let open = vec![f64::INFINITY; diagonal.len()];
    if diagonal.contains(&0.0) {
        return open;
    }
    // Scaled to a diagonal of ones: weights and exponents may differ by many decades.
    let scaled = DMatrix::from_fn(m.nrows(), m.ncols(), |a, b| m[(a, b)] / (diagonal[a] * diagonal[b]));
    match scaled.cholesky().map(|c| c.inverse()) {
        Some(inverse) => diagonal.iter().zip(inverse.diagonal().iter()).map(|(d, v)| v.sqrt() / d).collect(),
        None => open,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::direction_deg;

    /// A diffuse material: σ of the weight is that of the mean of its readings.
    #[test]
    fn a_diffuse_weight_is_as_sure_as_the_mean_of_its_readings() {
        let prior = Prior::usual(&"lambert".parse().expect("a model")).expect("space");
        let instrument = Instrument::default();
        let directions = Directions::List { wi: vec![direction_deg(20.0, 180.0)], wo: vec![direction_deg(60.0, 0.0)] };
        let got = precision(&prior, &instrument, &directions, &[0; 25]);
        let mut want: Vec<f64> = prior
            .draws()
            .iter()
            .map(|d| {
                let n = d[0] * std::f64::consts::FRAC_1_PI * 0.5 * 1e5;
                (n + 100.0).sqrt() / n / 5.0
            })
            .collect();
        want.sort_by(f64::total_cmp);
        assert!((got.errors[0][1] / want[24] - 1.0).abs() < 1e-12, "{:?} {}", got.errors, want[24]);
        assert_eq!((got.stops, got.rows, got.hours), (1, 25, 25.0 / 3600.0));
        let beyond = Directions::List { wi: vec![direction_deg(20.0, 180.0)], wo: vec![direction_deg(81.0, 0.0)] };
        assert_eq!(precision(&prior, &instrument, &beyond, &[0]).errors[0][1], f64::INFINITY);
    }
}
