//! The fit as a function of the shapes alone: for given shapes the weights follow (variable projection, Golub & Pereyra 1973), within
//! their ranges.
//!
//! Three ways to evaluate it, one problem: [`Search`] from the transforms, in microseconds; [`polish`] on true residuals, which
//! wins back the digits that sums of products lose; [`Streamed`](super::streamed::Streamed) by passes over the samples, for losses that are not linear in
//! the weights.

use nalgebra::{DMatrix, DVector};

use super::limits::Ranges;
use super::options::FitError;
use super::passes::{self, Moments, Saturation, ShapedLobe, Sums, Want};
use super::powers::PowerColumns;
use super::quadratic::{Feasible, Quadratic, Row};
use super::samples::Samples;
use super::transform::Transform;
use super::walk::Walk;
use crate::brdf::{LobeKind, MAX_LOBES, ModelSpec, Parameter};

/// A model on samples. Weights and values are in the samples' scale.
#[derive(Debug)]
pub(super) struct Problem<'a> {
    pub samples: &'a Samples<'a>,
    pub kinds: Vec<LobeKind>,
    /// Lobe and parameter that each t belongs to.
    pub layout: Vec<(usize, Parameter)>,
    /// Bounds of each t = ln(shape).
    pub bounds: Vec<(f64, f64)>,
    /// Range of each weight, `[channel][lobe]`.
    pub ranges: Vec<Vec<(f64, f64)>>,
    /// Largest sum of a channel's weights, where energy must be conserved.
    pub cap: Option<f64>,
    pub saturation: Saturation,
}

/// Adds a channel's matrix of bare columns, its lower triangle, to one of all parameters: columns count `strength` times and stand at `place`.
pub(super) fn spread_into(to: &mut DMatrix<f64>, bare: &DMatrix<f64>, strength: &[f64], place: &[usize]) {
    for (i, &a) in place.iter().enumerate() {
        for (j, &b) in place.iter().enumerate() {
            to[(a, b)] += strength[i] * strength[j] * bare[(i.max(j), i.min(j))];
        }
    }
}

/// A point of the problem with everything that goes with it.
#[derive(Debug, Clone)]
pub(super) struct Solution {
    pub t: Vec<f64>,
    pub lobes: Vec<ShapedLobe>,
    /// `weights[channel][lobe]`.
    pub weights: Vec<DVector<f64>>,
    /// Σ w r².
    pub cost: f64,
}

impl<'a> Problem<'a> {
    /// A model within the ranges given for the measurement's channels.
    pub fn new(samples: &'a Samples<'a>, model: &ModelSpec, ranges: &Ranges, conserve_energy: bool) -> Self {
        let kinds = model.lobes().to_vec();
        let parameters = |(l, kind): (usize, &LobeKind)| kind.lobe().parameters().iter().map(move |p| (l, *p));
        let layout = kinds.iter().enumerate().flat_map(parameters).collect();
        let unit = samples.scale;
        let scaled = |c: &usize| ranges.weights[*c].iter().map(|(low, high)| (low / unit, high / unit)).collect();
        Self {
            samples,
            kinds,
            layout,
            bounds: ranges.ln_shapes(),
            ranges: samples.channels.iter().map(scaled).collect(),
            cap: conserve_energy.then_some(1.0 / unit),
            saturation: None,
        }
    }

    /// Whether the weights can be where they must: the least of each channel below the cap.
    pub fn check(&self, names: &[String]) -> Result<(), FitError> {
        let Some(cap) = self.cap else { return Ok(()) };
        for (ranges, channel) in self.ranges.iter().zip(&self.samples.channels) {
            let least: f64 = ranges.iter().map(|r| r.0).sum();
            if least > cap {
                return Err(FitError::Infeasible { channel: names[*channel].clone(), least: least / cap });
            }
        }
        Ok(())
    }

