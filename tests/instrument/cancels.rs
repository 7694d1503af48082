//! What nobody knows of an instrument and yet needs no line in the budget: it acts on sample and reference alike, and the ratio loses it. And where it
//! does not.

use crate::support::*;
use goniofit::brdf::{LobeKind, Material};
use goniofit::control::Control;
use goniofit::geometry::angles::theta_of;
use goniofit::geometry::mirror;
use goniofit::gonio::parts::{Detector, Reference, Source};
use goniofit::gonio::{Actual, Instrument, Reduction, reduce, series};
use goniofit::measurement::{Directions, Weights};

type Pairs = (Directions, Weights);

/// Readings without noise by the instrument that there is, with errors of its own, reduced by what it is taken for.
fn taken_for(of: &Material, pairs: &Pairs, is: &Instrument, own: &Actual, described: &Instrument) -> Reduction {
    let entries: Vec<u32> = (0..pairs.0.len() as u32).collect();
    let readings = series(is, &pairs.0, &entries);
    let raw = with_job(of, is, pairs, 0, &["shot noise"], |job| job.read(readings, own, Control::silent()));
    reduce("m", &raw, described, None).expect("reduced")
}

/// Relative change of every valid value, channel-major, with its place.
fn changes(of: &Material, pairs: &Pairs, is: &Instrument, described: &Instrument) -> Vec<(usize, f64)> {
    let values = |is: &Instrument| taken_for(of, pairs, is, &Actual::nominal(), described).measurement.values;
    let (changed, meant) = (values(is), values(described));
    let both = changed.iter().zip(&meant).map(|(a, b)| a / b - 1.0).enumerate();
    both.filter(|(_, change)| change.is_finite()).collect()
}

fn largest(changes: &[(usize, f64)]) -> f64 {
    changes.iter().map(|(_, c)| c.abs()).fold(0.0, f64::max)
}

/// Counts electrons, with everything that a blank or a reference takes off.
fn counting() -> Instrument {
    let detector = Detector { dark_per_s: 300.0, ..faultless().detector };
    Instrument { electrons: 1e6, read_noise: 0.0, detector, ..faultless() }
}

/// The power of the source, the detector's responsivity, its solid angle and distance are a factor of all that is read with the shutter open.
#[test]
fn power_responsivity_and_solid_angle_cancel() {
    let (glossy, pairs) = (material(0.2, 0.1, 20.0), in_plane(15.0));
    let brighter = Instrument { electrons: 1.07 * counting().electrons, ..counting() };
    let found = changes(&glossy, &pairs, &brighter, &counting());
    assert!(found.len() > pairs.0.len() / 2 && largest(&found) < 1e-12, "{:e}", largest(&found));
}

/// An aperture that is wider than it is taken for brings more light of both; what it smears of a lobe is left: of half angle h it lowers a peak of
/// exponent n by n h²/4, to the order of the square of that.
#[test]
fn the_width_of_an_aperture_cancels_but_for_what_it_smears() {
    let wide = |aperture_deg: f64| Instrument {
        detector: Detector { aperture_deg, ..Detector::default() },
        electrons: 1e6 * aperture_deg * aperture_deg,
        read_noise: 0.0,
        reference: Reference { reflectance: 0.98, ..Reference::default() },
        ..Instrument::noiseless()
    };
    let (meant, is) = (wide(2.0), wide(2.1));
    let pairs = in_plane(15.0);
    // Rules over the cone take a cosine exactly, but for a cone that reaches below the horizon, which no pair up to 85° has.
    let matte = changes(&material(0.8, 0.0, 1.0), &pairs, &is, &meant);
    assert!(largest(&matte) < 1e-9, "{:e}", largest(&matte));
    let lobe = material(0.0, 0.5, 60.0);
    let half = |deg: f64| (0.5 * deg).to_radians();
    let lost = |deg: f64| 60.0 * half(deg).powi(2) / 4.0;
    let want = -(lost(2.1) - lost(2.0));
    let mut met = 0;
    for (i, change) in changes(&lobe, &pairs, &is, &meant) {
        let (wi, wo) = pairs.0.pair(i);
        if (mirror(wi) - wo).length() < 1e-9 && theta_of(wi) < 1.0 {
            assert!((change / want - 1.0).abs() < 3.0 * lost(2.1) + 0.02, "{i}: {change:e} {want:e}");
            met += 1;
        }
    }
    assert!(met >= 4, "{met}");
}

