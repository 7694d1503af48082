//! What 32-bit arithmetic would gain and cost: one pass of the sums a fit of Lambert + Phong needs (Gram matrix of three columns, data of
//! three channels) over 909,696 samples, in 64 bits, in 32 bits with the data stored so, and in 32 bits from data stored in 64, as a
//! table is. `cargo bench --bench precision` prints a Markdown table.
#![allow(clippy::expect_used)] // a bench may fail loudly

use std::ops::Range;
use std::time::Instant;

use goniofit::numeric::random::{Purpose, RngExt, stream};
use goniofit::numeric::simd::{Kernel, Simd, exp, vectorised};
use rayon::prelude::*;

const SAMPLES: usize = 909_696;
const BLOCK: usize = 512;
const CHANNELS: usize = 3;
const ROUNDS: usize = 40;
const EXPONENT: f64 = 89.0;
/// Σ w a b of the columns a, b in (1, φ, xφ), then Σ w a y of every channel.
const SUMS: usize = 6 + 3 * CHANNELS;

type Sums = [f64; SUMS];

struct Table<T> {
    x: Vec<T>,
    w: Vec<T>,
    y: [Vec<T>; CHANNELS],
}

fn main() {
    let table = made();
    let single = Table {
        x: narrowed(&table.x),
        w: narrowed(&table.w),
        y: [narrowed(&table.y[0]), narrowed(&table.y[1]), narrowed(&table.y[2])],
    };
    let energy: f64 = table.y.iter().flatten().zip(table.w.iter().cycle()).map(|(y, w)| w * y * y).sum();
    let double = || blocks(|r| vectorised(Double(table.block(r))));
    let exact = cost(&double(), energy);
    println!("| arithmetic | data in memory | ms a pass | relative error of the cost |");
    println!("|---|---|---|---|");
    let row = |name: &str, stored: &str, pass: &dyn Fn() -> Sums| {
        let quickest = (0..ROUNDS).map(|_| timed(pass)).fold(f64::INFINITY, f64::min);
        println!("| {name} | {stored} | {quickest:.2} | {:.0e} |", (cost(&pass(), energy) / exact - 1.0).abs());
    };
    row("64 bits", "64 bits", &double);
    row("32 bits", "32 bits", &|| blocks(|r| vectorised(Single(single.block(r)))));
    row("32 bits", "64 bits", &|| blocks(|r| vectorised(Converted(table.block(r)))));
}

fn timed(pass: &dyn Fn() -> Sums) -> f64 {
    let clock = Instant::now();
    std::hint::black_box(pass());
    1e3 * clock.elapsed().as_secs_f64()
}

/// Coordinates as dense near the peak as a MERL table's, a lobe over a diffuse ground, 1 % noise.
fn made() -> Table<f64> {
    let mut rng = stream(1, Purpose::Study, 1);
    let x: Vec<f64> = (0..SAMPLES).map(|_| (1.0 - 0.999 * rng.random::<f64>().powi(2)).ln()).collect();
    let value = |x: &f64, noise: f64| (0.1 + 0.4 * (EXPONENT * x).exp()) * (1.0 + 0.01 * (noise - 0.5));
    let y = [0, 1, 2].map(|_| x.iter().map(|x| value(x, rng.random())).collect());
    let w = (0..SAMPLES).map(|_| 0.5 + rng.random::<f64>()).collect();
    Table { x, w, y }
}

fn narrowed(list: &[f64]) -> Vec<f32> {
    list.iter().map(|v| *v as f32).collect()
}

/// The reduced cost of the linear weights, from the sums.
fn cost(sums: &Sums, energy: f64) -> f64 {
    let gram = nalgebra::Matrix2::new(sums[0], sums[1], sums[1], sums[2]);
    let inverse = gram.try_inverse().expect("two different columns");
    let explained = |c: usize| {
        let b = nalgebra::Vector2::new(sums[6 + 3 * c], sums[7 + 3 * c]);
        b.dot(&(inverse * b))
    };
    energy - (0..CHANNELS).map(explained).sum::<f64>()
}

fn blocks(block: impl Fn(Range<usize>) -> Sums + Sync + Send) -> Sums {
    let parts: Vec<Sums> = (0..SAMPLES.div_ceil(BLOCK))
        .into_par_iter()
        .map(|b| block(b * BLOCK..((b + 1) * BLOCK).min(SAMPLES)))
        .collect();
    parts.iter().fold([0.0; SUMS], |sum, part| std::array::from_fn(|k| sum[k] + part[k]))
}

