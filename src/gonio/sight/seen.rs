//! Tables of U and W ([`super`]) by the angle α and the exponent n.
//!
//! At one α both are smooth in ln n, whatever the cones: over a factor of two in n they are polynomials of degree 11 to rounding. So tables by α are
//! made at the Chebyshev nodes of each octave that is asked for, and that of any n is a sum of those twelve. Octaves lie so that a search by factors of
//! two from the lowest exponent on meets a node of each: there that node's table is all that is asked for.

use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_2, LN_2};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};
use std::time::Instant;

use super::disc::{Disc, Jet};
use super::table::{NODES, Table, nodes, weights};

/// U, W and their derivatives by n.
pub(super) type Seen = Table<4>;
/// Tables at the nodes of one octave, each made when it is first asked for.
type Octave = Arc<[OnceLock<Arc<Seen>>; NODES]>;

/// Tables of single exponents that are kept: a fit asks for each in blocks of samples.
const KEPT: usize = 32;
/// The exponent from which a search goes by factors of two, and the node of every octave that it meets, one in the middle.
const FIRST: f64 = 0.01;
const MET: usize = 5;
/// How close to a node an exponent is that node's: of its own size.
const SAME: f64 = 1e-9;

/// Tables for a source and an aperture.
#[derive(Debug)]
pub(super) struct Tables {
    source: Disc,
    detector: Disc,
    octaves: Mutex<HashMap<i32, Octave>>,
    /// The latest last, under the bits of their n.
    recent: Mutex<Vec<(u64, Arc<Seen>)>>,
}

/// Tables that somebody holds, and those that were asked for last.
struct Held {
    all: Vec<Weak<Tables>>,
    last: Option<Arc<Tables>>,
}

impl Tables {
    /// Those for these discs that nobody else has, none made yet.
    pub fn new(source: Disc, detector: Disc) -> Self {
        Self { source, detector, octaves: Mutex::default(), recent: Mutex::default() }
    }

    /// Those for these discs, one of which is wider than a point at least; the same ones as long as somebody holds them, or nobody has asked for others:
    /// readings and the fit that reduces them have the same cones.
    pub fn of(source: Disc, detector: Disc) -> Arc<Self> {
        static HELD: Mutex<Held> = Mutex::new(Held { all: Vec::new(), last: None });
        let Held { all: held, last } = &mut *HELD.lock().unwrap_or_else(PoisonError::into_inner);
        held.retain(|tables| tables.strong_count() > 0);
        let same = |tables: &Arc<Self>| tables.source == source && tables.detector == detector;
        let tables = held.iter().filter_map(Weak::upgrade).find(same).unwrap_or_else(|| {
            let made = Arc::new(Self::new(source, detector));
            held.push(Arc::downgrade(&made));
            made
        });
        *last = Some(Arc::clone(&tables));
        tables
    }

    /// The table for exponent `n`; that of next to nothing for 0.
    pub fn at(&self, n: f64) -> Arc<Seen> {
        let n = n.max(LEAST);
        if let Some(seen) = self.kept(n) {
            return seen;
        }
        let (place, octave) = (Place::of(n), self.octave(n));
        let node = |k: usize| self.node(&octave, place, k);
        let seen = if place.is_met {
            Arc::clone(node(MET))
        } else {
            Arc::new(Table::sum(&std::array::from_fn(|k| node(k).as_ref()), &place.weights(n)))
        };
        let mut recent = self.recent();
        if recent.len() >= KEPT {
            recent.remove(0);
        }
        recent.push((n.to_bits(), Arc::clone(&seen)));
        seen
    }

    /// Makes what [`Self::at`] needs as long as `until` is not past; whether all is there.
    pub fn prepare(&self, n: f64, until: Instant) -> bool {
        let n = n.max(LEAST);
        if self.kept(n).is_some() {
            return true;
        }
        let (place, octave) = (Place::of(n), self.octave(n));
        (0..NODES).filter(|k| !place.is_met || *k == MET).all(|k| {
            let is_there = octave[k].get().is_some() || Instant::now() < until;
            if is_there {
                self.node(&octave, place, k);
            }
            is_there
        })
    }

    fn recent(&self) -> std::sync::MutexGuard<'_, Vec<(u64, Arc<Seen>)>> {
        self.recent.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn kept(&self, n: f64) -> Option<Arc<Seen>> {
        self.recent().iter().find(|(key, _)| *key == n.to_bits()).map(|(_, seen)| Arc::clone(seen))
    }

    fn octave(&self, n: f64) -> Octave {
        let mut octaves = self.octaves.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(octaves.entry(Place::of(n).octave).or_default())
    }

