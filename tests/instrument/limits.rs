//! Every effect's limit: as its cause goes to 0 the reading goes to the ideal one, at the order that theory gives.

use crate::support::*;
use goniofit::brdf::Material;
use goniofit::control::Control;
use goniofit::gonio::parts::{Axes, Detector, Holder, Source, Surroundings};
use goniofit::gonio::{Actual, Instrument, Kind, Reading};
use goniofit::measurement::{Directions, Weights};

/// An instrument without noise and without parts.
fn ideal() -> Instrument {
    Instrument::noiseless()
}

/// Largest |reading/ideal − 1| over a scan of a glossy material, for causes x, x/2, x/4, and the orders between them.
fn orders(name: &str, of: impl Fn(f64) -> Instrument, from: f64) -> [f64; 2] {
    let (material, scan) = (material(0.2, 0.1, 20.0), in_plane(20.0));
    let best = read_nominal(&material, &ideal(), &scan).signal;
    let off = |x: f64| {
        let raw = read_nominal(&material, &of(x), &scan);
        let sample = raw.readings.iter().zip(&raw.signal).filter(|(r, _)| r.entry.is_some()).map(|(_, s)| *s);
        sample.zip(&best).map(|(s, ideal)| (s / ideal - 1.0).abs()).fold(0.0, f64::max)
    };
    let offs = [from, from / 2.0, from / 4.0].map(off);
    let orders = [(offs[0] / offs[1]).log2(), (offs[1] / offs[2]).log2()];
    println!("{name}: off by {offs:?}, orders {orders:?}");
    orders
}

#[test]
fn apertures_and_divergences_fade_as_their_square() {
    let aperture = |x: f64| Instrument { detector: Detector { aperture_deg: x, ..Detector::default() }, ..ideal() };
    let divergence = |x: f64| Instrument { source: Source { divergence_deg: x, ..Source::default() }, ..ideal() };
    for order in [orders("aperture", aperture, 0.8), orders("divergence", divergence, 0.8)] {
        assert!(order.iter().all(|o| (o - 2.0).abs() < 0.05), "{order:?}");
    }
}

#[test]
fn stray_light_fades_in_proportion() {
    let stray =
        |x: f64| Instrument { surroundings: Surroundings { stray_per_sr: x, ..Surroundings::default() }, ..ideal() };
    assert!(orders("stray light", stray, 1e-3).iter().all(|o| (o - 1.0).abs() < 1e-9));
}

/// An instrument that counts electrons, with errors of its own; its shot noise is left out wherever it is read by [`counted`].
fn counting() -> Instrument {
    Instrument { electrons: 1e6, read_noise: 0.0, ..ideal() }
}

/// Signals of the sample, with the errors of seed 5 (draws are in proportion to their σ), without shot noise.
fn counted(of: &Material, instrument: &Instrument, scan: &(Directions, Weights)) -> Vec<f64> {
    let raw = with_job(of, instrument, scan, 5, &["shot noise"], |job| job.run(Control::silent()));
    raw.readings.iter().zip(&raw.signal).filter(|(r, _)| r.kind == Kind::Sample).map(|(_, s)| *s).collect()
}

/// As [`orders`], against the instrument without the cause, for errors of its own too.
fn own_orders(name: &str, of: impl Fn(f64) -> Instrument, from: f64) -> [f64; 2] {
    let (material, scan) = (material(0.2, 0.1, 20.0), in_plane(20.0));
    let best = counted(&material, &of(0.0), &scan);
    let off = |x: f64| {
        let signal = counted(&material, &of(x), &scan);
        signal.iter().zip(&best).map(|(s, ideal)| (s / ideal - 1.0).abs()).fold(0.0, f64::max)
    };
    let offs = [from, from / 2.0, from / 4.0].map(off);
    let orders = [(offs[0] / offs[1]).log2(), (offs[1] / offs[2]).log2()];
    println!("{name}: off by {offs:?}, orders {orders:?}");
    orders
}

