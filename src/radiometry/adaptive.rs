//! Integrals that state their error: adaptive Gauss–Legendre quadrature on intervals and rectangles.
//!
//! Every cell is integrated with 6 and with 9 points a side; the difference is taken for the error of the 9-point value,
//! which for smooth integrands it overstates by far. Where the integrand has a kink or a jump the two may agree by chance, so
//! no cell's error is taken for less than its share of an eighth of what the value of its parent changed when that was split.
//! The cell with the largest error is halved along every axis until the sum of the errors meets the tolerance. What lies wholly between the points of the first cells (a far, tiny light) is not
//! seen: integrate over its own directions instead, or raise `cells`.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::quantity::Quantity;
use crate::numeric::quadrature::gauss_legendre;

const LOW_ORDER: usize = 6;
const HIGH_ORDER: usize = 9;
/// Share of a split's change that its parts must own up to.
const PARENT_SHARE: f64 = 0.125;

/// How accurate an integral is to be, and what it may cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quadrature {
    /// Error aimed at, relative to the integral's value.
    pub relative: f64,
    /// Error aimed at, in the integral's unit; the larger of the two counts.
    pub absolute: f64,
    /// Cells a side to begin with, rounded up to an even number.
    pub cells: usize,
    /// Evaluations of the integrand after which no further cell is split.
    pub max_evaluations: usize,
}

impl Default for Quadrature {
    /// Relative error 10⁻⁹ from 4 cells a side, at most 2 million evaluations.
    fn default() -> Self {
        Self { relative: 1e-9, absolute: 0.0, cells: 4, max_evaluations: 2_000_000 }
    }
}

/// The value of an integral and what is known about its error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Integral<Q> {
    /// The value.
    pub value: Q,
    /// Estimate of |value − integral|, rounding included.
    pub error: Q,
    /// How often the integrand was evaluated.
    pub evaluations: usize,
    /// Whether the error met the tolerance within the evaluations allowed.
    pub converged: bool,
}

impl<Q: Quantity> Integral<Q> {
    /// The same numbers as another quantity.
    #[must_use]
    pub fn as_quantity<R: Quantity>(self) -> Integral<R> {
        Integral {
            value: R::new(self.value.value()),
            error: R::new(self.error.value()),
            evaluations: self.evaluations,
            converged: self.converged,
        }
    }

    /// The integral times a number.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { value: Q::new(self.value.value() * factor), error: Q::new(self.error.value() * factor.abs()), ..self }
    }
}

impl Quadrature {
    /// ∫ f(x) dx over the interval; `None` when a limit or a value of `f` is not finite.
    /// ```
    /// # use goniofit::radiometry::Quadrature;
    /// let root = Quadrature::default().interval((0.0, 1.0), f64::sqrt).unwrap();
    /// assert!(root.converged && (root.value - 2.0 / 3.0).abs() <= root.error && root.error < 1e-9);
    /// ```
    #[must_use]
    pub fn interval(&self, x: (f64, f64), mut f: impl FnMut(f64) -> f64) -> Option<Integral<f64>> {
        self.adapt([x.0], [x.1], &mut |[x]| f(x))
    }

    /// ∬ f(x, y) dx dy over the rectangle; `None` when a limit or a value of `f` is not finite.
    /// ```
    /// # use goniofit::radiometry::Quadrature;
    /// let volume = Quadrature::default().rectangle((0.0, 1.0), (0.0, 2.0), |x, y| (x * y).exp()).unwrap();
    /// // Σ 2^k/(k k!) = Ei(2) − ln 2 − γ
    /// assert!((volume.value - 3.683_871_510_540_41).abs() < 1e-12 && volume.converged);
    /// ```
    #[must_use]
    pub fn rectangle(&self, x: (f64, f64), y: (f64, f64), mut f: impl FnMut(f64, f64) -> f64) -> Option<Integral<f64>> {
        self.adapt([x.0, y.0], [x.1, y.1], &mut |[x, y]| f(x, y))
    }

