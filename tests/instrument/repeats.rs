//! Noise that only repeats tell: σ of readings whose detector nobody described, and repeats that scatter more than the description says.

use crate::experiment::sigma;
use crate::support::*;
use goniofit::gonio::parts::{Protocol, Reference, Source, Surroundings};
use goniofit::gonio::{Instrument, Kind, Raw, reduce};
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
    let reduction = reduce("m", raw, instrument, None).expect("reduced");
    let mut m = reduction.measurement;
    m.notes.extend(reduction.unstated);
    m
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
    let expected = "σ is not stated, in any channel: the detector's noise is not described (instrument.electrons = 0), and repeats don't tell it: \
                    expected 12 repeats at least beyond the first of their stop, found 0 in channel y";
    assert!(m.sigma.is_none() && m.notes.iter().any(|n| n == expected), "{:?}", m.notes);
    let silent = undescribed(&noisy(5, 10));
    let m = measurement(&read(&matte, &silent, &in_plane(10.0), 1), &silent);
    assert!(
        m.sigma.is_none() && m.notes.iter().any(|n| n.contains("repeats are equal to their last digit in channel y"))
    );
}

fn cos_o(m: &Measurement, i: usize) -> f64 {
    m.directions.pair(i).1.z
}

/// Repeats of white and blank alone, as laboratories make them: σ holds for signals like theirs, of a peak far above them it is an upper limit, and the note
/// says of how many.
#[test]
fn signals_unlike_any_that_was_repeated_have_an_upper_limit() {
    let instrument =
        Instrument { surroundings: Surroundings { stray_per_sr: 1e-3, ..Surroundings::default() }, ..noisy(1, 16) };
    let sharp = material(0.5, 0.3, 2000.0);
    let raw = read(&sharp, &instrument, &in_plane(5.0), 2);
    let (known, found) = (measurement(&raw, &instrument), measurement(&raw, &undescribed(&instrument)));
    let white = 0.985 / std::f64::consts::PI;
    let (mut like, mut peaks) = ((f64::INFINITY, 0.0f64), 0);
    for i in (0..known.len()).filter(|i| known.value(0, *i).is_some()) {
        let ratio = sigma(&found, i) / sigma(&known, i);
        if known.value(0, i).expect("valid") > 10.0 * white {
            peaks += 1;
            // 300 times the white: noise like its own at most, which is ten times that of light.
            assert!((0.9..30.0).contains(&ratio), "{i}: {ratio}");
        } else {
            like = (like.0.min(ratio), like.1.max(ratio));
        }
    }
    println!("σ over described: {:.2} to {:.2} within what was repeated, {peaks} peaks", like.0, like.1);
    assert!(like.0 > 0.8 && like.1 < 2.0 && peaks > 3, "{like:?} {peaks}");
    let note = found.notes.iter().find(|n| n.contains("upper limit")).expect("said");
    println!("{note}");
    let brighter =
        (0..known.len()).filter(|i| known.value(0, *i).is_some_and(|f| f * cos_o(&known, *i) > 1.5 * white * 0.71));
    let limits: usize = note.split(' ').nth(2).and_then(|n| n.parse().ok()).expect("a count");
    // Noise moves some across.
    assert!(limits.abs_diff(brighter.count()) < 3, "{note}");
}

/// The same log in three units, its blanks a little below 0, and its repeats those of blanks and white alone.
#[test]
fn the_unit_of_a_log_changes_no_relative_error() {
    let instrument =
        Instrument { surroundings: Surroundings { stray_per_sr: 1e-3, ..Surroundings::default() }, ..noisy(1, 16) };
    let raw = read(&material(0.5, 0.0, 1.0), &instrument, &in_plane(10.0), 3);
    let low = Raw { signal: raw.signal.iter().map(|s| s - 500.0).collect(), ..raw };
    let of = |unit: f64| {
        let m = measurement(&scaled(&low, unit), &undescribed(&instrument));
        (0..m.len()).filter_map(|i| Some(sigma(&m, i) / m.value(0, i)?)).collect::<Vec<f64>>()
    };
    let first = of(1.0);
    assert!(first.len() > 50 && first.iter().all(|u| *u < 0.1), "{first:?}");
    for unit in [1e-12, 1e-3, 1e9] {
        let apart = of(unit).iter().zip(&first).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-6, "{unit}: {apart}");
    }
}

/// Steps of a converter that nobody described are those of the log: what rounding leaves in common of repeats counts. The white is rounded alike at every
/// visit, which is not counted: of noise of a tenth of a step some more miss.
#[test]
fn intervals_hold_through_steps_that_nobody_described() {
    let (matte, instrument) = (material(0.8, 0.0, 1.0), noisy(5, 16));
    let reference = Reference { reflectance_u: 0.0, ..instrument.reference };
    let quiet = Instrument { read_noise: 1.0, electrons: 1e7, reference, ..instrument };
    let scan = in_plane(10.0);
    for steps in [0.1, 0.3, 1.0] {
        let (mut held, mut all) = (0, 0);
        for seed in 0..40 {
            let raw = read(&matte, &quiet, &scan, seed);
            // Shot noise of a white is some 1500 electrons; where signals lie between steps is another thing in each log.
            let step = 1500.0 / steps * (1.0 + 0.3 * (0.618 * seed as f64).fract());
            let rounded = Raw { signal: raw.signal.iter().map(|s| (s / step).round() * step * 1e-6).collect(), ..raw };
            let m = measurement(&rounded, &Instrument { reference: quiet.reference, ..Instrument::noiseless() });
            for i in (0..m.len()).filter(|i| m.value(0, *i).is_some()) {
                let truth = 0.8 / std::f64::consts::PI;
                assert!(m.sigma.is_some(), "{:?}", m.notes);
                held += usize::from((m.value(0, i).expect("valid") - truth).abs() <= 1.96 * sigma(&m, i));
                all += 1;
            }
        }
        let share = held as f64 / f64::from(all);
        println!("noise of {steps} steps: {:.1} % of {all} intervals hold", 100.0 * share);
        assert!(share > 0.9, "{steps}: {share}");
    }
}

