//! Noise or model error? Residuals of neighbouring directions are independent where they are noise, and alike where the model can't
//! bend as the material does.

use crate::measurement::{Directions, Measurement};

use super::samples::Block;

/// Sums over pairs of neighbours.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Neighbours {
    /// Σ √(w w′) r r′.
    product: f64,
    /// Σ √(w w′) (r² + r′²)/2.
    square: f64,
    /// Pairs.
    count: usize,
}

/// Incidences closer than this (chord of the unit sphere) are the same.
const SAME_INCIDENCE: f64 = 1e-4;
/// Directions farther apart than this (chord, about 14°) are no neighbours.
const FARTHEST: f64 = 0.25;

impl Neighbours {
    /// Whether each sample of a block is a neighbour of the one before.
    pub fn pairs(measurement: &Measurement, block: &Block) -> Vec<bool> {
        let near = |pair: &[u32]| match &measurement.directions {
            Directions::Merl(_) => pair[1] == pair[0] + 1,
            Directions::List { wi, wo } => {
                let (a, b) = (pair[0] as usize, pair[1] as usize);
                wi[a].distance(wi[b]) < SAME_INCIDENCE && wo[a].distance(wo[b]) < FARTHEST
            }
        };
        std::iter::once(false).take(block.len()).chain(block.index.windows(2).map(near)).collect()
    }

    /// Sums over one channel of a block; `trust` is the robust weight of each residual.
    pub fn of(r: &[f64], trust: &[f64], w: &[f64], pairs: &[bool]) -> Self {
        let mut sums = Self::default();
        for i in (1..r.len()).filter(|&i| pairs[i]) {
            let weight = (w[i] * trust[i] * w[i - 1] * trust[i - 1]).sqrt();
            if weight > 0.0 {
                sums.product += weight * r[i] * r[i - 1];
                sums.square += 0.5 * weight * (r[i] * r[i] + r[i - 1] * r[i - 1]);
                sums.count += 1;
            }
        }
        sums
    }

    pub fn add(&mut self, other: &Self) {
        self.product += other.product;
        self.square += other.square;
        self.count += other.count;
    }

    /// Correlation of neighbours' residuals, and its standard error were they independent; `None` for too few pairs.
    pub fn correlation(&self) -> Option<(f64, f64)> {
        let enough = self.count >= 30 && self.square > 0.0;
        enough.then(|| (self.product / self.square, 1.0 / (self.count as f64).sqrt()))
    }
}

/// What the residuals are made of, in the loss's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Structure {
    /// rmse that noise explains.
    pub noise: f64,
    /// rmse of the model's own error.
    pub model: f64,
    /// Whether the noise is from stated σ, not from the residuals of neighbours.
    pub from_sigma: bool,
    /// Share of the residuals' variance that is structured, where it can be told.
    pub share: f64,
    /// How many independent samples the residuals are worth.
    pub effective_samples: f64,
}

/// Splits an rmse. `stated` is the rmse that stated σ explain.
pub(super) fn structure(rmse: f64, stated: Option<f64>, neighbours: &Neighbours, samples: usize) -> Option<Structure> {
    let correlation = neighbours.correlation();
    // A correlation within its own noise is none.
    let real = correlation.map(|(rho, error)| if rho > 3.0 * error { rho.min(1.0) } else { 0.0 });
    let noise = match (stated, real) {
        (Some(noise), _) => noise.min(rmse),
        (None, Some(rho)) => rmse * (1.0 - rho).sqrt(),
        (None, None) => return None,
    };
    let model = (rmse * rmse - noise * noise).max(0.0).sqrt();
    let share = if rmse > 0.0 { (model / rmse).powi(2) } else { 0.0 };
    let rho = real.unwrap_or(0.0);
    let effective_samples = samples as f64 * (1.0 - rho) / (1.0 + rho);
    Some(Structure { noise, model, from_sigma: stated.is_some(), share, effective_samples })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::{Purpose, RngExt, stream};

    #[test]
    fn independent_residuals_are_noise_and_slow_ones_model_error() {
        let mut rng = stream(3, Purpose::Study, 9);
        let n = 20_000;
        let noise: Vec<f64> = (0..n).map(|_| rng.random::<f64>() - 0.5).collect();
        let slow: Vec<f64> = (0..n).map(|i| 0.5 * (0.01 * f64::from(i)).sin()).collect();
        let both: Vec<f64> = noise.iter().zip(&slow).map(|(a, b)| a + b).collect();
        let (one, pairs) = (vec![1.0; n as usize], vec![true; n as usize]);
        let split = |r: &[f64]| {
            let rmse = (r.iter().map(|r| r * r).sum::<f64>() / f64::from(n)).sqrt();
            structure(rmse, None, &Neighbours::of(r, &one, &one, &pairs), n as usize).expect("pairs")
        };
        let (a, b, c) = (split(&noise), split(&slow), split(&both));
        assert_eq!((a.share, a.effective_samples), (0.0, f64::from(n)));
        assert!(b.share > 0.999 && b.effective_samples < 10.0, "{b:?}");
        assert!((c.noise / (1.0f64 / 12.0).sqrt() - 1.0).abs() < 0.02, "{c:?}");
        assert!((c.model / 0.125f64.sqrt() - 1.0).abs() < 0.02, "{c:?}");
        assert!(structure(1.0, None, &Neighbours::default(), 5).is_none());
    }
}
