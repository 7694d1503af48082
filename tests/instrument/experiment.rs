//! Redrawn instruments: what share of their readings' intervals, and of those of parameters fitted to the readings, hold the truth.
//! `benches/instrument_coverage.rs` runs the same ones in numbers.

use std::sync::Arc;

use glam::DVec3;
use goniofit::brdf::{LobeKind, Material, PerChannel, Sight};
use goniofit::chain;
use goniofit::control::Control;
use goniofit::fit::{FitOptions, fit};
use goniofit::geometry::angles::direction_deg;
use goniofit::gonio::parts::Protocol;
use goniofit::gonio::sight::Cones;
use goniofit::gonio::{Instrument, Job, Preset, Raw, Reduction, SimulationSpec};
use goniofit::measurement::{Directions, Measurement, Weights};
use goniofit::numeric::stats::normal_quantile;
use rayon::prelude::*;

/// kd, ks and n of the classes of materials; a matte one has no lobe.
pub const CLASSES: [(&str, [f64; 3]); 3] =
    [("matte", [0.8, 0.0, 1.0]), ("glossy", GLOSSY), ("mirror-like", [0.05, 0.5, 2e4])];
const GLOSSY: [f64; 3] = [0.2, 0.1, 60.0];

/// A name, and what it makes of a built-in instrument's.
pub type Study = (&'static str, fn(&str) -> Experiment);

/// What else is redrawn.
pub const STUDIES: [Study; 3] =
    [("out-of-plane", Experiment::out_of_plane), ("misfit", Experiment::misfit), ("visits", Experiment::visits)];

/// A material on the holder of an instrument.
pub struct Experiment {
    /// What a user describes.
    pub described: Instrument,
    /// kd, ks and n that fits are to find; `None` where the material is none of the fitted model, of which no parameter is right.
    pub truth: Option<[f64; 3]>,
    pub directions: Directions,
    /// Which of them are read, in order; each once where it is empty.
    rows: Vec<u32>,
    material: Material,
    /// Spot, source and aperture, over which readings are means.
    cones: Option<Arc<Cones>>,
}

/// Relative error of means over spot and cones: far below the noise of any reading.
const ACCURACY: f64 = 1e-4;

/// What one redrawn instrument's intervals hold.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Outcome {
    /// Reading by reading: error and σ; nothing where it is masked.
    pub readings: Vec<Option<(f64, f64)>>,
    /// Whether the intervals of kd, ks and n hold them, of a fit at face value and of one through the instrument; `None` where none is stated, which
    /// says nothing that could be false.
    pub parameters: [[Option<bool>; 3]; 2],
}

impl Experiment {
    /// In the plane of incidence, of a material of the fitted model.
    pub fn new(preset: &str, truth: [f64; 3]) -> Self {
        let spec: SimulationSpec = Preset::find(preset).expect("built in").spec().expect("reads");
        let described = spec.instrument;
        let [kd, ks, n] = truth;
        let lobes: &[(f64, f64)] = if ks > 0.0 { &[(ks, n)] } else { &[] };
        let directions = scan(width(&described, truth));
        let cones = Cones::of(&described).map(Arc::new);
        Self { described, truth: Some(truth), directions, rows: Vec::new(), material: material(kd, lobes), cones }
    }

    /// All round the sample, and round the mirror directions.
    pub fn out_of_plane(preset: &str) -> Self {
        let plane = Self::new(preset, GLOSSY);
        Self { directions: hemisphere(width(&plane.described, GLOSSY)), ..plane }
    }

    /// Three Phong lobes: one more than the reduction's own model has, and two more than that of the classes, by which no parameter would be right.
    pub fn misfit(preset: &str) -> Self {
        let material = material(0.2, &[(0.06, 15.0), (0.04, 100.0), (0.02, 500.0)]);
        Self { truth: None, material, ..Self::new(preset, GLOSSY) }
    }

    /// Each pair is approached twice and read three times then, with short visits to the reference after every fourth: so many that several of them
    /// are one component.
    pub fn visits(preset: &str) -> Self {
        let mut of = Self::new(preset, GLOSSY);
        of.described.readings = 3;
        of.described.protocol = Protocol { block: 4, repeats: 2 };
        let once = 0..of.directions.len() as u32;
        of.rows = once.clone().chain(once).collect();
        of
    }

    /// What each reading stands for.
    pub fn expected(&self, i: usize) -> f64 {
        let (wi, wo) = self.directions.pair(i);
        let mut value = [0.0];
        match &self.cones {
            Some(cones) => cones.write_value(&self.material, wi, wo, &mut value),
            None => self.material.write_value(wi, wo, &mut value),
        }
        value[0]
    }

    /// Raw readings of the instrument of this seed.
    pub fn raw(&self, seed: u64) -> Raw {
        self.with_job(seed, |job| job.run(Control::silent()))
    }