    /// The same model on other samples of the same measurement.
    pub fn on<'b>(&self, samples: &'b Samples<'b>) -> Problem<'b> {
        Problem {
            samples,
            kinds: self.kinds.clone(),
            layout: self.layout.clone(),
            bounds: self.bounds.clone(),
            ranges: self.ranges.clone(),
            cap: self.cap,
            saturation: self.saturation,
        }
    }

    /// The model with its first `count` shaped lobes alone, those without a shape kept.
    pub fn with_shapes(&self, count: usize) -> Self {
        let dropped: Vec<usize> = self.layout[count..].iter().map(|(lobe, _)| *lobe).collect();
        let kept = |l: &usize| !dropped.contains(l);
        let lobes: Vec<usize> = (0..self.kinds.len()).filter(kept).collect();
        let place = |l: usize| lobes.iter().position(|k| *k == l).unwrap_or(0);
        Self {
            samples: self.samples,
            kinds: lobes.iter().map(|&l| self.kinds[l]).collect(),
            layout: self.layout[..count].iter().map(|(l, p)| (place(*l), *p)).collect(),
            bounds: self.bounds[..count].to_vec(),
            ranges: self.ranges.iter().map(|r| lobes.iter().map(|&l| r[l]).collect()).collect(),
            cap: self.cap,
            saturation: self.saturation,
        }
    }

    /// Whether every lobe is a constant or a power, seen as it is, so that the transforms know all sums.
    pub fn is_transformable(&self) -> bool {
        let known = |k: &LobeKind| k.lobe().parameters().is_empty() || k.lobe().power(1.0).is_some();
        let plain = self.samples.loss.is_linear() && self.saturation.is_none() && self.samples.sight.is_none();
        plain && self.kinds.iter().all(known)
    }

    pub fn shaped(&self, t: &[f64]) -> Vec<ShapedLobe> {
        let shape_of = |lobe| {
            let own = self.layout.iter().zip(t).filter(move |((l, _), _)| *l == lobe);
            own.map(|(_, t)| t.exp()).collect()
        };
        self.kinds.iter().enumerate().map(|(l, kind)| ShapedLobe { kind: *kind, shape: shape_of(l) }).collect()
    }

