//! What is known of the parameters before: each anywhere in a range, evenly on a logarithmic scale, independently of the others.

use crate::brdf::{LobeKind, ModelSpec};

/// A range of one parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Range {
    /// The parameter's name: `lambert.weight`, `phong[1].exponent`.
    pub name: String,
    /// Least value, above 0.
    pub low: f64,
    /// Largest value.
    pub high: f64,
}

/// A model and the ranges of its parameters: of each lobe its weight, then its shapes.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    model: ModelSpec,
    ranges: Vec<Range>,
}

/// Why a prior can't be planned for.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Wrong {
    /// Candidates are pairs of directions in space.
    #[error("model {0} belongs to the flat world: expected lobes of space, found {0}")]
    Flat(ModelSpec),
    /// A name that the model does not have.
    #[error("{name}: expected a parameter of {model} ({known}), found {name}")]
    Unknown {
        /// What was asked for.
        name: String,
        /// The model.
        model: ModelSpec,
        /// What it has.
        known: String,
    },
    /// Not a range of positive numbers.
    #[error("{name}: expected LOW..HIGH with 0 < LOW <= HIGH <= {most:e}, found {low:e}..{high:e}")]
    Range {
        /// The parameter.
        name: String,
        /// Found.
        low: f64,
        /// Found.
        high: f64,
        /// Largest value that makes sense.
        most: f64,
    },
    /// A detector without noise needs no plan.
    #[error("instrument.electrons: a plan weighs noise against time; expected a number above 0, found 0")]
    Noiseless,
    /// No scan whatever tells the parameters.
    #[error(
        "no pair of directions tells the parameters of {0} apart anywhere in the prior: everything saturates, lies in the shadow, or two lobes are alike"
    )]
    Undetermined(ModelSpec),
    /// Not even one reading a parameter.
    #[error(
        "budget: the least that is needed, {pairs} pairs of directions read once, takes {least_s} s of the instrument, found {found_s} s"
    )]
    Budget {
        /// Pairs that are needed.
        pairs: usize,
        /// Seconds that they take.
        least_s: f64,
        /// Seconds that there are.
        found_s: f64,
    },
    /// More rows than a scan may have, however many readings each is.
    #[error(
        "budget: it pays for {found:e} rows of readings; expected at most {most:e}: let each take longer (instrument.detector.exposures_s)"
    )]
    TooMany {
        /// How many it pays for.
        found: f64,
        /// How many a scan may have.
        most: f64,
    },
}

/// Weights that are usual, if nothing else is said.
const DIFFUSE: (f64, f64) = (0.05, 0.8);
const GLOSSY: (f64, f64) = (0.02, 0.3);
/// Exponents that are usual: what lobes of one kind share between them.
const EXPONENT: (f64, f64) = (10.0, 1000.0);
/// Largest weight that makes sense.
const MOST_WEIGHT: f64 = 1e3;
/// Draws of the prior that stand for it.
const DRAWS: u32 = 48;
/// Bases of the Halton sequence, one a parameter.
const PRIMES: [u32; 8] = [2, 3, 5, 7, 11, 13, 17, 19];

impl Prior {
    /// The usual ranges: diffuse weights 0.05 to 0.8, others 0.02 to 0.3; exponents 10 to 1000, which several lobes of a kind share evenly on the
    /// logarithmic scale.
    ///
    /// # Errors
    /// [`Wrong::Flat`].
    pub fn usual(model: &ModelSpec) -> Result<Self, Wrong> {
        if model.is_flat() {
            return Err(Wrong::Flat(model.clone()));
        }
        let lobes = model.lobes();
        let mut ranges = Vec::new();
        for (l, kind) in lobes.iter().enumerate() {
            let before = lobes[..l].iter().filter(|k| *k == kind).count();
            let all = lobes.iter().filter(|k| *k == kind).count();
            let lobe = if before == 0 { kind.name().to_owned() } else { format!("{}[{before}]", kind.name()) };
            let (low, high) = if kind.lobe().parameters().is_empty() { DIFFUSE } else { GLOSSY };
            ranges.push(Range { name: format!("{lobe}.weight"), low, high });
            for parameter in kind.lobe().parameters() {
                let part = |k: usize| EXPONENT.0 * (EXPONENT.1 / EXPONENT.0).powf(k as f64 / all as f64);
                ranges.push(Range {
                    name: format!("{lobe}.{}", parameter.name),
                    low: part(before),
                    high: part(before + 1),
                });
            }
        }
        Ok(Self { model: model.clone(), ranges })
    }

    /// With another range of one parameter.
    ///
    /// # Errors
    /// [`Wrong`] where the model has no such parameter or the range is none.
    pub fn with(mut self, range: Range) -> Result<Self, Wrong> {
        let names = || self.names().join(", ");
        let Some(place) = self.ranges.iter().position(|r| r.name == range.name) else {
            return Err(Wrong::Unknown { known: names(), name: range.name, model: self.model });
        };
        let most = if range.name.ends_with(".weight") { MOST_WEIGHT } else { self.most_of_shape(place) };
        if !(range.low > 0.0 && range.low <= range.high && range.high <= most) {
            return Err(Wrong::Range { name: range.name, low: range.low, high: range.high, most });
        }
        self.ranges[place] = range;
        Ok(self)
    }

