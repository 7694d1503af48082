//! What scans are called: from text and back.

use std::fmt;
use std::str::FromStr;

use super::adaptive::{FIRST_PAIRS, MOST_PAIRS};
use super::scan::Scan;

/// Pairs of an adaptive scan, if nothing else is asked for: those of the first look and some fifty more for each incidence.
const PAIRS: u32 = 500;

/// Why a text is no scan.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ScanError {
    /// None of the known ones, or a step out of its range.
    #[error(
        "scan \"{text}\": expected in-plane[:STEP], adaptive[:N], hemisphere[:STEP], flat[:STEP] (STEP in degrees, 0.1 to 45), merl or list:FILE"
    )]
    Unknown {
        /// The text.
        text: String,
    },
    /// A number of pairs that no adaptive scan has.
    #[error(
        "scan \"{text}\": expected a number of pairs of directions from {FIRST_PAIRS}, which the first look alone takes, to {MOST_PAIRS}"
    )]
    Pairs {
        /// The text.
        text: String,
    },
}

impl FromStr for Scan {
    type Err = ScanError;

    fn from_str(text: &str) -> Result<Self, ScanError> {
        let wrong = || ScanError::Unknown { text: text.to_owned() };
        let (kind, number) = text.split_once(':').map_or((text, None), |(k, s)| (k, Some(s)));
        let step = |default: f64| match number {
            None => Ok(default),
            Some(s) => s.parse::<f64>().ok().filter(|v| (0.1..=45.0).contains(v)).ok_or_else(wrong),
        };
        match kind {
            "in-plane" => Ok(Self::InPlane { step_deg: step(1.0)? }),
            "adaptive" => Ok(Self::Adaptive { pairs: pairs(text, number)? }),
            "hemisphere" => Ok(Self::Hemisphere { step_deg: step(5.0)? }),
            "flat" => Ok(Self::Flat { step_deg: step(1.0)? }),
            "merl" if text == "merl" => Ok(Self::Merl),
            _ => Err(wrong()),
        }
    }
}

/// The number of pairs of an adaptive scan.
fn pairs(text: &str, number: Option<&str>) -> Result<u32, ScanError> {
    let possible = FIRST_PAIRS..=MOST_PAIRS;
    let wrong = || ScanError::Pairs { text: text.to_owned() };
    number.map_or(Ok(PAIRS), |s| s.parse().ok().filter(|n| possible.contains(n)).ok_or_else(wrong))
}

impl fmt::Display for Scan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InPlane { step_deg } => write!(f, "in-plane:{step_deg}"),
            Self::Adaptive { pairs } => write!(f, "adaptive:{pairs}"),
            Self::Hemisphere { step_deg } => write!(f, "hemisphere:{step_deg}"),
            Self::Flat { step_deg } => write!(f, "flat:{step_deg}"),
            Self::Merl => f.write_str("merl"),
            Self::List { name, .. } => write!(f, "list:{name}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back_and_wrong_ones_say_what_is_known() {
        for text in ["in-plane:2", "hemisphere:7.5", "merl", "flat:1", "adaptive:210", "adaptive:100000"] {
            assert_eq!(text.parse::<Scan>().expect(text).to_string(), text);
        }
        assert_eq!("adaptive".parse(), Ok(Scan::Adaptive { pairs: PAIRS }));
        for text in ["sphere", "merl:3", "hemisphere:0", "hemisphere:NaN", "in-plane:-1", "adaptively", ""] {
            assert!(text.parse::<Scan>().expect_err(text).to_string().contains("hemisphere[:STEP]"));
        }
        for text in ["adaptive:209", "adaptive:0", "adaptive:-500", "adaptive:5e2", "adaptive:", "adaptive:100001"] {
            let said = text.parse::<Scan>().expect_err(text).to_string();
            assert!(said.contains(text) && said.contains("from 210, which the first look alone takes"), "{said}");
        }
    }
}