/// Angles and places that are off by little change a reading in proportion; what is left of that is the next order, as small as the cause.
#[test]
fn errors_of_positions_fade_in_proportion() {
    let axes = |zero_u_deg: f64, jitter_deg: f64| Instrument {
        axes: Axes { zero_u_deg, jitter_deg, ..Axes::default() },
        ..counting()
    };
    let tilt = |x: f64| Instrument { sample: Holder { tilt_u_deg: x, ..Holder::default() }, ..counting() };
    let high = |height_u_m: f64, distance_m: f64| Instrument {
        sample: Holder { height_u_m, ..Holder::default() },
        detector: Detector { distance_m, ..Detector::default() },
        ..counting()
    };
    // An infinite distance is written as 0.
    let farther = |x: f64| high(1e-4, if x == 0.0 { 0.0 } else { 1.0 / x });
    for order in [
        own_orders("axis zeros", |x| axes(x, 0.0), 1e-3),
        own_orders("axis jitter", |x| axes(0.0, x), 1e-3),
        own_orders("sample tilt", tilt, 1e-3),
        own_orders("sample height", |x| high(x, 0.5), 1e-5),
        own_orders("1/distance, of a sample that is too high", farther, 1.0),
    ] {
        assert!(order.iter().all(|o| (o - 1.0).abs() < 0.01), "{order:?}");
    }
}

/// What is added to the flux, multiplies it, or bends the detector's answer does so in proportion to its cause.
#[test]
fn drift_dark_read_noise_and_nonlinearity_fade_in_proportion() {
    let moving = Axes { move_s: 5.0, ..Axes::default() };
    let source = |x: f64| Instrument {
        source: Source { drift_per_sqrt_hour: x, ..Source::default() },
        axes: moving,
        ..counting()
    };
    let detector = |detector: Detector| Instrument { detector, axes: moving, ..counting() };
    let dark = |x: f64| detector(Detector { dark_per_s: x, ..Detector::default() });
    // About a mean that it never takes below 0.
    let walk = |x: f64| detector(Detector { dark_per_s: 1e4, dark_drift_per_sqrt_hour: x, ..Detector::default() });
    let bent = |x: f64| detector(Detector { full_well: 4e6, nonlinearity_u: x, ..Detector::default() });
    let noise = |x: f64| Instrument { read_noise: x, ..counting() };
    for order in [
        own_orders("source drift", source, 0.01),
        own_orders("dark current", dark, 100.0),
        own_orders("dark drift", walk, 100.0),
        own_orders("electronic offset", |x| detector(Detector { offset: x, ..Detector::default() }), 100.0),
        own_orders("read noise", noise, 10.0),
        own_orders("nonlinearity", bent, 0.01),
        own_orders("exposure times", |x| detector(Detector { exposure_u: x, ..Detector::default() }), 0.01),
    ] {
        assert!(order.iter().all(|o| (o - 1.0).abs() < 1e-6), "{order:?}");
    }
}

/// A well that is short of the strongest signal by a share x cuts it by that share, and nothing once it is deep enough.
#[test]
fn saturation_cuts_what_the_well_is_short_of() {
    let (material, scan) = (material(0.2, 0.1, 20.0), in_plane(20.0));
    let top = counted(&material, &counting(), &scan).into_iter().fold(0.0, f64::max);
    let well =
        |x: f64| Instrument { detector: Detector { full_well: top * (1.0 - x), ..Detector::default() }, ..counting() };
    let order = own_orders("saturation", well, 0.02);
    assert!(order.iter().all(|o| (o - 1.0).abs() < 1e-9), "{order:?}");
}

/// What cuts or shadows does nothing at all, bit for bit, once it is out of the way.
#[test]
fn footprints_and_shadows_end() {
    let (material, scan) = (material(0.2, 0.1, 20.0), in_plane(20.0));
    let best = counted(&material, &counting(), &scan);
    let cut = |beam_diameter_m: f64| Instrument {
        source: Source { beam_diameter_m, ..Source::default() },
        sample: Holder { diameter_m: 0.04, ..Holder::default() },
        detector: Detector { field_diameter_m: 0.05, ..Detector::default() },
        ..counting()
    };
    let shade = |shadow_deg: f64| Instrument {
        surroundings: Surroundings { shadow_deg, ..Surroundings::default() },
        ..counting()
    };
    // At 75° a beam stretches 3.9 times. Incidences of 15° k meet steps of 20° at 0° and 60°; three pairs are 5° apart.
    let changed = |instrument: &Instrument| {
        let signal = counted(&material, instrument, &scan);
        signal.iter().zip(&best).filter(|(a, b)| a.to_bits() != b.to_bits()).count()
    };
    println!("footprint: {} and {} readings changed", changed(&cut(0.02)), changed(&cut(0.006)));
    assert!(changed(&cut(0.02)) > 0 && changed(&cut(0.006)) == 0);
    assert_eq!([changed(&shade(4.0)), changed(&shade(6.0))], [2, 5]);
}

