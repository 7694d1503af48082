//! Integrals that state their error: adaptive Gauss–Legendre quadrature on intervals and rectangles.
//!
//! Every cell is integrated by the 9-point Gauss–Legendre rule a side, and beside it, one axis at a time, by a 6-point rule
//! with points at the cell's borders, which sees what happens between them and the first point of the other. Twice the sum
//! of the differences is taken for the error, but not less than twice the cell's share of what splitting its parent
//! changed. The cell with the largest error is halved along the axis with the largest difference until the sum of
//! the errors meets the tolerance.
//!
//! How good that is: for smooth integrands it overstates the error by far; over random places of a jump, a kink or a square
//! root's edge on a line, the stated error held in more than 99 cases of 100. In the plane a jump that runs along a cell's
//! border, or meets it at a tip, can still hide for a while, and jumps cost: cut the domain there if you can. What lies
//! wholly between the points of the first cells (a far, tiny light) is not seen: integrate over its own directions
//! instead, or raise `cells`.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::quantity::Quantity;
use crate::numeric::quadrature::gauss_legendre;

/// Points of the Gauss–Legendre rule that gives the value.
const ORDER: usize = 9;
/// The rule it is compared with: (node, weight) on [−1, 1], Lobatto's with 6 points but for its ends, which stand 2⁻²⁰ inside
/// so that a border itself is never evaluated; the others are those that make it exact to degree 9 again.
const BORDER_RULE: [(f64, f64); 6] = [
    (-0.999_999_046_325_683_6, 0.066_667_556_769_061_8),
    (-0.765_054_594_310_632_9, 0.378_474_595_353_420_1),
    (-0.285_231_244_460_758, 0.554_857_847_877_518_1),
    (0.285_231_244_460_758, 0.554_857_847_877_518_1),
    (0.765_054_594_310_632_9, 0.378_474_595_353_420_1),
    (0.999_999_046_325_683_6, 0.066_667_556_769_061_8),
];
/// The stated error is this multiple of what was seen.
const SAFETY: f64 = 2.0;

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
        let step = 2 * evaluations_per_cell::<N>();
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
    cells: usize,
    evaluations: usize,
}

impl Sum {
    fn add<const N: usize>(&mut self, cell: &Cell<N>) {
        self.value += cell.value;
        self.error += cell.error;
        self.magnitude += cell.magnitude;
        self.cells += 1;
        self.evaluations += evaluations_per_cell::<N>();
    }

    fn remove<const N: usize>(&mut self, cell: &Cell<N>) {
        self.value -= cell.value;
        self.error -= cell.error;
        self.magnitude -= cell.magnitude;
        self.cells -= 1;
    }

    /// The rounding that no splitting removes: some units in the last place of ∫ |f|, and the random walk of adding the cells.
    fn rounding(&self) -> f64 {
        (8.0 + (self.cells as f64).sqrt()) * f64::EPSILON * self.magnitude
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
    /// The axis along which it is worst.
    axis: usize,
}

impl<const N: usize> Cell<N> {
    fn new((low, high): ([f64; N], [f64; N]), f: &mut dyn FnMut([f64; N]) -> f64) -> Option<Self> {
        let gauss = gauss_legendre(ORDER);
        let (value, magnitude) = tensor_rule([gauss.as_slice(); N], low, high, f);
        let (mut axis, mut largest, mut sum) = (0, 0.0, 0.0);
        for tried in 0..N {
            let rules = std::array::from_fn(|a| if a == tried { &BORDER_RULE } else { gauss.as_slice() });
            let difference = (value - tensor_rule(rules, low, high, f).0).abs();
            sum += difference;
            if difference > largest {
                (axis, largest) = (tried, difference);
            }
        }
        let error = SAFETY * sum;
        (error.is_finite() && magnitude.is_finite()).then_some(Self { low, high, value, error, magnitude, axis })
    }