    /// What `work` makes of the instrument's job.
    pub fn with_job<T>(&self, seed: u64, work: impl FnOnce(&Job<'_>) -> T) -> T {
        let truth = |wi: DVec3, wo: DVec3, out: &mut [f64]| {
            self.material.write_value(wi, wo, out);
            true
        };
        let along = Job::new(&truth, &self.material.channels, &self.described, (&self.directions, &Weights::Uniform));
        work(&Job { lobes: Some(&self.material), rows: &self.rows, seed, accuracy: ACCURACY, ..along })
    }

    /// Reduced as a user does: by the described instrument.
    pub fn reduced(&self, seed: u64) -> Reduction {
        chain::reduced("study", &self.raw(seed), &self.described).expect("reduced")
    }

    pub fn outcome(&self, seed: u64) -> Outcome {
        let m = self.reduced(seed).measurement;
        let readings = (0..m.len()).map(|i| Some((m.value(0, i)? - self.expected(i), sigma(&m, i)))).collect();
        Outcome { readings, parameters: [false, true].map(|through| self.parameters(&m, through)) }
    }

    /// A fit with the σ that the measurement states, at face value or through the instrument.
    fn parameters(&self, m: &Measurement, through: bool) -> [Option<bool>; 3] {
        let Some(truth) = self.truth else { return [None; 3] };
        let matte = truth[1] == 0.0;
        let model = if matte { "lambert" } else { "lambert+phong" };
        let sight = self.cones.clone().filter(|_| through).map(|cones| cones as Arc<dyn Sight>);
        let plain = FitOptions::new(model.parse().expect("a model"));
        let options = FitOptions { use_sigma: true, through: sight, ..plain };
        let material = fit(m, &options).expect("fits").material;
        let record = material.fit.as_ref().expect("a record");
        let holds = |interval: Option<(f64, f64)>, truth: f64| interval.map(|(a, b)| a <= truth && truth <= b);
        let kd = holds(record.interval_95[0].weight[0], truth[0]);
        if matte {
            return [kd, None, None];
        }
        let lobe = &record.interval_95[1];
        let PerChannel::Shared(exponent) = &lobe.shape[0].1 else { panic!("one exponent") };
        [kd, holds(lobe.weight[0], truth[1]), holds(*exponent, truth[2])]
    }
}

/// One channel, a Lambert lobe and Phong lobes of these weights and exponents.
fn material(kd: f64, phong: &[(f64, f64)]) -> Material {
    let mut lobes = vec![(LobeKind::Lambert, vec![kd], vec![])];
    lobes.extend(phong.iter().map(|(ks, n)| (LobeKind::Phong, vec![*ks], vec![*n])));
    Material::new(vec!["y".into()], lobes)
}

/// Independent and shared errors of a reading together, one σ.
pub fn sigma(m: &Measurement, i: usize) -> f64 {
    let own = m.sigma.as_ref().map_or(0.0, |s| s[i]);
    (own * own + m.common.iter().map(|k| k[i] * k[i]).sum::<f64>()).sqrt()
}

/// Standard deviation of a lobe as it is seen, degrees: its own and, along one axis, half the half angles of cones and spot.
fn width(instrument: &Instrument, [_, ks, n]: [f64; 3]) -> f64 {
    let cones = [instrument.source.divergence_deg, instrument.detector.aperture_deg].map(|full| (0.25 * full).powi(2));
    let own = if ks > 0.0 { n.sqrt().recip().to_degrees() } else { 10.0 };
    let nearness = instrument.source.nearness() + instrument.detector.nearness();
    let spot = (0.25 * instrument.source.beam_diameter_m * nearness).to_degrees();
    (own * own + cones.iter().sum::<f64>() + spot * spot).sqrt()
}

const INCIDENCES_DEG: [f64; 2] = [20.0, 45.0];

/// In the plane of incidence at 20° and 45°: about the mirror direction at shares of the lobe's width, and coarsely elsewhere.
fn scan(width_deg: f64) -> Directions {
    let (mut wi, mut wo) = (Vec::new(), Vec::new());
    for theta in INCIDENCES_DEG {
        let near = [0.0, 0.3, 0.6, 1.0, 1.4, 1.8, 2.3, 2.8, 3.5].into_iter();
        let about = near
            .flat_map(|k: f64| if k == 0.0 { vec![theta] } else { vec![theta - k * width_deg, theta + k * width_deg] });
        let rest = [-65.0, -50.0, -35.0, 0.0, 10.0, 30.0, 60.0, 70.0];
        for theta_o in about.chain(rest).filter(|t| t.abs() <= 75.0) {
            wi.push(direction_deg(theta, 0.0));
            wo.push(direction_deg(theta_o, 180.0));
        }
    }
    Directions::List { wi, wo }
}

/// All round the normal at 20° and 45°, and on circles about the mirror direction whose radii are shares of the lobe's width.
fn hemisphere(width_deg: f64) -> Directions {
    let (mut wi, mut wo) = (Vec::new(), Vec::new());
    let all_round = [10.0, 25.0, 40.0, 55.0, 70.0]
        .into_iter()
        .flat_map(|theta| (0..12).map(move |k| direction_deg(theta, 30.0 * f64::from(k))));
    let all_round: Vec<DVec3> = std::iter::once(DVec3::Z).chain(all_round).collect();
    for theta in INCIDENCES_DEG {
        let mirror = direction_deg(theta, 180.0);
        let across = DVec3::Z.cross(mirror).normalize();
        let along = across.cross(mirror);
        let circle = |share: f64| {
            let (sin, cos) = (share * width_deg).to_radians().sin_cos();
            (0..8).map(move |k| {
                let (around_sin, around_cos) = (45.0 * f64::from(k)).to_radians().sin_cos();
                cos * mirror + sin * (around_cos * along + around_sin * across)
            })
        };
        let near = std::iter::once(mirror).chain([0.6, 1.2, 2.0].into_iter().flat_map(circle));
        let above = near.filter(|wo| wo.z > 75f64.to_radians().cos());
        let of_incidence: Vec<DVec3> = above.chain(all_round.iter().copied()).collect();
        wi.extend(std::iter::repeat_n(direction_deg(theta, 0.0), of_incidence.len()));
        wo.extend(of_incidence);
    }
    Directions::List { wi, wo }
}

/// How often intervals hold.
pub struct Coverage {
    /// Over all readings that were valid in more than half of the instruments.
    pub mean: f64,
    /// Of the reading that holds least often, of the one that does most often, and their index.
    pub least: (f64, usize),
    pub most: (f64, usize),
    /// Width between the 2.5 % and 97.5 % quantiles of the errors, over that of the mean interval: least and most of the readings.
    pub quantiles: (f64, f64),
    /// Of kd, ks and n, at face value and through the instrument; `None` where none of them is ever stated.
    pub parameters: [[Option<Held>; 3]; 2],
    pub readings: usize,
}

/// Of a parameter's intervals.
#[derive(Debug, Clone, Copy)]
pub struct Held {
    /// Share of the instruments of which one is stated: elsewhere the data don't determine the parameter, and the fit says so.
    pub stated: f64,
    /// Share of the instruments of which none is stated that misses the truth. Not a share of those that are stated: which instruments let a parameter
    /// look determined hangs on the same noise.
    pub held: f64,
}

impl std::fmt::Display for Held {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.1}", 100.0 * self.held)?;
        if self.stated < 1.0 { write!(f, " ({:.0} stated)", 100.0 * self.stated) } else { Ok(()) }
    }
}