    pub fn feasible(&self, channel: usize) -> Feasible<'_> {
        Feasible { ranges: &self.ranges[channel], cap: self.cap }
    }

    /// Number of parameters: the weights of every channel and all shapes.
    pub fn parameters(&self) -> usize {
        self.ranges.len() * self.kinds.len() + self.layout.len()
    }

    /// Whether the energy limit decides the weights of a channel.
    pub fn is_capped(&self, channel: usize, x: &DVector<f64>) -> bool {
        self.feasible(channel).free_at(x).1
    }

    /// Weights of a channel as they may be: in their ranges, and each less by its part of what their sum is above the cap.
    pub fn within(&self, channel: usize, x: &DVector<f64>) -> DVector<f64> {
        let ranges = &self.ranges[channel];
        let x = x.map_with_location(|l, _, x| x.clamp(ranges[l].0, ranges[l].1));
        let slack = |l: usize| x[l] - ranges[l].0;
        let all: f64 = (0..x.len()).map(slack).sum();
        match self.cap.map(|cap| x.sum() - cap) {
            Some(over) if over > 0.0 && all > 0.0 => {
                DVector::from_fn(x.len(), |l, _| x[l] - (over / all).min(1.0) * slack(l))
            }
            _ => x,
        }
    }

    /// What the bare columns of a channel are multiplied by: 1 for the lobes themselves, the lobe's weight for its slopes.
    pub fn strength(&self, x: &DVector<f64>) -> Vec<f64> {
        std::iter::repeat_n(1.0, x.len()).chain(self.layout.iter().map(|(lobe, _)| x[*lobe])).collect()
    }

    /// Where a channel's columns stand among all parameters: weights channel by channel, then every t.
    pub fn place(&self, channels: usize, channel: usize) -> Vec<usize> {
        let lobes = self.kinds.len();
        let shapes = channels * lobes..channels * lobes + self.layout.len();
        (channel * lobes..(channel + 1) * lobes).chain(shapes).collect()
    }

    /// Half the gradient by t and the Gauss–Newton matrix of the reduced cost (Kaufman 1975): the slope columns' Gram matrix, less
    /// what the free weights can follow. `normal` is by [weights, bare slopes] of each channel, `pull` Σ w r slope of a channel.
    pub fn reduce<'m>(
        &self,
        weights: &[DVector<f64>],
        normal: impl Fn(usize) -> &'m DMatrix<f64>,
        pull: impl Fn(usize, usize) -> f64,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let (k, p) = (self.kinds.len(), self.layout.len());
        let mut reduced = DMatrix::zeros(p, p);
        let mut gradient = DVector::zeros(p);
        for (c, x) in weights.iter().enumerate() {
            let (matrix, following) = (normal(c), self.following(c, x, normal(c)));
            let strength = |i: usize| x[self.layout[i].0];
            for j in 0..p {
                let moved = following.undo(|l| matrix[(l, k + j)] * strength(j));
                for i in 0..p {
                    let followed: f64 = (0..k).map(|l| matrix[(l, k + i)] * moved[l]).sum();
                    reduced[(i, j)] += strength(i) * (matrix[(k + i, k + j)] * strength(j) - followed);
                }
                gradient[j] += strength(j) * pull(c, j);
            }
        }
        (0.5 * (&reduced + reduced.transpose()), gradient)
    }

    /// What the weights of a channel can follow. `matrix` is by [weights, …].
    fn following(&self, channel: usize, x: &DVector<f64>, matrix: &DMatrix<f64>) -> Following {
        let (places, capped) = self.feasible(channel).free_at(x);
        let mut free = [false; MAX_LOBES];
        places.into_iter().for_each(|l| free[l] = true);
        Following { quadratic: Quadratic::new(x.len(), |i, j| matrix[(i, j)], |_| 0.0), free, capped }
    }
}

/// The weights of a channel that a small change can move.
struct Following {
    quadratic: Quadratic,
    free: [bool; MAX_LOBES],
    /// Whether they stay on the cap.
    capped: bool,
}

impl Following {
    /// Minus the change of the weights that best cancels a column, of which the products with the weights' columns are given.
    fn undo(&self, products: impl Fn(usize) -> f64) -> Row {
        let solved = self.quadratic.with(products).solve_on_plane(|l| self.free[l], self.capped.then_some(0.0));
        solved.unwrap_or_default()
    }
}

/// The problem seen through its transforms.
#[derive(Debug)]
pub(super) struct Search<'a> {
    pub problem: &'a Problem<'a>,
    pub transform: &'a Transform,
    /// Σ w g² y² of each channel.
    pub energy: &'a [f64],
}

impl<'a> Search<'a> {
    pub fn new(problem: &'a Problem<'a>, transform: &'a Transform, energy: &'a [f64]) -> Self {
        Self { problem, transform, energy }
    }

