//! Lobes as an instrument sees them: averaged over the cones of its source and its aperture.
//!
//! A reduced reading is ⟨f cosθo⟩/⟨cosθo⟩, means over both cones; ⟨cosθo⟩ = cosθo (1 + cos a)/2 for an aperture of half
//! angle a, and a Lambert lobe is read as it is. Of a Phong lobe that depends on two numbers besides the
//! exponent: the angle α between the mirror direction r and wo, and q = cosθi/cosθo. For the mean of cosⁿ∠(r′, w′) w′ over r′ about r and w′
//! about wo lies in the plane of both, U(α) wo + W(α) r, and its z component over cosθo is U + q W. U and W with their derivatives by n are
//! tabulated (`seen`); then a sample costs an interpolation, whatever the cones. Where the spot has a size and source or detector are near, each of
//! its points sees both in directions of its own: the mean over it is a sum of such interpolations, of as many as lobe and spot call for.
//!
//! Limits: the lobe's own end at α = 90° is smeared by rules that do not follow it exactly, so broad lobes (n below 2) are off by up to 1e-3 of their
//! peak within an aperture's radius of it; pairs whose cones reach below the horizon have no place. Lobes narrower than 1/45 of the spot's smear (n above
//! 2.6e6 for 1.6°) are sums over points that stand too far apart.

mod disc;
mod seats;
mod seen;
mod table;

use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;

use self::disc::{Disc, power_of_alpha};
use self::seats::{Kept, Seat};
use self::seen::{Seen, Tables};
use super::instrument::Instrument;
use super::spot::{FINEST, Spot, View};
use crate::brdf::{LobeKind, Material, Place, Sight};
use crate::geometry::angles::{angle_between, theta_of};
use crate::geometry::mirror;
use crate::measurement::Dimension;

/// Half angle of a cone times √n from which on a lobe is narrow in it.
const NARROW: f64 = 1.5;
/// Exponents from which on a lobe is nothing at its end, a right angle off.
const ENDLESS: f64 = 100.0;
/// By which share of what is read nearer to the peak a table may be off, and of the peak by rounding; how much nearer: widths 1/√n of the lobe, and the
/// share that is left of the distance from the cones' reach.
const TABLED: f64 = 3e-9;
const ROUNDED: f64 = 1e-12;
const PIECES: f64 = 1.0;
const APART: f64 = 0.5;

/// How good a mean over the spot is: a share of the lobe's peak, and the order a + b s of the rule that reaches it, the lobe's width being 1/s of the
/// spot's smear.
#[derive(Debug, Clone, Copy)]
struct Finesse {
    error: f64,
    order: (f64, f64),
    /// The finest that is made.
    most: usize,
    /// The share of the narrower cone's half angle that a lobe is no narrower than, as it is seen through both.
    blurred: f64,
}

const FINE: Finesse = Finesse { error: 1e-9, order: (2.3, 2.8), most: FINEST, blurred: 0.0 };
/// As long as a lobe is no narrower than a tenth of the smear.
const ROUGH: Finesse = Finesse { error: 1e-4, order: (0.7, 1.35), most: 14, blurred: 0.5 };
/// Widths 1/√n from its peak where a lobe is nothing.
const NOWHERE: f64 = 9.0;

/// An instrument's source, aperture and spot, as lobes are seen through them.
#[derive(Debug)]
pub struct Cones {
    source: Disc,
    detector: Disc,
    /// None where both are points.
    tables: Option<Arc<Tables>>,
    spot: Option<Spot>,
    finesse: Finesse,
    /// What fits ask for again and again.
    kept: Kept,
}

impl Cones {
    /// Those of an instrument; `None` where lobes are seen as they are.
    #[must_use]
    pub fn of(instrument: &Instrument) -> Option<Self> {
        let spot = Spot::of(instrument, Dimension::Space);
        Self::new(instrument.source.half_angle(), instrument.detector.half_angle(), spot)
    }

    /// Cones of these half angles, rad, and a spot, where it matters; `None` for points.
    pub(super) fn new(source: f64, detector: f64, spot: Option<Spot>) -> Option<Self> {
        let (source, detector) = (Disc { half: source }, Disc { half: detector });
        let wide = source.half > 0.0 || detector.half > 0.0;
        let any = wide || spot.is_some();
        let tables = || wide.then(|| Tables::of(source, detector));
        any.then(|| Self { source, detector, tables: tables(), spot, finesse: FINE, kept: Kept::default() })
    }

    /// The same, with means over the spot to 1e-4 of each lobe's peak: enough to tell what errors of positions do.
    #[must_use]
    pub fn rough(self) -> Self {
        Self { finesse: ROUGH, ..self }
    }

    /// Whether sums over directions take longer than tables of a lobe of exponent `n`: over two cones at once, or one that the lobe is narrow in.
    pub(super) fn are_wide_for(&self, n: f64) -> bool {
        let narrow = |disc: Disc| disc.half * n.sqrt() > NARROW;
        narrow(self.source) || narrow(self.detector) || self.source.half > 0.0 && self.detector.half > 0.0
    }

