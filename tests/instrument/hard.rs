//! The instrument's rows of the hard cases, on every built-in instrument with all its other faults: as the aperture goes to 0, noise goes to 0 and
//! distances go to infinity, readings go to those of an instrument without, at the order that theory gives.

use crate::support::*;
use goniofit::control::Control;
use goniofit::gonio::parts::{Detector, Holder};
use goniofit::gonio::{Instrument, Kind, PRESETS};

/// What acts anew in every reading, and what cuts or rounds it.
const NOISE: [&str; 4] = ["shot noise", "read noise", "quantisation", "saturation"];

/// Of errors that an instrument keeps.
const SEED: u64 = 5;

/// The built-in instruments that have what goes away.
fn with(has: impl Fn(&Instrument) -> bool) -> Vec<(&'static str, Instrument)> {
    let all = PRESETS.iter().map(|p| (p.name, p.spec().expect("reads").instrument));
    let some: Vec<_> = all.filter(|(_, instrument)| has(instrument)).collect();
    assert!(some.len() >= 3, "{}", some.len());
    some
}

/// Signals of a glossy sample, by the errors of a seed, without these effects.
fn signals(instrument: &Instrument, seed: u64, left_out: &[&str]) -> Vec<f64> {
    let (material, scan) = (material(0.2, 0.1, 20.0), in_plane(30.0));
    let raw = with_job(&material, instrument, &scan, seed, left_out, |job| job.run(Control::silent()));
    raw.readings.iter().zip(&raw.signal).filter(|(r, _)| r.kind == Kind::Sample).map(|(_, s)| *s).collect()
}

/// Orders at which the largest change of a reading falls as the cause is 1/4, 1/8 and 1/16 of the built-in one.
fn orders(name: &str, of: impl Fn(f64) -> Instrument) -> [f64; 2] {
    let best = signals(&of(0.0), SEED, &NOISE);
    let off = |x: f64| {
        let signals = signals(&of(x), SEED, &NOISE);
        assert!(signals.iter().all(|s| s.is_finite()), "{name}");
        let pairs = signals.into_iter().zip(&best).filter(|(_, best)| **best != 0.0);
        pairs.map(|(s, best)| (s / best - 1.0).abs()).fold(0.0, f64::max)
    };
    let offs = [0.25, 0.125, 0.0625].map(off);
    println!("{name}: off by {offs:?}");
    assert!(offs[2] > 0.0, "{name}");
    [(offs[0] / offs[1]).log2(), (offs[1] / offs[2]).log2()]
}

/// How far an order measured at 1/4 to 1/16 of a cause may be off. At 1/4 the next term is 1 % of the first at most: n α²/4 of a lobe of n = 20 and a half
/// angle α of 0.5°, as much of the spot, and of the height what stands there. That moves an order by 0.015, and three such steps are allowed.
const SECOND: f64 = 0.045;

#[test]
fn aperture_to_0() {
    for (name, built_in) in with(|i| i.detector.aperture_deg > 0.0) {
        let of = |x: f64| {
            let aperture_deg = x * built_in.detector.aperture_deg;
            Instrument { detector: Detector { aperture_deg, ..built_in.detector.clone() }, ..built_in.clone() }
        };
        let order = orders(name, of);
        assert!(order.iter().all(|o| (o - 2.0).abs() < SECOND), "{name}: {order:?}");
    }
}

/// Both ends at 1/x of their distance r; infinitely far is written as 0. The spot's extent D does D²/4r², an error h of the height 2h/r: with
/// h = 30 D²/8r the spot's part is 1/120 of that at four times the distance, and the square of h/r is less.
#[test]
fn distance_to_infinity() {
    let far = |d: f64, x: f64| if x == 0.0 { 0.0 } else { d / x };
    for (name, built_in) in with(|i| i.detector.distance_m > 0.0 && i.source.beam_diameter_m > 0.0) {
        let of = |x: f64, height_u_m: f64| {
            let mut i = Instrument { sample: Holder { height_u_m, ..built_in.sample }, ..built_in.clone() };
            i.source.distance_m = far(i.source.distance_m, x);
            i.detector.distance_m = far(i.detector.distance_m, x);
            i
        };
        let order = orders(name, |x| of(x, 0.0));
        assert!(order.iter().all(|o| (o - 2.0).abs() < SECOND), "{name}: {order:?}");
        let high = 30.0 * built_in.source.beam_diameter_m.powi(2) / (8.0 * built_in.detector.distance_m);
        let order = orders(name, |x| of(x, high));
        assert!(order.iter().all(|o| (o - 1.0).abs() < SECOND), "{name}: {order:?}");
    }
}

/// Light 16 times and 256 times as strong: relative noise falls as its root. Squares of n readings whose variances are v tell a σ to 1/√(2m),
/// m = (Σv)²/Σv², an order from two of them to √2 of that over ln 16; five such steps.
#[test]
fn noise_to_0() {
    for (name, built_in) in with(|i| i.electrons > 0.0) {
        let relative = |(seed, times): (u64, f64)| {
            let mut instrument = Instrument { electrons: times * built_in.electrons, readings: 30, ..built_in.clone() };
            // No end of the well, and the longest exposure alone: in a short one the noise of reading counts.
            let exposures_s = built_in.detector.exposures_s.iter().copied().fold(0.0, f64::max);
            let endless = Detector { full_well: 0.0, bits: 0, nonlinearity_u: 0.0, ..built_in.detector.clone() };
            instrument.detector = Detector { exposures_s: vec![exposures_s], ..endless };
            let pairs: Vec<(f64, f64)> =
                signals(&instrument, seed, &[]).into_iter().zip(signals(&instrument, seed, &NOISE)).collect();
            assert!(pairs.iter().all(|(s, best)| s.is_finite() && best.is_finite()), "{name}");
            let lit = || pairs.iter().filter(|(_, best)| *best > 0.0);
            let squares: f64 = lit().map(|(s, best)| (s / best - 1.0).powi(2)).sum();
            let (sum, of_squares) = lit().fold((0.0, 0.0), |(a, b), (_, best)| (a + 1.0 / best, b + best.powi(-2)));
            ((squares / lit().count() as f64).sqrt(), sum * sum / of_squares)
        };
        let strong = [(1, 1e4), (2, 16e4), (3, 256e4)].map(relative);
        let orders = [(strong[0].0 / strong[1].0).log2() / 4.0, (strong[1].0 / strong[2].0).log2() / 4.0];
        let slack = 5.0 / strong[0].1.sqrt() / 16f64.ln();
        println!("{name}: σ and readings {strong:?}, orders {orders:?} to {slack:.3}");
        assert!(orders.iter().all(|o| (o - 0.5).abs() < slack), "{name}: {orders:?}");
    }
}
