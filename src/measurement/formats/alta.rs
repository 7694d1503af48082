//! ALTA text (Belcour, Barla, Pacanowski 2013). Header lines are `#` and a keyword, other `#` lines comments; a row holds the
//! coordinates of `#PARAM_IN`, the values of `#PARAM_OUT`, and the intervals that `#VS` announces. Angles are in radians.
//!
//! - `#DIM nx ny`: coordinates and values in a row.
//! - `#PARAM_IN`: see [`ParamIn`]; Δφ = φo − φi, so Δφ = 0 is the retro side; a negative θ means θ > 0 at φ + 180°.
//! - `#PARAM_OUT`: `INV_STERADIAN` (BRDF), `INV_STERADIAN_COSINE_FACTOR` (BRDF·cosθo), `RGB_COLOR`, `XYZ_COLOR` (BRDF in three channels). Where it is
//!   missing or `UNKNOWN_OUTPUT` the values are taken for a BRDF, and a note says so.
//! - `#VS v`: 1 adds the half-width of an interval round the value, 2 its lower and upper end, for the first value or for
//!   each. ALTA uses them as hard bounds that a fit must pass between; they are no standard deviations, so they are checked
//!   to be numbers, left out, and a note says so.

use glam::DVec3;

use super::limits::{AZIMUTH_RAD, Limit, POLAR_RAD};
use super::rows::Rows;
use super::source::Source;
use super::text::{Line, Lines, quoted};
use super::{Quantity, ReadOptions};
use crate::geometry::{HalfDiff, direction};
use crate::measurement::{Measurement, MeasurementError};

/// How a row's coordinates give the directions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ParamIn {
    /// θi, then θo·cosΔφ and θo·sinΔφ.
    TlTvProjDphi,
    /// θo, θi, Δφ.
    TvTlDphi,
    /// Cosine of the half angle alone: θd = 0, so wi = wo.
    CosTh,
    /// θh, θd, φd of the outgoing direction about the half vector.
    ThTdPd,
    /// θi, φi, θo, φo.
    Spherical,
    /// wo, then wi, three components each.
    Cartesian,
}

impl ParamIn {
    /// Name in the file and number of coordinates.
    const ALL: [(Self, &'static str, usize); 6] = [
        (Self::TlTvProjDphi, "ISOTROPIC_TL_TV_PROJ_DPHI", 3),
        (Self::TvTlDphi, "ISOTROPIC_TV_TL_DPHI", 3),
        (Self::CosTh, "COS_TH", 1),
        (Self::ThTdPd, "RUSIN_TH_TD_PD", 3),
        (Self::Spherical, "SPHERICAL_TL_PL_TV_PV", 4),
        (Self::Cartesian, "CARTESIAN", 6),
    ];

    /// Ranges of the coordinates that are angles, which come first in every row.
    fn limits(self) -> &'static [Limit] {
        match self {
            Self::TlTvProjDphi => &[POLAR_RAD, POLAR_RAD, POLAR_RAD],
            Self::TvTlDphi | Self::ThTdPd => &[POLAR_RAD, POLAR_RAD, AZIMUTH_RAD],
            Self::Spherical => &[POLAR_RAD, AZIMUTH_RAD, POLAR_RAD, AZIMUTH_RAD],
            Self::CosTh | Self::Cartesian => &[],
        }
    }