/// One reading in a log goes wrong: its own stop has the scatter that it shows, the others keep theirs, and the place is named.
#[test]
fn a_reading_that_went_wrong_spoils_its_own_stop_alone() {
    let (satin, instrument) = (material(0.3, 0.2, 60.0), noisy(5, 10));
    let clean = read(&satin, &instrument, &in_plane(10.0), 4);
    let mut raw = clean.clone();
    let spoilt = raw.readings.iter().position(|r| r.entry == Some(30)).expect("read");
    raw.signal[spoilt] += 1e6;
    let (before, after) =
        (measurement(&clean, &undescribed(&instrument)), measurement(&raw, &undescribed(&instrument)));
    let ratio = |i: usize| sigma(&after, i) / sigma(&before, i);
    assert!(ratio(30) > 100.0, "{}", ratio(30));
    for i in (0..after.len()).filter(|i| *i != 30 && after.value(0, *i).is_some()) {
        assert!((ratio(i) - 1.0).abs() < 0.05, "{i}: {}", ratio(i));
    }
    let note =
        after.notes.iter().find(|n| n.contains("scatter far more than the others at 1 of the stops")).expect("said");
    println!("{note}");
    assert!(before.notes.is_empty(), "{:?}", before.notes);
}

/// A power that walks, as described, is no noise of the reading besides.
#[test]
fn a_walk_that_is_described_is_not_counted_as_noise_too() {
    let steady = noisy(8, 16);
    let source = Source { drift_per_sqrt_hour: 0.05, ..Source::default() };
    let walking = Instrument { source, electrons: 1e12, read_noise: 1e4, ..steady };
    let raw = read(&material(0.8, 0.0, 1.0), &walking, &in_plane(10.0), 5);
    let blind = Instrument { source: Source::default(), ..undescribed(&walking) };
    let noise = |instrument: &Instrument| {
        let lines = reduce("m", &raw, instrument, None).expect("reduced").budget.lines;
        lines.iter().find(|l| l.name == "noise of the reading").map_or(0.0, |l| l.relative)
    };
    let (known, told, untold) = (noise(&walking), noise(&undescribed(&walking)), noise(&blind));
    let notes = measurement(&raw, &undescribed(&walking)).notes;
    assert!(notes.is_empty(), "{notes:?}");
    assert!(measurement(&raw, &walking).notes.is_empty(), "described drift is no contradiction");
    println!("noise of a reading: {known:.2e} described, {told:.2e} told the walk, {untold:.2e} not told");
    // Squares of a walk scatter widely: what they hide of noise, nobody knows.
    assert!(told < 0.5 * untold, "{told} {untold}");
}

/// A description that promises a third of the noise is found out, an honest one never blamed; of one reading that went wrong the place is named.
#[test]
fn repeats_that_scatter_more_than_described_are_told() {
    let (satin, instrument) = (material(0.3, 0.2, 60.0), noisy(5, 10));
    let hopeful = Instrument { electrons: 1e5, read_noise: 5.0, ..instrument.clone() };
    let of = |seed: u64| read(&satin, &instrument, &in_plane(10.0), seed);
    let blamed = |m: &Measurement| m.notes.iter().find(|n| n.contains("as far as the description says")).cloned();
    for seed in 0..50 {
        assert_eq!(blamed(&measurement(&of(seed), &instrument)), None, "{seed}");
    }
    let note = blamed(&measurement(&of(0), &hopeful)).expect("found out");
    println!("{note}");
    // Of the white alone, a tenth of all: its own ratio counts.
    let mut raw = of(0);
    let mean = |raw: &Raw| {
        let of = |i: &usize| raw.readings[*i].kind == Kind::Reference;
        let list: Vec<f64> = (0..raw.signal.len()).filter(of).map(|i| raw.signal[i]).collect();
        list.iter().sum::<f64>() / list.len() as f64
    };
    let white = mean(&raw);
    for i in (0..raw.signal.len()).filter(|i| raw.readings[*i].kind == Kind::Reference).collect::<Vec<_>>() {
        raw.signal[i] = white + 3.0 * (raw.signal[i] - white);
    }
    let note = blamed(&measurement(&raw, &instrument)).expect("found out");
    println!("{note}");
    assert!(
        note.starts_with("repeats of the reference, channel y, scatter 2.") || note.contains("scatter 3."),
        "{note}"
    );
    // Volts taken for electrons.
    let note = blamed(&measurement(&scaled(&of(0), 1e-5), &instrument)).expect("found out");
    println!("{note}");
    assert!(note.contains("σ is too large"), "{note}");
    let mut raw = of(0);
    let spoilt = raw.readings.iter().position(|r| r.entry == Some(30)).expect("read");
    raw.signal[spoilt] += 1e5;
    let note = blamed(&measurement(&raw, &instrument)).expect("found out");
    println!("{note}");
    let stop = raw.readings[spoilt].stop;
    let of_stop = raw.readings.iter().filter(|r| r.stop == stop);
    let (first, last) = (of_stop.clone().next().expect("one"), of_stop.clone().next_back().expect("one"));
    let middle = 0.5 * (first.time_s + last.time_s + last.exposure_s);
    assert!(note.contains(&format!("most at {middle} s")), "{note}");
}
