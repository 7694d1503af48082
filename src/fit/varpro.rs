//! Variable projection: the cost as a function of the shapes alone, the weights being solved for.

use argmin::core::Error;
use nalgebra::{DMatrix, DVector};

use super::nnls;
use super::passes::{self, Moments, ShapedLobe};
use super::samples::Samples;
use super::solver::{Linearization, Linearize};
use crate::brdf::{LobeKind, ModelSpec, Parameter};

/// A lobe whose share of a channel's root-sum-square is below this is rounding: 16 units in the last place.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// The reduced problem: parameters t = ln(shape), lobe by lobe.
#[derive(Debug)]
pub(super) struct Profile<'a> {
    pub samples: &'a Samples,
    pub kinds: Vec<LobeKind>,
    /// Lobe and parameter that each t belongs to.
    pub layout: Vec<(usize, Parameter)>,
}

/// A point of the reduced problem with everything that goes with it.
#[derive(Debug, Clone)]
pub(super) struct Solution {
    pub t: Vec<f64>,
    pub lobes: Vec<ShapedLobe>,
    /// `weights[channel][lobe]`.
    pub weights: Vec<DVector<f64>>,
    /// Σ w r² from true residuals.
    pub cost: f64,
}

impl<'a> Profile<'a> {
    pub fn new(samples: &'a Samples, model: &ModelSpec) -> Self {
        let kinds = model.lobes().to_vec();
        let layout = kinds
            .iter()
            .enumerate()
            .flat_map(|(l, kind)| kind.lobe().parameters().iter().map(move |p| (l, *p)))
            .collect();
        Self { samples, kinds, layout }
    }

    /// The problem with one shaped lobe fewer; `None` where there is but one.
    pub fn without_last_shape(&self) -> Option<Self> {
        let mut layout = self.layout.clone();
        let (last, _) = layout.pop()?;
        let mut kinds = self.kinds.clone();
        kinds.remove(last);
        (!layout.is_empty()).then_some(Self { samples: self.samples, kinds, layout })
    }

    /// Bounds of t.
    pub fn bounds(&self) -> Vec<(f64, f64)> {
        self.layout.iter().map(|(_, p)| (p.bounds.0.ln(), p.bounds.1.ln())).collect()
    }

    fn shaped(&self, t: &[f64]) -> Vec<ShapedLobe> {
        let shape_of = |lobe| {
            let own = self.layout.iter().zip(t).filter(move |((l, _), _)| *l == lobe);
            own.map(|(_, t)| t.exp()).collect()
        };
        self.kinds.iter().enumerate().map(|(l, kind)| ShapedLobe { kind: *kind, shape: shape_of(l) }).collect()
    }

    fn weights(&self, moments: &Moments) -> Vec<DVector<f64>> {
        let k = self.kinds.len();
        (0..self.samples.data.len())
            .map(|c| {
                nnls::solve(&moments.gram(c).view((0, 0), (k, k)).into_owned(), &moments.data[c].rows(0, k).into())
            })
            .collect()
    }

    /// The minimum over the weights at `t`, its last digits won back by one step on true residuals. Weights that are nothing
    /// but rounding are 0.
    pub fn solve(&self, t: &[f64]) -> Solution {
        let lobes = self.shaped(t);
        let moments = passes::moments(self.samples, &lobes, false);
        let mut weights = self.weights(&moments);
        for (c, x) in weights.iter_mut().enumerate() {
            let floor = ROUNDING * self.samples.energy[c].sqrt();
            for l in 0..x.len() {
                if x[l] * moments.gram(c)[(l, l)].sqrt() <= floor {
                    x[l] = 0.0;
                }
            }
        }
        let first = passes::residuals(self.samples, &lobes, &weights);
        let refined: Vec<DVector<f64>> =
            weights.iter().enumerate().map(|(c, x)| refine(x, moments.gram(c), &first.lobes[c])).collect();
        let second = passes::residuals(self.samples, &lobes, &refined);
        let better = second.cost < first.cost;
        let (weights, cost) = if better { (refined, second.cost) } else { (weights, first.cost) };
        Solution { t: t.to_vec(), lobes, weights, cost }
    }

    /// Gauss–Newton matrix of the reduced cost (Kaufman 1975): Σ over channels of the slope columns' Gram matrix, less what the
    /// free weights can follow.
    fn reduced_normal(&self, moments: &Moments, weights: &[DVector<f64>]) -> DMatrix<f64> {
        let (k, p) = (self.kinds.len(), self.layout.len());
        let slopes: Vec<usize> = (k..k + p).collect();
        let mut normal = DMatrix::zeros(p, p);
        for (c, x) in weights.iter().enumerate() {
            let gram = moments.gram(c);
            let strength = DMatrix::from_diagonal(&DVector::from_fn(p, |i, _| x[self.layout[i].0]));
            let active = active(x);
            let cross = sub(gram, &active, &slopes) * &strength;
            let mut follow = DMatrix::zeros(active.len(), p);
            for j in 0..p {
                follow.set_column(j, &nnls::solve_free(&sub(gram, &active, &active), &cross.column(j).into_owned()));
            }
            normal += &strength * sub(gram, &slopes, &slopes) * &strength - cross.transpose() * follow;
        }
        normal
    }
}

/// One step of iterative refinement on the positive weights, from what their normal equations leave.
fn refine(x: &DVector<f64>, gram: &DMatrix<f64>, left: &DVector<f64>) -> DVector<f64> {
    let active = active(x);
    let step = nnls::solve_free(&sub(gram, &active, &active), &left.select_rows(&active));
    let mut y = x.clone();
    active.iter().zip(step.iter()).for_each(|(&i, s)| y[i] -= s);
    if y.iter().all(|v| *v >= 0.0) { y } else { x.clone() }
}

fn active(x: &DVector<f64>) -> Vec<usize> {
    (0..x.len()).filter(|&i| x[i] > 0.0).collect()
}

fn sub(gram: &DMatrix<f64>, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
    gram.select_rows(rows).select_columns(columns)
}

impl Linearize for Profile<'_> {
    fn cost(&self, t: &DVector<f64>) -> Result<f64, Error> {
        let lobes = self.shaped(t.as_slice());
        let weights = self.weights(&passes::moments(self.samples, &lobes, false));
        Ok(passes::residuals(self.samples, &lobes, &weights).cost)
    }

    fn linearize(&self, t: &DVector<f64>) -> Result<Linearization, Error> {
        let lobes = self.shaped(t.as_slice());
        let moments = passes::moments(self.samples, &lobes, true);
        let weights = self.weights(&moments);
        let residuals = passes::residuals(self.samples, &lobes, &weights);
        let normal = self.reduced_normal(&moments, &weights);
        Ok(Linearization::from_normal(residuals.cost, normal, &residuals.shapes))
    }
}