    /// Writes ⟨f cosθo⟩ of a material at one point of the spot, all channels, and returns by which share of itself it may be off; `None` where that is not
    /// known: where a cone reaches below the horizon, or over the end of a broad lobe.
    pub(super) fn write_flux(&self, material: &Material, wi: DVec3, wo: DVec3, out: &mut [f64]) -> Option<f64> {
        let Place { alpha, ratio, .. } = self.place(wi, wo)?;
        let outer = self.source.half + self.detector.half;
        let mut off = vec![0.0; out.len()];
        out.fill(0.0);
        for term in &material.lobes {
            for (c, out) in out.iter_mut().enumerate() {
                let Some(shape) = term.shape_of(c) else { continue };
                let &[n] = &shape[..] else {
                    *out += term.weight[c] * term.kind.lobe().value(&[], 0.0, &mut []);
                    continue;
                };
                if n < ENDLESS && alpha + outer > FRAC_PI_2 {
                    return None;
                }
                // A table errs as much as the lobe is high within a piece of it; pieces are wider the farther off they are.
                let nearer = (alpha - PIECES / n.sqrt()).min(outer + APART * (alpha - outer)).max(0.0);
                let seen = self.seen(n);
                let [here, near, peak] =
                    [alpha, nearer, 0.0].map(|alpha| self.read(seen.as_deref(), n, alpha, ratio).0);
                *out += term.weight[c] * here;
                off[c] += term.weight[c] * (TABLED * near + ROUNDED * peak);
            }
        }
        let share = |(off, value): (&f64, &f64)| if *off > 0.0 { off / value.abs() } else { 0.0 };
        let worst = off.iter().zip(&*out).map(share).fold(0.0, f64::max);
        let cos = wo.z * self.mean_cos();
        out.iter_mut().for_each(|value| *value *= cos);
        Some(worst)
    }

    /// Writes what is read of a material at (wi, wo), all channels, 1/sr; its own value where a cone reaches below the horizon.
    pub fn write_value(&self, material: &Material, wi: DVec3, wo: DVec3, out: &mut [f64]) {
        let Some(place) = self.place(wi, wo) else { return material.write_value(wi, wo, out) };
        out.fill(0.0);
        // The points of the last order that a lobe asked for.
        let mut at: (Option<usize>, Vec<Seat>) = (None, Vec::new());
        for term in &material.lobes {
            // Channels mostly share their shape.
            let mut last = (f64::NAN, 0.0);
            for (c, out) in out.iter_mut().enumerate() {
                let Some(shape) = term.shape_of(c) else { continue };
                let value = match shape[..] {
                    [n] if n == last.0 => last.1,
                    [n] => {
                        let order = self.order(&place, n);
                        if order != at.0 {
                            at = (order, self.seats(&place, order));
                        }
                        self.mean(self.seen(n).as_deref(), n, &place, &at.1).0
                    }
                    _ => term.kind.lobe().value(&[], 0.0, &mut []),
                };
                last = (shape.first().copied().unwrap_or(f64::NAN), value);
                *out += term.weight[c] * value;
            }
        }
    }

    /// The mean of cosθo over the aperture, over its value in the middle: (1 + cos a)/2.
    fn mean_cos(&self) -> f64 {
        (0.5 * self.detector.half).cos().powi(2)
    }

    /// U and W of a lobe; none for points, which see it as it is.
    fn seen(&self, n: f64) -> Option<Arc<Seen>> {
        self.tables.as_ref().map(|tables| tables.at(n))
    }

    /// A lobe of weight 1 as it is read from one point of the spot at α, q = cosθi/cosθo being `q`, 1/sr, and its derivative by n.
    fn read(&self, seen: Option<&Seen>, n: f64, alpha: f64, q: f64) -> (f64, f64) {
        self.scaled(n, bare(seen, n, alpha, q))
    }

    /// The mean of [`Self::read`] over the spot, what reflects more light counting more; that of the middle without points.
    fn mean(&self, seen: Option<&Seen>, n: f64, place: &Place, seats: &[Seat]) -> (f64, f64) {
        if seats.is_empty() {
            return self.read(seen, n, place.alpha, place.ratio);
        }
        let sums = seats.iter().fold((0.0, 0.0), |sums, seat| {
            let (value, slope) = bare(seen, n, seat.alpha, seat.ratio);
            (sums.0 + seat.weight * value, sums.1 + seat.weight * slope)
        });
        self.scaled(n, sums)
    }

    /// A mean of cosⁿα and its derivative by n as those of the lobe that is read.
    fn scaled(&self, n: f64, (value, slope): (f64, f64)) -> (f64, f64) {
        let scale = 1.0 / (TAU * self.mean_cos());
        ((n + 2.0) * scale * value, ((n + 2.0) * slope + value) * scale)
    }

