//! Parameters by name, and the ranges that a user allows them: `phong.exponent=50`, `phong[1].exponent=1..1e4`,
//! `lambert.weight[g]=0..0.5`.

use std::fmt;
use std::str::FromStr;

use super::options::FitError;
use crate::brdf::{LobeKind, ModelSpec};

/// A parameter of a model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ParameterName {
    /// The lobe's kind; a flat lobe's twin in space means it too.
    pub kind: LobeKind,
    /// Which of the model's lobes of that kind, from 0.
    pub occurrence: usize,
    /// Which of its parameters.
    pub field: Field,
}

/// A parameter of a lobe.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Field {
    /// The weight, of one channel or of all.
    Weight(Option<String>),
    /// A shape parameter.
    Shape(String),
}

/// A range that a parameter must stay in, ends included; of one point where it is fixed.
#[derive(Debug, Clone, PartialEq)]
pub struct Limit {
    /// Which parameter.
    pub parameter: ParameterName,
    /// Least value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
}

impl Limit {
    /// Reads `NAME=VALUE`.
    ///
    /// # Errors
    /// What is wrong with the text.
    pub fn fixed(text: &str) -> Result<Self, String> {
        let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE, phong.exponent=50 say")?;
        let value = finite(value)?;
        Ok(Self { parameter: name.parse()?, low: value, high: value })
    }

    /// Reads `NAME=LOW..HIGH`; either end may be left out.
    ///
    /// # Errors
    /// What is wrong with the text.
    pub fn range(text: &str) -> Result<Self, String> {
        let expected = "expected NAME=LOW..HIGH, phong.exponent=1..1e4 say";
        let (name, range) = text.split_once('=').ok_or(expected)?;
        let (low, high) = range.split_once("..").ok_or(expected)?;
        let low = if low.trim().is_empty() { 0.0 } else { finite(low)? };
        let high = if high.trim().is_empty() { f64::INFINITY } else { number(high)? };
        if low > high {
            return Err(format!("the range {} is empty", span(low, high)));
        }
        Ok(Self { parameter: name.parse()?, low, high })
    }

    /// The first two of these that limit one parameter: only one of them could hold. `lambert.weight` is about `lambert.weight[r]` too.
    #[must_use]
    pub fn doubled(limits: &[Self]) -> Option<(usize, usize)> {
        let earlier = |j: usize| limits[..j].iter().position(|l| l.parameter.overlaps(&limits[j].parameter));
        (0..limits.len()).find_map(|j| earlier(j).map(|i| (i, j)))
    }

    fn is_fixed(&self) -> bool {
        self.low == self.high
    }

    /// Its values as they are typed.
    fn values(&self) -> String {
        if self.is_fixed() { short(self.low) } else { span(self.low, self.high) }
    }

    /// What of it lies in the range `searched` for a shape; a fixed value may lie below that, at n = 0 say. What is wrong where nothing
    /// does.
    fn of_shape(&self, searched: (f64, f64)) -> Result<(f64, f64), String> {
        let (low, high) = searched;
        if self.is_fixed() {
            let value = self.low.max(TINY_SHAPE);
            return if value <= high {
                Ok((value, value))
            } else {
                Err(format!("a value up to {}, where the range that is searched ends", short(high)))
            };
        }
        if self.low > high || self.high < low {
            return Err(format!("a range that meets {}, which is what is searched", span(low, high)));
        }
        Ok((self.low.max(low), self.high.min(high)))
    }
}

/// Shortly, and exactly: by powers of ten where that is shorter.
fn short(x: f64) -> String {
    if x == 0.0 || (1e-4..1e6).contains(&x) { x.to_string() } else { format!("{x:e}") }
}

/// `LOW..HIGH`, without an end that is none.
fn span(low: f64, high: f64) -> String {
    format!("{}..{}", short(low), if high == f64::INFINITY { String::new() } else { short(high) })
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.parameter, self.values())
    }
}

fn number(text: &str) -> Result<f64, String> {
    let value: f64 = text.trim().parse().map_err(|_| format!("\"{}\" is not a number", text.trim()))?;
    if value >= 0.0 { Ok(value) } else { Err(format!("{value} is not a number ≥ 0")) }
}

fn finite(text: &str) -> Result<f64, String> {
    number(text).and_then(|value| if value.is_finite() { Ok(value) } else { Err(format!("{value} is not finite")) })
}

