//! Sums of products of columns: what every pass over residuals ends in.

use nalgebra::{DMatrix, DVector};

use super::passes::Scratch;
use crate::numeric::simd::{Eight, Kernel, LANES, Lanes, Simd, dot, dot_vectorised, dot3, vectorised};

impl Scratch {
    /// Adds Σ pull·col and the lower triangle of Σ weight·col·col.
    pub fn tally(&self, columns: usize, gradient: &mut DVector<f64>, products: &mut DMatrix<f64>) {
        let mut sums = Tallied::new(columns);
        sums.add(self);
        sums.add_to(gradient, products);
    }
}

/// Σ pull·col and Σ weight·col·col of many blocks, in lanes.
#[derive(Debug, Clone, Default)]
pub(super) struct Tallied {
    pub gradient: Vec<Eight>,
    /// The lower triangle, row by row; empty where only the gradient is wanted.
    products: Vec<Eight>,
}

impl Tallied {
    pub fn new(columns: usize) -> Self {
        let zero = [0.0; LANES];
        Self { gradient: vec![zero; columns], products: vec![zero; columns * (columns + 1) / 2] }
    }

    /// Of the gradient alone.
    pub fn gradient(columns: usize) -> Self {
        Self { products: Vec::new(), ..Self::new(columns) }
    }

    /// Adds the columns that it has room for.
    pub fn add(&mut self, scratch: &Scratch) {
        if self.products.is_empty() {
            let sums = self.gradient.iter_mut().zip(&scratch.columns);
            return sums.for_each(|(to, column)| to[0] += dot_vectorised(&scratch.pull, column));
        }
        let (list, pull, weight) = (&scratch.columns[..self.gradient.len()], &scratch.pull[..], &scratch.weight[..]);
        match list.len() {
            1 => vectorised(Tally::<1> { columns: list, pull, weight, into: self }),
            2 => vectorised(Tally::<2> { columns: list, pull, weight, into: self }),
            3 => vectorised(Tally::<3> { columns: list, pull, weight, into: self }),
            4 => vectorised(Tally::<4> { columns: list, pull, weight, into: self }),
            5 => vectorised(Tally::<5> { columns: list, pull, weight, into: self }),
            6 => vectorised(Tally::<6> { columns: list, pull, weight, into: self }),
            7 => vectorised(Tally::<7> { columns: list, pull, weight, into: self }),
            _ => vectorised(TallyAny { columns: list, pull, weight, into: self }),
        }
    }

    /// Σ pull·col so far, which begins again.
    pub fn take_gradient(&mut self, into: &mut DVector<f64>) {
        let taken = self.gradient.iter_mut().map(std::mem::take);
        into.iter_mut().zip(taken).for_each(|(to, lanes)| *to = lanes.iter().sum());
    }

    /// Adds the sums to a vector and the lower triangle of a matrix.
    pub fn add_to(&self, gradient: &mut DVector<f64>, products: &mut DMatrix<f64>) {
        gradient.iter_mut().zip(&self.gradient).for_each(|(to, lanes)| *to += lanes.iter().sum::<f64>());
        let mut list = self.products.iter();
        for a in 0..self.gradient.len() {
            for (b, lanes) in list.by_ref().take(a + 1).enumerate() {
                products[(a, b)] += lanes.iter().sum::<f64>();
            }
        }
    }
}

/// All sums of K columns at once, in registers.
struct Tally<'a, const K: usize> {
    columns: &'a [Vec<f64>],
    pull: &'a [f64],
    weight: &'a [f64],
    into: &'a mut Tallied,
}

impl<const K: usize> Kernel for Tally<'_, K> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let n = self.pull.len();
        let columns: [&[f64]; K] = std::array::from_fn(|a| &self.columns[a][..n]);
        let mut sums =
            RunningSums { gradient: [Lanes::splat(simd, 0.0); K], products: [[Lanes::splat(simd, 0.0); K]; K] };
        let ((pull, pull_rest), (weight, weight_rest)) = (self.pull.as_chunks(), self.weight[..n].as_chunks());
        for i in 0..pull.len() {
            let row = columns.map(|column| Lanes::load(simd, &column.as_chunks().0[i]));
            sums.add(Lanes::load(simd, &pull[i]), Lanes::load(simd, &weight[i]), row);
        }
        if !pull_rest.is_empty() {
            let rest = columns.map(|column| padded(simd, column.as_chunks::<LANES>().1));
            sums.add(padded(simd, pull_rest), padded(simd, weight_rest), rest);
        }
        let mut products = self.into.products.iter_mut();
        for a in 0..K {
            add(simd, &mut self.into.gradient[a], sums.gradient[a]);
            (0..=a).zip(products.by_ref()).for_each(|(b, to)| add(simd, to, sums.products[a][b]));
        }
    }
}

struct RunningSums<S: Simd, const K: usize> {
    gradient: [Lanes<S>; K],
    products: [[Lanes<S>; K]; K],
}

impl<S: Simd, const K: usize> RunningSums<S, K> {
    #[inline(always)]
    fn add(&mut self, pull: Lanes<S>, weight: Lanes<S>, columns: [Lanes<S>; K]) {
        for a in 0..K {
            self.gradient[a] = pull.mul_add(columns[a], self.gradient[a]);
            let weighted = weight * columns[a];
            // A fixed range, so that the loops unroll and the sums stay in registers.
            for b in 0..K {
                if b <= a {
                    self.products[a][b] = weighted.mul_add(columns[b], self.products[a][b]);
                }
            }
        }
    }
}

/// Any number of columns: more sums than there are registers.
struct TallyAny<'a> {
    columns: &'a [Vec<f64>],
    pull: &'a [f64],
    weight: &'a [f64],
    into: &'a mut Tallied,
}

impl Kernel for TallyAny<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _simd: S) {
        let mut products = self.into.products.iter_mut();
        for (a, column) in self.columns.iter().enumerate() {
            self.into.gradient[a][0] += dot(self.pull, column);
            let row = self.columns[..=a].iter().zip(products.by_ref());
            row.for_each(|(other, to)| to[0] += dot3(self.weight, column, other));
        }
    }
}

/// What is left of a list, 0 beyond its end.
#[inline(always)]
fn padded<S: Simd>(simd: S, rest: &[f64]) -> Lanes<S> {
    let mut eight = [0.0; LANES];
    eight.iter_mut().zip(rest).for_each(|(to, v)| *to = *v);
    Lanes::load(simd, &eight)
}

#[inline(always)]
fn add<S: Simd>(simd: S, to: &mut Eight, more: Lanes<S>) {
    (Lanes::load(simd, to) + more).store(to);
}
