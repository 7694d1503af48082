//! The search without a start value: the cost on a lattice of shapes one octave apart, the promising nodes polished, and how sure one
//! can be that the best of the minima found is the lowest there is.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::budget::Deadline;
use super::options::FitError;
use super::passes::{self, ShapedLobe};
use super::quadratic::{Feasible, Quadratic};
use super::reduced::{Problem, Search, Solution};
use super::solver::{self, LevenbergMarquardt, Linearize, Outcome, SolverOptions};
use super::streamed::Streamed;
use crate::brdf::MAX_LOBES;
use crate::numeric::random::{Purpose, RngExt, stream};

/// Combinations of nodes kept while lobes are added one by one.
const BEAM: usize = 24;
/// Single lobes from which pairs are built where a cost takes passes.
const STREAMED_BEAM: usize = 6;
/// Lattice starts polished at most.
const MOST_STARTS: usize = 8;
/// Starts drawn at random on top, for models with several lobes.
const RANDOM_STARTS: usize = 16;
/// Costs that differ by less than this share belong to one minimum.
const SAME: f64 = 1e-9;

/// How the global minimum was looked for.
#[derive(Debug, Clone, Default)]
pub(super) struct SearchReport {
    /// Starts polished; of a robust fit those whose s was followed.
    pub starts: usize,
    /// Of them, how many ended in the lowest minimum; of a robust fit, as well as the best.
    pub reached: usize,
    /// Distinct minima seen.
    pub minima: usize,
    /// Cost of the second lowest minimum over the lowest's, less 1.
    pub runner_up_excess: Option<f64>,
    /// Chance that one more random start would find a minimum not seen before (Boender & Rinnooy Kan 1987); none where the lattice itself
    /// brackets the minima of the one shape.
    pub unseen: Option<f64>,
    /// Whether the time left some starts out.
    pub cut: bool,
    /// Whether the time ended while s settled.
    pub unsettled: bool,
}

/// The lowest minimum, and how it was found.
#[derive(Debug)]
pub(super) struct Found {
    pub outcome: Outcome,
    pub report: SearchReport,
}

/// Where lobes of one problem may stand: nodes an octave apart within the bounds of each t, closer where a range is narrow.
struct Nodes {
    /// All distinct t, ascending.
    t: Vec<f64>,
    /// Of each parameter, its nodes as indices into `t`.
    of: Vec<Vec<usize>>,
    /// Whether all parameters share the same nodes, so that only ascending combinations count.
    alike: bool,
}

/// t from `low` to `high`, shapes an octave apart.
pub(super) fn octaves(low: f64, high: f64) -> Vec<f64> {
    let count = ((high - low) / std::f64::consts::LN_2 + 1e-9).floor() as usize;
    (0..=count).map(|k| low + k as f64 * std::f64::consts::LN_2).collect()
}

/// Nodes of a range at least, unless its ends are one: both of them and the middle.
const FEWEST_NODES: usize = 3;

/// Nodes from `low` to `high`: octaves apart, or evenly spaced from end to end where that would be fewer than `fewest`.
fn spaced(low: f64, high: f64, fewest: usize) -> Vec<f64> {
    let octaves = octaves(low, high);
    if low >= high || octaves.len() >= fewest {
        return octaves;
    }
    let step = (high - low) / (fewest - 1) as f64;
    let inner = (0..fewest - 1).map(|k| low + k as f64 * step);
    inner.chain([high]).collect()
}

impl Nodes {
    fn new(problem: &Problem<'_>) -> Self {
        let fewest = problem.bounds.len().max(FEWEST_NODES);
        let lists: Vec<Vec<f64>> = problem.bounds.iter().map(|(low, high)| spaced(*low, *high, fewest)).collect();
        let mut t: Vec<f64> = lists.iter().flatten().copied().collect();
        t.sort_by(f64::total_cmp);
        t.dedup();
        let index = |x: &f64| t.partition_point(|y| y < x);
        let of = lists.iter().map(|list| list.iter().map(index).collect()).collect();
        Self { of, t, alike: problem.bounds.windows(2).all(|b| b[0] == b[1]) }
    }

