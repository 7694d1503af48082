//! How well a scan tells the parameters of a model, over a prior of them.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::MAX_ANGLE_DEG;
use super::information::{Model, Noise};
use super::pair::Pair;
use super::prior::Prior;
use crate::geometry::angles::theta_of;
use crate::gonio::cost::hours;
use crate::gonio::effects::shadow::may_be_shadowed;
use crate::gonio::instrument::Instrument;
use crate::gonio::reduce::positions::Kept;
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
    /// Relative standard errors of a fit that weighs by all stated errors, parameter by parameter, at the 10 %, 50 % and 90 % quantiles of the prior: by readings' own noise and by what they
    /// share, errors of positions and the certificate. Infinite where the scan does not tell the parameter.
    pub errors: Vec<[f64; 3]>,
    /// Mean over the prior of ln det of the information of the noise on ln(parameter); −∞ where the scan leaves a parameter open anywhere in the prior.
    pub mean_ln_det: f64,
    /// The same with what readings share: minus the mean of ln det of the covariance.
    pub(super) mean_ln_sure: f64,
}

/// What a scan tells at one draw of the prior. A fit by stated errors (`use_sigma`) weighs readings by all of them.
#[derive(Debug, Clone)]
pub(super) struct Told {
    /// Information of the noise, parameters by parameters.
    own: DMatrix<f64>,
    /// A: the same by the fit's weights.
    pub normal: DMatrix<f64>,
    /// What the noise adds to the scatter of the fit's normal equations.
    spread: DMatrix<f64>,
    /// What each shared error of 1 σ does to them: parameters by errors.
    pub shared: DMatrix<f64>,
}

/// Quantiles of the prior that errors are given at.
pub const QUANTILES: [f64; 3] = [0.1, 0.5, 0.9];

/// The precision of a scan whose rows are read in this order, over the prior's draws.
#[must_use]
pub fn precision(prior: &Prior, instrument: &Instrument, directions: &Directions, rows: &[u32]) -> Precision {
    precisions(prior, instrument, (directions, rows), &[]).0
}

/// The same, and of that scan read so often that it takes each of these hours. Errors that are shared are as large as before; weights change. Rows must
/// not be none, nor take no time.
#[must_use]
pub fn precisions(
    prior: &Prior,
    instrument: &Instrument,
    (directions, rows): (&Directions, &[u32]),
    in_hours: &[f64],
) -> (Precision, Vec<Precision>) {
    let stops = stops(instrument, rows);
    let mut lengths: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    stops.iter().for_each(|(row, n)| lengths.entry(*row).or_default().push(*n));
    let of_pair = |(row, list): (u32, Vec<usize>)| (directions.pair(row as usize), list);
    let read: Vec<(Pair, Vec<usize>)> =
        lengths.into_iter().map(of_pair).filter(|(pair, _)| counts(*pair, instrument)).collect();
    let (model, noise, kept) = (Model::of(prior), Noise::of(instrument), Kept::of(instrument));
    let once = hours(instrument, directions, rows);
    let times: Vec<f64> = std::iter::once(1.0).chain(in_hours.iter().map(|hours| hours / once)).collect();
    let each: Vec<Vec<Told>> =
        prior.draws().par_iter().map(|draw| at(&model, (&noise, &kept), draw, &read, &times)).collect();
    let of = |i: usize| {
        let told: Vec<&Told> = each.iter().map(|of_times| &of_times[i]).collect();
        Precision::new(once * times[i], (stops.len(), rows.len()), &told)
    };
    (of(0), (1..times.len()).map(of).collect())
}

