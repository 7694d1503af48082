//! The trials: readings by a setting beside those that they are measured against.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::time::Instant;

use super::SimulateSweep;
use super::laws::Shown;
use crate::brdf::{Material, Sight};
use crate::chain::{ChainError, Source, measure, reduced_until, with_job};
use crate::control::Control;
use crate::fit::{FitOptions, fit};
use crate::gonio::sight::Cones;
use crate::gonio::{ACCURACY, Instrument, Job, Kind, Raw, Scan};
use crate::measurement::{Dimension, Measurement};
use crate::numeric::random::mix;
use crate::tradeoff::fit::parameter_error;
use crate::tradeoff::sweep::{Trial, Turn};

/// One way to read.
#[derive(Debug)]
pub(super) enum Read {
    /// Means over cones to this relative error, without noise.
    Quadrature(f64),
    /// By rules of this order, without noise.
    Order(u32),
    /// An effect left out; all of them on where it is none.
    Without(Option<&'static str>),
    /// As the instrument reads, noise and all.
    Noisy { instrument: Box<Instrument>, scan: Scan },
}

/// Relative error that means over cones may have, and the only order of their rules where one is set.
type Rules = (f64, Option<u32>);

/// Places of both kinds of better readings.
const FINE: usize = 0;
const HIGH: usize = 1;
/// Means over cones of the reference.
const FINEST: f64 = 1e-10;
/// Share of the full well below which a reading is taken.
const UNSATURATED: f64 = 0.95;
/// Effects by chance, anew in every reading.
const NOISE: [&str; 3] = ["shot noise", "read noise", "quantisation"];

/// Root of the mean of the squared relative changes |x − r|/max(|x|, |r|), over pairs of which both are numbers: each is 1 at most where signs
/// agree, so that a reading in
/// a shadow's edge does not hide all others.
#[must_use]
pub fn relative_change(values: &[f64], reference: &[f64]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (x, r) in values.iter().zip(reference).filter(|(x, r)| !x.is_nan() && !r.is_nan()) {
        let larger = x.abs().max(r.abs());
        sum += if larger > 0.0 { ((x - r) / larger).powi(2) } else { 0.0 };
        count += 1.0;
    }
    f64::sqrt(sum / count)
}

/// The largest relative change |x − r|/|r| over pairs of which both are numbers; where r is 0 and x is not, it counts as 1.
pub(in crate::tradeoff) fn largest_change(values: &[f64], reference: &[f64]) -> f64 {
    let change = |(x, r): (&f64, &f64)| if *r == 0.0 && *x != 0.0 { x.signum().abs() } else { ((x - r) / r).abs() };
    let changes = values.iter().zip(reference).map(change);
    changes.filter(|change| change.is_finite()).fold(0.0, f64::max)
}

/// Where trials are made.
pub(super) struct Bench<'a> {
    what: &'a SimulateSweep<'a>,
    seed: u64,
    control: Control<'a>,
    /// Readings without noise to the finest accuracy, and by rules of twice the highest order, with the round that they are of: no other reads them.
    better: [Option<(u32, Raw)>; 2],
    /// Readings of a round with all effects but noise, or with the one kind of noise that is looked at.
    whole: HashMap<Option<&'static str>, (u32, Judged)>,
    /// True values, by scan.
    truths: HashMap<String, Vec<f64>>,
    quadrature_error: f64,
}

/// Readings and what comes of them.
struct Judged {
    raw: Raw,
    values: Vec<f64>,
    fitted: Option<Material>,
}

impl<'a> Bench<'a> {
    pub fn new(what: &'a SimulateSweep<'a>, seed: u64, control: Control<'a>) -> Self {
        let (whole, truths) = (HashMap::new(), HashMap::new());
        Self { what, seed, control, better: [None, None], whole, truths, quadrature_error: 0.0 }
    }