/// Redraws instruments of these seeds.
pub fn coverage(of: &Experiment, seeds: std::ops::Range<u64>) -> Coverage {
    let runs: Vec<Outcome> = seeds.into_par_iter().map(|seed| of.outcome(seed)).collect();
    coverage_by(of, &runs)
}

/// What these redrawn instruments say.
pub fn coverage_by(of: &Experiment, runs: &[Outcome]) -> Coverage {
    let k = normal_quantile(0.975);
    let list: Vec<(f64, f64, usize)> = (0..of.directions.len())
        .filter_map(|i| {
            let valid: Vec<(f64, f64)> = runs.iter().filter_map(|run| run.readings[i]).collect();
            (valid.len() * 2 > runs.len()).then(|| {
                let held = valid.iter().filter(|(error, sigma)| error.abs() <= k * sigma).count();
                (held as f64 / valid.len() as f64, spread(&valid, k), i)
            })
        })
        .collect();
    let by = |pick: fn(f64, f64) -> bool| {
        list.iter().fold(None, |best: Option<(f64, usize)>, (share, _, i)| match best {
            Some((found, _)) if !pick(*share, found) => best,
            _ => Some((*share, *i)),
        })
    };
    let parameter = |way: usize, p: usize| {
        let stated: Vec<bool> = runs.iter().filter_map(|run| run.parameters[way][p]).collect();
        let missed = stated.iter().filter(|held| !**held).count();
        let share = |count: usize| count as f64 / runs.len() as f64;
        (!stated.is_empty()).then(|| Held { stated: share(stated.len()), held: 1.0 - share(missed) })
    };
    Coverage {
        mean: list.iter().map(|l| l.0).sum::<f64>() / list.len() as f64,
        least: by(|a, b| a < b).expect("readings"),
        most: by(|a, b| a > b).expect("readings"),
        quantiles: list.iter().fold((f64::INFINITY, 0.0), |(low, high), l| (l.1.min(low), l.1.max(high))),
        parameters: [0, 1].map(|way| [0, 1, 2].map(|p| parameter(way, p))),
        readings: list.len(),
    }
}

/// The central 95 % of the errors over the mean interval.
fn spread(valid: &[(f64, f64)], k: f64) -> f64 {
    let mut errors: Vec<f64> = valid.iter().map(|v| v.0).collect();
    errors.sort_by(f64::total_cmp);
    let at = |p: f64| errors[((p * errors.len() as f64) as usize).min(errors.len() - 1)];
    let mean = valid.iter().map(|v| v.1).sum::<f64>() / valid.len() as f64;
    (at(0.975) - at(0.025)) / (2.0 * k * mean)
}