    /// The best combinations, found by adding one lobe at a time and keeping the best few; of single lobes the best `first`.
    /// Lobes share a node only where there are fewer nodes than lobes.
    fn combinations(&self, first: usize, cost: impl Fn(&[usize]) -> f64 + Sync) -> Vec<Vec<f64>> {
        let mut beam: Vec<(f64, Vec<usize>)> = vec![(0.0, Vec::new())];
        for own in &self.of {
            let shared = own.len() < self.of.len();
            let mut sets: Vec<Vec<usize>> = Vec::new();
            for (_, before) in &beam {
                for &k in own.iter().filter(|k| shared || !before.contains(k)) {
                    let mut set = before.clone();
                    set.push(k);
                    if self.alike {
                        set.sort_unstable();
                    }
                    sets.push(set);
                }
            }
            sets.sort_unstable();
            sets.dedup();
            let keep = if beam[0].1.is_empty() && self.of.len() > 1 { first } else { BEAM };
            let mut next: Vec<(f64, Vec<usize>)> = sets.into_par_iter().map(|set| (cost(&set), set)).collect();
            next.sort_by(|a, b| a.0.total_cmp(&b.0));
            next.truncate(keep);
            beam = next;
        }
        beam.into_iter().take(MOST_STARTS).map(|(_, set)| set.iter().map(|&k| self.t[k]).collect()).collect()
    }
}

/// The lowest minimum of a problem that the transforms know; after `deadline` that next to the lattice's best node alone.
pub(super) fn search(search: &Search<'_>, steps: u64, deadline: Deadline) -> Result<Found, FitError> {
    search_with(search, steps, RANDOM_STARTS, deadline)
}

fn search_with(search: &Search<'_>, steps: u64, random: usize, deadline: Deadline) -> Result<Found, FitError> {
    let problem = search.problem;
    let mut starts = match problem.layout.len() {
        0 => vec![Vec::new()],
        1 => bracketed(search),
        _ => {
            let nodes = Nodes::new(problem);
            let lattice = Lattice::new(search, &nodes.t);
            nodes.combinations(usize::MAX, |set| lattice.cost(problem, set)) // pairs in full
        }
    };
    let several = problem.layout.len() > 1;
    let mut cut = (several || starts.len() > 1) && deadline.is_past();
    if cut {
        starts.truncate(1);
    } else if several {
        // A lobe more can only help: from the smaller model's optimum the larger one never ends above it.
        let smaller = problem.with_shapes(problem.layout.len() - 1);
        let found = search_with(&search.of(&smaller), steps, 0, deadline)?;
        cut |= found.report.cut;
        let cost = |t: &[f64]| search.solve(t).cost;
        starts.push(extended(problem, found.outcome.parameters.as_slice(), cost));
    }
    let lattice = starts.len();
    if several && !cut {
        cut = random > 0 && deadline.is_past();
        starts.extend(drawn(problem, if cut { 0 } else { random }));
    }
    let run = |start: &Vec<f64>| polish_start(search.walk(), problem, start.clone(), steps);
    let outcomes = starts.par_iter().map(run).collect::<Result<Vec<Outcome>, FitError>>()?;
    let mut best = best_of(outcomes, lattice)?;
    best.report.cut = cut;
    if random > 0 && !problem.layout.is_empty() {
        order_alike(problem, &mut best.outcome);
        // The shapes' last digits, where the cost itself no longer tells points apart.
        let lm = LevenbergMarquardt::bounded(problem.bounds.clone());
        let last = solver::minimize(search.walk(), lm, best.outcome.parameters.clone(), steps);
        let last = last.map_err(|e| FitError::Solver { reason: e.to_string() })?;
        best.outcome.history.extend(last.history.into_iter().skip(1));
        (best.outcome.parameters, best.outcome.cost, best.outcome.stop) = (last.parameters, last.cost, last.stop);
    }
    Ok(best)
}