impl Precision {
    fn new(hours: f64, (stops, rows): (usize, usize), told: &[&Told]) -> Self {
        let covariances: Vec<Option<DMatrix<f64>>> = told.iter().map(|of| of.covariance()).collect();
        let parameters = told.first().map_or(0, |of| of.own.nrows());
        let quantiles = |a: usize| {
            // Rounding may leave nothing of a variance where A is nearly singular.
            let variance = |of: &DMatrix<f64>| Some(of[(a, a)]).filter(|v| *v > 0.0);
            let error = |of: &Option<DMatrix<f64>>| of.as_ref().and_then(variance).map_or(f64::INFINITY, f64::sqrt);
            let mut list: Vec<f64> = covariances.iter().map(error).collect();
            list.sort_by(f64::total_cmp);
            QUANTILES.map(|q| list[(q * (list.len() - 1) as f64).round() as usize])
        };
        let mean = |of: &dyn Fn(&Told) -> f64| told.iter().map(|t| of(t)).sum::<f64>() / told.len() as f64;
        Self {
            hours,
            stops,
            rows,
            errors: (0..parameters).map(quantiles).collect(),
            mean_ln_det: mean(&|t| ln_det(&t.own)),
            mean_ln_sure: mean(&Told::ln_sure),
        }
    }
}

/// ln det of a positive matrix, else −∞.
fn ln_det(m: &DMatrix<f64>) -> f64 {
    let of = |c: nalgebra::Cholesky<f64, nalgebra::Dyn>| c.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>();
    m.clone().cholesky().map_or(f64::NEG_INFINITY, |c| 2.0 * of(c))
}

/// Rows that are one stop: which, and how many.
fn stops(instrument: &Instrument, rows: &[u32]) -> Vec<(u32, usize)> {
    let blocks = rows.chunks(instrument.protocol.block as usize);
    blocks.flat_map(|block| block.chunk_by(|a, b| a == b).map(|same| (same[0], same.len()))).collect()
}

/// Whether a fit has it: no angle beyond the limit, not in the shadow.
pub(super) fn counts((wi, wo): Pair, instrument: &Instrument) -> bool {
    let most = MAX_ANGLE_DEG.to_radians() + 1e-9;
    theta_of(wi) <= most && theta_of(wo) <= most && !may_be_shadowed(wi, wo, instrument)
}

/// What all stops tell at one draw of the parameters, read so many times: pairs with the numbers of rows of their stops.
fn at(
    model: &Model,
    (noise, kept): (&Noise<'_>, &Kept<'_>),
    draw: &[f64],
    pairs: &[(Pair, Vec<usize>)],
    times: &[f64],
) -> Vec<Told> {
    let p = model.parameters();
    let mut told = vec![Told::new(p, kept.len()); times.len()];
    let mut gradient = vec![0.0; p];
    let truth = model.truth(draw);
    for (pair, stops) in pairs {
        let f = model.value(draw, *pair, &mut gradient);
        let Some(own) = noise.variance(f, *pair) else { continue };
        let jitter = noise.jitter(model, draw, *pair);
        let once: f64 = stops.iter().map(|rows| 1.0 / (own / *rows as f64 + jitter)).sum();
        let shared = kept.components(*pair, f, &truth);
        told.iter_mut().zip(times).for_each(|(told, times)| told.add(&gradient, 1.0 / (once * times), &shared));
    }
    told
}

impl Told {
    pub fn new(parameters: usize, shared: usize) -> Self {
        let nothing = DMatrix::zeros(parameters, parameters);
        Self {
            own: nothing.clone(),
            normal: nothing.clone(),
            spread: nothing,
            shared: DMatrix::zeros(parameters, shared),
        }
    }

    /// Adds a reading of this variance of its own, and these errors that it shares.
    pub fn add(&mut self, gradient: &[f64], own: f64, shared: &[f64]) {
        let weight = 1.0 / (own + shared.iter().map(|u| u * u).sum::<f64>());
        let g = DVector::from_column_slice(gradient);
        self.own.ger(1.0 / own, &g, &g, 1.0);
        self.normal.ger(weight, &g, &g, 1.0);
        self.spread.ger(weight * weight * own, &g, &g, 1.0);
        self.shared.ger(weight, &g, &DVector::from_column_slice(shared), 1.0);
    }