/// Relative σ of readings over many repeats, against their mean.
fn scatter(electrons: f64) -> f64 {
    let (material, scan) = (material(0.5, 0.0, 1.0), in_plane(30.0));
    let instrument = Instrument { electrons, readings: 400, ..counting() };
    let noisy = read(&material, &instrument, &scan, 5).signal;
    let best = counted(&material, &instrument, &scan);
    let squares: Vec<f64> = noisy.iter().zip(&best).map(|(s, mean)| (s / mean - 1.0).powi(2) * mean).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64 / electrons).sqrt()
}

/// 12,000 readings tell a σ to 1/√24,000 = 0.65 %, so an order from two of them is good to 1.3 %/ln 4 = 0.01: five such steps.
#[test]
fn shot_noise_fades_as_the_root_of_the_light() {
    let sigma = [1e4, 4e4, 16e4].map(scatter);
    let orders = [(sigma[0] / sigma[1]).log2() / 2.0, (sigma[1] / sigma[2]).log2() / 2.0];
    println!("shot noise: σ of a signal of 1 electron per unit {sigma:?}, orders {orders:?}");
    assert!(orders.iter().all(|o| (o - 0.5).abs() < 0.05), "{orders:?}");
    assert!((sigma[0] * 1e2 - 1.0).abs() < 5.0 / 24_000f64.sqrt(), "{}", sigma[0]);
}

/// Rounding to steps is off by no more than half of one, and in the mean square by step²/12: over n readings that scatters by 0.9/√n.
#[test]
fn quantisation_fades_as_its_step() {
    let (material, scan) = (material(0.2, 0.1, 20.0), in_plane(0.5));
    let best = counted(&material, &counting(), &scan);
    let mut rms = Vec::new();
    for bits in [12, 13, 14] {
        let detector = Detector { full_well: 4e6, bits, ..Detector::default() };
        let step = 4e6 / (2f64.powi(bits as i32) - 1.0);
        let signal = counted(&material, &Instrument { detector, ..counting() }, &scan);
        let off: Vec<f64> = signal.iter().zip(&best).map(|(a, b)| (a - b) / step).collect();
        assert!(off.iter().all(|o| o.abs() <= 0.5 + 1e-9));
        let square = 12.0 * off.iter().map(|o| o * o).sum::<f64>() / off.len() as f64;
        let bound = 5.0 * 0.9 / (off.len() as f64).sqrt();
        println!("quantisation, {bits} bits: variance {square:.3} of step²/12, of {} readings", off.len());
        assert!((square - 1.0).abs() < bound, "{bits}: {square}");
        rms.push(square.sqrt() * step);
    }
    let orders = [(rms[0] / rms[1]).log2(), (rms[1] / rms[2]).log2()];
    println!("quantisation: orders {orders:?}");
    assert!(orders.iter().all(|o| (o - 1.0).abs() < 0.15), "{orders:?}");
}

/// Walks of power and dark have, after an hour, the standard deviation that is stated: over 2,000 instruments to 1/√4,000 = 1.6 %.
#[test]
fn walks_have_their_standard_deviation_after_an_hour() {
    let reading = |time_s: f64| Reading { kind: Kind::Dark, entry: None, time_s, exposure_s: 1.0, repeat: 0, stop: 0 };
    let readings: Vec<Reading> = (0..=60).map(|minute| reading(60.0 * f64::from(minute))).collect();
    let ends = |power: f64, dark: f64| {
        let instrument = Instrument {
            source: Source { drift_per_sqrt_hour: power, ..Source::default() },
            detector: Detector { dark_drift_per_sqrt_hour: dark, ..Detector::default() },
            ..counting()
        };
        let squares = |of: &dyn Fn(Actual) -> Vec<f64>| {
            let end = |seed| of(Actual::draw(&instrument, &readings, seed)).last().copied().expect("a walk").powi(2);
            ((0..2000).map(end).sum::<f64>() / 2000.0).sqrt()
        };
        [squares(&|a| a.power), squares(&|a| a.dark)]
    };
    for (power, dark) in [(0.01, 30.0), (0.001, 3.0)] {
        let [p, d] = ends(power, dark);
        println!("walks: {p} of {power}, {d} of {dark}");
        assert!((p / power - 1.0).abs() < 0.08 && (d / dark - 1.0).abs() < 0.08, "{p} {d}");
    }
}

