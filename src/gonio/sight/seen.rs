//! Tables of U and W ([`super`]) by the angle α and the exponent n.
//!
//! At one α both are smooth in ln n, whatever the cones: over a factor of two in n they are polynomials of degree 11 to rounding. So tables by α are
//! made at the Chebyshev nodes of each octave that is asked for, and that of any n is a sum of those twelve.

use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_2, LN_2};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};

use super::disc::{Disc, Jet};
use super::table::{NODES, Table, nodes, weights};

/// U, W and their derivatives by n.
pub(super) type Seen = Table<4>;
/// Tables at the nodes of one octave, made when they are first asked for.
type Octave = Arc<OnceLock<[Seen; NODES]>>;

/// Tables of single exponents that are kept: a fit asks for each in blocks of samples.
const KEPT: usize = 32;

/// Tables for a source and an aperture.
#[derive(Debug)]
pub(super) struct Tables {
    source: Disc,
    detector: Disc,
    octaves: Mutex<HashMap<i32, Octave>>,
    /// The latest last, under the bits of their n.
    recent: Mutex<Vec<(u64, Arc<Seen>)>>,
}

impl Tables {
    /// Those for these discs, one of which is wider than a point at least; the same ones as long as somebody holds them.
    pub fn of(source: Disc, detector: Disc) -> Arc<Self> {
        static HELD: Mutex<Vec<Weak<Tables>>> = Mutex::new(Vec::new());
        let mut held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
        held.retain(|tables| tables.strong_count() > 0);
        let same = |tables: &Arc<Self>| tables.source == source && tables.detector == detector;
        if let Some(tables) = held.iter().filter_map(Weak::upgrade).find(same) {
            return tables;
        }
        let tables = Arc::new(Self { source, detector, octaves: Mutex::default(), recent: Mutex::default() });
        held.push(Arc::downgrade(&tables));
        tables
    }

    /// The table for exponent `n`; that of next to nothing for 0.
    pub fn at(&self, n: f64) -> Arc<Seen> {
        let n = n.max(LEAST);
        let recent = || self.recent.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, seen)) = recent().iter().find(|(key, _)| *key == n.to_bits()) {
            return Arc::clone(seen);
        }
        let index = n.log2().floor() as i32;
        let octave = Arc::clone(self.octaves.lock().unwrap_or_else(PoisonError::into_inner).entry(index).or_default());
        let low = f64::from(index) * LN_2;
        let tables = octave.get_or_init(|| nodes(low, low + LN_2).map(|ln| self.make(ln.exp(), index)));
        let seen = Arc::new(Table::sum(tables, &weights(low, low + LN_2, n.ln())));
        let mut recent = recent();
        if recent.len() >= KEPT {
            recent.remove(0);
        }
        recent.push((n.to_bits(), Arc::clone(&seen)));
        seen
    }

    /// The table for `n` with the pieces of its octave.
    fn make(&self, n: f64, octave: i32) -> Seen {
        let joined = |u: Jet, w: Jet| [u[0], w[0], u[1], w[1]];
        let (large, small) = (self.detector.half.max(self.source.half), self.detector.half.min(self.source.half));
        if self.source.half == 0.0 {
            return Table::new(ends(octave, large, 0.0), |alpha| {
                let m = self.detector.moments(n, alpha);
                joined(m.p, m.q)
            });
        }
        if self.detector.half == 0.0 {
            return Table::new(ends(octave, large, 0.0), |alpha| joined(self.source.moments(n, alpha).mean, [0.0; 2]));
        }
        let reach = reach(n);
        let band = (large - reach, large + reach);
        if self.detector.half >= self.source.half {
            // For each r′ the mean over the aperture is P wo + Q r′; P and Q r′ are averaged over the source.
            let inner = Table::new(ends(octave, large, 0.0), |alpha| {
                let m = self.detector.moments(n, alpha);
                joined(m.p, m.q)
            });
            return Table::new(ends(octave, large, small), |alpha| {
                let [p, q] = self.source.means(alpha, n.sqrt(), band, |a| pair(inner.at(a)));
                joined([0, 1].map(|j| p.0[j] + q.2[j]), q.1)
            });
        }
        let inner = Table::new(ends(octave, large, 0.0), |alpha| self.source.moments(n, alpha).mean);
        Table::new(ends(octave, large, small), |alpha| {
            let [(_, of_wo, of_r)] = self.detector.means(alpha, n.sqrt(), band, |a| [inner.at(a)]);
            joined(of_wo, of_r)
        })
    }
}

fn pair(of: [f64; 4]) -> [Jet; 2] {
    [[of[0], of[2]], [of[1], of[3]]]
}

/// Exponents below this are this.
const LEAST: f64 = 1e-6;
/// ln of the share of its peak below which a lobe is nothing.
const NOTHING: f64 = -80.0;
/// Width of the pieces at an edge in units of the lobe's, 1/√n; the share of its distance from the nearest edge that a piece may have; rad.
const PIECE: f64 = 0.7;
const GROWTH: f64 = 0.4;
const LONGEST: f64 = 0.2;

/// How far a lobe reaches, rad.
fn reach(n: f64) -> f64 {
    2.0 * (0.5 * -(NOTHING / n).exp_m1()).sqrt().asin()
}

/// Ends of pieces for discs of these half angles and the exponents of an octave. What a lobe's width smears are edges at their difference and their sum;
/// pieces grow with the distance from these, and a lobe's reach beyond the sum nothing is left.
fn ends(octave: i32, large: f64, small: f64) -> Vec<f64> {
    let fine = PIECE / 2f64.powi(octave + 1).sqrt();
    let (inner, outer) = (large - small, large + small);
    let last = outer + reach(2f64.powi(octave));
    let middle = 0.5 * (outer - inner);
    let mut ends = vec![0.0, inner, outer, last];
    ends.extend(graded(fine, inner).map(|d| inner - d));
    ends.extend(graded(fine, middle).flat_map(|d| [inner + d, outer - d]));
    ends.extend(graded(fine, last - outer).map(|d| outer + d));
    // The lobe ends at a right angle, which the discs smear.
    ends.extend([FRAC_PI_2 - outer, FRAC_PI_2, FRAC_PI_2 + outer].iter().filter(|e| **e < last));
    ends.sort_by(f64::total_cmp);
    ends.dedup_by(|a, b| *a - *b < 1e-3 * fine);
    ends
}

/// Distances from an edge at which pieces end, up to `length`.
fn graded(fine: f64, length: f64) -> impl Iterator<Item = f64> {
    let next = move |d: &f64| Some(d + fine.max(GROWTH * d).min(LONGEST));
    std::iter::successors(Some(fine.min(LONGEST)), next).take_while(move |d| *d < length)
}
