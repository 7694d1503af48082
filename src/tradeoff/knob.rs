//! The knobs: what of a command can be turned, and how that is typed.

use serde::Serialize;

/// What of a command is turned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Knob {
    /// Samples per pixel of a picture.
    Samples,
    /// Relative error that a picture may have: samples go where it is noisy.
    PictureTarget,
    /// Every how many-th entry of a table is fitted.
    Stride,
    /// One of every so many entries of a table is fitted, spread over it.
    Part,
    /// Share by which the rmse of a fit to a part of a table may be too large.
    ExcessTarget,
    /// Relative error that means over the instrument's cones may have.
    Quadrature,
    /// Order of the rules over cones and spot.
    Order,
    /// Effects of the instrument that are left out.
    Effects,
    /// Readings averaged at each pair of directions.
    Readings,
    /// How long the shutter is open, as a multiple of what the instrument says.
    Dwell,
    /// Step of the scan, degrees.
    Step,
    /// Step of the table that is rendered in the material's place, degrees.
    Resolution,
    /// How the time of the whole chain is shared out.
    Shares,
}

impl Knob {
    /// What its size counts, for an axis.
    #[must_use]
    pub fn axis(self) -> &'static str {
        match self {
            Self::Samples => "samples per pixel",
            Self::PictureTarget => "relative error asked for",
            Self::Stride | Self::Part => "directions fitted",
            Self::ExcessTarget => "rmse excess asked for",
            Self::Quadrature => "relative error of means over cones asked for",
            Self::Order => "order of the rules over cones and spot",
            Self::Effects => "effects left out",
            Self::Readings => "readings a pair of directions",
            Self::Dwell => "exposure, times the instrument's own",
            Self::Step => "pairs of directions",
            Self::Resolution => "step of the table, degrees",
            Self::Shares => "time in all",
        }
    }

    /// Whether a size between two that were measured can be asked for.
    #[must_use]
    pub fn is_dial(self) -> bool {
        matches!(self, Self::Samples | Self::Stride | Self::Part | Self::Readings | Self::Dwell)
    }

    /// The nearest size that can be asked for, not below `size` where `up` and not above it else; `whole` is all that there is.
    #[must_use]
    pub fn rounded(self, size: f64, up: bool, whole: f64) -> f64 {
        let round = |x: f64| if up { (x - 1e-9).ceil() } else { (x + 1e-9).floor() };
        match self {
            Self::Samples | Self::Readings => round(size).max(1.0),
            // More directions are a smaller stride.
            Self::Stride | Self::Part => {
                whole / if up { (whole / size + 1e-9).floor() } else { (whole / size - 1e-9).ceil() }.max(1.0)
            }
            Self::Dwell => significant(size, round),
            _ => size,
        }
    }

    /// The option for this size.
    #[must_use]
    pub fn typed(self, size: f64, whole: f64) -> String {
        match self {
            Self::Samples => format!("--samples {size:.0}"),
            Self::PictureTarget | Self::Quadrature => format!("--target-error {}", short(size)),
            Self::Stride => format!("--stride {:.0}", whole / size),
            Self::Part => format!("--part {:.0}", whole / size),
            Self::ExcessTarget => format!("--target-rmse-excess {}", short(size)),
            Self::Readings => format!("--readings {size:.0}"),
            Self::Dwell => format!("exposures × {}", short(size)),
            Self::Order => format!("order {size:.0}"),
            Self::Resolution => format!("--scan hemisphere:{size}"),
            Self::Effects | Self::Step | Self::Shares => String::new(),
        }
    }
}

/// A positive number of three digits, by `round` of the first three as a whole number.
fn significant(x: f64, round: impl Fn(f64) -> f64) -> f64 {
    let last = x.log10().floor() - 2.0;
    // Read as it will be typed, so that both are the same number.
    format!("{}e{last}", round(x / 10f64.powf(last))).parse().unwrap_or(x)
}

/// A number as one types it.
fn short(x: f64) -> String {
    if x < 1e-3 { format!("{x:e}") } else { x.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_rounded_to_the_side_that_was_asked_for() {
        assert_eq!(Knob::Samples.rounded(12.3, true, 0.0), 13.0);
        assert_eq!(Knob::Samples.rounded(12.3, false, 0.0), 12.0);
        assert_eq!(Knob::Samples.rounded(12.0, true, 0.0), 12.0);
        // An exposure is the number that is typed.
        for (size, down, up) in
            [(0.001_234, 0.001_23, 0.001_24), (2.0, 2.0, 2.0), (9.999, 9.99, 10.0), (123.4, 123.0, 124.0)]
        {
            assert_eq!([false, true].map(|is_up| Knob::Dwell.rounded(size, is_up, 0.0)), [down, up]);
            for x in [down, up] {
                let typed = Knob::Dwell.typed(x, 0.0);
                assert_eq!(typed.rsplit(' ').next().and_then(|t| t.parse().ok()), Some(x), "{typed}");
            }
        }
        // 1000 directions, 130 wanted: every seventh gives 142.9, every eighth 125.
        assert_eq!(Knob::Stride.typed(Knob::Stride.rounded(130.0, true, 1000.0), 1000.0), "--stride 7");
        assert_eq!(Knob::Stride.typed(Knob::Stride.rounded(130.0, false, 1000.0), 1000.0), "--stride 8");
        assert_eq!(Knob::Stride.typed(Knob::Stride.rounded(1000.0, true, 1000.0), 1000.0), "--stride 1");
    }
}