/// Lobes that could change places get rising shapes, so that one minimum looks the same whichever start found it.
fn order_alike(problem: &Problem<'_>, outcome: &mut Outcome) {
    let Some(order) = rising(problem, outcome.parameters.as_slice()) else { return };
    let pick = |list: &[f64]| -> Vec<f64> { order.iter().map(|&i| list[i]).collect() };
    outcome.parameters = DVector::from_vec(pick(outcome.parameters.as_slice()));
    outcome.history.iter_mut().for_each(|step| step.parameters = pick(&step.parameters));
}

/// As [`order_alike`], of a solution.
pub(super) fn ordered(problem: &Problem<'_>, at: Solution) -> Solution {
    let Some(order) = rising(problem, &at.t) else { return at };
    let lobe = |i: usize| problem.layout[i].0;
    let mut weights = at.weights.clone();
    for (to, from) in weights.iter_mut().zip(&at.weights) {
        order.iter().enumerate().for_each(|(i, &old)| to[lobe(i)] = from[lobe(old)]);
    }
    let t: Vec<f64> = order.iter().map(|&i| at.t[i]).collect();
    Solution { lobes: problem.shaped(&t), t, weights, cost: at.cost }
}

/// Where each shape stands among them by size; `None` where lobes can't change places, for they may not have the same values.
fn rising(problem: &Problem<'_>, t: &[f64]) -> Option<Vec<usize>> {
    let bounds = problem.bounds.windows(2).all(|b| b[0] == b[1]);
    let of = |ranges: &Vec<(f64, f64)>| problem.layout.windows(2).all(|l| ranges[l[0].0] == ranges[l[1].0]);
    let mut order: Vec<usize> = (0..t.len()).collect();
    order.sort_by(|&a, &b| t[a].total_cmp(&t[b]));
    (bounds && problem.ranges.iter().all(of)).then_some(order)
}

/// Starts polished of a problem that takes passes.
const STREAMED_STARTS: usize = 4;

/// The lowest minimum of a problem that takes passes over its samples: the lattice on `few` of them, its best nodes polished on `more`, the very best alone
/// where it is late.
pub(super) fn search_streamed(
    few: &Problem<'_>,
    more: &Problem<'_>,
    steps: u64,
    deadline: Deadline,
) -> Result<Found, FitError> {
    let mut starts = if few.layout.is_empty() {
        vec![Vec::new()]
    } else {
        let nodes = Nodes::new(few);
        let cost = |set: &[usize]| {
            let part = few.with_shapes(set.len());
            let t: Vec<f64> = set.iter().map(|&k| nodes.t[k]).collect();
            Streamed::rough(&part).solve(&t).cost
        };
        let mut best = nodes.combinations(STREAMED_BEAM, cost);
        best.truncate(STREAMED_STARTS);
        best
    };
    let cut = starts.len() > 1 && deadline.is_past();
    if cut {
        starts.truncate(1);
    }
    let lattice = starts.len();
    let run = |start: &Vec<f64>| polish_start(Streamed::rough(more), more, start.clone(), steps);
    let outcomes = starts.par_iter().map(run).collect::<Result<Vec<Outcome>, FitError>>()?;
    let mut found = best_of(outcomes, lattice)?;
    found.report.cut = cut;
    Ok(found)
}

/// The lowest minimum without a robust loss: from the transforms where they know all sums, else on parts of the samples, few and more.
pub(super) fn search_plain(
    problem: &Problem<'_>,
    (few, more): (&Problem<'_>, &Problem<'_>),
    steps: u64,
    deadline: Deadline,
) -> Result<Found, FitError> {
    if !problem.is_transformable() {
        return search_streamed(few, more, steps, deadline);
    }
    let (transform, energy) = passes::transform(problem.samples);
    search(&Search::new(problem, &transform, &energy), steps, deadline)
}

