//! The plan: candidates, their information per second, the best shares of the time, whole readings.

use super::candidates;
use super::exchange::{Search, Sites};
use super::information::{Model, Noise};
use super::optimum::{Optimum, Table, best};
use super::pair::{IMAGES, Pair, TURNED, image, place, same};
use super::precision::{Precision, counts, precision};
use super::prior::{Prior, Wrong};
use super::rounding::{self, Share};
use crate::geometry::mirror;
use crate::gonio::cost::{dwell_s, visit_s};
use crate::gonio::instrument::Instrument;
use crate::gonio::reduce::positions::Kept;
use crate::gonio::scan::Scan;
use crate::gonio::travel::move_s;
use crate::measurement::Directions;

/// What a plan is made for.
#[derive(Debug, Clone)]
pub struct Wish<'a> {
    /// Model and parameters.
    pub prior: &'a Prior,
    /// The instrument.
    pub instrument: &'a Instrument,
    /// Seconds of the instrument that there are.
    pub budget_s: f64,
}

/// A scan that is worth its time.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The distinct pairs of directions.
    pub directions: Directions,
    /// The order in which they are read, and how often: equal ones in a row are one stop.
    pub rows: Vec<u32>,
    /// Readings that each row stands for: more than the instrument's own where rows would be too many.
    pub readings: u32,
    /// What it costs and tells.
    pub precision: Precision,
    /// Mean ln det of the information that the best shares of the time give a second, whatever the moves: at least this much less `gap` is best.
    pub best_a_second: f64,
    /// By how much that may fall short of the best.
    pub gap: f64,
    /// Draws of the prior at which no scan tells the parameters; the plan does without them.
    pub undetermined: usize,
    /// Points of the prior that it is made for: draws and corners.
    pub draws: usize,
}

/// Largest shares of the budget that a first stop at every pair may take: its move, and all of it.
const MOVES: f64 = 0.2;
const FIRST: f64 = 0.5;
/// Most distinct pairs, and the share of the largest weight that each must have.
const MOST_PAIRS: usize = 60;
const LEAST_SHARE: f64 = 0.01;
/// Steps of the scan of the plane of incidence that is tried beside, the first that fits into the budget, degrees.
const EVEN_DEG: [f64; 4] = [5.0, 7.0, 10.0, 15.0];

/// Proposes where to measure. Where a row of the instrument's own readings is so short that the budget pays for more rows than a scan may have, each row
/// is several times as many readings.
///
/// # Errors
/// [`Wrong`]: a detector without noise, a prior that no scan tells, a budget that is too small or too large.
pub fn plan(wish: &Wish<'_>) -> Result<Plan, Wrong> {
    if !wish.instrument.is_noisy() {
        return Err(Wrong::Noiseless);
    }
    let draws = wish.prior.planned_for();
    let weighed = Weighed::new(wish, &draws)?;
    let mut times = 1;
    let mut scanned = weighed.scanned(wish, &draws);
    while let Err(Wrong::TooMany { found, most }) = scanned {
        times = longer(wish.instrument, times, found / most).ok_or(Wrong::TooMany { found, most })?;
        let instrument = &repeating(wish.instrument, times);
        let wish = Wish { instrument, ..wish.clone() };
        scanned = Weighed::new(&wish, &draws)?.scanned(&wish, &draws);
    }
    let Scanned { directions, rows, precision, .. } = scanned?;
    Ok(Plan {
        precision,
        directions,
        rows,
        readings: repeating(wish.instrument, times).readings,
        best_a_second: weighed.optimum.mean_ln_det,
        gap: weighed.optimum.gap,
        undetermined: weighed.undetermined,
        draws: draws.len(),
    })
}

/// The instrument that reads so many times as often in each row.
fn repeating(instrument: &Instrument, times: u32) -> Instrument {
    Instrument { readings: instrument.readings.saturating_mul(times), ..instrument.clone() }
}

/// How many times as many readings a row must be where `times` leave so many times too many rows; `None` beyond what can be counted.
fn longer(instrument: &Instrument, times: u32, too_many: f64) -> Option<u32> {
    let longer = (f64::from(times) * too_many).ceil().max(f64::from(times) + 1.0);
    (longer * f64::from(instrument.readings) <= f64::from(u32::MAX)).then_some(longer as u32)
}

/// Candidates, and the shares of the time that are best.
struct Weighed {
    pairs: Vec<Pair>,
    usual_s: f64,
    stops: Vec<Share>,
    table: Table,
    optimum: Optimum,
    undetermined: usize,
}

