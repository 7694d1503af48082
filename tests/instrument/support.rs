//! Materials, instruments and short ways through the chain.

use glam::DVec3;
use goniofit::brdf::{LobeKind, Material};
use goniofit::control::Control;
use goniofit::gonio::parts::{Axes, Detector, Holder, Protocol, Reference, Source, Surroundings};
use goniofit::gonio::{Actual, Instrument, Job, Raw, Reduction, Scan, reduce, series};
use goniofit::measurement::{Dimension, Directions, Weights};

/// One channel, one lobe of each kind.
pub fn material(kd: f64, ks: f64, n: f64) -> Material {
    Material::new(vec!["y".into()], vec![(LobeKind::Lambert, vec![kd], vec![]), (LobeKind::Phong, vec![ks], vec![n])])
}

/// The pairs of an in-plane scan.
pub fn in_plane(step_deg: f64) -> (Directions, Weights) {
    Scan::InPlane { step_deg }.directions().expect("small")
}

/// Parts whose effects a reduction undoes: a small sample and field, a standard that is no Lambertian, brackets, stray light; no noise.
pub fn faultless() -> Instrument {
    Instrument {
        source: Source { beam_diameter_m: 0.02, ..Source::default() },
        sample: Holder { diameter_m: 0.03, ..Holder::default() },
        detector: Detector { field_diameter_m: 0.025, exposures_s: vec![0.1, 1.0], ..Detector::default() },
        reference: Reference { reflectance: 0.98, shape: 0.2, ..Reference::default() },
        surroundings: Surroundings { stray_per_sr: 0.01, shadow_deg: 4.0 },
        ..Instrument::noiseless()
    }
}

/// Every part, with faults of a usual size; no errors of positions.
pub fn lab() -> Instrument {
    Instrument {
        electrons: 1e6,
        read_noise: 8.0,
        source: Source { drift_per_sqrt_hour: 0.01, ..Source::default() },
        detector: Detector {
            dark_per_s: 200.0,
            dark_drift_per_sqrt_hour: 30.0,
            full_well: 4e5,
            bits: 16,
            nonlinearity_u: 0.004,
            exposures_s: vec![0.02, 0.5],
            ..Detector::default()
        },
        reference: Reference { reflectance: 0.985, reflectance_u: 0.003, ..Reference::default() },
        axes: Axes { move_s: 2.0, ..Axes::default() },
        surroundings: Surroundings { stray_per_sr: 2e-3, shadow_deg: 3.0 },
        protocol: Protocol { block: 60, repeats: 8 },
        ..Instrument::default()
    }
}

/// The same with errors of positions too.
pub fn crooked() -> Instrument {
    Instrument {
        sample: Holder { height_u_m: 2e-4, tilt_u_deg: 0.05, ..Holder::default() },
        axes: Axes { zero_u_deg: 0.05, jitter_deg: 0.02, ..lab().axes },
        detector: Detector { distance_m: 0.5, ..lab().detector },
        ..lab()
    }
}

/// Raw readings of a material.
pub fn read(of: &Material, instrument: &Instrument, scan: &(Directions, Weights), seed: u64) -> Raw {
    with_job(of, instrument, scan, seed, &[], |job| job.run(Control::silent()))
}

/// Raw readings by an instrument without errors of its own.
pub fn read_nominal(of: &Material, instrument: &Instrument, scan: &(Directions, Weights)) -> Raw {
    let entries: Vec<u32> = (0..scan.0.len() as u32).collect();
    let readings = series(instrument, &scan.0, &entries);
    with_job(of, instrument, scan, 0, &[], |job| job.read(readings, &Actual::nominal(), Control::silent()))
}

/// What `work` makes of a job.
pub fn with_job<T>(
    of: &Material,
    instrument: &Instrument,
    scan: &(Directions, Weights),
    seed: u64,
    left_out: &[&str],
    work: impl FnOnce(&Job<'_>) -> T,
) -> T {
    let truth = |wi: DVec3, wo: DVec3, out: &mut [f64]| {
        out.copy_from_slice(&of.value(wi, wo));
        true
    };
    let (directions, weights) = (&scan.0, &scan.1);
    let (accuracy, channels) = (1e-9, &of.channels);
    let dimension = if of.is_flat() { Dimension::Flat } else { Dimension::Space };
    work(&Job { dimension, seed, accuracy, left_out, ..Job::new(&truth, channels, instrument, (directions, weights)) })
}

/// Reduced, errors of positions by the slopes of `model`.
pub fn reduced(raw: &Raw, instrument: &Instrument, model: &Material) -> Reduction {
    let slopes = |wi: DVec3, wo: DVec3, out: &mut [f64]| {
        out.copy_from_slice(&model.value(wi, wo));
        true
    };
    reduce("m", raw, instrument, Some(&slopes)).expect("reduced")
}