fn polish_start(at: impl Linearize, problem: &Problem<'_>, start: Vec<f64>, steps: u64) -> Result<Outcome, FitError> {
    // The last digits are for the best alone.
    let options = SolverOptions { ftol: 1e-13, polish: 0, ..SolverOptions::default() };
    let lm = LevenbergMarquardt::new(options).with_bounds(problem.bounds.clone());
    solver::minimize(at, lm, DVector::from_vec(start), steps).map_err(|e| FitError::Solver { reason: e.to_string() })
}

/// A smaller model's optimum with one lobe more, where that helps most among the last shape's nodes.
pub(super) fn extended(problem: &Problem<'_>, smaller: &[f64], cost: impl Fn(&[f64]) -> f64 + Sync) -> Vec<f64> {
    let nodes = Nodes::new(problem);
    let last = nodes.of.last().map_or(&[][..], Vec::as_slice);
    let tried = last.par_iter().map(|&k| {
        let t: Vec<f64> = smaller.iter().copied().chain([nodes.t[k]]).collect();
        (cost(&t), t)
    });
    tried.min_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(|| smaller.to_vec(), |(_, t)| t)
}

/// The nodes of the last shape; of a model without shapes one, which has none.
pub(super) fn last_nodes(problem: &Problem<'_>) -> Vec<Option<f64>> {
    let nodes = Nodes::new(problem);
    nodes.of.last().map_or_else(|| vec![None], |own| own.iter().map(|&k| Some(nodes.t[k])).collect())
}

/// Shapes drawn evenly on the logarithmic scale.
fn drawn(problem: &Problem<'_>, count: usize) -> Vec<Vec<f64>> {
    let mut rng = stream(0, Purpose::Study, problem.layout.len() as u64);
    let mut draw = |(low, high): &(f64, f64)| low + (high - low) * rng.random::<f64>();
    (0..count).map(|_| problem.bounds.iter().map(&mut draw).collect()).collect()
}

fn best_of(outcomes: Vec<Outcome>, lattice: usize) -> Result<Found, FitError> {
    let lowest = outcomes.iter().map(|o| o.cost).fold(f64::INFINITY, f64::min);
    let same = |a: f64, b: f64| a <= b * (1.0 + SAME) + f64::MIN_POSITIVE;
    let mut costs: Vec<f64> = outcomes.iter().map(|o| o.cost).collect();
    costs.sort_by(f64::total_cmp);
    let reached = costs.iter().filter(|c| same(**c, lowest)).count();
    costs.dedup_by(|b, a| same(*b, *a));
    let drawn = outcomes.len() - lattice;
    let mut seen: Vec<f64> = outcomes[lattice..].iter().map(|o| o.cost).collect();
    seen.sort_by(f64::total_cmp);
    seen.dedup_by(|b, a| same(*b, *a));
    let unseen = (drawn > 1).then(|| {
        let (w, n) = (seen.len() as f64, drawn as f64);
        (w * (w + 1.0) / (n * (n - 1.0))).min(1.0)
    });
    let report = SearchReport {
        starts: outcomes.len(),
        reached,
        minima: costs.len(),
        runner_up_excess: costs.get(1).filter(|_| lowest > 0.0).map(|c| c / lowest - 1.0),
        unseen,
        cut: false,
        unsettled: false,
    };
    let outcome = outcomes.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
    outcome.map(|outcome| Found { outcome, report }).ok_or_else(|| FitError::Solver { reason: "no start".into() })
}