    fn adapt<const N: usize>(
        &self,
        low: [f64; N],
        high: [f64; N],
        f: &mut dyn FnMut([f64; N]) -> f64,
    ) -> Option<Integral<f64>> {
        let mut sum = Sum::default();
        let mut heap = BinaryHeap::new();
        for (low, high) in split(low, high, self.cells.div_ceil(2).max(1)) {
            let parent = Cell::new((low, high), f)?;
            sum.evaluations += evaluations_per_cell::<N>();
            parent.split_into(&mut heap, &mut sum, f)?;
        }
        let step = (1 << N) * evaluations_per_cell::<N>();
        while !sum.meets(self) && sum.evaluations + step <= self.max_evaluations {
            let Some(worst) = heap.pop() else { break };
            sum.remove(&worst);
            worst.split_into(&mut heap, &mut sum, f)?;
        }
        sum.settle(heap.into_sorted_vec()).result(self)
    }
}

/// The running totals over all cells.
#[derive(Default)]
struct Sum {
    value: f64,
    error: f64,
    magnitude: f64,
    evaluations: usize,
}

impl Sum {
    fn add<const N: usize>(&mut self, cell: &Cell<N>) {
        self.value += cell.value;
        self.error += cell.error;
        self.magnitude += cell.magnitude;
        self.evaluations += evaluations_per_cell::<N>();
    }

    fn remove<const N: usize>(&mut self, cell: &Cell<N>) {
        self.value -= cell.value;
        self.error -= cell.error;
        self.magnitude -= cell.magnitude;
    }

    /// The rounding that no splitting removes: a few units in the last place of ∫ |f|.
    fn rounding(&self) -> f64 {
        8.0 * f64::EPSILON * self.magnitude
    }

    fn meets(&self, wanted: &Quadrature) -> bool {
        self.error <= wanted.absolute.max(wanted.relative * self.value.abs()).max(self.rounding())
    }

    /// The totals summed afresh, from the smallest error up, free of what adding and removing left behind.
    fn settle<const N: usize>(self, cells: Vec<Cell<N>>) -> Self {
        let mut fresh = Self::default();
        for cell in cells {
            fresh.add(&cell);
        }
        Self { evaluations: self.evaluations, ..fresh }
    }

    fn result(self, wanted: &Quadrature) -> Option<Integral<f64>> {
        let converged = self.meets(wanted);
        let error = (self.error + self.rounding()).finite()?;
        Some(Integral { value: self.value.finite()?, error, evaluations: self.evaluations, converged })
    }
}

/// One box of the domain, its integral and the error of that.
struct Cell<const N: usize> {
    low: [f64; N],
    high: [f64; N],
    value: f64,
    error: f64,
    magnitude: f64,
}

impl<const N: usize> Cell<N> {
    fn new((low, high): ([f64; N], [f64; N]), f: &mut dyn FnMut([f64; N]) -> f64) -> Option<Self> {
        let (rough, _) = tensor_rule(LOW_ORDER, low, high, f);
        let (value, magnitude) = tensor_rule(HIGH_ORDER, low, high, f);
        let error = (value - rough).abs();
        (error.is_finite() && magnitude.is_finite()).then_some(Self { low, high, value, error, magnitude })
    }

    /// Puts the halves of this cell along every axis into the heap and the sum.
    fn split_into(
        &self,
        heap: &mut BinaryHeap<Self>,
        sum: &mut Sum,
        f: &mut dyn FnMut([f64; N]) -> f64,
    ) -> Option<()> {
        let mut children = Vec::with_capacity(1 << N);
        for child in split(self.low, self.high, 2) {
            children.push(Self::new(child, f)?);
        }
        let change = (children.iter().map(|child| child.value).sum::<f64>() - self.value).abs();
        let least = PARENT_SHARE * change / children.len() as f64;
        for mut child in children {
            child.error = child.error.max(least);
            sum.add(&child);
            heap.push(child);
        }
        Some(())
    }
}

impl<const N: usize> Ord for Cell<N> {
    fn cmp(&self, other: &Self) -> Ordering {
        self.error.total_cmp(&other.error)
    }
}
impl<const N: usize> PartialOrd for Cell<N> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl<const N: usize> PartialEq for Cell<N> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl<const N: usize> Eq for Cell<N> {}