    /// (wi, wo) at coordinates `x`; `None` where there is no such direction.
    fn pair(self, x: &[f64]) -> Option<(DVec3, DVec3)> {
        match (self, x) {
            (Self::TlTvProjDphi, &[theta_i, x, y]) => {
                Some((direction(theta_i, 0.0), direction(x.hypot(y), y.atan2(x))))
            }
            (Self::TvTlDphi, &[theta_o, theta_i, dphi]) => Some((direction(theta_i, 0.0), direction(theta_o, dphi))),
            (Self::CosTh, &[cos_h]) => {
                let sin_h = ((1.0 - cos_h) * (1.0 + cos_h)).sqrt();
                (cos_h.abs() <= 1.0).then(|| (DVec3::new(sin_h, 0.0, cos_h), DVec3::new(sin_h, 0.0, cos_h)))
            }
            (Self::ThTdPd, &[theta_h, theta_d, phi_d]) => {
                let (wo, wi) = HalfDiff { theta_h, theta_d, phi_d }.to_pair();
                Some((wi, wo))
            }
            (Self::Spherical, &[theta_i, phi_i, theta_o, phi_o]) => {
                Some((direction(theta_i, phi_i), direction(theta_o, phi_o)))
            }
            (Self::Cartesian, &[ox, oy, oz, ix, iy, iz]) => {
                Some((unit(DVec3::new(ix, iy, iz))?, unit(DVec3::new(ox, oy, oz))?))
            }
            _ => None,
        }
    }
}

/// `v` normalised, if it is a unit vector but for the digits of a file.
fn unit(v: DVec3) -> Option<DVec3> {
    ((v.length() - 1.0).abs() < 1e-4).then(|| v.normalize())
}

/// What the header says.
#[derive(Debug, Default)]
struct Header {
    dim: Option<(usize, usize)>,
    param_in: Option<ParamIn>,
    param_out: Option<String>,
    intervals: Vec<usize>,
}

/// What the values are.
struct Output {
    channels: Vec<String>,
    quantity: Quantity,
    note: Option<String>,
}

/// Reads an ALTA text file.
pub(super) fn read(source: &Source, options: &ReadOptions) -> Result<Measurement, MeasurementError> {
    let mut lines = Lines::new(source)?;
    let mut header = Header::default();
    let mut body: Option<Body> = None;
    while let Some(line) = lines.next_filled()? {
        match (line.text.trim_start().strip_prefix('#'), &mut body) {
            (Some(comment), None) => header.take(line, comment)?,
            (Some(_), Some(_)) => {}
            (None, Some(body)) => body.row(line)?,
            (None, none) => none.insert(Body::new(line, &header, options)?).row(line)?,
        }
    }
    let Some(body) = body else { return Err(lines.ends_too_early("a row of data")) };
    let mut measurement = body.finish(source.name());
    measurement.notes.extend(lines.cut_note());
    Ok(measurement)
}

impl Header {
    /// Takes in what follows the `#` of one line; anything unknown is a comment.
    fn take(&mut self, line: Line<'_>, comment: &str) -> Result<(), MeasurementError> {
        let mut words = comment.split_whitespace();
        if comment.starts_with(char::is_whitespace) {
            return Ok(());
        }
        match words.next() {
            Some("DIM") => {
                let counts: Vec<usize> = words.map(|w| count(line, "#DIM", w)).collect::<Result<_, _>>()?;
                let &[nx, ny] = counts.as_slice() else {
                    return Err(line.invalid("#DIM", "two numbers", quoted(comment)));
                };
                self.dim = Some((nx, ny));
            }
            Some("PARAM_IN") => self.param_in = Some(param_in(line, words.next().unwrap_or_default())?),
            Some("PARAM_OUT") => self.param_out = words.next().map(str::to_string),
            Some("VS") => self.intervals = words.map(|w| count(line, "#VS", w)).collect::<Result<_, _>>()?,
            Some("FORMAT") if words.next() == Some("binary") => {
                return Err(line.unsupported("ALTA's binary form is not read, only its text"));
            }
            _ => {}
        }
        Ok(())
    }