/// Every bracketed minimum of the one-shape cost, and the ends where it falls outwards.
fn bracketed(search: &Search<'_>) -> Vec<Vec<f64>> {
    let nodes = Nodes::new(search.problem).t;
    let evaluate = |t: &f64| -> (f64, f64, f64) {
        let at = search.walk().linearize(&DVector::from_element(1, *t));
        let slope = |l: solver::Linearization| (l.cost, 2.0 * (l.factor.transpose() * l.rhs)[0]);
        let (cost, slope) = at.map_or((f64::NAN, f64::NAN), slope);
        (*t, cost, slope)
    };
    let nodes: Vec<(f64, f64, f64)> = nodes.par_iter().map(evaluate).collect();
    let mut found: Vec<(f64, f64)> = nodes.windows(2).filter_map(|pair| hermite_minimum(pair[0], pair[1])).collect();
    if let (Some(&(t0, c0, d0)), Some(&(t1, c1, d1))) = (nodes.first(), nodes.last()) {
        found.extend((d0 > 0.0).then_some((c0, t0)));
        found.extend((d1 < 0.0).then_some((c1, t1)));
    }
    // A node below both neighbours whose slopes don't show it (rounding), or a flat cost: the lowest node serves.
    let lowest = nodes.iter().map(|&(t, c, _)| (c, t)).min_by(|a, b| a.0.total_cmp(&b.0));
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let Some((cost, t)) = lowest
        && found.first().is_none_or(|f| f.0 > cost)
    {
        found.insert(0, (cost, t));
    }
    found.into_iter().take(MOST_STARTS).map(|(_, t)| vec![t]).collect()
}

/// Minimum (cost, t) of the cubic through two (t, cost, slope), where the slopes bracket one.
fn hermite_minimum(a: (f64, f64, f64), b: (f64, f64, f64)) -> Option<(f64, f64)> {
    if !(a.2 < 0.0 && b.2 > 0.0) {
        return None;
    }
    let h = b.0 - a.0;
    // c(s) = c0 + m0 s + q s² + p s³ on s in [0, 1]
    let (m0, m1) = (a.2 * h, b.2 * h);
    let q = 3.0 * (b.1 - a.1) - 2.0 * m0 - m1;
    let p = m0 + m1 - 2.0 * (b.1 - a.1);
    let root = q.mul_add(q, -3.0 * p * m0).max(0.0).sqrt();
    let s = (-m0 / (q + root)).clamp(0.0, 1.0);
    Some((a.1 + s * (m0 + s * (q + s * p)), a.0 + s * h))
}

/// Sums over all pairs of nodes: column 0 … base−1 the lobes without a shape, then one column a node.
struct Lattice {
    base: Vec<usize>,
    shaped: Vec<usize>,
    gram: Vec<DMatrix<f64>>,
    data: Vec<DVector<f64>>,
    energy: f64,
}

impl Lattice {
    fn new(search: &Search<'_>, t: &[f64]) -> Self {
        let problem = search.problem;
        let (shaped, base): (Vec<usize>, Vec<usize>) =
            (0..problem.kinds.len()).partition(|&l| !problem.kinds[l].lobe().parameters().is_empty());
        // The closed set of lobes sees to it that the shaped ones of a model are of one kind.
        let kind = problem.kinds[shaped[0]];
        let plain = base.iter().map(|&l| ShapedLobe { kind: problem.kinds[l], shape: Vec::new() });
        let lobes: Vec<ShapedLobe> = plain.chain(t.iter().map(|t| ShapedLobe { kind, shape: vec![t.exp()] })).collect();
        let moments = search.moments(&lobes, false);
        Self { base, shaped, gram: moments.gram, data: moments.data, energy: search.energy.iter().sum() }
    }

    /// Reduced cost with the first shaped lobes at these nodes, the others absent.
    fn cost(&self, problem: &Problem<'_>, nodes: &[usize]) -> f64 {
        let base = self.base.len();
        let n = base + nodes.len();
        let column = |i: usize| if i < base { i } else { base + nodes[i - base] };
        let lobe = |i: usize| if i < base { self.base[i] } else { self.shaped[i - base] };
        let mut ranges = [(0.0, 0.0); MAX_LOBES];
        let mut cost = self.energy;
        for (c, data) in self.data.iter().enumerate() {
            (0..n).for_each(|i| ranges[i] = problem.ranges[c][lobe(i)]);
            let gram = &self.gram[if self.gram.len() == 1 { 0 } else { c }];
            let quadratic = Quadratic::new(n, |i, j| gram[(column(i), column(j))], |i| data[column(i)]);
            cost += quadratic.value(&quadratic.minimise(&Feasible { ranges: &ranges[..n], cap: problem.cap }));
        }
        cost
    }
}
