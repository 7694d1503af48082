//! Rows exchanged between pairs of directions for as long as that makes the parameters surer by all that is stated, what readings share included.
//!
//! What readings share makes no concave function of the shares of the time, so no theorem tells how far the best still is: this is a local search,
//! in whole rows, that adds where a second gains most and drops where one loses least (exchanges: Fedorov 1972; adding before dropping: Mitchell 1974).

use nalgebra::{Cholesky, DMatrix, DVectorView, Dyn};
use rayon::prelude::*;

use super::information::{Model, Noise};
use super::pair::Pair;
use super::precision::Told;
use super::prior::Prior;
use super::rounding::Share;
use crate::gonio::instrument::Instrument;
use crate::gonio::reduce::positions::Kept;

/// Most exchanges, those tried in vain among them.
const MOST: usize = 400;
/// Share of all rows that one exchange moves at first; halved where that gains nothing.
const FIRST: f64 = 1.0 / 32.0;
/// An exchange has to lower standard errors by this much, as a share of them and in the mean over parameters.
const GAIN: f64 = 1e-4;
/// Pairs that are looked at between two looks at all of them: those that are read, and so many that gain most.
const NEXT: usize = 256;
/// Exchanges after which all are looked at again.
const AGAIN: usize = 16;

/// Pairs that may be read, and what reading them costs.
pub(super) struct Sites {
    /// The pairs.
    pub pairs: Vec<Pair>,
    /// Most rows of one stop at each.
    pub rows_per_stop: Vec<u32>,
    /// Seconds of a row, its part of visits included.
    pub row_s: f64,
    /// Seconds of a move.
    pub move_s: f64,
}

impl Sites {
    fn stops(&self, x: usize, rows: u32) -> u32 {
        rows.div_ceil(self.rows_per_stop[x])
    }

    fn seconds(&self, x: usize, rows: u32) -> f64 {
        f64::from(self.stops(x, rows)) * self.move_s + f64::from(rows) * self.row_s
    }

    /// Shares of the time that so many rows of each are.
    pub fn shares(&self, rows: &[u32]) -> Vec<(Pair, Share)> {
        let read = || (0..rows.len()).filter(|&x| rows[x] > 0);
        let row_s = |x: usize| self.row_s + self.move_s / f64::from(self.rows_per_stop[x]);
        let all_s: f64 = read().map(|x| f64::from(rows[x]) * row_s(x)).sum();
        let of = |x: usize| {
            let weight = f64::from(rows[x]) * row_s(x) / all_s;
            (self.pairs[x], Share { weight, row_s: row_s(x), rows_per_stop: self.rows_per_stop[x] })
        };
        read().map(of).collect()
    }
}

/// What the rows of each pair tell at one draw of the prior.
struct Draw {
    readings: Vec<Reading>,
    /// Number of shared errors.
    errors: usize,
}

struct Reading {
    /// Derivatives by ln(parameter).
    gradient: Vec<f64>,
    /// 1 σ of each shared error, and the sum of their squares.
    shared: Vec<f64>,
    square: f64,
    /// Variance of one row by noise, infinite where nothing is read, and of one stop by jitter.
    own: f64,
    jitter: f64,
}

/// All of them at some draws of the prior.
pub(super) struct Search<'a> {
    sites: &'a Sites,
    draws: Vec<Draw>,
}

/// Where a draw stands: inverses of the normal equations' matrix and of their scatter, G, minus ln det of the covariance.
struct State {
    normal: DMatrix<f64>,
    scatter: DMatrix<f64>,
    /// Row by row.
    shared: Vec<f64>,
    ln_sure: f64,
}

impl<'a> Search<'a> {
    pub fn new(sites: &'a Sites, prior: &Prior, instrument: &Instrument, draws: &[Vec<f64>]) -> Self {
        let (model, noise, kept) = (Model::of(prior), Noise::of(instrument), Kept::of(instrument));
        let draws = draws.par_iter().map(|at| Draw::new(at, &sites.pairs, (&model, &noise, &kept))).collect();
        Self { sites, draws }
    }

    /// Rows that are surer and take no longer than `rows` do, or `rows` themselves. Draws that they leave open are not counted.
    pub fn better(&mut self, rows: Vec<u32>) -> Vec<u32> {
        let states: Vec<Option<State>> = self.draws.par_iter().map(|draw| draw.state(&rows, self.sites)).collect();
        let mut told = states.iter().map(Option::is_some);
        self.draws.retain(|_| told.next() == Some(true));
        let budget_s = self.seconds(&rows);
        let mut chunk = ((FIRST * rows.iter().map(|n| f64::from(*n)).sum::<f64>()) as u32).max(1);
        let mut at = At { rows, states: states.into_iter().flatten().collect() };
        if at.states.is_empty() {
            return at.rows;
        }
        let mut looked_at = self.worth_a_look(&at, chunk);
        // Exchanges since that look.
        let mut since = 0;
        for _ in 0..MOST {
            let better = self.exchanged(&at, &looked_at, chunk, budget_s).filter(|new| new.is_surer(&at));
            match better {
                Some(better) => (at, since) = (better, since + 1),
                None if since > 0 => since = AGAIN,
                None if chunk == 1 => break,
                None => (chunk, since) = (chunk / 2, AGAIN),
            }
            if since >= AGAIN {
                (looked_at, since) = (self.worth_a_look(&at, chunk), 0);
            }
        }
        at.rows
    }