impl<T> Table<T> {
    fn block(&self, range: Range<usize>) -> Samples<'_, T> {
        Samples {
            x: &self.x[range.clone()],
            w: &self.w[range.clone()],
            y: self.y.each_ref().map(|y| &y[range.clone()]),
        }
    }
}

/// Samples of a block.
struct Samples<'a, T> {
    x: &'a [T],
    w: &'a [T],
    y: [&'a [T]; CHANNELS],
}

/// Which of (1, w, φ, xφ, wφ, wxφ, y of every channel) are multiplied in each sum.
const TERMS: [(usize, usize); SUMS] = [
    (1, 0),
    (4, 0),
    (4, 2),
    (5, 0),
    (5, 2),
    (5, 3),
    (1, 6),
    (4, 6),
    (5, 6),
    (1, 7),
    (4, 7),
    (5, 7),
    (1, 8),
    (4, 8),
    (5, 8),
];

struct Double<'a>(Samples<'a, f64>);

impl Kernel for Double<'_> {
    type Output = Sums;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Sums {
        let Samples { x, w, y } = self.0;
        let mut phi = [0.0; BLOCK];
        phi.iter_mut().zip(x).for_each(|(p, x)| *p = exp(EXPONENT * x));
        let mut sums = [simd.splat_f64s(0.0); SUMS];
        let lists = [x, w, &phi[..x.len()], y[0], y[1], y[2]].map(|l| S::as_simd_f64s(l).0);
        for i in 0..lists[0].len() {
            let [x, w, phi, y0, y1, y2] = lists.map(|l| l[i]);
            let slope = simd.mul_f64s(x, phi);
            let one = simd.splat_f64s(1.0);
            let factors = [one, w, phi, slope, simd.mul_f64s(w, phi), simd.mul_f64s(w, slope), y0, y1, y2];
            for (sum, (p, q)) in sums.iter_mut().zip(TERMS) {
                *sum = simd.mul_add_f64s(factors[p], factors[q], *sum);
            }
        }
        sums.map(|s| simd.reduce_sum_f64s(s))
    }
}

struct Single<'a>(Samples<'a, f32>);

impl Kernel for Single<'_> {
    type Output = Sums;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Sums {
        let Samples { x, w, y } = self.0;
        let mut phi = [0.0f32; BLOCK];
        phi.iter_mut().zip(x).for_each(|(p, x)| *p = exp_single(EXPONENT as f32 * x));
        let mut sums = [simd.splat_f32s(0.0); SUMS];
        let lists = [x, w, &phi[..x.len()], y[0], y[1], y[2]].map(|l| S::as_simd_f32s(l).0);
        for i in 0..lists[0].len() {
            let [x, w, phi, y0, y1, y2] = lists.map(|l| l[i]);
            let slope = simd.mul_f32s(x, phi);
            let one = simd.splat_f32s(1.0);
            let factors = [one, w, phi, slope, simd.mul_f32s(w, phi), simd.mul_f32s(w, slope), y0, y1, y2];
            for (sum, (p, q)) in sums.iter_mut().zip(TERMS) {
                *sum = simd.mul_add_f32s(factors[p], factors[q], *sum);
            }
        }
        sums.map(|s| f64::from(simd.reduce_sum_f32s(s)))
    }
}

/// [`Single`] after narrowing the block.
struct Converted<'a>(Samples<'a, f64>);

impl Kernel for Converted<'_> {
    type Output = Sums;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Sums {
        let Samples { x, w, y } = self.0;
        let n = x.len();
        let mut lists = [[0.0f32; BLOCK]; 2 + CHANNELS];
        for (to, from) in lists.iter_mut().zip([x, w, y[0], y[1], y[2]]) {
            to.iter_mut().zip(from).for_each(|(to, v)| *to = *v as f32);
        }
        let [x, w, y0, y1, y2] = &lists;
        Single(Samples { x: &x[..n], w: &w[..n], y: [&y0[..n], &y1[..n], &y2[..n]] }).run(simd)
    }
}

/// eˣ to two units in the last place for −87 < x < 88; below, e⁻⁸⁷.
#[inline(always)]
fn exp_single(x: f32) -> f32 {
    let x = if x < -87.0 { -87.0 } else { x };
    let rounded = x.mul_add(std::f32::consts::LOG2_E, 12_582_912.0);
    let k = rounded - 12_582_912.0;
    let r = k.mul_add(-1.428_606_8e-6, k.mul_add(-0.693_145_75, x));
    let mut p = 1.0 / 720.0f32;
    for c in [1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
        p = p.mul_add(r, c);
    }
    f32::from_bits(p.to_bits().wrapping_add(rounded.to_bits() << 23))
}