impl FromStr for ParameterName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        let (lobe, field) =
            text.split_once('.').ok_or_else(|| format!("\"{text}\" is no parameter: expected LOBE.NAME"))?;
        let (name, occurrence) = bracketed(lobe)?;
        let occurrence = match occurrence {
            None => 0,
            Some(index) => index.parse().map_err(|_| format!("\"{index}\" does not count lobes"))?,
        };
        let kind = LobeKind::from_name(name).ok_or_else(|| {
            format!("no lobe is called \"{name}\"; known are {}", LobeKind::ALL.map(LobeKind::name).join(", "))
        })?;
        let (name, channel) = bracketed(field)?;
        let known = kind.lobe().parameters().iter().any(|p| p.name == name);
        let field = match (name, channel) {
            ("weight", channel) => Field::Weight(channel.map(str::to_owned)),
            (name, None) if known => Field::Shape(name.to_owned()),
            _ => return Err(format!("{} has no parameter \"{field}\"", kind.name())),
        };
        Ok(Self { kind, occurrence, field })
    }
}

/// `name[index]` → (name, index).
fn bracketed(text: &str) -> Result<(&str, Option<&str>), String> {
    match text.split_once('[') {
        None => Ok((text, None)),
        Some((name, rest)) => match rest.strip_suffix(']') {
            Some(index) => Ok((name, Some(index))),
            None => Err(format!("\"{text}\" lacks its closing ]")),
        },
    }
}

impl ParameterName {
    /// Its lobe: `phong`, `phong[1]` for the second of the kind.
    fn lobe(&self) -> String {
        match self.occurrence {
            0 => self.kind.name().into(),
            k => format!("{}[{k}]", self.kind.name()),
        }
    }

    /// Whether some parameter goes by both names; a lobe and its flat twin are one.
    fn overlaps(&self, other: &Self) -> bool {
        let lobe = |name: &Self| (name.kind.flat_twin(), name.occurrence);
        let same = match (&self.field, &other.field) {
            (Field::Weight(Some(a)), Field::Weight(Some(b))) | (Field::Shape(a), Field::Shape(b)) => a == b,
            (Field::Weight(_), Field::Weight(_)) => true,
            _ => false,
        };
        same && lobe(self) == lobe(other)
    }
}

impl fmt::Display for ParameterName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.lobe())?;
        match &self.field {
            Field::Weight(None) => write!(f, ".weight"),
            Field::Weight(Some(channel)) => write!(f, ".weight[{channel}]"),
            Field::Shape(name) => write!(f, ".{name}"),
        }
    }
}

/// The ranges of all parameters of a model: of every weight, `[channel][lobe]`, and of every shape, lobe by lobe.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ranges {
    pub weights: Vec<Vec<(f64, f64)>>,
    pub shapes: Vec<(f64, f64)>,
    /// Whether somebody set a limit of a lobe of this kind: such lobes keep their places.
    pub limited: Vec<LobeKind>,
}

impl Ranges {
    /// The models' own ranges cut by the limits.
    pub fn new(model: &ModelSpec, channels: &[String], limits: &[Limit]) -> Result<Self, FitError> {
        let lobes = model.lobes();
        let mut ranges = Self {
            weights: vec![vec![(0.0, f64::INFINITY); lobes.len()]; channels.len()],
            shapes: lobes.iter().flat_map(|k| k.lobe().parameters()).map(|p| p.bounds).collect(),
            limited: Vec::new(),
        };
        for limit in limits {
            ranges.apply(model, channels, limit)?;
        }
        Ok(ranges)
    }

    fn apply(&mut self, model: &ModelSpec, channels: &[String], limit: &Limit) -> Result<(), FitError> {
        let name = &limit.parameter;
        let wrong = |expected, found| FitError::Limit { name: name.to_string(), expected, found };
        let kind = if model.is_flat() { name.kind.flat_twin() } else { name.kind };
        let mut of_kind = model.lobes().iter().enumerate().filter(|(_, k)| **k == kind);
        let (lobe, _) =
            of_kind.nth(name.occurrence).ok_or_else(|| wrong(format!("a lobe of the model {model}"), name.lobe()))?;
        self.limited.push(kind);
        match &name.field {
            Field::Weight(channel) => {
                let chosen: Vec<usize> =
                    (0..channels.len()).filter(|&c| channel.as_ref().is_none_or(|n| *n == channels[c])).collect();
                if chosen.is_empty() {
                    let found = channel.clone().unwrap_or_default();
                    return Err(wrong(format!("a channel of {}", channels.join(", ")), found));
                }
                for c in chosen {
                    self.weights[c][lobe] = (limit.low, limit.high);
                }
            }
            Field::Shape(shape) => {
                let before: usize = model.lobes()[..lobe].iter().map(|k| k.lobe().parameters().len()).sum();
                let parameters = kind.lobe().parameters();
                let own = parameters.iter().position(|p| p.name == shape).unwrap_or(0);
                let met = limit.of_shape(parameters[own].bounds);
                self.shapes[before + own] = met.map_err(|expected| wrong(expected, limit.values()))?;
            }
        }
        Ok(())
    }

    /// Bounds of t = ln(shape).
    pub fn ln_shapes(&self) -> Vec<(f64, f64)> {
        self.shapes.iter().map(|(low, high)| (low.ln(), high.ln())).collect()
    }
}

