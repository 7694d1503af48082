//! Arithmetic the other rooms rely on: float repair, ordered sums, quadrature, keyed random streams, statistics.
//!
//! In and out: plain numbers. The one decision to know: anything summed in parallel is summed in fixed blocks whose
//! partial results are added in order, so results do not depend on the number of threads.

pub mod estimate;
pub mod float;
pub mod lanes;
pub mod line;
pub mod quadrature;
pub mod random;
pub mod simd;
pub mod stats;
pub mod sum;