    /// One exchange: rows where a second gains most, instead of those where it loses least.
    fn exchanged(&self, at: &At, looked_at: &[usize], chunk: u32, budget_s: f64) -> Option<At> {
        let added = self.best(at, looked_at.iter().flat_map(|&x| more(x, at.rows[x], chunk)))?;
        let mut new = self.changed(at, added)?;
        while self.seconds(&new.rows) > budget_s * (1.0 + 1e-9) {
            let read = (0..new.rows.len()).filter(|&x| new.rows[x] > 0 && x != added.0);
            let dropped = self.best(&new, read.flat_map(|x| less(x, new.rows[x], chunk)))?;
            new = self.changed(&new, dropped)?;
        }
        Some(new)
    }

    fn changed(&self, at: &At, (x, n): Change) -> Option<At> {
        let mut rows = at.rows.clone();
        rows[x] = n;
        self.at(rows)
    }

    /// The change that gains most, or loses least, a second.
    fn best(&self, at: &At, changes: impl Iterator<Item = Change>) -> Option<Change> {
        self.rated(at, changes).into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).map(|of| of.1)
    }

    /// The pairs that are read, and those that gain most.
    fn worth_a_look(&self, at: &At, chunk: u32) -> Vec<usize> {
        let all = 0..at.rows.len();
        let mut rated = self.rated(at, all.clone().flat_map(|x| more(x, at.rows[x], chunk)));
        rated.sort_by(|a, b| b.0.total_cmp(&a.0));
        let most = rated.into_iter().take(NEXT).map(|(_, (x, _))| x);
        let mut looked_at: Vec<usize> = most.chain(all.filter(|&x| at.rows[x] > 0)).collect();
        looked_at.sort_unstable();
        looked_at.dedup();
        looked_at
    }

    /// What changes gain for each second that they add or free, without those that leave a parameter open.
    fn rated(&self, at: &At, changes: impl Iterator<Item = Change>) -> Vec<(f64, Change)> {
        let changes: Vec<Change> = changes.collect();
        let gains = self.gains(at, &changes);
        let seconds = |(x, n): Change| (self.sites.seconds(x, n) - self.sites.seconds(x, at.rows[x])).abs();
        let rated = changes.into_iter().zip(gains).map(|(change, gain)| (gain / seconds(change), change));
        rated.filter(|(rate, _)| rate.is_finite()).collect()
    }

    /// What each change alone adds to the mean of minus ln det of the covariance.
    fn gains(&self, at: &At, changes: &[Change]) -> Vec<f64> {
        let of = |(draw, state): (&Draw, &State)| -> Vec<f64> {
            let weighed = |x: usize, n: u32| draw.weighed(self.sites, x, n);
            // Changes of one pair come one after the other.
            let of_pair = |changes: &[Change]| -> Vec<f64> {
                let x = changes[0].0;
                let (forms, before) = (draw.forms(state, x), weighed(x, at.rows[x]));
                changes.iter().map(|&(x, n)| forms.gain(before, weighed(x, n))).collect()
            };
            changes.chunk_by(|a, b| a.0 == b.0).flat_map(of_pair).collect()
        };
        let each: Vec<Vec<f64>> = self.draws.par_iter().zip(&at.states).map(of).collect();
        let mean = |i: usize| each.iter().map(|list| list[i]).sum::<f64>() / each.len() as f64;
        (0..changes.len()).map(mean).collect()
    }

    /// Nothing where these rows leave a parameter open.
    fn at(&self, rows: Vec<u32>) -> Option<At> {
        let states = self.draws.par_iter().map(|draw| draw.state(&rows, self.sites)).collect::<Option<Vec<_>>>()?;
        Some(At { rows, states })
    }

    fn seconds(&self, rows: &[u32]) -> f64 {
        (0..rows.len()).map(|x| self.sites.seconds(x, rows[x])).sum()
    }
}

/// Rows of each pair, and where that leaves each draw.
struct At {
    rows: Vec<u32>,
    states: Vec<State>,
}

impl At {
    /// Mean over the draws.
    fn ln_sure(&self) -> f64 {
        self.states.iter().map(|s| s.ln_sure).sum::<f64>() / self.states.len() as f64
    }