    /// Channels, quantity and what must be told of them.
    fn output(&self, line: Line<'_>, ny: usize) -> Result<Output, MeasurementError> {
        let name = self.param_out.as_deref();
        let three = |names: [&str; 3]| names.map(String::from).to_vec();
        let plain = || match ny {
            1 => vec!["value".to_string()],
            _ => (1..=ny).map(|i| format!("value{i}")).collect(),
        };
        let (channels, quantity) = match name {
            Some("RGB_COLOR") => (three(["r", "g", "b"]), Quantity::Brdf),
            Some("XYZ_COLOR") => (three(["x", "y", "z"]), Quantity::Brdf),
            Some("INV_STERADIAN_COSINE_FACTOR") => (plain(), Quantity::BrdfCos),
            Some("INV_STERADIAN" | "UNKNOWN_OUTPUT") | None => (plain(), Quantity::Brdf),
            Some(other) => {
                return Err(line.unsupported(&format!(
                    "expected an output parameterisation that is a BRDF, found {}",
                    quoted(other)
                )));
            }
        };
        if channels.len() != ny {
            let expected = format!("{} values a row for {}", channels.len(), name.unwrap_or_default());
            return Err(line.invalid("#DIM", expected, ny.to_string()));
        }
        let unknown = matches!(name, None | Some("UNKNOWN_OUTPUT"));
        let note =
            unknown.then(|| "the file does not say what its values are (no #PARAM_OUT): read as BRDF".to_string());
        Ok(Output { channels, quantity, note })
    }
}

/// A small count.
fn count(line: Line<'_>, column: &str, word: &str) -> Result<usize, MeasurementError> {
    let parsed = word.parse().ok().filter(|n| *n <= 64);
    parsed.ok_or_else(|| line.invalid(column, "a whole number up to 64", quoted(word)))
}

fn param_in(line: Line<'_>, name: &str) -> Result<ParamIn, MeasurementError> {
    let known = ParamIn::ALL.iter().find(|(_, n, _)| *n == name).map(|(param, _, _)| *param);
    known.ok_or_else(|| {
        let names: Vec<&str> = ParamIn::ALL.iter().map(|(_, n, _)| *n).collect();
        let reason =
            format!("expected an input parameterisation that is read ({}), found {}", names.join(", "), quoted(name));
        line.unsupported(&reason)
    })
}

/// The rows under construction.
struct Body {
    param: ParamIn,
    nx: usize,
    channels: Vec<String>,
    /// Numbers of a row: with intervals there may be one set for all values, or one for each.
    widths: [usize; 2],
    rows: Rows,
    notes: Vec<String>,
}

impl Body {
    /// Checks the header once the first row is met.
    fn new(line: Line<'_>, header: &Header, options: &ReadOptions) -> Result<Self, MeasurementError> {
        let missing = |what: &str| line.invalid("", format!("{what} before the first row"), "a row");
        let param = header.param_in.ok_or_else(|| missing("#PARAM_IN"))?;
        let (_, name, nx) =
            ParamIn::ALL.into_iter().find(|(p, _, _)| *p == param).ok_or_else(|| missing("#PARAM_IN"))?;
        let (stated, ny) = header.dim.ok_or_else(|| missing("#DIM"))?;
        if stated != nx || ny == 0 {
            let expected = format!("{nx} coordinates for {name} and at least one value");
            return Err(line.invalid("#DIM", expected, format!("{stated} {ny}")));
        }
        let output = header.output(line, ny)?;
        let sum: usize = header.intervals.iter().sum();
        let each = if header.intervals.len() == 1 { sum * ny } else { sum };
        let mut notes: Vec<String> = output.note.into_iter().collect();
        if sum > 0 {
            notes.push("the file's intervals (#VS) are bounds, not standard deviations: left out".into());
        }
        let quantity = options.quantity.unwrap_or(output.quantity);
        let rows = Rows::new(ny, quantity);
        Ok(Self { param, nx, channels: output.channels, widths: [nx + ny + sum, nx + ny + each], rows, notes })
    }