const fn evaluations_per_cell<const N: usize>() -> usize {
    LOW_ORDER.pow(N as u32) + HIGH_ORDER.pow(N as u32)
}

/// ∫ f and ∫ |f| over a box by the tensor product of the Gauss–Legendre rule of `order` points.
fn tensor_rule<const N: usize>(
    order: usize,
    low: [f64; N],
    high: [f64; N],
    f: &mut dyn FnMut([f64; N]) -> f64,
) -> (f64, f64) {
    let rule = gauss_legendre(order);
    let (mut value, mut magnitude) = (0.0, 0.0);
    for index in 0..order.pow(N as u32) {
        let (mut digits, mut weight, mut x) = (index, 1.0, [0.0; N]);
        for axis in 0..N {
            let (node, node_weight) = rule[digits % order];
            let half = 0.5 * (high[axis] - low[axis]);
            x[axis] = low[axis] + half * (1.0 + node);
            weight *= half * node_weight;
            digits /= order;
        }
        let term = weight * f(x);
        value += term;
        magnitude += term.abs();
    }
    (value, magnitude)
}

/// The boxes into which `parts` cuts along every axis divide a box.
fn split<const N: usize>(low: [f64; N], high: [f64; N], parts: usize) -> impl Iterator<Item = ([f64; N], [f64; N])> {
    let border = move |axis: usize, cut: usize| {
        let t = cut as f64 / parts as f64;
        low[axis] * (1.0 - t) + high[axis] * t
    };
    (0..parts.pow(N as u32)).map(move |index| {
        let digit = |axis: usize| index / parts.pow(axis as u32) % parts;
        (std::array::from_fn(|a| border(a, digit(a))), std::array::from_fn(|a| border(a, digit(a) + 1)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stated_error_holds_for_smooth_kinked_and_jumping_integrands() {
        let rule = Quadrature { relative: 1e-6, ..Quadrature::default() };
        let laws: [(&str, &dyn Fn(f64) -> f64, f64); 4] = [
            ("peak", &|x| 1.0 / (1e-6 + x * x), 2e3 * (1e3f64).atan()),
            ("kink", &|x: f64| (x - 0.3).abs(), 0.5 * (1.3 * 1.3 + 0.7 * 0.7)),
            ("jump", &|x| f64::from(u8::from(x > 0.123)), 0.877),
            ("log", &|x: f64| x.abs().ln(), -2.0),
        ];
        for (name, f, want) in laws {
            let got = rule.interval((-1.0, 1.0), f).expect("finite");
            assert!(got.converged && (got.value - want).abs() <= got.error, "{name}: {got:?}, exact {want}");
        }
    }

    #[test]
    fn a_budget_that_is_too_small_is_admitted_and_its_error_is_honest() {
        let rule = Quadrature { relative: 1e-12, max_evaluations: 20_000, ..Quadrature::default() };
        let disc = |x: f64, y: f64| f64::from(u8::from(x * x + y * y < 1.0));
        let got = rule.rectangle((-1.0, 1.0), (-1.0, 1.0), disc).expect("finite");
        assert!(!got.converged && got.evaluations <= 20_000);
        assert!((got.value - std::f64::consts::PI).abs() <= got.error && got.error < 0.05, "{got:?}");
    }

    #[test]
    fn what_is_not_finite_gives_no_number() {
        let rule = Quadrature::default();
        assert_eq!(rule.interval((0.0, f64::INFINITY), |x| (-x).exp()), None);
        assert_eq!(rule.interval((0.0, 1.0), |x| if x > 0.9 { f64::NAN } else { 1.0 }), None);
        assert_eq!(rule.rectangle((0.0, 1.0), (f64::NAN, 1.0), |_, _| 1.0), None);
        let empty = rule.interval((1.0, 1.0), |_| 1.0).expect("an empty interval");
        assert!(empty.value == 0.0 && empty.converged);
    }
}