    fn node<'o>(&self, octave: &'o Octave, place: Place, k: usize) -> &'o Arc<Seen> {
        octave[k].get_or_init(|| Arc::new(self.make(place.nodes()[k].exp(), place.low.exp())))
    }

    /// The table for `n` with the pieces of the octave from `lowest` on.
    fn make(&self, n: f64, lowest: f64) -> Seen {
        let joined = |u: Jet, w: Jet| [u[0], w[0], u[1], w[1]];
        let (large, small) = (self.detector.half.max(self.source.half), self.detector.half.min(self.source.half));
        if self.source.half == 0.0 {
            return Table::new(ends(lowest, large, 0.0), |alpha| {
                let m = self.detector.moments(n, alpha);
                joined(m.p, m.q)
            });
        }
        if self.detector.half == 0.0 {
            return Table::new(ends(lowest, large, 0.0), |alpha| joined(self.source.moments(n, alpha).mean, [0.0; 2]));
        }
        let reach = reach(n);
        let band = (large - reach, large + reach);
        if self.detector.half >= self.source.half {
            // For each r′ the mean over the aperture is P wo + Q r′; P and Q r′ are averaged over the source.
            let inner = Table::new(ends(lowest, large, 0.0), |alpha| {
                let m = self.detector.moments(n, alpha);
                joined(m.p, m.q)
            });
            return Table::new(ends(lowest, large, small), |alpha| {
                let [p, q] = self.source.means(alpha, n.sqrt(), band, |a| pair(inner.at(a)));
                joined([0, 1].map(|j| p.0[j] + q.2[j]), q.1)
            });
        }
        let inner = Table::new(ends(lowest, large, 0.0), |alpha| self.source.moments(n, alpha).mean);
        Table::new(ends(lowest, large, small), |alpha| {
            let [(_, of_wo, of_r)] = self.detector.means(alpha, n.sqrt(), band, |a| [inner.at(a)]);
            joined(of_wo, of_r)
        })
    }
}

/// Where an exponent lies.
#[derive(Clone, Copy)]
struct Place {
    octave: i32,
    /// ln of its octave's lowest exponent.
    low: f64,
    /// Whether it is the node [`MET`].
    is_met: bool,
}

impl Place {
    fn of(n: f64) -> Self {
        // Octaves from FIRST on, and by how much of one theirs begin lower.
        let (octaves, offset) = ((n / FIRST).log2(), 0.5 * (1.0 + nodes(-1.0, 1.0)[MET]));
        let octave = (octaves + offset).floor();
        let is_met = (octaves - octave).abs() < SAME;
        Self { octave: octave as i32, low: FIRST.ln() + (octave - offset) * LN_2, is_met }
    }

    /// ln of the nodes' exponents.
    fn nodes(self) -> [f64; NODES] {
        nodes(self.low, self.low + LN_2)
    }

    /// What each node's table counts for `n`.
    fn weights(self, n: f64) -> [f64; NODES] {
        weights(self.low, self.low + LN_2, n.ln())
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

/// Ends of pieces for discs of these half angles and the exponents of the octave from `lowest` on. What a lobe's width smears are edges at their difference and their sum;
/// pieces grow with the distance from these, and a lobe's reach beyond the sum nothing is left.
fn ends(lowest: f64, large: f64, small: f64) -> Vec<f64> {
    let fine = PIECE / (2.0 * lowest).sqrt();
    let (inner, outer) = (large - small, large + small);
    let last = outer + reach(lowest);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::LobeKind;

    /// A search by factors of two asks for one table an octave; beside a node the sum of twelve is the same function.
    #[test]
    fn octaves_are_met_at_a_node_and_joined_between() {
        assert_eq!(LobeKind::Phong.lobe().parameters()[0].bounds.0, FIRST);
        let tables = Tables::of(Disc { half: 0.01 }, Disc { half: 0.035 });
        for k in [0, 7, 13, 20] {
            let n = FIRST * 2f64.powi(k);
            let place = Place::of(n);
            assert!(place.is_met && place.octave == k && (place.nodes()[MET] - n.ln()).abs() < 1e-12, "{n}");
            let of_node = tables.at(n);
            let made = |tables: &Tables| tables.octave(n).iter().filter(|node| node.get().is_some()).count();
            assert_eq!(made(&tables), 1);
            let beside = tables.at(n * (1.0 + 1e-7));
            assert_eq!(made(&tables), NODES);
            let width = 1.0 / n.sqrt();
            for alpha in [0.0, 0.02, 0.045, 0.045 + width] {
                let (peak, a, b) = (of_node.at(0.0), of_node.at(alpha), beside.at(alpha));
                for i in 0..2 {
                    let moved = a[i] + 1e-7 * n * a[2 + i];
                    assert!((moved - b[i]).abs() < 1e-9 * peak[i], "{n} {alpha}: {a:?} {b:?}");
                }
            }
        }
    }

    /// What is there takes no time; what is not is not begun once the time is over.
    #[test]
    fn no_table_is_begun_after_the_time() {
        let tables = Tables::of(Disc { half: 0.011 }, Disc { half: 0.0 });
        let past = Instant::now();
        let later = past + std::time::Duration::from_secs(100);
        assert!(!tables.prepare(30.0, past));
        assert!(tables.octave(30.0).iter().all(|node| node.get().is_none()));
        assert!(tables.prepare(30.0, later) && tables.prepare(30.0, past) && tables.prepare(31.0, past));
        tables.at(30.0);
        assert!(tables.prepare(30.0, past));
    }
}