    /// What the references are.
    pub fn said(&self) -> Vec<String> {
        let mut said = Vec::new();
        if self.better[FINE].is_some() {
            said.push(format!(
                "quadratures: the same readings with means over cones to {FINEST:.0e}; their last doubling moved them by {:.1e} at most",
                self.quadrature_error
            ));
        }
        if self.better[HIGH].is_some() {
            said.push(format!(
                "orders: the same readings by rules of order {}: where errors fall by the square, they have a quarter of the last one's",
                self.highest_order()
            ));
        }
        if !self.whole.is_empty() {
            said.push("effects: the same readings by the same instrument with all effects on, noise only where it is the effect".into());
        }
        if !self.truths.is_empty() {
            said.push(
                "readings, exposure, step: the material itself, exactly; their noise: the same readings without it"
                    .into(),
            );
        }
        said
    }

    /// What a reader must know.
    pub fn notes(&self) -> Vec<String> {
        let least = self.what.quadrature.iter().copied().fold(f64::INFINITY, f64::min);
        let said = format!(
            "some readings' orders end before {FINEST:.0e}: an error far below {:.0e} may be the reference's",
            self.quadrature_error
        );
        (self.quadrature_error > least).then_some(said).into_iter().collect()
    }

    /// A trial, and what it shows of noise.
    pub fn trial(&mut self, read: &Read, turn: Turn) -> Result<(Trial, Shown), ChainError> {
        let quiet = |trial: Trial| (trial, Shown::NOTHING);
        match read {
            Read::Quadrature(accuracy) => self.means((*accuracy, None), (FINEST, None), turn.round).map(quiet),
            Read::Order(order) => {
                let better = (ACCURACY, Some(self.highest_order()));
                self.means((ACCURACY, Some(*order)), better, turn.round).map(quiet)
            }
            Read::Without(name) => self.without(*name, turn.round).map(quiet),
            Read::Noisy { instrument, scan } => self.noisy(instrument, scan, turn.seed),
        }
    }

    /// Raw readings, and the time that they took, s.
    fn read(&self, (accuracy, order): Rules, left_out: &[&str], seed: u64) -> Result<(Raw, f64), ChainError> {
        let SimulateSweep { source, name, instrument, scan, .. } = self.what;
        let quiet = self.control.quiet();
        with_job(name, source, instrument, scan, seed, quiet, |job| {
            let clock = Instant::now();
            let raw = Job { accuracy, order, left_out, ..*job }.run(quiet);
            (raw, clock.elapsed().as_secs_f64())
        })
    }

    /// The same instrument in all settings of a round.
    fn instrument_of(&self, round: u32) -> u64 {
        mix(self.seed ^ mix(u64::from(round)))
    }

    /// Readings by rules against those by better ones, which are made once a round.
    fn means(&mut self, rules: Rules, better: Rules, round: u32) -> Result<Trial, ChainError> {
        let seed = self.instrument_of(round);
        let kind = if better.1.is_some() { HIGH } else { FINE };
        let known = self.better[kind].take().filter(|(of, _)| *of == round);
        let reference = match known {
            Some(known) => known,
            None => (round, self.read(better, &NOISE, seed)?.0),
        };
        let (raw, seconds) = self.read(rules, &NOISE, seed)?;
        let error = of_samples(&raw, &reference.1);
        if kind == FINE {
            self.quadrature_error = self.quadrature_error.max(reference.1.quadrature_error);
        }
        self.better[kind] = Some(reference);
        Ok(Trial { seconds, errors: vec![error, f64::NAN, f64::NAN] })
    }

    fn highest_order(&self) -> u32 {
        2 * self.what.orders.iter().copied().max().unwrap_or(1)
    }

    fn without(&mut self, name: Option<&'static str>, round: u32) -> Result<Trial, ChainError> {
        let seed = self.instrument_of(round);
        // Of noise only the one that is looked at.
        let own = name.filter(|name| NOISE.contains(name));
        let quiet: Vec<&str> = NOISE.into_iter().filter(|noise| Some(*noise) != own).collect();
        self.whole.retain(|_, (of, _)| *of == round);
        if !self.whole.contains_key(&own) {
            let (raw, _) = self.read((ACCURACY, None), &quiet, seed)?;
            let judged = self.judge(raw)?;
            self.whole.insert(own, (round, judged));
        }
        let left_out: Vec<&str> = quiet.iter().copied().chain(name).collect();
        let (raw, seconds) = self.read((ACCURACY, None), &left_out, seed)?;
        let less = self.judge(raw)?;
        let Some((_, all)) = self.whole.get(&own) else { return Ok(Trial { seconds, errors: vec![f64::NAN; 3] }) };
        let parameters =
            less.fitted.as_ref().zip(all.fitted.as_ref()).map_or(f64::NAN, |(less, all)| parameter_error(less, all));
        let errors = vec![of_samples(&less.raw, &all.raw), relative_change(&less.values, &all.values), parameters];
        Ok(Trial { seconds, errors })
    }