/// Stands for a shape of 0 on the logarithmic scale.
pub(super) const TINY_SHAPE: f64 = 1e-300;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_ranges_read_back_and_wrong_ones_say_why() {
        for name in ["phong.exponent", "phong[1].exponent", "lambert.weight", "lambert.weight[g]"] {
            assert_eq!(name.parse::<ParameterName>().expect(name).to_string(), name);
        }
        let limit = Limit::range("phong.exponent=1..1e4").expect("a range");
        assert_eq!((limit.low, limit.high), (1.0, 1e4));
        assert_eq!(Limit::range("phong.exponent=..7").expect("a range").low, 0.0);
        assert_eq!(Limit::range("phong.exponent=7..").expect("a range").high, f64::INFINITY);
        assert_eq!(Limit::fixed("phong.exponent=50").expect("a value").high, 50.0);
        for (text, says) in [
            ("phong.exponent", "NAME=VALUE"),
            ("ward.exponent=1", "ward"),
            ("phong.roughness=1", "roughness"),
            ("phong[x].exponent=1", "count"),
            ("phong[1.exponent=1", "]"),
            ("phong.exponent=sharp", "sharp"),
            ("phong.exponent=-1", "-1"),
            ("lambert.exponent=1", "exponent"),
        ] {
            let error = Limit::fixed(text).expect_err(text);
            assert!(error.contains(says), "{text}: {error}");
        }
        assert!(Limit::range("phong.exponent=5..1").expect_err("empty").contains("empty"));
        assert!(Limit::range("phong.exponent=5").is_err());
    }

    #[test]
    fn limits_are_written_as_they_are_typed() {
        for text in
            ["phong.exponent=1..1e8", "phong.exponent=1..", "lambert.weight=0..1e-150", "phong[1].exponent=0..7"]
        {
            assert_eq!(Limit::range(text).expect(text).to_string(), text);
        }
        assert_eq!(Limit::fixed("lambert.weight=1e150").expect("a value").to_string(), "lambert.weight=1e150");
        assert!(Limit::fixed("phong.exponent=inf").is_err() && Limit::range("phong.exponent=inf..").is_err());
    }

    #[test]
    fn two_limits_of_one_parameter_are_found() {
        let limits =
            |texts: &[&str]| -> Vec<Limit> { texts.iter().map(|t| Limit::fixed(t).expect("a value")).collect() };
        for (texts, want) in [
            (&["phong.exponent=1", "lambert.weight=1", "phong.exponent=1"][..], Some((0, 2))),
            (&["lambert.weight[r]=1", "lambert.weight=1"], Some((0, 1))),
            (&["phong.exponent=1", "phong2d.exponent=2"], Some((0, 1))),
            (&["lambert.weight[r]=1", "lambert.weight[g]=1", "phong.weight=1", "phong[1].weight=1"], None),
        ] {
            assert_eq!(Limit::doubled(&limits(texts)), want, "{texts:?}");
        }
    }

    #[test]
    fn limits_find_their_parameter_or_say_that_there_is_none() {
        let channels = ["r".to_owned(), "g".to_owned()];
        let ranges = |model: &str, limits: &[&str]| {
            let limits: Vec<Limit> = limits.iter().map(|l| Limit::range(l).expect("a range")).collect();
            Ranges::new(&model.parse().expect("a model"), &channels, &limits)
        };
        let got =
            ranges("lambert+phong+phong", &["phong[1].exponent=1..1e4", "lambert.weight[g]=0..0.5"]).expect("fine");
        assert_eq!(got.shapes, [(0.01, 1e8), (1.0, 1e4)]);
        assert_eq!(got.weights[1][0], (0.0, 0.5));
        assert_eq!(got.weights[0][0], (0.0, f64::INFINITY));
        assert_eq!(ranges("lambert2d+phong2d", &["phong.exponent=2..3"]).expect("the twin").shapes, [(2.0, 3.0)]);
        for (model, limit, says) in [
            ("lambert", "phong.exponent=1..2", "model lambert"),
            ("lambert+phong", "phong[1].exponent=1..2", "phong[1].exponent"),
            (
                "lambert+phong",
                "phong.exponent=1e9..1e10",
                "meets 0.01..1e8, which is what is searched, found 1e9..1e10",
            ),
            ("lambert+phong", "phong.exponent=1e9..1e9", "up to 1e8, where the range that is searched ends, found 1e9"),
            ("lambert+phong", "phong.exponent=0..0.001", "found 0..0.001"),
            ("lambert+phong", "phong.weight[b]=0..1", "r, g"),
        ] {
            let error = ranges(model, &[limit]).expect_err(limit).to_string();
            assert!(error.contains(says), "{limit}: {error}");
        }
    }
}