    /// The same samples under other bounds.
    pub fn of<'b>(&'b self, problem: &'b Problem<'b>) -> Search<'b> {
        Search { problem, transform: self.transform, energy: self.energy }
    }

    /// As the solver takes it.
    pub fn walk(&self) -> Walk<'_> {
        Walk::new(self)
    }

    /// Gram matrices and data vectors at `lobes`, with the slopes by t on request.
    pub fn moments(&self, lobes: &[ShapedLobe], slopes: bool) -> Moments {
        let columns = PowerColumns::new(lobes, slopes);
        let samples = self.problem.samples;
        let (lists, channels) = (samples.lists(), samples.channels.len());
        let k = columns.list.len();
        let mut gram = vec![DMatrix::zeros(k, k); lists];
        let mut data = vec![DVector::zeros(k); channels];
        // A lobe alone: its products with constants, and with the data.
        for (a, lobe) in columns.lobes.iter().enumerate() {
            let jets = match lobe.exponent {
                None => self.transform.totals.iter().map(|t| [*t, 0.0, 0.0]).collect(),
                Some(n) => self.transform.at(n, 0..lists + channels),
            };
            let constants = columns.lobes.iter().enumerate().filter(|(_, other)| other.exponent.is_none());
            for (b, _) in constants {
                gram.iter_mut().zip(&jets).for_each(|(gram, jet)| columns.products(a, b, jet, gram));
            }
            for (data, jet) in data.iter_mut().zip(&jets[lists..]) {
                for (i, column) in columns.list.iter().enumerate().filter(|(_, column)| column.lobe == a) {
                    data[i] = column.constant * jet[0] + column.linear * jet[1];
                }
            }
        }
        let shaped: Vec<(usize, f64)> =
            columns.lobes.iter().enumerate().filter_map(|(l, lobe)| lobe.exponent.map(|n| (l, n))).collect();
        for (place, &(a, n)) in shaped.iter().enumerate() {
            for &(b, m) in &shaped[..=place] {
                let jets = self.transform.at(n + m, 0..lists);
                gram.iter_mut().zip(&jets).for_each(|(gram, jet)| columns.products(a, b, jet, gram));
            }
        }
        Moments { gram, data }
    }

    /// The cost of a channel by its weights, Σ w g² y² aside.
    fn quadratic(&self, moments: &Moments, channel: usize) -> Quadratic {
        let (gram, data) = (moments.gram(channel), &moments.data[channel]);
        Quadratic::new(self.problem.kinds.len(), |i, j| gram[(i, j)], |i| data[i])
    }

    /// The weights that minimise the cost.
    pub fn weights(&self, moments: &Moments) -> Vec<DVector<f64>> {
        let k = self.problem.kinds.len();
        let solve = |c: usize| self.quadratic(moments, c).minimise(&self.problem.feasible(c));
        (0..moments.data.len()).map(|c| DVector::from_column_slice(&solve(c)[..k])).collect()
    }

    /// Σ w r² = y·y − 2 b·x + x·Gx; a difference, so good to about 1e-15 of y·y.
    pub fn cost_of(&self, moments: &Moments, weights: &[DVector<f64>]) -> f64 {
        let of = |(c, x): (usize, &DVector<f64>)| self.energy[c] + self.quadratic(moments, c).value(&row(x));
        weights.iter().enumerate().map(of).sum::<f64>()
    }

    pub fn solve(&self, t: &[f64]) -> Solution {
        let lobes = self.problem.shaped(t);
        let moments = self.moments(&lobes, false);
        let weights = self.weights(&moments);
        let cost = self.cost_of(&moments, &weights);
        Solution { t: t.to_vec(), lobes, weights, cost }
    }
}

/// Weights in a row.
fn row(x: &DVector<f64>) -> Row {
    std::array::from_fn(|l| x.get(l).copied().unwrap_or(0.0))
}

/// A lobe whose share of a channel's root-sum-square is below this is rounding: 16 units in the last place.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// Polishing passes at most.
const POLISH_PASSES: usize = 40;
/// Share of the cost below which a step no longer pays.
const PAYS: f64 = 1e-12;