impl Weighed {
    fn new(wish: &Wish<'_>, draws: &[Vec<f64>]) -> Result<Self, Wrong> {
        let Wish { prior, instrument, .. } = *wish;
        let pairs = candidates::pairs(prior.sharpest(), instrument);
        let usual_s = usual_move_s(instrument, &pairs);
        let (stops, mut table) = tell(prior, instrument, usual_s, &pairs, draws);
        let open = || Wrong::Undetermined(prior.model().clone());
        let undetermined = table.drop_undetermined();
        let optimum = if table.draws.is_empty() { None } else { best(&table) }.ok_or_else(open)?;
        Ok(Self { pairs, usual_s, stops, table, optimum, undetermined })
    }

    /// The surest scan: by noise alone the first is best; by what readings share another may be, and one between.
    fn scanned(&self, wish: &Wish<'_>, draws: &[Vec<f64>]) -> Result<Scanned, Wrong> {
        let (kept, weights) = supported(&self.table, &self.optimum, affordable(wish, self.usual_s));
        let share = |(&x, weight): (&usize, &f64)| Share { weight: *weight, ..self.stops[x] };
        let chosen: Vec<(Pair, Share)> = kept.iter().zip(&weights).map(|of| (self.pairs[*of.0], share(of))).collect();
        let mirrored = whole(mirrored(&chosen, wish.instrument), wish);
        let even = EVEN_DEG.iter().map(|step_deg| whole(even_grid(wish, *step_deg, self.usual_s, draws), wish));
        let fits = |scan: &Result<Scanned, Wrong>| !matches!(scan, Err(Wrong::Budget { .. }));
        let mut best = whole(chosen, wish)?;
        for other in std::iter::once(mirrored).chain(even.into_iter().find(fits)) {
            match other {
                Ok(other) if other.sureness() > best.sureness() => best = other,
                Err(wrong @ Wrong::TooMany { .. }) => return Err(wrong),
                _ => {}
            }
        }
        self.exchanged(best, wish, draws)
    }

    /// The same scan with rows exchanged where that makes it surer.
    fn exchanged(&self, scan: Scanned, wish: &Wish<'_>, draws: &[Vec<f64>]) -> Result<Scanned, Wrong> {
        let instrument = wish.instrument;
        if Kept::of(instrument).is_nothing() {
            return Ok(scan);
        }
        let sites = self.sites(&scan, instrument);
        let mut rows = vec![0; sites.pairs.len()];
        scan.rows.iter().for_each(|&x| rows[x as usize] += 1);
        let rows = Search::new(&sites, wish.prior, instrument, draws).better(rows);
        match whole(sites.shares(&rows), wish) {
            Ok(other) if other.sureness() > scan.sureness() => Ok(other),
            Err(wrong @ Wrong::TooMany { .. }) => Err(wrong),
            _ => Ok(scan),
        }
    }

    /// The pairs of a scan, turned by half a turn and mirrored at the plane of incidence as well, for errors may act on these the other way round; and all candidates.
    fn sites(&self, scan: &Scanned, instrument: &Instrument) -> Sites {
        let own = (0..scan.shares.len()).map(|x| (scan.directions.pair(x), scan.shares[x].rows_per_stop));
        let others = self.pairs.iter().zip(&self.stops).map(|(pair, stop)| (*pair, stop.rows_per_stop));
        let images = own.clone().flat_map(|(pair, rows)| IMAGES.map(|signs| (image(pair, signs), rows)));
        let images = images.filter(|(pair, _)| counts(*pair, instrument));
        let mut distinct: Vec<(Pair, u32)> = own.collect();
        for (pair, rows) in others.chain(images) {
            if !distinct.iter().any(|of| same(of.0, pair)) {
                distinct.push((pair, rows));
            }
        }
        let (pairs, rows_per_stop) = distinct.into_iter().unzip();
        Sites { pairs, rows_per_stop, row_s: row_s(instrument), move_s: self.usual_s }
    }
}

/// Whole readings.
struct Scanned {
    directions: Directions,
    /// Of each pair of `directions`.
    shares: Vec<Share>,
    rows: Vec<u32>,
    precision: Precision,
}

impl Scanned {
    fn sureness(&self) -> f64 {
        self.precision.mean_ln_sure
    }
}

/// Shares of the time to whole readings, in the order of reading.
fn whole(mut list: Vec<(Pair, Share)>, wish: &Wish<'_>) -> Result<Scanned, Wrong> {
    let Wish { prior, instrument, budget_s } = *wish;
    list.sort_by(|a, b| place(a.0).partial_cmp(&place(b.0)).unwrap_or(std::cmp::Ordering::Equal));
    list.dedup_by(|again, first| {
        let same = same(again.0, first.0);
        first.1.weight += if same { again.1.weight } else { 0.0 };
        same
    });
    let shares: Vec<Share> = list.iter().map(|c| c.1).collect();
    let (wi, wo) = list.iter().map(|c| c.0).unzip();
    let directions = Directions::List { wi, wo };
    let rows = rounding::rows(&shares, &directions, instrument, budget_s)?;
    Ok(Scanned { precision: precision(prior, instrument, &directions, &rows), directions, shares, rows })
}