    fn row(&mut self, line: Line<'_>) -> Result<(), MeasurementError> {
        let numbers = line.numbers()?;
        if !self.widths.contains(&numbers.len()) {
            let [a, b] = self.widths;
            let expected = if a == b { format!("{a} numbers") } else { format!("{a} or {b} numbers") };
            return Err(line.invalid("", expected, numbers.len().to_string()));
        }
        let (x, rest) = numbers.split_at(self.nx);
        if let Some(i) = x.iter().position(|c| !c.is_finite()) {
            return Err(line.invalid(&format!("column {}", i + 1), "a finite coordinate", "one that is not finite"));
        }
        for (i, (&angle, limit)) in x.iter().zip(self.param.limits()).enumerate() {
            limit.check(line, || format!("column {}", i + 1), angle)?;
        }
        if let (ParamIn::TlTvProjDphi, &[_, x, y]) = (self.param, x) {
            POLAR_RAD.check(line, || "columns 2 and 3, θo".into(), x.hypot(y))?;
        }
        let Some((wi, wo)) = self.param.pair(x) else {
            return Err(line.invalid("", "coordinates of a direction", format!("{x:?}")));
        };
        let divisor = self.rows.directions(wi, wo);
        for (channel, &stored) in rest.iter().take(self.channels.len()).enumerate() {
            self.rows
                .value(channel, divisor, Some(stored), || line.place(&format!("column {}", self.nx + channel + 1)));
        }
        Ok(())
    }

    fn finish(self, name: String) -> Measurement {
        let mut measurement = self.rows.finish(name, self.channels);
        measurement.notes.extend(self.notes);
        measurement
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{phi_of, theta_of};

    #[test]
    fn parameterisations_agree_on_one_pair() {
        // θi = 0.4, θo = 0.9, Δφ = 2.
        let (wi, wo) = (direction(0.4, 0.0), direction(0.9, 2.0));
        let half = HalfDiff::from_pair(wo, wi).expect("half");
        let same = |param: ParamIn, x: &[f64]| {
            let (a, b) = param.pair(x).expect("pair");
            let angles = (theta_of(a), theta_of(b), a.dot(b));
            assert!((angles.0 - 0.4).abs() < 1e-14 && (angles.1 - 0.9).abs() < 1e-14, "{param:?}: {angles:?}");
            assert!((angles.2 - wi.dot(wo)).abs() < 1e-14, "{param:?}");
        };
        same(ParamIn::TlTvProjDphi, &[0.4, 0.9 * 2f64.cos(), 0.9 * 2f64.sin()]);
        same(ParamIn::TvTlDphi, &[0.9, 0.4, 2.0]);
        same(ParamIn::ThTdPd, &[half.theta_h, half.theta_d, half.phi_d]);
        same(ParamIn::Spherical, &[0.4, 1.0, 0.9, 3.0]);
        same(ParamIn::Spherical, &[-0.4, 1.0 + std::f64::consts::PI, 0.9, 3.0]);
        same(ParamIn::Cartesian, &[wo.x, wo.y, wo.z, wi.x, wi.y, wi.z]);
    }

    #[test]
    fn azimuth_zero_is_the_retro_side() {
        let (wi, wo) = ParamIn::TlTvProjDphi.pair(&[0.5, 0.5, 0.0]).expect("pair");
        assert!((wi - wo).length() < 1e-15);
        let (wi, wo) = ParamIn::TlTvProjDphi.pair(&[0.5, -0.5, 0.0]).expect("pair");
        assert!((wo - crate::geometry::mirror(wi)).length() < 1e-15);
        let (wi, wo) = ParamIn::CosTh.pair(&[0.3]).expect("pair");
        assert!(wi == wo && (theta_of(wi).cos() - 0.3).abs() < 1e-15 && phi_of(wi) == 0.0);
        assert!(ParamIn::CosTh.pair(&[1.1]).is_none());
        assert!(ParamIn::Cartesian.pair(&[0.0, 0.0, 2.0, 0.0, 0.0, 1.0]).is_none());
    }
}
