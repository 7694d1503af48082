//! Passes over the samples: each returns a few dozen sums, however many samples there are. Sums run in blocks of fixed size,
//! in a fixed order, so they do not depend on the number of threads.

use nalgebra::{DMatrix, DVector};

use super::samples::Samples;
use crate::brdf::LobeKind;
use crate::numeric::sum::fold_blocks;

/// A lobe of the model at given shapes (natural units).
#[derive(Debug, Clone)]
pub(super) struct ShapedLobe {
    pub kind: LobeKind,
    pub shape: Vec<f64>,
}

/// Basis columns of one block: lobe values φ, then for each shape parameter dφ/dt with t = ln(shape).
struct Columns {
    phi: Vec<Vec<f64>>,
    slope: Vec<Vec<f64>>,
}

fn columns(samples: &Samples, lobes: &[ShapedLobe], block: std::ops::Range<usize>) -> Columns {
    let mut out = Columns { phi: Vec::new(), slope: Vec::new() };
    for lobe in lobes {
        let (phi, slopes) = basis(samples, lobe.kind, &lobe.shape, block.clone());
        out.phi.push(phi);
        out.slope.extend(slopes);
    }
    out
}

/// Values of one lobe over a block, and its derivatives by t = ln(shape).
pub(super) fn basis(
    samples: &Samples,
    kind: LobeKind,
    shape: &[f64],
    block: std::ops::Range<usize>,
) -> (Vec<f64>, Vec<Vec<f64>>) {
    let coordinate = &samples.coordinate(kind)[block];
    let mut phi = vec![0.0; coordinate.len()];
    let mut slopes = vec![vec![0.0; coordinate.len()]; shape.len()];
    kind.lobe().fill(shape, coordinate, &mut phi, &mut slopes);
    for (list, s) in slopes.iter_mut().zip(shape) {
        list.iter_mut().for_each(|d| *d *= s);
    }
    (phi, slopes)
}

/// Σ a·b with eight running sums: the compiler can use vector registers, and the bracketing is fixed.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (mut lanes, (a8, b8)) = ([0.0f64; 8], (a.chunks_exact(8), b.chunks_exact(8)));
    let rest: f64 = a8.remainder().iter().zip(b8.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a8.zip(b8) {
        for k in 0..8 {
            lanes[k] += x[k] * y[k];
        }
    }
    lanes.iter().sum::<f64>() + rest
}

/// Sums of products for given shapes. `K` columns: the lobe values, then their slopes.
#[derive(Debug, Clone)]
pub(super) struct Moments {
    /// Σ w g² col·col, one matrix for each weight list.
    pub gram: Vec<DMatrix<f64>>,
    /// Σ w g² col·y, one vector for each channel.
    pub data: Vec<DVector<f64>>,
}

impl Moments {
    /// The sums of one channel.
    pub fn gram(&self, channel: usize) -> &DMatrix<f64> {
        if self.gram.len() == 1 { &self.gram[0] } else { &self.gram[channel] }
    }

    fn symmetric(mut self) -> Self {
        self.gram.iter_mut().for_each(DMatrix::fill_upper_triangle_with_lower_triangle);
        self
    }
}

/// One pass for [`Moments`]; with `slopes` also of the derivative columns.
pub(super) fn moments(samples: &Samples, lobes: &[ShapedLobe], slopes: bool) -> Moments {
    let parameters: usize = lobes.iter().map(|l| l.shape.len()).sum();
    let k = lobes.len() + if slopes { parameters } else { 0 };
    let zero = Moments {
        gram: vec![DMatrix::zeros(k, k); samples.weight_lists()],
        data: vec![DVector::zeros(k); samples.data.len()],
    };
    fold_blocks(
        samples.len(),
        zero.clone(),
        |block| {
            let basis = columns(samples, lobes, block.clone());
            let mut sums = zero.clone();
            let mut weighted = vec![Vec::new(); k];
            for channel in 0..samples.data.len() {
                let fresh = channel < samples.weight_lists();
                let data = &samples.data[channel][block.clone()];
                for (a, column) in basis.phi.iter().chain(&basis.slope).take(k).enumerate() {
                    if fresh {
                        weighted[a] = weigh(samples, channel, block.clone(), column);
                        for (b, other) in basis.phi.iter().chain(&basis.slope).take(a + 1).enumerate() {
                            sums.gram[channel][(a, b)] = dot(&weighted[a], other);
                        }
                    }
                    sums.data[channel][a] = dot(&weighted[a], data);
                }
            }
            sums
        },
        |total, part| {
            total.gram.iter_mut().zip(&part.gram).for_each(|(t, p)| *t += p);
            total.data.iter_mut().zip(&part.data).for_each(|(t, p)| *t += p);
        },
    )
    .symmetric()
}

