//! Variable projection: the cost as a function of the shapes alone, the weights being solved for.

use argmin::core::Error;
use nalgebra::{DMatrix, DVector};

use super::nnls;
use super::passes::{self, Moments, ShapedLobe};
use super::samples::Samples;
use super::solver::{Linearization, Linearize};
use crate::brdf::{LobeKind, ModelSpec, Parameter};

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

    /// The minimum over the weights at `t`, its last digits won back by one step on true residuals.
    pub fn solve(&self, t: &[f64]) -> Solution {
        let lobes = self.shaped(t);
        let moments = passes::moments(self.samples, &lobes, false);
        let mut weights = self.weights(&moments);
        let mut cost = f64::INFINITY;
        for _ in 0..2 {
            let now = passes::residuals(self.samples, &lobes, &weights);
            if now.cost >= cost {
                break;
            }
            cost = now.cost;
            let refined: Vec<DVector<f64>> = weights
                .iter()
                .enumerate()
                .map(|(c, x)| {
                    let active = active(x);
                    let step =
                        nnls::solve_free(&sub(moments.gram(c), &active, &active), &now.lobes[c].select_rows(&active));
                    let mut y = x.clone();
                    active.iter().zip(step.iter()).for_each(|(&i, s)| y[i] -= s);
                    if y.iter().all(|v| *v >= 0.0) { y } else { x.clone() }
                })
                .collect();
            let then = passes::residuals(self.samples, &lobes, &refined);
            if then.cost < cost {
                (weights, cost) = (refined, then.cost);
            }
        }
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
