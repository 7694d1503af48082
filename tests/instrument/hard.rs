//! The instrument's rows of the hard cases, on every built-in instrument with all its other faults: as the aperture goes to 0, noise goes to 0 and
//! distances go to infinity, readings go to those of an instrument without, at the order that theory gives.

use crate::support::*;
use goniofit::control::Control;
use goniofit::gonio::parts::{Detector, Holder};
use goniofit::gonio::{Instrument, Kind, PRESETS};

/// What acts anew in every reading, and what cuts or rounds it.
const NOISE: [&str; 4] = ["shot noise", "read noise", "quantisation", "saturation"];

/// The built-in instruments that have what goes away.
fn with(has: impl Fn(&Instrument) -> bool) -> Vec<(&'static str, Instrument)> {
    let all = PRESETS.iter().map(|p| (p.name, p.spec().expect("reads").instrument));
    let some: Vec<_> = all.filter(|(_, instrument)| has(instrument)).collect();
    assert!(some.len() >= 3, "{}", some.len());
    some
}

/// Signals of a glossy sample, by the errors of one seed, without these effects.
fn signals(instrument: &Instrument, left_out: &[&str]) -> Vec<f64> {
    let (material, scan) = (material(0.2, 0.1, 20.0), in_plane(30.0));
    let raw = with_job(&material, instrument, &scan, 5, left_out, |job| job.run(Control::silent()));
    raw.readings.iter().zip(&raw.signal).filter(|(r, _)| r.kind == Kind::Sample).map(|(_, s)| *s).collect()
}

/// Orders at which the largest change of a reading falls as the cause is 1/4, 1/8 and 1/16 of the built-in one.
fn orders(name: &str, of: impl Fn(f64) -> Instrument) -> [f64; 2] {
    let best = signals(&of(0.0), &NOISE);
    let off = |x: f64| {
        let pairs = signals(&of(x), &NOISE).into_iter().zip(&best).filter(|(_, best)| **best != 0.0);
        pairs.map(|(s, best)| (s / best - 1.0).abs()).fold(0.0, f64::max)
    };
    let offs = [0.25, 0.125, 0.0625].map(off);
    println!("{name}: off by {offs:?}");
    assert!(offs[2] > 0.0, "{name}");
    [(offs[0] / offs[1]).log2(), (offs[1] / offs[2]).log2()]
}

#[test]
fn aperture_to_0() {
    for (name, built_in) in with(|i| i.detector.aperture_deg > 0.0) {
        let of = |x: f64| {
            let aperture_deg = x * built_in.detector.aperture_deg;
            Instrument { detector: Detector { aperture_deg, ..built_in.detector.clone() }, ..built_in.clone() }
        };
        let order = orders(name, of);
        assert!(order.iter().all(|o| (o - 2.0).abs() < 0.05), "{name}: {order:?}");
    }
}

/// Both ends at x⁻¹ of their distance; infinitely far is written as 0. What is left of the spot is its square; a sample that is too high counts in
/// proportion.
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
        assert!(order.iter().all(|o| (o - 2.0).abs() < 0.05), "{name}: {order:?}");
        // Five times as high as the spot's own effect would hide it.
        let order = orders(name, |x| of(x, 5.0 * built_in.source.beam_diameter_m.powi(2)));
        assert!(order.iter().all(|o| (o - 1.0).abs() < 0.2), "{name}: {order:?}");
    }
}

/// Light 16 times and 256 times as strong: relative noise falls as its root. n readings tell a σ to 1/√(2n), an order from two of them to √2 of that over
/// ln 16; five such steps.
#[test]
fn noise_to_0() {
    for (name, built_in) in with(|i| i.electrons > 0.0) {
        let relative = |times: f64| {
            let mut instrument = Instrument { electrons: times * built_in.electrons, readings: 30, ..built_in.clone() };
            // No end of the well, and the longest exposure alone: in a short one the noise of reading counts.
            let exposures_s = built_in.detector.exposures_s.iter().copied().fold(0.0, f64::max);
            let endless = Detector { full_well: 0.0, bits: 0, nonlinearity_u: 0.0, ..built_in.detector.clone() };
            instrument.detector = Detector { exposures_s: vec![exposures_s], ..endless };
            let pairs = signals(&instrument, &[]).into_iter().zip(signals(&instrument, &NOISE));
            let squares: Vec<f64> =
                pairs.filter(|(_, best)| *best > 0.0).map(|(s, best)| (s / best - 1.0).powi(2)).collect();
            ((squares.iter().sum::<f64>() / squares.len() as f64).sqrt(), squares.len())
        };
        let strong = [1e4, 16e4, 256e4].map(relative);
        let orders = [(strong[0].0 / strong[1].0).log2() / 4.0, (strong[1].0 / strong[2].0).log2() / 4.0];
        let slack = 5.0 / (strong[0].1 as f64).sqrt() / 16f64.ln();
        println!("{name}: σ {strong:?}, orders {orders:?} to {slack:.3}");
        assert!(orders.iter().all(|o| (o - 0.5).abs() < slack), "{name}: {orders:?}");
    }
}
