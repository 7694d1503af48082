//! What all errors of positions do to one reading, and where that belongs.

use glam::DVec3;

use super::alike::alike;
use super::bend::{self, Bend};
use super::positions::{Off, Optics, net};
use super::shared::{JITTER, Shared};
use super::spread::{self, Heights};
use crate::gonio::simulate::Truth;

/// Variance of a normal error's square, over the square of its mean: what is left of jitter's once its mean is taken off.
const SCATTER: f64 = 2.0;
/// Share of a value beyond which a mean shift is no small correction.
const FARTHEST: f64 = 0.3;
/// Share of the variance from which on squares of errors call for draws: a normal interval then holds 94.6 % of an exponential flank.
const BENT: f64 = 0.02;
/// Share from which on they are worth knowing: a lobe's readings on both sides of its peak cancel what is in proportion.
const CURVED: f64 = 1e-4;

/// Effects on one reading of one channel, 1/sr: u and q of every error, what kept ones do in second order where it matters, and the variance of all
/// together where the second order matters much.
#[derive(Debug)]
pub(super) struct Effect {
    parts: Vec<(f64, f64)>,
    /// The mean of what each axis' jitter does.
    shifts: Vec<f64>,
    /// What every two axes' jitter do together, 1 σ, where it matters.
    twists: Vec<f64>,
    /// The square of a mean shift that is not taken off.
    left: f64,
    bend: Option<Bend>,
    whole: Option<f64>,
}

impl Effect {
    /// Variances of first and second order.
    fn variances(&self, kept: usize) -> (f64, f64) {
        let linear = self.parts.iter().map(|(u, _)| u * u).sum();
        let squares = |list: &[(f64, f64)]| list.iter().map(|(_, q)| q * q).sum::<f64>();
        let bent = self.bend.as_ref().map_or_else(|| 3.0 * squares(&self.parts[..kept]), Bend::variance);
        let twisted: f64 = self.twists.iter().map(|h| h * h).sum();
        (linear, bent + SCATTER * squares(&self.parts[kept..]) + twisted + self.left)
    }

    /// What jitter's squares change a reading by on average: jitter blurs, and lowers a peak. A model whose change is as large as the value tells nothing.
    pub fn shift(&self, value: f64) -> f64 {
        let shift: f64 = self.shifts.iter().sum();
        if shift.abs() < FARTHEST * value.abs() { shift } else { 0.0 }
    }

    /// What the second order has of both.
    fn share(&self, kept: usize) -> f64 {
        let (linear, bent) = self.variances(kept);
        bent / (linear + bent)
    }

    /// What each axis' jitter does, 1 σ: in proportion, and by its square.
    fn of_stop(&self, kept: usize) -> Vec<f64> {
        let factor = self.factor(kept).sqrt();
        let alone = self.parts[kept..].iter().flat_map(|(u, q)| [factor * u, factor * SCATTER.sqrt() * q]);
        alone.chain(self.twists.iter().map(|h| factor * h)).collect()
    }

    /// The factor of both that makes them the whole.
    fn factor(&self, kept: usize) -> f64 {
        let (linear, bent) = self.variances(kept);
        self.whole.filter(|_| linear + bent > 0.0).map_or(1.0, |whole| whole / (linear + bent))
    }
}

/// Whether what errors' squares do is worth knowing beside what they do in proportion.
pub(super) fn is_curved(linear: &[f64], squares: &[f64]) -> bool {
    let sum = |list: &[f64]| list.iter().map(|x| x * x).sum::<f64>();
    let bent = 3.0 * sum(squares);
    bent > CURVED * (sum(linear) + bent)
}

/// How many of the errors the instrument keeps: the first ones.
pub(super) fn kept(errors: &[Off]) -> usize {
    errors.iter().filter(|(family, _, _)| *family != JITTER).count()
}