    /// Where a fit's search of the shape at `place` ends.
    fn most_of_shape(&self, place: usize) -> f64 {
        let bounds = |kind: &LobeKind| {
            std::iter::once(MOST_WEIGHT).chain(kind.lobe().parameters().iter().map(|p| p.bounds.1)).collect::<Vec<_>>()
        };
        self.model.lobes().iter().flat_map(bounds).nth(place).unwrap_or(MOST_WEIGHT)
    }

    /// The model.
    #[must_use]
    pub fn model(&self) -> &ModelSpec {
        &self.model
    }

    /// The ranges, in the model's order.
    #[must_use]
    pub fn ranges(&self) -> &[Range] {
        &self.ranges
    }

    /// Names of all parameters.
    #[must_use]
    pub fn names(&self) -> Vec<&str> {
        self.ranges.iter().map(|r| r.name.as_str()).collect()
    }

    /// The largest shape parameter that may be: how sharp lobes can be. 1 where there is none.
    pub(super) fn sharpest(&self) -> f64 {
        let shapes = self.ranges.iter().filter(|r| !r.name.ends_with(".weight"));
        shapes.map(|r| r.high).fold(1.0, f64::max)
    }

    /// Parameter sets that stand for the prior: points of a Halton sequence (Halton 1960), the same at every call.
    #[must_use]
    pub fn draws(&self) -> Vec<Vec<f64>> {
        let at = |k: u32| {
            let of =
                |(range, base): (&Range, &u32)| range.low * (range.high / range.low).powf(radical_inverse(k, *base));
            self.ranges.iter().zip(&PRIMES).map(of).collect()
        };
        (1..=DRAWS).map(at).collect()
    }

    /// What a plan is made for: the draws, and the corners of the ranges, so that no truth among them is left open. Corners of more than five
    /// parameters are too many.
    pub(super) fn planned_for(&self) -> Vec<Vec<f64>> {
        let p = self.ranges.len();
        let corner = |bits: u32| {
            let of = |(k, range): (usize, &Range)| if bits >> k & 1 == 0 { range.low } else { range.high };
            self.ranges.iter().enumerate().map(of).collect()
        };
        let corners = if p <= 5 { 1 << p } else { 0 };
        self.draws().into_iter().chain((0..corners).map(corner)).collect()
    }
}

/// The digits of `k` in this base, mirrored at the point.
fn radical_inverse(mut k: u32, base: u32) -> f64 {
    let (mut sum, mut digit) = (0.0, 1.0 / f64::from(base));
    while k > 0 {
        sum += digit * f64::from(k % base);
        digit /= f64::from(base);
        k /= base;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_prior_has_every_parameter_and_lobes_of_a_kind_share_the_exponents() {
        let prior = |model: &str| Prior::usual(&model.parse().expect("a model"));
        assert_eq!(prior("lambert").expect("space").names(), ["lambert.weight"]);
        let two = prior("lambert+phong+phong").expect("space");
        let names = ["lambert.weight", "phong.weight", "phong.exponent", "phong[1].weight", "phong[1].exponent"];
        assert_eq!(two.names(), names);
        assert!((two.ranges()[2].high / 100.0 - 1.0).abs() < 1e-12 && two.ranges()[2].high == two.ranges()[4].low);
        assert!(matches!(prior("phong2d"), Err(Wrong::Flat(_))));
        for draw in two.draws() {
            assert!(draw.iter().zip(two.ranges()).all(|(x, r)| (r.low..=r.high).contains(x)), "{draw:?}");
        }
    }

    #[test]
    fn ranges_are_replaced_by_name_and_wrong_ones_refused() {
        let usual = || Prior::usual(&"lambert+phong".parse().expect("a model")).expect("space");
        let range = |name: &str, low: f64, high: f64| Range { name: name.into(), low, high };
        let set = usual().with(range("phong.exponent", 50.0, 60.0)).expect("a range");
        assert_eq!((set.ranges()[2].low, set.sharpest()), (50.0, 60.0));
        for wrong in [
            range("phong[1].exponent", 1.0, 2.0),
            range("phong.exponent", 0.0, 2.0),
            range("phong.exponent", 1.0, 1e9),
            range("phong.weight", 1.0, f64::INFINITY),
        ] {
            let error = usual().with(wrong.clone()).expect_err(&wrong.name).to_string();
            assert!(error.contains(&wrong.name), "{error}");
        }
    }

    /// A Halton sequence is even: the mean of 48 points lies within its discrepancy of the middle.
    #[test]
    fn draws_fill_their_ranges() {
        for base in PRIMES {
            let mean = (1..=DRAWS).map(|k| radical_inverse(k, base)).sum::<f64>() / f64::from(DRAWS);
            // Of N points in base b the discrepancy is below b log_b(bN)/N.
            let bound = f64::from(base) * (1.0 + f64::from(DRAWS).ln() / f64::from(base).ln()) / f64::from(DRAWS);
            assert!((mean - 0.5).abs() < bound, "{base}: {mean}");
        }
    }
}
