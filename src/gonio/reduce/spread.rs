//! Errors of positions where a reading does not follow them in proportion: on the flank of a sharp lobe, at its peak.
//!
//! All errors are drawn together (GUM Supplement 1) and move the directions of a model that stays where it is: a fitted lobe stands about the mirror
//! direction wherever the axes' zeros are. The change's 95 % quantile over 1.96 is the σ of the normal distribution whose 95 % interval is as wide.
//!
//! Where errors lower all readings of a lobe, one that leaves the plane of a scan say, the lobe that was fitted is as much too low. So each draw's change
//! counts as often as what is read would then have to be higher: the largest reading without errors over the largest with them ([`Heights`]).

use std::sync::LazyLock;

use glam::DVec3;
use rayon::prelude::*;

use super::positions::{Off, Optics, Pose};
use crate::gonio::simulate::Truth;
use crate::numeric::stats::normal_quantile;

/// Draws: the quantile that they give scatters by about 1 %.
const DRAWS: usize = 1024;
/// Errors of positions that there are at most.
const MOST: usize = 11;
/// Share of the largest reading from which on one may be the largest under other errors; most that are asked; most that a draw may count.
const COUNTS: f64 = 0.01;
const PAIRS: usize = 256;
const HIGHEST: f64 = 3.0;

/// Standard normal numbers, even in all dimensions: the additive recurrence of the generalised golden ratio, x^(d + 1) = x + 1 (Roberts 2018).
static NORMAL: LazyLock<Vec<[f64; MOST]>> = LazyLock::new(|| {
    let ratio = (0..64).fold(1.0f64, |x, _| (1.0 + x).powf(1.0 / (MOST as f64 + 1.0)));
    let draw = |k: usize| {
        std::array::from_fn(|d| {
            let share = (0.5 + (k + 1) as f64 * ratio.powi(-(d as i32 + 1))).fract();
            normal_quantile(share.clamp(1e-12, 1.0 - 1e-12))
        })
    };
    (0..DRAWS).map(draw).collect()
});

/// How much higher the model must be under each draw of kept errors for its largest reading to be what it is, channel by channel.
#[derive(Debug)]
pub(super) struct Heights(Vec<Vec<f64>>);

impl Heights {
    /// By readings of these pairs of directions, those of a lobe's peak among them; `errors` are the kept ones, the first of all.
    pub fn new(optics: &Optics<'_>, pairs: &[(DVec3, DVec3)], errors: &[Off], model: &Truth<'_>, width: usize) -> Self {
        let still: Vec<Vec<f64>> = pairs.iter().map(|p| optics.flux(*p, &Pose::default(), model, width)).collect();
        let most = |list: &[Vec<f64>], c: usize| list.iter().map(|f| f[c]).fold(0.0, f64::max);
        let tops: Vec<f64> = (0..width).map(|c| most(&still, c)).collect();
        let counts = |f: &[f64]| f.iter().zip(&tops).any(|(f, top)| *f > COUNTS * top);
        let near: Vec<(DVec3, DVec3)> = pairs.iter().zip(&still).filter(|(_, f)| counts(f)).map(|(p, _)| *p).collect();
        let chosen: Vec<(DVec3, DVec3)> = near.iter().step_by(near.len().div_ceil(PAIRS).max(1)).copied().collect();
        let of_draw = |draw: &[f64; MOST]| {
            let off = pose(errors, draw);
            let read: Vec<Vec<f64>> = chosen.iter().map(|p| optics.flux(*p, &off, model, width)).collect();
            (0..width).map(|c| (tops[c] / most(&read, c)).clamp(1.0, HIGHEST)).collect()
        };
        Self(NORMAL.par_iter().map(of_draw).collect())
    }
}

fn pose(errors: &[Off], draw: &[f64; MOST]) -> Pose {
    errors.iter().zip(draw).fold(Pose::default(), |sum, ((_, of, sigma), z)| sum.plus(&of(z * sigma)))
}

/// The variance that stands for all errors of one reading together, channel by channel; `relative` is what each does to the reference,
/// `shifts` what the reading is corrected by on average.
pub(super) fn variances(
    optics: &Optics<'_>,
    pair: (DVec3, DVec3),
    (errors, heights): (&[Off], &Heights),
    relative: &[f64],
    model: &Truth<'_>,
    (values, shifts): (&[f64], &[f64]),
) -> Vec<f64> {
    let width = values.len();
    let still = optics.flux(pair, &Pose::default(), model, width);
    let per_flux = optics.scale(pair);
    let mut changes = vec![Vec::with_capacity(DRAWS); width];
    for (draw, heights) in NORMAL.iter().zip(&heights.0) {
        let of_reference: f64 = draw.iter().zip(relative).map(|(z, r)| z * r).sum();
        let read = optics.flux(pair, &pose(errors, draw), model, width);
        for (c, list) in changes.iter_mut().enumerate() {
            list.push((heights[c] * per_flux * (read[c] - still[c]) - shifts[c] - values[c] * of_reference).abs());
        }
    }
    changes.into_iter().map(|list| (quantile(list, 0.95) / normal_quantile(0.975)).powi(2)).collect()
}

/// The value below which a share `p` of the list lies; NaN where there are none.
fn quantile(mut list: Vec<f64>, p: f64) -> f64 {
    let at = ((p * list.len() as f64).ceil() as usize).saturating_sub(1);
    list.sort_by(f64::total_cmp);
    list.get(at).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums of draws in any direction are normal with the σ that they should have, and their 95 % quantile is where it should be.
    #[test]
    fn draws_are_normal_in_every_direction() {
        for turn in 0..40u32 {
            let weights: Vec<f64> = (0..MOST).map(|d| (f64::from(turn) + 1.7 * d as f64).sin()).collect();
            let length = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
            let sums: Vec<f64> =
                NORMAL.iter().map(|z| z.iter().zip(&weights).map(|(z, w)| z * w / length).sum::<f64>().abs()).collect();
            let rms = (sums.iter().map(|s| s * s).sum::<f64>() / DRAWS as f64).sqrt();
            let q = quantile(sums, 0.95) / normal_quantile(0.975);
            // Of independent draws the quantile would scatter by 3 %.
            assert!((rms - 1.0).abs() < 0.03 && (q - 1.0).abs() < 0.05, "{turn}: {rms} {q}");
        }
    }
}