/// w g² · column over a block.
fn weigh(samples: &Samples, channel: usize, block: std::ops::Range<usize>, column: &[f64]) -> Vec<f64> {
    let (w, g) = (&samples.weight(channel)[block.clone()], &samples.slope[block]);
    w.iter().zip(g).zip(column).map(|((w, g), x)| w * g * g * x).collect()
}

/// Sums over true residuals r = g (Σ x φ − y).
#[derive(Debug, Clone)]
pub(super) struct Residuals {
    /// Σ w r² over all channels.
    pub cost: f64,
    /// Σ w r g φ_l, per channel and lobe: what is left of the weights' normal equations.
    pub lobes: Vec<DVector<f64>>,
    /// Σ over channels of x_l Σ w r g dφ_l/dt, per shape parameter: half the cost's gradient.
    pub shapes: DVector<f64>,
}

/// One pass over true residuals for given shapes and weights (`weights[channel][lobe]`).
pub(super) fn residuals(samples: &Samples, lobes: &[ShapedLobe], weights: &[DVector<f64>]) -> Residuals {
    let owner: Vec<usize> = lobes.iter().enumerate().flat_map(|(l, lobe)| vec![l; lobe.shape.len()]).collect();
    let zero = Residuals {
        cost: 0.0,
        lobes: vec![DVector::zeros(lobes.len()); samples.data.len()],
        shapes: DVector::zeros(owner.len()),
    };
    fold_blocks(
        samples.len(),
        zero.clone(),
        |block| {
            let basis = columns(samples, lobes, block.clone());
            let mut sums = zero.clone();
            for (channel, x) in weights.iter().enumerate() {
                let (w, g) = (&samples.weight(channel)[block.clone()], &samples.slope[block.clone()]);
                let mut r: Vec<f64> = samples.data[channel][block.clone()].iter().map(|y| -y).collect();
                for (phi, x) in basis.phi.iter().zip(x.iter()) {
                    r.iter_mut().zip(phi).for_each(|(r, p)| *r += x * p);
                }
                r.iter_mut().zip(g).for_each(|(r, g)| *r *= g);
                let wr: Vec<f64> = r.iter().zip(w).map(|(r, w)| w * r).collect();
                sums.cost += dot(&wr, &r);
                let wrg: Vec<f64> = wr.iter().zip(g).map(|(r, g)| r * g).collect();
                for (l, phi) in basis.phi.iter().enumerate() {
                    sums.lobes[channel][l] = dot(&wrg, phi);
                }
                for (p, slope) in basis.slope.iter().enumerate() {
                    sums.shapes[p] += x[owner[p]] * dot(&wrg, slope);
                }
            }
            sums
        },
        |total, part| {
            total.cost += part.cost;
            total.shapes += part.shapes;
            total.lobes.iter_mut().zip(&part.lobes).for_each(|(t, p)| *t += p);
        },
    )
}

/// Jacobian rows of one block for the covariance: lobe values and the slopes by t, each times g.
pub(super) fn jacobian_block(
    samples: &Samples,
    lobes: &[ShapedLobe],
    block: std::ops::Range<usize>,
) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let mut basis = columns(samples, lobes, block.clone());
    let g = &samples.slope[block];
    for column in basis.phi.iter_mut().chain(basis.slope.iter_mut()) {
        column.iter_mut().zip(g).for_each(|(x, g)| *x *= g);
    }
    (basis.phi, basis.slope)
}