/// Each pair together with that on the other side of the mirror direction, where there is one: what moves a lobe raises the one and lowers the other.
fn mirrored(list: &[(Pair, Share)], instrument: &Instrument) -> Vec<(Pair, Share)> {
    let half = |share: Share| Share { weight: 0.5 * share.weight, ..share };
    let mut all = Vec::with_capacity(2 * list.len());
    for ((wi, wo), share) in list {
        let top = mirror(*wi);
        let other = (2.0 * top.dot(*wo) * top - *wo).normalize();
        if same((*wi, other), (*wi, *wo)) || !counts((*wi, other), instrument) {
            all.push(((*wi, *wo), *share));
            continue;
        }
        all.extend([*wo, other].map(|wo| ((*wi, wo), half(*share))));
    }
    all
}

/// A usual scan in the plane of incidence, every pair as often: what shows errors of positions, for it has both sides of every lobe.
fn even_grid(wish: &Wish<'_>, step_deg: f64, move_s: f64, draws: &[Vec<f64>]) -> Vec<(Pair, Share)> {
    let Some((directions, _)) = (Scan::InPlane { step_deg }).directions() else { return Vec::new() };
    let pairs: Vec<Pair> = (0..directions.len()).map(|i| directions.pair(i)).collect();
    // Turned to where candidates have the source.
    let pairs = pairs.into_iter().map(|pair| image(pair, TURNED));
    let pairs: Vec<Pair> = pairs.filter(|pair| counts(*pair, wish.instrument)).collect();
    let (stops, _) = tell(wish.prior, wish.instrument, move_s, &pairs, draws);
    let weight = 1.0 / pairs.len().max(1) as f64;
    pairs.into_iter().zip(stops).map(|(pair, stop)| (pair, Share { weight, ..stop })).collect()
}

impl Plan {
    /// The share of the best information a second that a scan gives, D-efficiency: exp of the mean ln det over the number of parameters.
    #[must_use]
    pub fn efficiency(&self, of: &Precision) -> f64 {
        let p = of.errors.len() as f64;
        ((of.mean_ln_det - self.best_a_second) / p).exp() / (3600.0 * of.hours)
    }
}

/// Seconds of a move as a plan makes it: the mean over a round through candidates, as many as a plan has at most and evenly spread, in the order of
/// reading. How far one moves depends on what is chosen, which is chosen by what a stop costs: this is taken for every stop.
fn usual_move_s(instrument: &Instrument, pairs: &[Pair]) -> f64 {
    let mut sorted = pairs.to_vec();
    sorted.sort_by(|a, b| place(*a).partial_cmp(&place(*b)).unwrap_or(std::cmp::Ordering::Equal));
    let round: Vec<Pair> = sorted.into_iter().step_by(pairs.len().div_ceil(MOST_PAIRS).max(1)).collect();
    let next = round.iter().cycle().skip(1);
    round.iter().zip(next).map(|(a, b)| move_s(instrument, *a, *b)).sum::<f64>() / round.len().max(1) as f64
}

/// How many pairs the budget lets the axes stop at.
fn affordable(wish: &Wish<'_>, move_s: f64) -> usize {
    let time = (wish.budget_s - 2.0 * visit_s(wish.instrument)).max(0.0);
    let stop_s = move_s + dwell_s(wish.instrument);
    // A move of 0 s leaves infinitely many, which the clamp ends.
    let most = (MOVES * time / move_s).min(FIRST * time / stop_s) as usize;
    most.clamp(wish.prior.ranges().len(), MOST_PAIRS)
}

/// How each candidate is best read, and what it tells a second.
fn tell(
    prior: &Prior,
    instrument: &Instrument,
    move_s: f64,
    pairs: &[Pair],
    draws: &[Vec<f64>],
) -> (Vec<Share>, Table) {
    let (model, noise) = (Model::of(prior), Noise::of(instrument));
    let p = model.parameters();
    let mut told = vec![Vec::with_capacity(pairs.len() * p); draws.len()];
    let mut gradient = vec![0.0; p];
    let mut stops = Vec::with_capacity(pairs.len());
    for pair in pairs {
        let values: Vec<(f64, Option<f64>, f64)> = draws
            .iter()
            .map(|draw| {
                let f = model.value(draw, *pair, &mut gradient);
                (f, noise.variance(f, *pair), noise.jitter(&model, draw, *pair))
            })
            .collect();
        let stop =
            length(instrument, move_s, values.iter().filter_map(|(_, own, jitter)| own.map(|own| (own, *jitter))));
        for ((list, draw), (_, own, jitter)) in told.iter_mut().zip(draws).zip(&values) {
            model.value(draw, *pair, &mut gradient);
            // All rows of a stop share its jitter.
            let row = |own: f64| own + f64::from(stop.rows_per_stop) * jitter;
            let scale = own.map_or(0.0, |own| 1.0 / (row(own) * stop.row_s).sqrt());
            list.extend(gradient.iter().map(|g| g * scale));
        }
        stops.push(stop);
    }
    (stops, Table { parameters: p, draws: told })
}