    /// By more than is worth another exchange.
    fn is_surer(&self, than: &Self) -> bool {
        let parameters = self.states.first().map_or(0, |s| s.normal.nrows());
        self.ln_sure() > than.ln_sure() + 2.0 * GAIN * parameters as f64
    }
}

/// A pair, and the number of rows that it is to have.
type Change = (usize, u32);

/// A row more, or a whole chunk.
fn more(x: usize, rows: u32, chunk: u32) -> impl Iterator<Item = Change> {
    [1, chunk].into_iter().skip(usize::from(chunk == 1)).map(move |n| (x, rows + n))
}

/// A chunk less, or all.
fn less(x: usize, rows: u32, chunk: u32) -> impl Iterator<Item = Change> {
    [0, rows.saturating_sub(chunk)].into_iter().skip(usize::from(rows <= chunk)).map(move |n| (x, n))
}

impl Draw {
    fn new(at: &[f64], pairs: &[Pair], (model, noise, kept): (&Model, &Noise<'_>, &Kept<'_>)) -> Self {
        let reading = |pair: &Pair| {
            let mut gradient = vec![0.0; model.parameters()];
            let f = model.value(at, *pair, &mut gradient);
            let shared = kept.components(*pair, f, &model.truth(at));
            let own = noise.variance(f, *pair).unwrap_or(f64::INFINITY);
            Reading::new(gradient, shared, own, noise.jitter(model, at, *pair))
        };
        Self { readings: pairs.iter().map(reading).collect(), errors: kept.len() }
    }

    /// Variance of the mean of so many rows of a pair, what is shared left out; infinite where nothing is read.
    fn noise(&self, sites: &Sites, x: usize, rows: u32) -> f64 {
        let of = &self.readings[x];
        of.own / f64::from(rows) + of.jitter / f64::from(sites.stops(x, rows))
    }

    /// The fit's weight of so many rows, and what their noise adds to the scatter.
    fn weighed(&self, sites: &Sites, x: usize, rows: u32) -> (f64, f64) {
        let noise = if rows == 0 { f64::INFINITY } else { self.noise(sites, x, rows) };
        if noise == f64::INFINITY {
            return (0.0, 0.0);
        }
        let weight = 1.0 / (noise + self.readings[x].square);
        (weight, weight * weight * noise)
    }

    fn state(&self, rows: &[u32], sites: &Sites) -> Option<State> {
        let mut told = Told::new(self.readings.first()?.gradient.len(), self.errors);
        for (x, of) in self.readings.iter().enumerate().filter(|(x, of)| rows[*x] > 0 && of.own < f64::INFINITY) {
            told.add(&of.gradient, self.noise(sites, x, rows[x]), &of.shared);
        }
        let ln_sure = told.ln_sure();
        let (normal, scatter) = (inverse(&told.normal)?, inverse(&told.scatter())?);
        ln_sure.is_finite().then_some(State {
            normal,
            scatter,
            shared: told.shared.transpose().as_slice().to_vec(),
            ln_sure,
        })
    }

    fn forms(&self, state: &State, x: usize) -> Forms {
        let Reading { gradient: g, shared: u, square, .. } = &self.readings[x];
        let q: Vec<f64> = state.shared.chunks_exact(u.len()).map(|row| dot(row, u)).collect();
        let scatter = |a: &[f64], b: &[f64]| form(&state.scatter, a, b);
        Forms {
            normal: form(&state.normal, g, g),
            square: *square,
            gg: scatter(g, g),
            gq: scatter(g, &q),
            qq: scatter(&q, &q),
        }
    }
}

/// What a pair's derivatives g and shared errors u are in the inverses of A, the normal equations' matrix, and of S, their scatter: gᵀA⁻¹g, uᵀu, and by
/// S⁻¹ the products of g and q = G u.
struct Forms {
    normal: f64,
    square: f64,
    gg: f64,
    gq: f64,
    qq: f64,
}

impl Forms {
    /// What it adds to minus ln det of the covariance, 2 ln det A - ln det S, to weigh the pair otherwise: A gains δa g gᵀ; S, the noise's part and G Gᵀ,
    /// gains α g gᵀ + δa (g qᵀ + q gᵀ) with α = δb + δa² uᵀu.
    fn gain(&self, (a, b): (f64, f64), (new_a, new_b): (f64, f64)) -> f64 {
        let (da, db) = (new_a - a, new_b - b);
        let alpha = db + da * da * self.square;
        let Self { gg, gq, qq, .. } = *self;
        let normal = 1.0 + da * self.normal;
        // det(1 + M W) of M = [[α, δa], [δa, 0]] and W = [[gg, gq], [gq, qq]].
        let scatter = (1.0 + alpha * gg + da * gq) * (1.0 + da * gq) - da * gg * (alpha * gq + da * qq);
        if normal > 0.0 && scatter > 0.0 { 2.0 * normal.ln() - scatter.ln() } else { f64::NEG_INFINITY }
    }
}

