//! Lobes as an instrument sees them: averaged over the cones of its source and its aperture.
//!
//! A reduced reading is ⟨f cosθo⟩/⟨cosθo⟩, means over both cones; ⟨cosθo⟩ = cosθo (1 + cos a)/2 for an aperture of half
//! angle a, and a Lambert lobe is read as it is. Of a Phong lobe that depends on two numbers besides the
//! exponent: the angle α between the mirror direction r and wo, and q = cosθi/cosθo. For the mean of cosⁿ∠(r′, w′) w′ over r′ about r and w′
//! about wo lies in the plane of both, U(α) wo + W(α) r, and its z component over cosθo is U + q W. U and W with their derivatives by n are
//! tabulated once for each n; then a sample costs an interpolation, whatever the cones.
//!
//! Limits: the lobe's own end at α = 90° is smeared by rules that do not follow it exactly, so broad lobes (n below 2) are off by up to 1e-3 of their
//! peak within an aperture's radius of it; pairs whose cones reach below the horizon have no place.

mod disc;
mod table;

use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use glam::DVec3;

use self::disc::{Disc, Jet, split};
use self::table::Table;
use super::instrument::Instrument;
use crate::brdf::{LobeKind, Material, Sight};
use crate::geometry::angles::{angle_between, theta_of};
use crate::geometry::mirror;

/// U, W and their derivatives by n.
type Seen = Table<4>;
/// A table that is made when it is first asked for, under the bits of its n.
type Slot = (u64, Arc<OnceLock<Seen>>);

/// Tables that are kept.
const KEPT: usize = 256;

/// An instrument's source and aperture, as lobes are seen through them.
#[derive(Debug)]
pub struct Cones {
    source: Disc,
    detector: Disc,
    tables: Mutex<Vec<Slot>>,
}

impl Cones {
    /// Those of an instrument; `None` where both are points, so that lobes are seen as they are.
    #[must_use]
    pub fn of(instrument: &Instrument) -> Option<Self> {
        let source = Disc { half: instrument.source.half_angle() };
        let detector = Disc { half: instrument.detector.half_angle() };
        let any = source.half > 0.0 || detector.half > 0.0;
        any.then(|| Self { source, detector, tables: Mutex::default() })
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

    /// The table for exponent `n`.
    fn seen(&self, n: f64) -> Arc<OnceLock<Seen>> {
        let mut tables = self.tables.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, slot)) = tables.iter().find(|(key, _)| *key == n.to_bits()) {
            return Arc::clone(slot);
        }
        if tables.len() >= KEPT {
            tables.remove(0);
        }
        let slot = Arc::new(OnceLock::new());
        tables.push((n.to_bits(), Arc::clone(&slot)));
        slot
    }

    fn table(&self, n: f64) -> Seen {
        let joined = |u: Jet, w: Jet| [u[0], w[0], u[1], w[1]];
        let (large, small) = (self.detector.half.max(self.source.half), self.detector.half.min(self.source.half));
        if self.source.half == 0.0 {
            return Table::new(ends(n, large, 0.0), |alpha| {
                let m = self.detector.moments(n, alpha);
                joined(m.p, m.q)
            });
        }
        if self.detector.half == 0.0 {
            return Table::new(ends(n, large, 0.0), |alpha| joined(self.source.moments(n, alpha).mean, [0.0; 2]));
        }
        let width = (small * n.sqrt()).min(SHARPEST);
        let orders = (6.0 + 4.0 * width, 8.0 + 6.0 * width);
        if self.detector.half >= self.source.half {
            // For each r′ the mean over the aperture is P wo + Q r′; P and Q r′ are averaged over the source.
            let inner = Table::new(ends(n, large, 0.0), |alpha| {
                let m = self.detector.moments(n, alpha);
                joined(m.p, m.q)
            });
            return Table::new(ends(n, large, small), |alpha| {
                let [p, q] = self.source.mean_of(alpha, orders, |a| pair(inner.at(a)));
                let (of_r, of_wo) = split(alpha, q.1, q.2);
                joined([0, 1].map(|j| p.0[j] + of_wo[j]), of_r)
            });
        }
        let inner = Table::new(ends(n, large, 0.0), |alpha| self.source.moments(n, alpha).mean);
        Table::new(ends(n, large, small), |alpha| {
            let [(_, along, across)] = self.detector.mean_of(alpha, orders, |a| [inner.at(a)]);
            let (of_wo, of_r) = split(alpha, along, across);
            joined(of_wo, of_r)
        })
    }
}

fn pair(of: [f64; 4]) -> [Jet; 2] {
    [[of[0], of[2]], [of[1], of[3]]]
}

/// Half angle of the smaller cone times √n from which on its rule grows no finer: the edges that a lobe so sharp leaves are averaged all the same.
const SHARPEST: f64 = 10.0;
/// ln of the share of its peak below which a lobe is nothing.
const NOTHING: f64 = -80.0;
/// Width of a piece in units of the lobe's, 1/√n.
const PIECE: f64 = 0.7;

/// Ends of pieces for discs of these half angles: inside |a − b| less a lobe's reach nothing changes, beyond a + b and that reach nothing is left.
fn ends(n: f64, large: f64, small: f64) -> Vec<f64> {
    let reach = 2.0 * (0.5 * -(NOTHING / n).exp_m1()).sqrt().asin();
    let (first, last) = ((large - small - reach).max(0.0), large + small + reach);
    // What a second cone has averaged is as smooth as its rule.
    let sharpness = n.sqrt().min(SHARPEST / small);
    let count = ((last - first) * sharpness / PIECE).ceil().max(8.0);
    let mut ends: Vec<f64> = (0..=count as usize).map(|k| first + (last - first) * k as f64 / count).collect();
    if first > 0.0 {
        ends.insert(0, 0.0);
    }
    // The lobe ends at a right angle, which the discs smear.
    let edges = [FRAC_PI_2 - large - small, FRAC_PI_2, FRAC_PI_2 + large + small];
    ends.extend(edges.iter().filter(|e| **e < last));
    ends.sort_by(f64::total_cmp);
    ends.dedup_by(|a, b| *a - *b < 1e-12);
    ends
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
        let slot = self.seen(n);
        let seen = slot.get_or_init(|| self.table(n));
        for (i, [alpha, q]) in places.iter().enumerate() {
            let [u, w, du, dw] = seen.at(*alpha);
            let (value, slope) = (u + q * w, du + q * dw);
            values[i] = (n + 2.0) * scale * value;
            slopes[i] = ((n + 2.0) * slope + value) * scale;
        }
    }
}