    /// Reduces readings and fits the truth's model to them.
    fn judge(&self, raw: Raw) -> Result<Judged, ChainError> {
        let table = reduced_until(self.what.name, &raw, self.what.instrument, self.control.stop)?.measurement;
        let fitted = self.fitted(&table, self.what.instrument);
        Ok(Judged { raw, values: table.values, fitted })
    }

    fn fitted(&self, table: &Measurement, instrument: &Instrument) -> Option<Material> {
        fitted_as(self.what.source, table, instrument)
    }

    fn noisy(&mut self, instrument: &Instrument, scan: &Scan, seed: u64) -> Result<(Trial, Shown), ChainError> {
        let SimulateSweep { source, name, .. } = self.what;
        let quiet = self.control.quiet();
        let clock = Instant::now();
        let table = measure(name, source, instrument, scan, seed, quiet)?;
        let seconds = clock.elapsed().as_secs_f64();
        let key = scan.to_string();
        if !self.truths.contains_key(&key) {
            let ideal = measure(name, source, &Instrument::noiseless(), scan, 0, quiet)?;
            self.truths.insert(key.clone(), ideal.values);
        }
        let truth = self.truths.get(&key).map_or(&[][..], |values| &values[..]);
        let (noise, change, saturates) = if instrument.is_plain() {
            (relative_change(&table.values, truth), largest_change(&table.values, truth), false)
        } else {
            // The same instrument, with the same errors of its own, with noise and without.
            let [noisy, calm] = [&[][..], &NOISE].map(|left_out| {
                with_job(name, source, instrument, scan, seed, quiet, |job| Job { left_out, ..*job }.run(quiet))
            });
            let Sums { noisy, calm, saturates } = sums_of(&noisy?, &calm?, instrument);
            (relative_change(&noisy, &calm), largest_change(&noisy, &calm), saturates)
        };
        let parameters = match (source, self.fitted(&table, instrument)) {
            (Source::Fitted(truth), Some(fitted)) => parameter_error(&fitted, truth),
            _ => f64::NAN,
        };
        // An error that could not be told is as large as one may be.
        let off = if parameters.is_nan() && matches!(source, Source::Fitted(_)) { f64::INFINITY } else { parameters };
        let shown = Shown { change, parameters: f64::max(0.0, off), saturates };
        Ok((Trial { seconds, errors: vec![noise, relative_change(&table.values, truth), parameters] }, shown))
    }
}

/// Fits the truth's model, where it is a sum of lobes, through the instrument's cones where it has any.
fn fitted_as(source: &Source, table: &Measurement, instrument: &Instrument) -> Option<Material> {
    let Source::Fitted(truth) = source else { return None };
    let cones = Cones::of(instrument).filter(|_| table.dimension == Dimension::Space);
    let through = cones.map(|cones| Arc::new(cones) as Arc<dyn Sight>);
    let options = FitOptions { through, ..FitOptions::new(truth.model().parse().ok()?) };
    fit(table, &options).ok().map(|fitted| fitted.material)
}

/// Readings added up at each pair of directions, of the longest exposure that does not saturate, with noise and without.
struct Sums {
    noisy: Vec<f64>,
    calm: Vec<f64>,
    /// Whether some exposure saturates.
    saturates: bool,
}

