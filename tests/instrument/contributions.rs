//! What effects contribute, and what can be left out for a tolerance.

use crate::support::*;
use goniofit::control::Control;
use goniofit::gonio::parts::{Detector, Source, Surroundings};
use goniofit::gonio::{Change, Instrument, Job};

/// Everything that is not by chance, so that readings with and without can be compared.
fn quiet() -> Instrument {
    Instrument {
        electrons: 1e6,
        read_noise: 0.0,
        source: Source { divergence_deg: 0.05, ..lab().source },
        detector: Detector { aperture_deg: 0.1, dark_per_s: 0.5, bits: 0, ..crooked().detector },
        surroundings: Surroundings { stray_per_sr: 1e-6, shadow_deg: 0.0 },
        ..crooked()
    }
}

/// Largest |a − b|/max(|a|, |b|).
fn largest(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| if a == b { 0.0 } else { (a - b).abs() / a.abs().max(b.abs()) }).fold(0.0, f64::max)
}

/// Signals of the sample without shot noise and without these effects.
fn sample(job: &Job<'_>, left_out: &[&str]) -> Vec<f64> {
    let left_out = [&["shot noise"], left_out].concat();
    let raw = Job { left_out: &left_out, ..*job }.run(Control::silent());
    raw.readings.iter().zip(&raw.signal).filter(|(r, _)| r.entry.is_some()).map(|(_, s)| *s).collect()
}

/// A contribution is the change of whole runs with and without, bit for bit, though most of it starts from light that is worked out once.
#[test]
fn a_contribution_is_what_two_runs_differ_by() {
    let (material, scan, instrument) = (material(0.2, 0.1, 60.0), in_plane(15.0), quiet());
    with_job(&material, &instrument, &scan, 5, &[], |job| {
        let all = sample(job, &[]);
        let found = job.contributions(Control::silent());
        let mut seen = 0;
        for effect in found.effects.iter().filter(|e| e.on && !e.noise) {
            let want = largest(&all, &sample(job, &[effect.effect]));
            assert_eq!(effect.reading.expect("on").largest, want, "{}", effect.effect);
            seen += 1;
        }
        assert_eq!(seen, 11, "{:?}", found.effects);
    });
}

/// σ of each noise over the reading, by hand.
#[test]
fn noise_contributes_its_standard_deviation() {
    let (material, scan) = (material(0.5, 0.0, 1.0), in_plane(30.0));
    let detector = Detector { full_well: 1e6, bits: 12, ..Detector::default() };
    let instrument = Instrument { electrons: 1e5, read_noise: 20.0, detector, ..Instrument::default() };
    let step = 1e6 / 4095.0;
    with_job(&material, &instrument, &scan, 0, &[], |job| {
        let dimmest = sample(job, &["read noise", "quantisation"]).into_iter().fold(f64::INFINITY, f64::min);
        let found = job.contributions(Control::silent());
        let of = |name: &str| -> Change {
            found.effects.iter().find(|e| e.effect == name).and_then(|e| e.reading).expect("on")
        };
        for (name, sigma) in
            [("shot noise", dimmest.sqrt()), ("read noise", 20.0), ("quantisation", step / 12f64.sqrt())]
        {
            let want = sigma / dimmest;
            assert!((of(name).largest / want - 1.0).abs() < 1e-12, "{name}: {} {want}", of(name).largest);
            assert!(of(name).rms < want);
        }
    });
}

/// Whatever the tolerance, readings without what may be left out differ by less, from those with everything.
#[test]
fn what_is_spared_changes_less_than_the_tolerance() {
    let (material, scan, instrument) = (material(0.2, 0.1, 60.0), in_plane(15.0), quiet());
    let mut counts = Vec::new();
    for seed in [1, 2] {
        with_job(&material, &instrument, &scan, seed, &[], |job| {
            let all = sample(job, &[]);
            for tolerance in [1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0] {
                let spared = job.spared(tolerance, Control::silent());
                let names: Vec<&str> = spared.iter().map(|s| s.effect).collect();
                let changed = largest(&all, &sample(job, &names));
                println!("seed {seed}, {tolerance:e}: {} left out, changed by {changed:e}", names.len());
                assert!(changed < tolerance, "{tolerance:e}: {changed:e} without {names:?}");
                assert!(spared.iter().map(|s| s.bound).sum::<f64>() < tolerance);
                counts.push(names.len());
            }
        });
    }
    // The shot noise of the darkest reading is never below 10⁻⁸; at the largest tolerance most effects go.
    assert!(counts[0] == 0 && counts[7] >= 8, "{counts:?}");
    assert!(counts.chunks(8).all(<[usize]>::is_sorted), "{counts:?}");
}