    /// Puts the halves of this cell into the heap and the sum.
    fn split_into(&self, heap: &mut BinaryHeap<Self>, sum: &mut Sum, f: &mut dyn FnMut([f64; N]) -> f64) -> Option<()> {
        let (mut below, mut above) = (self.high, self.low);
        let middle = 0.5 * self.low[self.axis] + 0.5 * self.high[self.axis];
        (below[self.axis], above[self.axis]) = (middle, middle);
        let (mut first, mut second) = (Self::new((self.low, below), f)?, Self::new((above, self.high), f)?);
        let least = 0.5 * SAFETY * (first.value + second.value - self.value).abs();
        for half in [&mut first, &mut second] {
            half.error = half.error.max(least);
            sum.add(half);
        }
        heap.extend([first, second]);
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
    (ORDER + N * BORDER_RULE.len()) * ORDER.pow(N as u32 - 1)
}

/// ∫ f and ∫ |f| over a box by the tensor product of one rule on [−1, 1] an axis.
fn tensor_rule<const N: usize>(
    rules: [&[(f64, f64)]; N],
    low: [f64; N],
    high: [f64; N],
    f: &mut dyn FnMut([f64; N]) -> f64,
) -> (f64, f64) {
    let (mut value, mut magnitude) = (0.0, 0.0);
    for index in 0..rules.iter().map(|rule| rule.len()).product() {
        let (mut digits, mut weight, mut x): (usize, _, _) = (index, 1.0, [0.0; N]);
        for (axis, rule) in rules.iter().enumerate() {
            let (node, node_weight) = rule[digits % rule.len()];
            let half = 0.5 * (high[axis] - low[axis]);
            x[axis] = low[axis] + half * (1.0 + node);
            weight *= half * node_weight;
            digits /= rule.len();
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
#[allow(clippy::float_cmp)] // exact results are compared exactly
mod tests {
    use super::*;
    use crate::numeric::random::{Purpose, RngExt, stream};

    /// Share of 1000 random places c for which the stated error held.
    fn coverage(relative: f64, f: fn(f64, f64) -> f64, exact: fn(f64) -> f64) -> f64 {
        let rule = Quadrature { relative, ..Quadrature::default() };
        let mut rng = stream(5, Purpose::Study, 0);
        let mut held = 0;
        for _ in 0..1000 {
            let c: f64 = rng.random();
            let got = rule.interval((0.0, 1.0), |x| f(x, c)).expect("finite");
            assert!(got.converged, "c {c}: {got:?}");
            held += u32::from((got.value - exact(c)).abs() <= got.error);
        }
        f64::from(held) / 1000.0
    }

    #[test]
    fn the_stated_error_always_holds_for_peaks_and_nearly_always_at_jumps_kinks_and_edges() {
        for relative in [1e-3, 1e-6, 1e-9] {
            let peak = coverage(relative, |x, c| 1.0 / (x * x + c * c), |c| (1.0 / c).atan() / c);
            let jump = coverage(relative, |x, c| f64::from(u8::from(x > c)), |c| 1.0 - c);
            let kink = coverage(relative, |x, c| (x - c).max(0.0), |c| 0.5 * (1.0 - c).powi(2));
            let edge = coverage(relative, |x, c| (x - c).max(0.0).sqrt(), |c| 2.0 / 3.0 * (1.0 - c).powf(1.5));
            // What the chapter of this file says, less five standard errors of a share of 1000.
            let least = 0.99 - 5.0 * f64::sqrt(0.99 * 0.01 / 1000.0);
            let rough = jump.min(kink).min(edge);
            assert!(peak == 1.0 && rough > least, "{relative:e}: {peak} {jump} {kink} {edge}");
        }
    }

    #[test]
    fn end_points_may_be_singular() {
        let got = Quadrature::default().interval((0.0, 1.0), f64::ln).expect("finite inside");
        assert!(got.converged && (got.value + 1.0).abs() <= got.error, "{got:?}");
    }

    #[test]
    fn a_budget_that_is_too_small_is_admitted_and_more_of_it_helps() {
        let disc = |x: f64, y: f64| f64::from(u8::from(x * x + y * y < 1.0));
        let errors = [20_000, 80_000, 320_000].map(|max_evaluations| {
            let rule = Quadrature { relative: 1e-12, max_evaluations, ..Quadrature::default() };
            let got = rule.rectangle((-1.0, 1.0), (-1.0, 1.0), disc).expect("finite");
            assert!(!got.converged && got.evaluations <= max_evaluations);
            assert!((got.value - std::f64::consts::PI).abs() <= got.error, "{got:?}");
            got.error
        });
        assert!(errors[0] > 1.5 * errors[1] && errors[1] > 1.5 * errors[2], "{errors:?}");
    }

    #[test]
    fn a_jump_along_an_axis_costs_little() {
        let rule = Quadrature { relative: 1e-6, ..Quadrature::default() };
        let got = rule.rectangle((0.0, 1.0), (0.0, 1.0), |x, _| f64::from(u8::from(x < 0.3))).expect("finite");
        assert!(got.converged && (got.value - 0.3).abs() <= got.error && got.evaluations < 50_000, "{got:?}");
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