    /// The order of the rule over the spot that a lobe asks for; `None` where the middle tells all: without a spot, and where the lobe is nothing.
    fn order(&self, place: &Place, n: f64) -> Option<usize> {
        let spot = self.spot.as_ref()?;
        let Place { alpha, smear, wi, wo, .. } = *place;
        if alpha > self.source.half + self.detector.half + smear + NOWHERE / n.sqrt() {
            return None;
        }
        let Finesse { error, order: (least, per_width), most, blurred } = self.finesse;
        let width = n.sqrt().recip().hypot(blurred * self.source.half.min(self.detector.half));
        let order = (least + per_width * smear / width).ceil() as usize;
        Some(order.min(most).max(spot.smooth_order((wi, wo), error)))
    }

    /// The points of the spot by the rule of an order, what they count adding up to 1; none without one.
    fn seats(&self, place: &Place, order: Option<usize>) -> Vec<Seat> {
        match (&self.spot, order) {
            (Some(spot), Some(order)) => seats::of(spot, place, order),
            _ => Vec::new(),
        }
    }
}

/// U + q W at α, and its derivative by n.
fn bare(seen: Option<&Seen>, n: f64, alpha: f64, q: f64) -> (f64, f64) {
    let Some(seen) = seen else { return power_of_alpha(n, alpha).into() };
    let [u, w, du, dw] = seen.at(alpha);
    (u + q * w, du + q * dw)
}

impl Sight for Cones {
    fn describe(&self) -> String {
        let full = |disc: Disc| format!("{:.3}°", 2.0 * disc.half.to_degrees());
        let spot = if self.spot.is_some() { ", a spot of some size" } else { "" };
        format!("an aperture of {}, a divergence of {}{spot}", full(self.detector), full(self.source))
    }

    fn place(&self, wi: DVec3, wo: DVec3) -> Option<Place> {
        let points = View { smear: 0.0, theta: [theta_of(wi), theta_of(wo)] };
        let View { smear, theta } = self.spot.as_ref().map_or(points, |spot| spot.view((wi, wo)));
        let above = theta[0] + self.source.half < FRAC_PI_2 && theta[1] + self.detector.half < FRAC_PI_2;
        let above = above && self.spot.as_ref().is_none_or(|spot| spot.is_within((wi, wo)));
        let alpha = angle_between(mirror(wi), wo);
        above.then(|| Place { alpha, ratio: wi.z / wo.z, smear, wi, wo })
    }

    fn prepare(&self, _kind: LobeKind, shape: &[f64], until: Instant) -> bool {
        shape.iter().all(|n| self.tables.as_ref().is_none_or(|tables| tables.prepare(*n, until)))
    }

    fn anew(&self) -> Option<Arc<dyn Sight>> {
        let Self { source, detector, spot, finesse, .. } = *self;
        let tables = self.tables.as_ref().map(|_| Arc::new(Tables::new(source, detector)));
        Some(Arc::new(Self { source, detector, tables, spot, finesse, kept: Kept::default() }))
    }

    fn fill(&self, kind: LobeKind, shape: &[f64], places: &[Place], values: &mut [f64], derivatives: &mut [Vec<f64>]) {
        let (&[n], Some(slopes)) = (shape, derivatives.first_mut()) else {
            values.fill(kind.lobe().value(&[], 0.0, &mut []));
            return;
        };
        let seen = self.seen(n);
        for (i, place) in places.iter().enumerate() {
            let order = self.order(place, n);
            let seats = order.map(|order| self.kept.get(place, order, || self.seats(place, Some(order))));
            (values[i], slopes[i]) = self.mean(seen.as_deref(), n, place, seats.as_deref().unwrap_or_default());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_made_anew_is_the_same_and_nobody_elses() {
        let cones = Cones::new(0.013, 0.031, None).expect("wide");
        let read = |sight: &dyn Sight| {
            let [wi, wo] = [0.5f64, 0.45].map(|theta| DVec3::new(theta.sin(), 0.0, theta.cos()));
            let place = sight.place(DVec3::new(-wi.x, 0.0, wi.z), wo).expect("above the horizon");
            let (mut value, mut slopes) = ([0.0], [vec![0.0]]);
            sight.fill(LobeKind::Phong, &[200.0], &[place], &mut value, &mut slopes);
            (value[0].to_bits(), slopes[0][0].to_bits())
        };
        let known = read(&cones);
        // A time that is over makes nothing: what is known is there, what is made anew is not.
        let past = Instant::now();
        assert!(cones.prepare(LobeKind::Phong, &[200.0], past));
        let anew = cones.anew().expect("tables are kept");
        assert!(!anew.prepare(LobeKind::Phong, &[200.0], past));
        assert_eq!(read(&*anew), known);
        assert_eq!(anew.describe(), cones.describe());
    }
}
