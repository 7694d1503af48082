//! The uncertainty budget: component, standard uncertainty, and how it is known.

/// How a component is evaluated (GUM).
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub enum Type {
    /// By the scatter of readings.
    A,
    /// By other knowledge: certificates, specifications.
    B,
    /// Of both kinds: all together.
    #[serde(rename = "A+B")]
    Both,
}

impl Type {
    /// A or B.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::A => "A",
            Self::B => "B",
            Self::Both => "A+B",
        }
    }
}

/// A component over the whole scan.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Line {
    /// What it is.
    pub name: &'static str,
    /// How it is known.
    #[serde(rename = "type")]
    pub kind: Type,
    /// Standard uncertainty of what a reading depends on, in `unit`: as described (type B), or root of the mean square over all readings (type A). None of
    /// all together.
    pub u: Option<f64>,
    /// Its unit; rates are signals a second, walks their standard deviation after an hour. Empty where it is relative.
    pub unit: &'static str,
    /// Sensitivity coefficient, 1/sr by `unit`: `rms` over `u` (type B), or root of the mean square of a reading's (type A, where σ and it differ from
    /// reading to reading).
    pub sensitivity: Option<f64>,
    /// Standard uncertainty that it brings to a reading, root of the mean square over all valid readings, 1/sr.
    pub rms: f64,
    /// The same relative to each reading, median over the readings.
    pub relative: f64,
}

/// All components, summed up and reading by reading.
#[derive(Debug, Clone, PartialEq)]
pub struct Budget {
    /// Components that there are, and all together.
    pub lines: Vec<Line>,
    /// Each component's variance in every reading, channel-major, in the order of `lines`, without the last.
    variances: Vec<Vec<f64>>,
}

impl Budget {
    /// From components, each with its variance in every reading.
    pub(super) fn new(parts: Vec<(Input, Vec<f64>)>, values: &[f64]) -> Self {
        let parts: Vec<_> = parts.into_iter().filter(|(_, v)| v.iter().any(|v| *v > 0.0)).collect();
        let total: Vec<f64> = (0..values.len()).map(|i| parts.iter().map(|(_, v)| v[i]).sum()).collect();
        let mut lines: Vec<Line> = parts.iter().map(|(input, v)| line(*input, v, values)).collect();
        let all = Input { name: "all together", kind: Type::Both, u: None, unit: "", sensitivity: None };
        lines.push(line(all, &total, values));
        Self { lines, variances: parts.into_iter().map(|(_, v)| v).collect() }
    }

    /// Standard uncertainty that component `line` brings to reading `place` (channel-major).
    #[must_use]
    pub fn contribution(&self, line: usize, place: usize) -> f64 {
        self.variances[line][place].sqrt()
    }
}

/// What readings depend on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Input {
    pub name: &'static str,
    pub kind: Type,
    pub u: Option<f64>,
    pub unit: &'static str,
    /// Where it is not one over `u`.
    pub sensitivity: Option<f64>,
}

fn line(Input { name, kind, u, unit, sensitivity }: Input, variances: &[f64], values: &[f64]) -> Line {
    let valid = || values.iter().zip(variances).filter(|(v, _)| v.is_finite());
    let count = valid().count().max(1) as f64;
    let rms = (valid().map(|(_, u)| u).sum::<f64>() / count).sqrt();
    let mut shares: Vec<f64> = valid().filter(|(v, _)| **v != 0.0).map(|(v, u)| u.sqrt() / v.abs()).collect();
    shares.sort_by(f64::total_cmp);
    let relative = shares.get(shares.len() / 2).copied().unwrap_or(0.0);
    Line { name, kind, u, unit, sensitivity: sensitivity.or(u.map(|u| rms / u)), rms, relative }
}