/// A mean over a cone of a lobe of any sharpness is what a fine sum over the same cone says.
#[test]
fn the_mean_over_a_wide_aperture_of_a_sharp_lobe_is_that_of_a_fine_sum() {
    let (material, scan) = (material(0.1, 0.2, 2e3), in_plane(15.0));
    let instrument = Instrument { detector: Detector { aperture_deg: 3.0, ..Detector::default() }, ..ideal() };
    let raw = read_nominal(&material, &instrument, &scan);
    assert!(raw.quadrature_error < 1e-7, "{}", raw.quadrature_error);
    let depth = 1.0 - 1.5f64.to_radians().cos();
    for (i, reading) in raw.readings.iter().enumerate() {
        let (wi, wo) = scan.0.pair(reading.entry.expect("sample") as usize);
        let frame = goniofit::geometry::frame::Frame::from_normal(wo);
        let (rings, around) = (400, 64);
        let mut sum = 0.0;
        for k in 0..rings {
            let z = 1.0 - depth * (f64::from(k) + 0.5) / f64::from(rings);
            let s = (1.0 - z * z).sqrt();
            for j in 0..around {
                let phi = std::f64::consts::TAU * f64::from(j) / f64::from(around);
                let w = frame.to_world(glam::DVec3::new(s * phi.cos(), s * phi.sin(), z));
                sum += if w.z > 0.0 { material.value(wi, w)[0] * w.z } else { 0.0 };
            }
        }
        let want = sum / f64::from(rings * around);
        assert!((raw.signal[i] / want - 1.0).abs() < 2e-4, "{i}: {} {want}", raw.signal[i]);
    }
}

/// What is off changes no bit: an instrument with every part at its ideal gives f cosθo, and leaving out by name is the same as not having.
#[test]
fn an_effect_that_is_off_changes_no_bit() {
    let (material, scan) = (material(0.2, 0.1, 20.0), in_plane(10.0));
    let bits = |signal: &[f64]| signal.iter().map(|s| s.to_bits()).collect::<Vec<_>>();
    let best = read_nominal(&material, &ideal(), &scan);
    let wanted: Vec<f64> = (0..scan.0.len())
        .map(|i| {
            let (wi, wo) = scan.0.pair(i);
            wo.z * material.value(wi, wo)[0]
        })
        .collect();
    assert_eq!(bits(&best.signal), bits(&wanted));
    let full = crooked();
    let without = Instrument { axes: Axes { jitter_deg: 0.0, ..full.axes }, ..full.clone() };
    let a = with_job(&material, &full, &scan, 7, &["axis jitter"], |job| job.run(Control::silent()));
    let b = with_job(&material, &without, &scan, 7, &[], |job| job.run(Control::silent()));
    assert_eq!(bits(&a.signal), bits(&b.signal));
    assert!(full != without);
}

/// The reduction of readings without noise, by an instrument without errors, is the truth: dark, stray light, drift, a small sample, a standard that
/// is no Lambertian and brackets all cancel.
#[test]
fn a_nominal_instrument_s_readings_reduce_to_the_truth() {
    let (material, scan) = (material(0.2, 0.1, 20.0), in_plane(10.0));
    let instrument = faultless();
    let raw = read_nominal(&material, &instrument, &scan);
    let m = reduced(&raw, &instrument, &material).measurement;
    let mut shadowed = 0;
    for i in 0..m.len() {
        let (wi, wo) = m.directions.pair(i);
        match m.value(0, i) {
            Some(value) => assert!((value / material.value(wi, wo)[0] - 1.0).abs() < 1e-12, "{i}: {value}"),
            None => shadowed += 1,
        }
    }
    // The six incidences are multiples of 15°, the scan's steps of 10°: three of them meet.
    assert_eq!(shadowed, 3);
    assert!(m.notes.iter().any(|n| n.contains("shadow each other")), "{:?}", m.notes);
}