/// The effects on one reading, the mean over `stops` at a pair of directions, channel by channel.
pub(super) fn effects(
    optics: &Optics<'_>,
    (pair, stops): ((DVec3, DVec3), f64),
    errors: &[Off],
    reference: &[(f64, f64)],
    model: &Truth<'_>,
    values: &[f64],
) -> Vec<Effect> {
    let scale = optics.scale(pair);
    let (_, list) = optics.moved(pair, errors, model, values.len());
    let part = |c: usize, value: f64, k: usize| {
        let (u, q) = net(scale, value, list[k][c], reference[k]);
        if errors[k].0 != JITTER {
            return (u, q);
        }
        // Several stops average what moves, and the scatter of what bends.
        (u / stops.sqrt(), q / stops.sqrt())
    };
    let parts = |(c, value): (usize, &f64)| (0..errors.len()).map(|k| part(c, *value, k)).collect();
    let kept = kept(errors);
    let shifts = |(c, value): (usize, &f64)| {
        (kept..errors.len()).map(|k| net(scale, *value, list[k][c], reference[k]).1).collect()
    };
    let effect = |of: (usize, &f64)| {
        let twists = Vec::new();
        let effect = Effect { parts: parts(of), shifts: shifts(of), twists, left: 0.0, bend: None, whole: None };
        let left = effect.shifts.iter().sum::<f64>() - effect.shift(*of.1);
        Effect { left: left * left, ..effect }
    };
    let mut effects: Vec<Effect> = values.iter().enumerate().map(effect).collect();
    if effects.iter().all(|e| e.share(kept) <= CURVED) {
        return effects;
    }
    let products = |of: std::ops::Range<usize>| {
        let alone: Vec<Vec<f64>> = list[of.clone()].iter().map(|of| of.iter().map(|(_, q)| *q).collect()).collect();
        optics.products(pair, &errors[of], &alone, model, values.len())
    };
    let (of_kept, of_jitter) = (products(0..kept), products(kept..errors.len()));
    for (c, effect) in effects.iter_mut().enumerate() {
        effect.twists = of_jitter.iter().map(|of| scale * of[c] / stops.sqrt()).collect();
        if kept > 0 {
            let squares = effect.parts[..kept].iter().map(|(_, q)| *q).collect();
            effect.bend = Some(Bend { squares, products: of_kept.iter().map(|of| scale * of[c]).collect() });
        }
    }
    effects
}

/// Whether the second order of one of these matters so much that errors have to be drawn.
pub(super) fn is_bent(effects: &[Effect], errors: &[Off]) -> bool {
    effects.iter().any(|e| e.share(kept(errors)) > BENT)
}

/// Draws all errors of a reading where its second order calls for it.
pub(super) fn draw(
    effects: &mut [Effect],
    optics: &Optics<'_>,
    pair: (DVec3, DVec3),
    (errors, heights): (&[Off], &Heights),
    reference: &[(f64, f64)],
    model: &Truth<'_>,
    values: &[f64],
) {
    let relative: Vec<f64> = reference.iter().map(|(u, _)| *u).collect();
    let shifts: Vec<f64> = effects.iter().zip(values).map(|(e, value)| e.shift(*value)).collect();
    let whole = spread::variances(optics, pair, (errors, heights), &relative, model, (values, &shifts));
    let bent = effects.iter_mut().zip(whole).filter(|(e, _)| e.share(kept(errors)) > BENT);
    bent.for_each(|(e, v)| e.whole = Some(v));
}

/// Notes what jitter does to all channels of a reading alike, whose `list` are its places and effects.
pub(super) fn place_of_stop(list: &[(usize, Effect)], kept: usize, shared: &mut Shared<'_>) {
    let patterns: Vec<Vec<f64>> = list.iter().map(|(_, effect)| effect.of_stop(kept)).collect();
    list.iter().zip(alike(&patterns)).for_each(|((place, _), u)| shared.add_of_stop(*place, u));
}

/// Puts effects on readings of these places where they belong: what readings share into components, the rest into each one's own.
pub(super) fn place_all(list: &[(usize, Effect)], errors: &[Off], shared: &mut Shared<'_>) {
    let kept = kept(errors);
    for (place, effect) in list {
        let factor = effect.factor(kept);
        let twisted: f64 = effect.twists.iter().map(|h| h * h).sum();
        if twisted + effect.left > 0.0 {
            shared.add_own(JITTER, *place, factor * (twisted + effect.left));
        }
        for (k, ((family, _, _), (u, q))) in errors.iter().zip(&effect.parts).enumerate() {
            if k >= kept {
                shared.add_own(*family, *place, factor * (u * u + SCATTER * q * q));
                continue;
            }
            shared.add(*family, (k, 0), *place, factor.sqrt() * u);
            match &effect.bend {
                Some(bend) => shared.attribute(*family, *place, factor * bend.variance_of(k)),
                None => shared.add_own(*family, *place, factor * 3.0 * q * q),
            }
        }
    }
    place_bent(list, kept, shared);
}

/// The second order of kept errors, as components.
fn place_bent(list: &[(usize, Effect)], kept: usize, shared: &mut Shared<'_>) {
    let bent: Vec<(usize, Bend, f64)> = list
        .iter()
        .filter_map(|(place, effect)| {
            let factor = effect.factor(kept);
            Some((*place, effect.bend.as_ref()?.scaled(factor.sqrt()), factor * effect.variances(kept).0))
        })
        .collect();
    let (planes, own) = bend::components(&bent.iter().map(|(_, b, first)| (b, *first)).collect::<Vec<_>>());
    let places = || bent.iter().map(|(place, _, _)| *place);
    for plane in planes {
        shared.add_plane(places().zip(plane));
    }
    places().zip(own).for_each(|(place, variance)| shared.add_attributed(place, variance));
}
