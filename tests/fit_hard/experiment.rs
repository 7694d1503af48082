//! Experiments whose truth is known: a simulated measurement, outliers on request, and whether the intervals of its fit hold the truth.
//! `benches/coverage.rs` runs the same ones in numbers.

use goniofit::brdf::{LobeKind, Material, PerChannel};
use goniofit::control::Control;
use goniofit::fit::{FitOptions, Robust, RobustKind, fit};
use goniofit::gonio::{Instrument, Scan, simulate};
use goniofit::measurement::Measurement;
use goniofit::numeric::random::{Purpose, RngExt, Stream, stream};

/// Gross outliers: this share of the values is moved by 10 to 100 of its own σ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outliers {
    None,
    /// All upwards.
    OneSided(f64),
    /// Up or down with equal chance.
    Symmetric(f64),
}

/// One way to measure a truth and to fit it.
#[derive(Debug, Clone)]
pub struct Cell {
    pub scan: Scan,
    /// Electrons of the instrument, which set the noise.
    pub electrons: f64,
    pub outliers: Outliers,
    pub robust: Option<RobustKind>,
    /// Whether the fit is told the σ.
    pub stated_sigma: bool,
}

/// Lambert and one Phong lobe in one channel: (kd, ks, n).
pub type Truth = [f64; 3];

pub fn of_truth([kd, ks, n]: Truth) -> Material {
    Material::new(
        vec!["r".to_owned()],
        vec![(LobeKind::Lambert, vec![kd], vec![]), (LobeKind::Phong, vec![ks], vec![n])],
    )
}

impl Cell {
    pub fn plain(scan: Scan, electrons: f64) -> Self {
        Self { scan, electrons, outliers: Outliers::None, robust: None, stated_sigma: true }
    }

    pub fn measure(&self, truth: Truth, seed: u64) -> Measurement {
        let material = of_truth(truth);
        let value = |wi, wo, out: &mut [f64]| {
            out.copy_from_slice(&material.value(wi, wo));
            true
        };
        let instrument = Instrument { electrons: self.electrons, ..Instrument::default() };
        let mut m = simulate("truth", &value, &material.channels, &instrument, &self.scan, seed, Control::silent())
            .expect("a scan");
        add_outliers(&mut m, self.outliers, &mut stream(seed, Purpose::Study, 77));
        if !self.stated_sigma {
            m.sigma = None;
        }
        m
    }

    pub fn options(&self) -> FitOptions {
        let robust = self.robust.map(|kind| Robust { kind, scale: kind.default_scale() });
        FitOptions { robust, ..FitOptions::new("lambert+phong".parse().expect("a model")) }
    }

    /// Whether the 95 % intervals of kd, ks and n hold the truth.
    pub fn held(&self, truth: Truth, seed: u64) -> [bool; 3] {
        let got = fit(&self.measure(truth, seed), &self.options()).expect("a fit").material;
        let record = got.fit.as_ref().expect("a record");
        let PerChannel::Shared(shape) = &record.interval_95[1].shape[0].1 else { panic!("one exponent") };
        let intervals = [record.interval_95[0].weight[0], record.interval_95[1].weight[0], *shape];
        std::array::from_fn(|i| intervals[i].is_some_and(|(low, high)| low <= truth[i] && truth[i] <= high))
    }

    /// Whether the truth lies at least five standard errors above 0 in each parameter; by the errors that values without noise have, so that
    /// the noise has no say in it.
    pub fn is_clear_of_bounds(&self, truth: Truth, seed: u64) -> bool {
        let mut m = self.measure(truth, seed);
        let material = of_truth(truth);
        m.values = (0..m.len())
            .map(|i| {
                let (wi, wo) = m.directions.pair(i);
                material.value(wi, wo)[0]
            })
            .collect();
        let got = fit(&m, &self.options()).expect("a fit").material;
        let error = &got.fit.as_ref().expect("a record").standard_error;
        let PerChannel::Shared(shape) = &error[1].shape[0].1 else { panic!("one exponent") };
        let errors = [error[0].weight[0], error[1].weight[0], *shape];
        truth.iter().zip(errors).all(|(truth, e)| e.is_some_and(|e| *truth > 5.0 * e))
    }
}

/// Moves values off, each by itself with the share's chance.
pub fn add_outliers(m: &mut Measurement, outliers: Outliers, rng: &mut Stream) {
    let (share, symmetric) = match outliers {
        Outliers::None => return,
        Outliers::OneSided(share) => (share, false),
        Outliers::Symmetric(share) => (share, true),
    };
    let sigma = m.sigma.clone().expect("a noisy instrument states sigma");
    for (value, sigma) in m.values.iter_mut().zip(sigma) {
        if rng.random::<f64>() < share {
            let size = 10.0 + 90.0 * rng.random::<f64>();
            let up = !symmetric || rng.random::<bool>();
            *value += if up { size } else { -size } * sigma;
        }
    }
}
