//! The search as the solver takes it: the reduced cost from the transforms, point by point.

use std::cell::RefCell;
use std::rc::Rc;

use argmin::core::Error;
use nalgebra::DVector;

use super::passes::Moments;
use super::reduced::Search;
use super::solver::{Linearization, Linearize};

/// A way through the search's points. An accepted trial is linearised where its cost was taken, so the last point is kept.
#[derive(Debug)]
pub(super) struct Walk<'a> {
    search: &'a Search<'a>,
    last: RefCell<Option<Rc<Visited>>>,
}

#[derive(Debug)]
struct Visited {
    t: DVector<f64>,
    moments: Moments,
    weights: Vec<DVector<f64>>,
    cost: f64,
}

impl<'a> Walk<'a> {
    pub fn new(search: &'a Search<'a>) -> Self {
        Self { search, last: RefCell::new(None) }
    }

    fn visit(&self, t: &DVector<f64>) -> Rc<Visited> {
        if let Some(last) = self.last.borrow().as_ref().filter(|last| last.t == *t) {
            return Rc::clone(last);
        }
        let moments = self.search.moments(&self.search.problem.shaped(t.as_slice()), true);
        let weights = self.search.weights(&moments);
        let cost = self.search.cost_of(&moments, &weights).max(0.0);
        let here = Rc::new(Visited { t: t.clone(), moments, weights, cost });
        *self.last.borrow_mut() = Some(Rc::clone(&here));
        here
    }
}

impl Linearize for Walk<'_> {
    fn cost(&self, t: &DVector<f64>) -> Result<f64, Error> {
        Ok(self.visit(t).cost)
    }

    fn linearize(&self, t: &DVector<f64>) -> Result<Linearization, Error> {
        let k = self.search.problem.kinds.len();
        let here = self.visit(t);
        let (moments, weights) = (&here.moments, &here.weights);
        let pull = |c: usize, i: usize| {
            let products = weights[c].iter().enumerate().map(|(l, x)| moments.gram(c)[(k + i, l)] * x);
            products.sum::<f64>() - moments.data[c][k + i]
        };
        let (normal, gradient) = self.search.problem.reduce(weights, |c| moments.gram(c), pull);
        Ok(Linearization::from_normal(here.cost, normal, &gradient))
    }
}