impl Reading {
    fn new(gradient: Vec<f64>, shared: Vec<f64>, own: f64, jitter: f64) -> Self {
        let square = shared.iter().map(|u| u * u).sum();
        Self { gradient, shared, square, own, jitter }
    }
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    DVectorView::from_slice(x, x.len()).dot(&DVectorView::from_slice(y, y.len()))
}

/// xᵀ M y of a symmetric matrix.
fn form(m: &DMatrix<f64>, x: &[f64], y: &[f64]) -> f64 {
    m.as_slice().chunks_exact(y.len()).zip(x).map(|(row, x)| x * dot(row, y)).sum()
}

/// The inverse of a positive matrix, scaled to a diagonal of ones in between.
fn inverse(m: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale: Vec<f64> = m.diagonal().iter().map(|d| 1.0 / d.sqrt()).collect();
    let scaled = |m: &DMatrix<f64>| DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * scale[i] * scale[j]);
    let factor: Option<Cholesky<f64, Dyn>> = scaled(m).cholesky();
    factor.map(|c| scaled(&c.inverse())).filter(|m| m.iter().all(|x| x.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::direction_deg;
    use crate::numeric::random::{Purpose, RngExt, stream};

    fn sites(pairs: usize, rows_per_stop: u32, move_s: f64) -> Sites {
        let pair = (direction_deg(30.0, 180.0), direction_deg(30.0, 0.0));
        Sites { pairs: vec![pair; pairs], rows_per_stop: vec![rows_per_stop; pairs], row_s: 1.0, move_s }
    }

    /// Readings of random derivatives and shared errors.
    fn random(sites: &Sites, parameters: usize, errors: usize, seed: u64) -> Draw {
        let rng = &mut stream(seed, Purpose::Study, 0);
        let mut list = |n: usize| -> Vec<f64> { (0..n).map(|_| rng.random::<f64>() - 0.4).collect() };
        let readings = sites.pairs.iter().map(|_| Reading::new(list(parameters), list(errors), 0.05, 0.01)).collect();
        Draw { readings, errors }
    }

    /// One parameter, whose derivative is 1 everywhere, and one shared error that raises what the first pair says and lowers what the second says,
    /// both as noisy: half the rows each.
    #[test]
    fn what_an_error_raises_is_read_as_often_as_what_it_lowers() {
        let sites = sites(3, 1, 0.0);
        let readings = [0.3, -0.3, 0.9].map(|u| Reading::new(vec![1.0], vec![u], 0.1, 0.0)).into();
        let mut search = Search { sites: &sites, draws: vec![Draw { readings, errors: 1 }] };
        assert_eq!(search.better(vec![100, 0, 0]), [50, 50, 0]);
        assert_eq!(search.better(vec![0, 0, 64]), [32, 32, 0]);
    }

    /// What an exchange is said to gain is what the covariance says afterwards.
    #[test]
    fn gains_are_differences() {
        let sites = sites(12, 2, 3.0);
        let search = Search { sites: &sites, draws: vec![random(&sites, 3, 5, 1), random(&sites, 3, 5, 2)] };
        let at = search.at((0..12).map(|x| x % 4).collect()).expect("determined");
        for change in (0..12).flat_map(|x| [0, 1, 2, 7].map(|n| (x, n))) {
            let want = search.changed(&at, change).expect("determined").ln_sure() - at.ln_sure();
            let found = search.gains(&at, &[change])[0];
            assert!((found - want).abs() < 1e-10, "{change:?}: {found} {want}");
        }
    }

    /// Never longer, surer, without what can't be read, and where nothing is known there is nothing to exchange.
    #[test]
    fn exchanges_keep_the_time() {
        let sites = sites(40, 3, 5.0);
        let mut search = Search { sites: &sites, draws: vec![random(&sites, 2, 3, 3), random(&sites, 2, 3, 4)] };
        // Saturated, say.
        search.draws.iter_mut().for_each(|draw| draw.readings[7].own = f64::INFINITY);
        let rows: Vec<u32> = (0..40).map(|x| 2 + x % 5).collect();
        let better = search.better(rows.clone());
        let sure = |rows: &[u32]| search.at(rows.to_vec()).expect("determined").ln_sure();
        let gained = sure(&better) - sure(&rows);
        assert!(search.seconds(&better) <= search.seconds(&rows) * (1.0 + 1e-9) && gained > 0.5, "{gained}");
        assert_eq!(better[7], 0, "nothing is read there");
        assert_eq!(search.better(vec![0; 40]), vec![0; 40]);
    }
}
