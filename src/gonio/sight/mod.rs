//! Lobes as an instrument sees them: averaged over the cones of its source and its aperture.
//!
//! A reduced reading is ⟨f cosθo⟩/⟨cosθo⟩, means over both cones; ⟨cosθo⟩ = cosθo (1 + cos a)/2 for an aperture of half
//! angle a, and a Lambert lobe is read as it is. Of a Phong lobe that depends on two numbers besides the
//! exponent: the angle α between the mirror direction r and wo, and q = cosθi/cosθo. For the mean of cosⁿ∠(r′, w′) w′ over r′ about r and w′
//! about wo lies in the plane of both, U(α) wo + W(α) r, and its z component over cosθo is U + q W. U and W with their derivatives by n are
//! tabulated (`seen`); then a sample costs an interpolation, whatever the cones.
//!
//! Limits: the lobe's own end at α = 90° is smeared by rules that do not follow it exactly, so broad lobes (n below 2) are off by up to 1e-3 of their
//! peak within an aperture's radius of it; pairs whose cones reach below the horizon have no place.

mod disc;
mod seen;
mod table;

use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;

use self::disc::Disc;
use self::seen::Tables;
use super::instrument::Instrument;
use crate::brdf::{LobeKind, Material, Sight};
use crate::geometry::angles::{angle_between, theta_of};
use crate::geometry::mirror;

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

/// An instrument's source and aperture, as lobes are seen through them.
#[derive(Debug)]
pub struct Cones {
    source: Disc,
    detector: Disc,
    tables: Arc<Tables>,
}

impl Cones {
    /// Those of an instrument; `None` where both are points, so that lobes are seen as they are.
    #[must_use]
    pub fn of(instrument: &Instrument) -> Option<Self> {
        let source = Disc { half: instrument.source.half_angle() };
        let detector = Disc { half: instrument.detector.half_angle() };
        Self::new(source.half, detector.half)
    }

    /// Those of these half angles, rad; `None` for points.
    pub(super) fn new(source: f64, detector: f64) -> Option<Self> {
        let (source, detector) = (Disc { half: source }, Disc { half: detector });
        let any = source.half > 0.0 || detector.half > 0.0;
        any.then(|| Self { source, detector, tables: Tables::of(source, detector) })
    }

    /// Whether sums over directions take longer than tables of a lobe of exponent `n`: over two cones at once, or one that the lobe is narrow in.
    pub(super) fn are_wide_for(&self, n: f64) -> bool {
        let narrow = |disc: Disc| disc.half * n.sqrt() > NARROW;
        narrow(self.source) || narrow(self.detector) || self.source.half > 0.0 && self.detector.half > 0.0
    }

    /// Writes ⟨f cosθo⟩ of a material, all channels, and returns by which share of itself it may be off; `None` where that is not known: where a cone
    /// reaches below the horizon, or over the end of a broad lobe.
    pub(super) fn write_flux(&self, material: &Material, wi: DVec3, wo: DVec3, out: &mut [f64]) -> Option<f64> {
        let place @ [alpha, q] = self.place(wi, wo)?;
        let outer = self.source.half + self.detector.half;
        let mut off = vec![0.0; out.len()];
        out.fill(0.0);
        for term in &material.lobes {
            for (c, out) in out.iter_mut().enumerate() {
                let Some(shape) = term.shape_of(c) else { continue };
                let n = shape.first().copied().unwrap_or(f64::INFINITY);
                if n < ENDLESS && alpha + outer > FRAC_PI_2 {
                    return None;
                }
                // A table errs as much as the lobe is high within a piece of it; pieces are wider the farther off they are.
                let nearer = (alpha - PIECES / n.sqrt()).min(outer + APART * (alpha - outer)).max(0.0);
                let (mut values, mut slopes) = ([0.0; 3], vec![vec![0.0; 3]; shape.len()]);
                self.fill(term.kind, &shape, &[place, [nearer, q], [0.0, q]], &mut values, &mut slopes);
                *out += term.weight[c] * values[0];
                if !shape.is_empty() {
                    off[c] += term.weight[c] * (TABLED * values[1] + ROUNDED * values[2]);
                }
            }
        }
        let share = |(off, value): (&f64, &f64)| if *off > 0.0 { off / value.abs() } else { 0.0 };
        let worst = off.iter().zip(&*out).map(share).fold(0.0, f64::max);
        let cos = wo.z * (0.5 * self.detector.half).cos().powi(2);
        out.iter_mut().for_each(|value| *value *= cos);
        Some(worst)
    }

    /// Writes what is read of a material at (wi, wo), all channels, 1/sr; its own value where a cone reaches below the horizon.
    pub fn write_value(&self, material: &Material, wi: DVec3, wo: DVec3, out: &mut [f64]) {
        let Some(place) = self.place(wi, wo) else { return material.write_value(wi, wo, out) };
        out.fill(0.0);
        for term in &material.lobes {
            for (c, out) in out.iter_mut().enumerate() {
                let Some(shape) = term.shape_of(c) else { continue };
                let (mut value, mut slopes) = ([0.0], vec![vec![0.0]; shape.len()]);
                self.fill(term.kind, &shape, &[place], &mut value, &mut slopes);
                *out += term.weight[c] * value[0];
            }
        }
    }
}

impl Sight for Cones {
    fn describe(&self) -> String {
        let full = |disc: Disc| format!("{:.3}°", 2.0 * disc.half.to_degrees());
        format!("an aperture of {}, a divergence of {}", full(self.detector), full(self.source))
    }

    fn place(&self, wi: DVec3, wo: DVec3) -> Option<[f64; 2]> {
        let above = theta_of(wi) + self.source.half < FRAC_PI_2 && theta_of(wo) + self.detector.half < FRAC_PI_2;
        above.then(|| [angle_between(mirror(wi), wo), wi.z / wo.z])
    }

    fn prepare(&self, _kind: LobeKind, shape: &[f64], until: Instant) -> bool {
        shape.iter().all(|n| self.tables.prepare(*n, until))
    }

    fn fill(
        &self,
        kind: LobeKind,
        shape: &[f64],
        places: &[[f64; 2]],
        values: &mut [f64],
        derivatives: &mut [Vec<f64>],
    ) {
        let (&[n], Some(slopes)) = (shape, derivatives.first_mut()) else {
            values.fill(kind.lobe().value(&[], 0.0, &mut []));
            return;
        };
        // (1 + cos a)/2.
        let scale = 1.0 / (TAU * (0.5 * self.detector.half).cos().powi(2));
        let seen = self.tables.at(n);
        for (i, [alpha, q]) in places.iter().enumerate() {
            let [u, w, du, dw] = seen.at(*alpha);
            let (value, slope) = (u + q * w, du + q * dw);
            values[i] = (n + 2.0) * scale * value;
            slopes[i] = ((n + 2.0) * slope + value) * scale;
        }
    }
}
