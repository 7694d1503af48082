//! The forward simulation: truth, instrument and scan to a measurement.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use super::forward::lit_rows;
use super::instrument::Instrument;
use super::scan::Scan;
use crate::control::{Control, Stop, counted};
use crate::measurement::{Directions, Masked, Measurement, STOPPED};
use crate::numeric::sum::BLOCK;

/// The material on the sample holder: writes the value of every channel for (wi, wo) above the horizon, in 1/sr (1/rad in the
/// flat world, directions in the xz plane), and answers whether it is known there.
pub type Truth<'a> = dyn Fn(DVec3, DVec3, &mut [f64]) -> bool + Sync + 'a;

/// Measures a material with channels of these names by an instrument along a scan. Directions below the horizon, and those
/// where the truth is not known, are masked. `None` where the scan has too many entries, or is
/// adaptive and not chosen yet ([`super::adapt`]).
pub fn simulate(
    name: &str,
    truth: &Truth<'_>,
    channels: &[String],
    instrument: &Instrument,
    scan: &Scan,
    seed: u64,
    control: Control<'_>,
) -> Option<Measurement> {
    let (directions, weights) = scan.directions()?;
    let (n, width) = (directions.len(), channels.len());
    let times = times(scan, n);
    let at = Readings { truth, instrument, directions: &directions, times: &times, width, seed };
    let measured = AtomicU64::new(0);
    control.progress.start("measuring", n as u64);
    let block = |b: usize| {
        let range = b * BLOCK..((b + 1) * BLOCK).min(n);
        let (len, (block, seen)) = (range.len(), at.block(range, control.stop));
        measured.fetch_add(seen, Ordering::Relaxed);
        control.progress.advance(len as u64);
        block
    };
    let blocks: Vec<Block> = (0..n.div_ceil(BLOCK)).into_par_iter().map(block).collect();
    control.progress.finish();
    let values = join_planes(width, &blocks, |b| &b.0);
    let marked = values.iter().filter(|v| v.is_nan()).count() as u64;
    let sigma = instrument.is_noisy().then(|| join_planes(width, &blocks, |b| &b.1));
    let lit = lit_rows(&directions, &[]).len() as u64;
    let missed = lit - measured.into_inner().min(lit);
    let notes = (missed > 0).then(|| {
        format!("{STOPPED}{} of {lit} readings: {} of directions not read", lit - missed, counted(missed, "pair"))
    });
    Some(Measurement {
        notes: notes.into_iter().collect(),
        origin: format!("simulated, scan {scan}, seed {seed}"),
        dimension: scan.dimension(),
        weights,
        masked: Masked { marked, ..Masked::default() },
        sigma,
        ..Measurement::new(name, directions, channels.to_vec(), values)
    })
}

/// What is read, and how.
struct Readings<'a> {
    truth: &'a Truth<'a>,
    instrument: &'a Instrument,
    directions: &'a Directions,
    /// How often each pair of directions is read; empty where each is once.
    times: &'a [u32],
    width: usize,
    seed: u64,
}

impl Readings<'_> {
    /// Values and σ of some pairs of directions in a row, and how many of them lie above the horizon and were come to before a stop.
    fn block(&self, range: Range<usize>, stop: &Stop) -> (Block, u64) {
        let (len, width) = (range.len(), self.width);
        let (mut values, mut sigma) = (vec![f64::NAN; len * width], vec![f64::NAN; len * width]);
        let (mut f, mut seen) = (vec![0.0; width], 0);
        for (slot, i) in range.enumerate() {
            if stop.requested() {
                break; // the rest is not measured
            }
            let (wi, wo) = self.directions.pair(i);
            seen += u64::from(wi.z > 0.0 && wo.z > 0.0);
            if wi.z > 0.0 && wo.z > 0.0 && (self.truth)(wi, wo, &mut f) {
                let repeated = self.times.get(i).map(|&times| repeated(self.instrument, times));
                let instrument = repeated.as_ref().unwrap_or(self.instrument);
                for (c, f) in f.iter().enumerate() {
                    let reading = instrument.read(*f, wo.z, self.seed, (i * width + c) as u64);
                    (values[c * len + slot], sigma[c * len + slot]) = reading;
                }
            }
        }
        ((values, sigma), seen)
    }
}

/// How often each pair of directions is read; empty where each is once.
fn times(scan: &Scan, n: usize) -> Vec<u32> {
    if scan.rows().is_empty() {
        return Vec::new();
    }
    let mut times = vec![0u32; n];
    scan.rows().iter().for_each(|&row| times[row as usize] += 1);
    times
}

/// The instrument that takes so many times the readings.
fn repeated(instrument: &Instrument, times: u32) -> Instrument {
    Instrument { readings: instrument.readings.saturating_mul(times), ..instrument.clone() }
}

/// Values and σ of a block, each channel-major.
type Block = (Vec<f64>, Vec<f64>);

/// One part of channel-major blocks, joined to channel-major planes.
fn join_planes(width: usize, blocks: &[Block], part: fn(&Block) -> &Vec<f64>) -> Vec<f64> {
    let plane = |c: usize| {
        blocks.iter().map(part).flat_map(move |b| {
            let len = b.len() / width;
            b[c * len..(c + 1) * len].iter().copied()
        })
    };
    (0..width).flat_map(plane).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::{LobeKind, Material};

    fn measure(threads: usize, instrument: &Instrument, scan: &Scan) -> Measurement {
        let material = Material::new(
            vec!["a".into(), "b".into()],
            vec![(LobeKind::Lambert, vec![0.3, 0.5], vec![]), (LobeKind::Phong, vec![0.1, 0.2], vec![30.0])],
        );
        let truth = |wi, wo, out: &mut [f64]| {
            out.copy_from_slice(&material.value(wi, wo));
            true
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
        let channels = material.channels.clone();
        pool.install(|| simulate("m", &truth, &channels, instrument, scan, 5, Control::silent()).expect("fits"))
    }

    #[test]
    fn readings_have_the_same_bits_from_any_number_of_threads() {
        let scan = Scan::Hemisphere { step_deg: 10.0 };
        let bits = |m: &Measurement| m.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let one = measure(1, &Instrument::default(), &scan);
        assert_eq!(bits(&one), bits(&measure(2, &Instrument::default(), &scan)));
        assert_eq!(bits(&one), bits(&measure(8, &Instrument::default(), &scan)));
    }

    #[test]
    fn a_noiseless_instrument_reads_the_truth_above_the_horizon_and_masks_the_rest() {
        let m = measure(2, &Instrument::noiseless(), &Scan::Merl);
        assert!(m.sigma.is_none());
        let above = (0..m.len()).filter(|&i| {
            let (wi, wo) = m.directions.pair(i);
            wi.z > 0.0 && wo.z > 0.0
        });
        assert_eq!(m.masked.total() as usize, 2 * (m.len() - above.count()));
        let (wi, wo) = m.directions.pair(1000);
        let peak = 0.5 / std::f64::consts::PI
            + 0.2 * 32.0 / std::f64::consts::TAU * crate::geometry::half_diff::cos_alpha(wi, wo).powi(30);
        assert!((m.value(1, 1000).expect("valid") / peak - 1.0).abs() < 1e-12);
    }
}