/// A detector that is farther than it is taken for sees less of both, by 1/r²; what is left is how it sees the edge of the spot, by the square of the
/// spot's radius over the distance: less than a hundredth.
#[test]
fn a_distance_cancels_but_for_the_spot_s_extent() {
    let at = |distance_m: f64| Instrument {
        source: Source { beam_diameter_m: 0.017, ..Source::default() },
        detector: Detector { distance_m, ..Detector::default() },
        electrons: 1e6 / (distance_m * distance_m),
        read_noise: 0.0,
        reference: Reference { reflectance: 0.98, ..Reference::default() },
        ..Instrument::noiseless()
    };
    let pairs = in_plane(15.0);
    let found = changes(&material(0.8, 0.0, 1.0), &pairs, &at(0.606), &at(0.6));
    // Up to 45° the spot is 12 mm long at most on either side: (12/600)² of 2 %, times 8 at most, what c cosθo/|v|³ has of (wo·p/r)².
    let near = |(i, _): &&(usize, f64)| theta_of(pairs.0.pair(*i).0) < 46f64.to_radians();
    let near: Vec<(usize, f64)> = found.iter().filter(near).copied().collect();
    assert!(near.len() > 20 && largest(&near) < 0.01 * 0.02, "{:e}", largest(&near));
}

/// A band that is wider than it is taken for does nothing to a spectrum without curvature, nor to the reference, and adds (B′² − B²)/12 times the second
/// derivative to one that bends.
#[test]
fn a_bandwidth_matters_where_a_spectrum_bends_alone() {
    let wavelengths: Vec<f64> = (0..7).map(|k| 500.0 + 10.0 * f64::from(k)).collect();
    let spectral = |weight: &dyn Fn(f64) -> f64| {
        let names = wavelengths.iter().map(|w| format!("{w}nm")).collect();
        Material::new(names, vec![(LobeKind::Lambert, wavelengths.iter().map(|w| weight(*w)).collect(), vec![])])
    };
    let band = |bandwidth_nm: f64| Instrument {
        source: Source { bandwidth_nm, ..Source::default() },
        reference: Reference { reflectance: 0.98, ..Reference::default() },
        ..Instrument::noiseless()
    };
    let (pairs, is, meant) = (in_plane(30.0), band(11.0), band(10.0));
    let n = pairs.0.len();
    let straight = changes(&spectral(&|w| 0.3 + 1e-3 * (w - 530.0)), &pairs, &is, &meant);
    // Beyond the first and the last channel the spectrum is taken as it is there.
    let inner = |(place, _): &&(usize, f64)| *place / n == 3;
    assert!(straight.iter().filter(inner).all(|(_, c)| c.abs() < 1e-12));
    let bent = changes(&spectral(&|w| 0.3 + 1e-4 * (w - 530.0).powi(2)), &pairs, &is, &meant);
    let of = |width: f64| 0.3 + width * width / 12.0 * 2e-4;
    let want = of(11.0) / of(10.0) - 1.0;
    let middle: Vec<f64> = bent.iter().filter(inner).map(|(_, c)| *c).collect();
    assert!(!middle.is_empty() && middle.iter().all(|c| (c / want - 1.0).abs() < 1e-9), "{want:e}: {middle:?}");
}

/// An exposure's error is that of sample and reference where both are read in it, and has no line in the budget; of a peak that only the short one can
/// read it is left, (1 + ε of the short)/(1 + ε of the long).
#[test]
fn the_error_of_an_exposure_cancels_where_sample_and_reference_share_it() {
    let (glossy, pairs) = (material(0.2, 0.1, 60.0), in_plane(15.0));
    let with = |exposures_s: Vec<f64>, full_well: f64| {
        let detector = Detector { exposures_s, full_well, exposure_u: 0.02, ..counting().detector };
        Instrument { detector, ..counting() }
    };
    let own = |exposures: Vec<f64>| Actual { exposures, ..Actual::nominal() };
    let of = |instrument: &Instrument, errors: Vec<f64>| {
        let zeros = vec![0.0; errors.len()];
        let [off, right] = [errors, zeros].map(|e| taken_for(&glossy, &pairs, instrument, &own(e), instrument));
        let values = off.measurement.values.iter().zip(&right.measurement.values);
        let ratios: Vec<f64> = values.map(|(a, b)| a / b).filter(|r| r.is_finite()).collect();
        (ratios, off.budget.lines.iter().any(|l| l.name == "exposure times"))
    };
    let (alone, has_line) = of(&with(vec![1.0], 0.0), vec![0.03]);
    assert!(!has_line && alone.iter().all(|r| (r - 1.0).abs() < 1e-12), "{alone:?}");
    // White reads 2.2e5 electrons in a second, the peak up to 1e6.
    let (both, has_line) = of(&with(vec![0.1, 1.0], 4e5), vec![0.03, -0.01]);
    let peak = |r: &&f64| (**r - 1.0).abs() > 1e-9;
    let apart = both.iter().filter(peak).count();
    assert!(has_line && apart > 0 && apart < both.len() / 2, "{apart} of {}", both.len());
    // Beside the ratio there is what was taken off in the long exposure, stray light and dark: 1.03e4 electrons a second, of 4e5 at least.
    let most = (1.03f64 / 0.99 - 1.0) * (1.0 + 1.03e4 / 3.8e5);
    assert!(both.iter().filter(peak).all(|r| (0.04..=most).contains(&(r - 1.0))), "{both:?}");
}