    /// A⁻¹ (B + G Gᵀ) A⁻¹; nothing where A is singular.
    fn covariance(&self) -> Option<DMatrix<f64>> {
        let diagonal: Vec<f64> = self.normal.diagonal().iter().map(|d| d.sqrt()).collect();
        if diagonal.contains(&0.0) {
            return None;
        }
        // Scaled to a diagonal of ones: weights and exponents may differ by many decades.
        let scaled =
            |m: &DMatrix<f64>| DMatrix::from_fn(m.nrows(), m.ncols(), |a, b| m[(a, b)] / diagonal[a] / diagonal[b]);
        let inverse = scaled(&self.normal).cholesky()?.inverse();
        let covariance = &inverse * scaled(&self.scatter()) * &inverse;
        Some(scaled(&covariance))
    }

    /// B + G Gᵀ.
    pub fn scatter(&self) -> DMatrix<f64> {
        &self.spread + &self.shared * self.shared.transpose()
    }

    /// Minus ln det of the covariance; −∞ where A is singular, or B + G Gᵀ to rounding.
    pub fn ln_sure(&self) -> f64 {
        let (normal, scatter) = (ln_det(&self.normal), ln_det(&self.scatter()));
        if scatter == f64::NEG_INFINITY { scatter } else { 2.0 * normal - scatter }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::direction_deg;

    /// By hand, of one parameter with g = 2 and two readings: own variances 0.01 and 0.04, one shared error of 0.1 and 0.3 besides one of the first alone, 0.2.
    #[test]
    fn covariance_is_that_of_a_fit_that_weighs_all_errors() {
        let mut told = Told::new(1, 2);
        told.add(&[2.0], 0.01, &[0.1, 0.2]);
        told.add(&[2.0], 0.04, &[0.3, 0.0]);
        let w: [f64; 2] = [1.0 / (0.01 + 0.01 + 0.04), 1.0 / (0.04 + 0.09)];
        let a = 4.0 * (w[0] + w[1]);
        let own = 4.0 * (w[0] * w[0] * 0.01 + w[1] * w[1] * 0.04);
        let shared = 4.0 * ((w[0] * 0.1 + w[1] * 0.3).powi(2) + (w[0] * 0.2).powi(2));
        let want = (own + shared) / (a * a);
        let got = told.covariance().expect("determined")[(0, 0)];
        assert!((got / want - 1.0).abs() < 1e-14, "{got} {want}");
        assert!((told.ln_sure() + want.ln()).abs() < 1e-12);
        assert!((ln_det(&told.own) - (4.0f64 * (100.0 + 25.0)).ln()).abs() < 1e-12);
        assert!(Told::new(1, 2).covariance().is_none() && Told::new(1, 2).ln_sure() == f64::NEG_INFINITY);
    }

    /// Read four times as often: a fourth of the noise's variance, and of a certificate's error all of it.
    #[test]
    fn more_hours_lessen_the_noise_and_not_the_certificate() {
        let prior = Prior::usual(&"lambert".parse().expect("a model")).expect("space");
        let mut instrument = Instrument::default();
        instrument.reference.reflectance_u = 0.01;
        let directions = Directions::List { wi: vec![direction_deg(20.0, 180.0)], wo: vec![direction_deg(60.0, 0.0)] };
        let hours = precision(&prior, &instrument, &directions, &[0; 25]).hours;
        let (once, more) = precisions(&prior, &instrument, (&directions, &[0; 25]), &[hours, 4.0 * hours]);
        let noise = |of: &Precision| of.errors[0][1].powi(2) - 1e-4;
        assert_eq!(more[0].errors, once.errors);
        assert!((4.0 * noise(&more[1]) / noise(&once) - 1.0).abs() < 1e-6, "{once:?} {more:?}");
    }

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