fn sums_of(noisy: &Raw, calm: &Raw, instrument: &Instrument) -> Sums {
    let full =
        if instrument.detector.full_well > 0.0 { UNSATURATED * instrument.detector.full_well } else { f64::INFINITY };
    // By pair and channel: the exposure, and both sums.
    let mut longest: BTreeMap<(u32, usize), (f64, f64, f64)> = BTreeMap::new();
    let mut saturates = false;
    for (i, reading) in calm.readings.iter().enumerate() {
        let Some(entry) = reading.entry.filter(|_| reading.kind == Kind::Sample) else { continue };
        saturates |= calm.signals(i).iter().any(|r| *r >= full);
        for (c, (x, r)) in noisy.signals(i).iter().zip(calm.signals(i)).enumerate().filter(|(_, (_, r))| **r < full) {
            let sums = longest.entry((entry, c)).or_insert((0.0, 0.0, 0.0));
            if reading.exposure_s > sums.0 {
                *sums = (reading.exposure_s, 0.0, 0.0);
            }
            if reading.exposure_s == sums.0 {
                *sums = (sums.0, sums.1 + x, sums.2 + r);
            }
        }
    }
    let (noisy, calm) = longest.values().map(|sums| (sums.1, sums.2)).unzip();
    Sums { noisy, calm, saturates }
}

/// Relative change of the readings of the sample.
fn of_samples(raw: &Raw, reference: &Raw) -> f64 {
    let of = |raw: &Raw| -> Vec<f64> {
        let samples = (0..raw.readings.len()).filter(|i| raw.readings[*i].kind == Kind::Sample);
        samples.flat_map(|i| raw.signals(i).to_vec()).collect()
    };
    relative_change(&of(raw), &of(reference))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::BuiltInMaterial;

    #[test]
    fn changes_are_relative_to_the_larger_and_leave_out_what_is_not_known() {
        let found = relative_change(&[1.0, 0.0, f64::NAN, 0.0, -1.0], &[2.0, 3.0, 1.0, 0.0, 1.0]);
        // ½, 1, –, 0, 2: a change of sign is the only one above 1.
        assert!((found - ((0.25 + 1.0 + 4.0) / 4.0f64).sqrt()).abs() < 1e-15, "{found}");
    }

    #[test]
    fn the_largest_change_counts_what_is_read_where_nothing_is() {
        assert_eq!(largest_change(&[1.5, 2.0], &[1.0, 2.0]), 0.5);
        assert_eq!(largest_change(&[1.5, 1e-9], &[1.0, 0.0]), 1.0);
        assert_eq!(largest_change(&[3.0, -1e-9], &[1.0, 0.0]), 2.0);
        assert_eq!(largest_change(&[0.0, f64::NAN, 1.0, f64::NAN], &[0.0, 1.0, f64::NAN, 0.0]), 0.0);
    }

    /// Raw readings are large, and rounds may be many.
    #[test]
    fn what_a_round_is_measured_against_goes_with_it() {
        let source = Source::Fitted(Box::new(BuiltInMaterial::find("satin").expect("built in").material()));
        let (instrument, scan) = (Instrument::default(), Scan::InPlane { step_deg: 30.0 });
        let what = SimulateSweep {
            source: &source,
            name: "satin",
            instrument: &instrument,
            scan: &scan,
            quadrature: vec![],
            orders: vec![],
            effects: true,
            readings: vec![],
            dwell: vec![],
            steps: vec![],
        };
        let mut bench = Bench::new(&what, 3, Control::silent());
        let mut tried = |round: u32| {
            let turn = Turn { round, seed: 0, again: false };
            let reads = [Read::Quadrature(1e-3), Read::Without(None), Read::Without(Some("shot noise"))];
            let errors = reads.map(|read| bench.trial(&read, turn).expect("reads").0.errors[0]);
            let rounds: Vec<u32> = bench.whole.values().map(|(of, _)| *of).collect();
            let kept = (bench.better[FINE].as_ref().map(|(of, _)| *of), rounds);
            assert_eq!(kept, (Some(round), vec![round; 2]), "one of all effects, one with the noise that is looked at");
            errors.map(f64::to_bits)
        };
        let all: Vec<[u64; 3]> = [0, 1, 2, 0].into_iter().map(&mut tried).collect();
        assert!(all[0] == all[3] && all[0][2] != all[1][2], "a round comes out as it did, and unlike others: {all:?}");
    }
}
