//! Sums that do not depend on the number of threads: fixed blocks in parallel, then a serial fold in order.

use std::ops::Range;

use rayon::prelude::*;

/// Samples per block. It fixes how sums are bracketed, so it must never depend on the number of threads.
pub const BLOCK: usize = 4096;

/// Maps every block of `0..len` in parallel and returns the results in order.
pub fn map_blocks<T: Send>(len: usize, map: impl Fn(Range<usize>) -> T + Sync + Send) -> Vec<T> {
    (0..len.div_ceil(BLOCK)).into_par_iter().map(|b| map(b * BLOCK..((b + 1) * BLOCK).min(len))).collect()
}

/// Maps every block of `0..len` in parallel, then folds the results serially in order.
pub fn fold_blocks<T: Send>(
    len: usize,
    start: T,
    map: impl Fn(Range<usize>) -> T + Sync + Send,
    mut add: impl FnMut(&mut T, T),
) -> T {
    let mut total = start;
    for part in map_blocks(len, map) {
        add(&mut total, part);
    }
    total
}

/// Σ f(i) over `0..len`, the same bits for any number of threads.
pub fn sum_blocks(len: usize, f: impl Fn(usize) -> f64 + Sync + Send) -> f64 {
    fold_blocks(len, 0.0, |block| block.map(&f).sum::<f64>(), |total, part| *total += part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_has_the_same_bits_from_any_number_of_threads() {
        let sum = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
            pool.install(|| sum_blocks(100_003, |i| (i as f64).sin() * 1e3f64.powi((i % 7) as i32)))
        };
        let one = sum(1);
        assert_eq!(one.to_bits(), sum(2).to_bits());
        assert_eq!(one.to_bits(), sum(8).to_bits());
    }
}