/// Seconds of a row, its part of visits included.
fn row_s(instrument: &Instrument) -> f64 {
    dwell_s(instrument) + visit_s(instrument) / f64::from(instrument.protocol.block)
}

/// ln of the largest ratio of noise to jitter that makes stops longer.
const LONGEST_LN: f64 = 50.0;

/// How many rows a stop is best read: longer where noise is large against jitter and moves are dear. A stop costs move + k dwell and leaves
/// jitter + noise/k: their product is least at k² = move noise/(dwell jitter).
fn length(instrument: &Instrument, move_s: f64, variances: impl Iterator<Item = (f64, f64)>) -> Share {
    let block = instrument.protocol.block;
    let row_s = row_s(instrument);
    let (mut sum, mut count) = (0.0, 0u32);
    for (own, jitter) in variances.filter(|(own, jitter)| *own > 0.0 && *jitter > 0.0) {
        sum += (own / jitter).ln();
        count += 1;
    }
    if count == 0 {
        return Share { weight: 0.0, row_s, rows_per_stop: block };
    }
    // Of hardly any jitter the ratio has no end.
    let ratio = (sum / f64::from(count)).min(LONGEST_LN).exp();
    let best = (move_s * ratio / row_s).sqrt().round();
    let rows_per_stop = best.clamp(1.0, f64::from(block)) as u32;
    Share { weight: 0.0, row_s: row_s + move_s / f64::from(rows_per_stop), rows_per_stop }
}

/// The candidates that are worth a stop, `most` at most, and their best weights among themselves: the lesser half is dropped and the rest weighed
/// anew until few enough are left that still tell the parameters.
fn supported(table: &Table, optimum: &Optimum, most: usize) -> (Vec<usize>, Vec<f64>) {
    let mut kept: Vec<usize> = (0..table.len()).filter(|&x| optimum.weights[x] > 0.0).collect();
    let mut weights: Vec<f64> = kept.iter().map(|&x| optimum.weights[x]).collect();
    loop {
        let largest = weights.iter().copied().fold(0.0, f64::max);
        let worthy = weights.iter().filter(|w| **w >= LEAST_SHARE * largest).count();
        let wanted = worthy.min(most.max(kept.len() / 2));
        if wanted == kept.len() {
            return (kept, weights);
        }
        let mut by_weight: Vec<usize> = (0..kept.len()).collect();
        by_weight.sort_by(|a, b| weights[*b].total_cmp(&weights[*a]));
        by_weight.truncate(wanted);
        by_weight.sort_unstable();
        let fewer: Vec<usize> = by_weight.iter().map(|&i| kept[i]).collect();
        let Some(again) = best(&table.picked(&fewer)) else { return (kept, weights) };
        (kept, weights) = (fewer, again.weights);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::parts::{Axes, Holder};

    /// Zeros and a tilt: surer than the even scan that it starts from, in no more time, no pair twice.
    #[test]
    fn exchanges_make_a_scan_surer() {
        let axes = Axes { zero_u_deg: 0.05, move_s: 5.0, ..Axes::default() };
        let sample = Holder { tilt_u_deg: 0.05, ..Holder::default() };
        let instrument = Instrument { sample, axes, ..Instrument::default() };
        let prior = Prior::usual(&"lambert+phong".parse().expect("a model")).expect("space");
        let wish = Wish { prior: &prior, instrument: &instrument, budget_s: 900.0 };
        let draws = prior.draws();
        let weighed = Weighed::new(&wish, &draws).expect("determined");
        let even = whole(even_grid(&wish, 7.0, weighed.usual_s, &draws), &wish).expect("time enough");
        let sure = even.sureness();
        let better = weighed.exchanged(even, &wish, &draws).expect("rows enough");
        assert!(better.sureness() > sure + 1.0, "{} {sure}", better.sureness());
        assert!(better.precision.hours <= 900.0 / 3600.0 + 1e-12, "{}", better.precision.hours);
        let pair = |x: usize| better.directions.pair(x);
        let n = better.directions.len();
        assert!((0..n).all(|x| (0..x).all(|y| !same(pair(x), pair(y)))));
    }
}
