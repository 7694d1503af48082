//! Noise that only repeats tell: σ of readings whose detector nobody described, and repeats that scatter more than the description says.

use crate::experiment::sigma;
use crate::support::*;
use goniofit::gonio::parts::{Protocol, Reference};
use goniofit::gonio::{Instrument, Raw, reduce};
use goniofit::measurement::{Directions, Measurement};
use rayon::prelude::*;

/// A detector with noise of both kinds, before a reference.
fn noisy(readings: u32, repeats: u32) -> Instrument {
    Instrument {
        electrons: 1e5,
        read_noise: 60.0,
        readings,
        reference: Reference { reflectance: 0.985, reflectance_u: 0.003, ..Reference::default() },
        protocol: Protocol { block: 40, repeats },
        ..Instrument::default()
    }
}

/// What a user knows of it whose log has volts.
fn undescribed(of: &Instrument) -> Instrument {
    Instrument { electrons: 0.0, read_noise: 0.0, ..of.clone() }
}

fn scaled(raw: &Raw, unit: f64) -> Raw {
    Raw { signal: raw.signal.iter().map(|s| unit * s).collect(), ..raw.clone() }
}

fn measurement(raw: &Raw, instrument: &Instrument) -> Measurement {
    reduce("m", raw, instrument, None).expect("reduced").measurement
}

/// Five readings a stop: over a whole scan their scatter tells σ of each reading as well as knowing the detector does, whatever the signal's unit.
#[test]
fn repeats_tell_the_noise_that_a_description_does() {
    let (satin, instrument) = (material(0.3, 0.2, 60.0), noisy(5, 10));
    let raw = read(&satin, &instrument, &in_plane(5.0), 1);
    let (known, found) = (measurement(&raw, &instrument), measurement(&raw, &undescribed(&instrument)));
    let in_volts = measurement(&scaled(&raw, 3.7e-9), &undescribed(&instrument));
    assert!(found.origin.contains("from the scatter of repeats") && found.notes.is_empty(), "{}", found.origin);
    let mut range = (f64::INFINITY, 0.0f64);
    for i in (0..known.len()).filter(|i| known.value(0, *i).is_some()) {
        assert_eq!(known.value(0, i).map(f64::to_bits), found.value(0, i).map(f64::to_bits));
        let ratio = sigma(&found, i) / sigma(&known, i);
        range = (range.0.min(ratio), range.1.max(ratio));
        assert!((sigma(&in_volts, i) / sigma(&found, i) - 1.0).abs() < 1e-9);
    }
    println!("σ by repeats over σ by description: {:.3} to {:.3}", range.0, range.1);
    // 820 degrees of freedom know a σ to 2.5 %, three numbers of a curve each less well.
    assert!(range.0 > 0.9 && range.1 < 1.1, "{range:?}");
}

/// Few repeats know σ badly, and intervals are wider for it: they hold as often as they say.
#[test]
fn intervals_by_few_repeats_hold() {
    let (matte, instrument) = (material(0.8, 0.0, 1.0), noisy(2, 3));
    let instrument = Instrument { reference: Reference { reflectance_u: 0.0, ..instrument.reference }, ..instrument };
    let (wi, wo): (Vec<_>, Vec<_>) = (1..=11)
        .map(|k| f64::from(6 * k).to_radians())
        .map(|t| (glam::DVec3::Z, glam::DVec3::new(t.sin(), 0.0, t.cos())))
        .unzip();
    let scan = (Directions::List { wi, wo }, goniofit::measurement::Weights::Uniform);
    let held = |seed: u64| {
        let raw = read(&matte, &instrument, &scan, seed);
        let m = measurement(&raw, &undescribed(&instrument));
        let holds = |i: usize| {
            let (wi, wo) = m.directions.pair(i);
            let value = m.value(0, i).expect("valid");
            f64::from((value - matte.value(wi, wo)[0]).abs() <= 1.96 * sigma(&m, i))
        };
        (0..m.len()).map(holds).sum::<f64>() / m.len() as f64
    };
    let seeds = 1000;
    let mean = (0..seeds).into_par_iter().map(held).sum::<f64>() / seeds as f64;
    println!("{:.1} % of 11,000 intervals hold", 100.0 * mean);
    // Readings of one log hold together where its σ came out large: a thousand logs know the share to 0.4 %.
    assert!((0.935..0.985).contains(&mean), "{mean}");
}

/// Without repeats nothing is made up, and equal ones tell nothing.
#[test]
fn what_repeats_don_t_tell_is_said() {
    let matte = material(0.8, 0.0, 1.0);
    let single = noisy(1, 1);
    let m = measurement(&read(&matte, &single, &in_plane(10.0), 1), &undescribed(&single));
    let expected = "σ is not stated: the detector's noise is not described (instrument.electrons = 0) and repeats don't tell it: expected \
                    12 repeats at least beyond the first of their stop, found 0 in channel y";
    assert!(m.sigma.is_none() && m.notes.iter().any(|n| n == expected), "{:?}", m.notes);
    let silent = undescribed(&noisy(5, 10));
    let m = measurement(&read(&matte, &silent, &in_plane(10.0), 1), &silent);
    assert!(m.sigma.is_none() && m.notes.iter().any(|n| n.contains("channel y are equal to their last digit")));
}

/// A description that promises a third of the noise is found out, an honest one never blamed; of one reading that went wrong the place is named.
#[test]
fn repeats_that_scatter_more_than_described_are_told() {
    let (satin, instrument) = (material(0.3, 0.2, 60.0), noisy(5, 10));
    let hopeful = Instrument { electrons: 1e5, read_noise: 5.0, ..instrument.clone() };
    let of = |seed: u64| read(&satin, &instrument, &in_plane(10.0), seed);
    let blamed = |m: &Measurement| m.notes.iter().find(|n| n.starts_with("repeats scatter")).cloned();
    for seed in 0..50 {
        assert_eq!(blamed(&measurement(&of(seed), &instrument)), None, "{seed}");
    }
    let note = blamed(&measurement(&of(0), &hopeful)).expect("found out");
    println!("{note}");
    let mut raw = of(0);
    let spoilt = raw.readings.iter().position(|r| r.entry == Some(30)).expect("read");
    raw.signal[spoilt] += 1e5;
    let note = blamed(&measurement(&raw, &instrument)).expect("found out");
    println!("{note}");
    let stop = raw.readings[spoilt].stop;
    let of_stop = raw.readings.iter().filter(|r| r.stop == stop);
    let (first, last) = (of_stop.clone().next().expect("one"), of_stop.last().expect("one"));
    let middle = 0.5 * (first.time_s + last.time_s + last.exposure_s);
    assert!(note.contains(&format!("most at {middle} s, channel y")), "{note}");
}