/// Damped Gauss–Newton steps in weights and shapes together, on true residuals, from a point that the transforms found: wins back the
/// digits that the difference of sums loses. The best point seen is kept.
pub(super) fn polish(search: &Search<'_>, start: Solution) -> Solution {
    let problem = search.problem;
    let evaluate = |s: &Solution| passes::sums(problem.samples, &s.lobes, &s.weights, None, Want::Gradient);
    let mut at = start;
    let mut moments = search.moments(&at.lobes, true);
    drop_rounding(search, &moments, &mut at);
    let mut sums = evaluate(&at);
    at.cost = sums.iter().map(|s| s.cost).sum();
    let mut damping = 0.0;
    for _ in 0..POLISH_PASSES {
        let mut next = joint_step(problem, &moments, &at, &sums, damping);
        let found = evaluate(&next);
        next.cost = found.iter().map(|s| s.cost).sum();
        if next.cost < at.cost {
            let won = 1.0 - next.cost / at.cost;
            (at, sums) = (next, found);
            if won < PAYS {
                break;
            }
            damping = if damping > 1e-9 { 0.1 * damping } else { 0.0 };
            moments = search.moments(&at.lobes, true);
        } else if damping > 1.0 {
            break;
        } else {
            damping = (20.0 * damping).max(1e-10);
        }
    }
    at
}

/// Weights that are nothing but rounding are 0.
fn drop_rounding(search: &Search<'_>, moments: &Moments, at: &mut Solution) {
    for (c, x) in at.weights.iter_mut().enumerate() {
        let floor = ROUNDING * search.energy[c].sqrt();
        for l in 0..x.len() {
            let free = search.problem.ranges[c][l].0 == 0.0;
            if free && x[l] * moments.gram(c)[(l, l)].sqrt() <= floor {
                x[l] = 0.0;
            }
        }
    }
}

/// The step in all parameters from the sums of true residuals, its part in the shapes damped by a share of their matrix's diagonal.
fn joint_step(problem: &Problem<'_>, moments: &Moments, at: &Solution, sums: &[Sums], damping: f64) -> Solution {
    let (k, p) = (problem.kinds.len(), problem.layout.len());
    let pull = |c: usize, i: usize| sums[c].gradient[k + i];
    let (mut normal, mut by_t) = problem.reduce(&at.weights, |c| moments.gram(c), pull);
    let strength = |x: &DVector<f64>| DVector::from_fn(p, |i, _| x[problem.layout[i].0]);
    // What the weights do by themselves, and what is then left of the gradient by t.
    let mut own = Vec::new();
    for (c, x) in at.weights.iter().enumerate() {
        let moved = problem.following(c, x, moments.gram(c)).undo(|l| sums[c].gradient[l]);
        let moved = DVector::from_column_slice(&moved[..k]);
        by_t -= (moments.gram(c).view((k, 0), (p, k)) * &moved).component_mul(&strength(x));
        own.push(moved);
    }
    for i in 0..p {
        normal[(i, i)] *= 1.0 + damping;
    }
    let held = |i: usize| {
        let (low, high) = problem.bounds[i];
        low == high || (at.t[i] <= low && by_t[i] > 0.0) || (at.t[i] >= high && by_t[i] < 0.0)
    };
    let quadratic = Quadratic::new(p, |i, j| normal[(i, j)], |i| by_t[i]);
    let solved = quadratic.solve_on_plane(|i| !held(i), None).unwrap_or_default();
    let moved = |i: usize| (at.t[i] - solved[i]).clamp(problem.bounds[i].0, problem.bounds[i].1);
    let t: Vec<f64> = (0..p).map(|i| if held(i) { at.t[i] } else { moved(i) }).collect();
    let step = DVector::from_fn(p, |i, _| t[i] - at.t[i]);
    let follow = |(c, x): (usize, &DVector<f64>)| {
        let cross = moments.gram(c).view((0, k), (k, p)) * step.component_mul(&strength(x));
        let also = problem.following(c, x, moments.gram(c)).undo(|l| cross[l]);
        let next = x - &own[c] - DVector::from_column_slice(&also[..k]);
        DVector::from_fn(k, |l, _| next[l].clamp(problem.ranges[c][l].0, problem.ranges[c][l].1))
    };
    let weights = at.weights.iter().enumerate().map(follow).collect();
    Solution { lobes: problem.shaped(&t), t, weights, cost: f64::NAN }
}
