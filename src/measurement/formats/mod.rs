//! File formats, one file each. Content is sniffed; a name's extension only chooses what to write.
//!
//! In: a path (`-` is stdin) and [`ReadOptions`]. Out: a [`Measurement`], or a [`MeasurementError`] that names file, place, what was
//! expected and what was found. The one decision to know: a direction below the horizon is no error in a listed table;
//! its values are masked, and a note says how many and where the first stands. (A table on the MERL grid keeps them: the
//! format itself marks what is not measured.) On the horizon itself values are masked where a cosine would have to be
//! divided out, and in the flat world.

mod alta;
mod cells;
mod csv;
mod fred;
mod limits;
mod merl;
pub mod rgl;
mod rows;
mod sniff;
mod source;
mod text;
mod zemax;

use std::io::Write;
use std::path::Path;

pub(crate) use self::csv::{flat_deg, is_reserved, push_number, spherical_deg};
use self::source::Source;
use super::{Dimension, Directions, Measurement, MeasurementError, MerlAngles, Weights};

/// The formats that goniofit reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// MERL `.binary`.
    Merl,
    /// goniofit's CSV.
    Csv,
    /// ALTA text.
    Alta,
    /// RGL tensor file `.bsdf`.
    Rgl,
    /// Zemax `.bsdf` text.
    Zemax,
    /// FRED text.
    Fred,
}

impl Format {
    /// Every format.
    pub const ALL: [Self; 6] = [Self::Merl, Self::Csv, Self::Alta, Self::Rgl, Self::Zemax, Self::Fred];

    /// The name that options use.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Merl => "merl",
            Self::Csv => "csv",
            Self::Alta => "alta",
            Self::Rgl => "rgl",
            Self::Zemax => "zemax",
            Self::Fred => "fred",
        }
    }

    /// What it is, in words.
    #[must_use]
    pub fn description(self) -> &'static str {
        match self {
            Self::Merl => "MERL binary",
            Self::Csv => "CSV",
            Self::Alta => "ALTA text",
            Self::Rgl => "RGL tensor file",
            Self::Zemax => "Zemax BSDF text",
            Self::Fred => "FRED BSDF text",
        }
    }

    /// The format called `name` in options.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.name().eq_ignore_ascii_case(name))
    }

    /// The format that a file of this name is written in: `.binary`, `.csv`. `None` for an extension that belongs to no format,
    /// to one that is only read, or to several (`.bsdf`).
    #[must_use]
    pub fn from_extension(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?;
        match extension.to_ascii_lowercase().as_str() {
            "binary" => Some(Self::Merl),
            "csv" => Some(Self::Csv),
            _ => None,
        }
    }

    /// Whether [`write()`] writes it.
    #[must_use]
    pub fn is_written(self) -> bool {
        matches!(self, Self::Merl | Self::Csv)
    }
}

/// Whether a file's values are the BRDF or the BRDF times the cosine of the outgoing direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quantity {
    /// BRDF, 1/sr.
    #[default]
    Brdf,
    /// BRDF · cosθo, 1/sr.
    BrdfCos,
}

impl Quantity {
    /// The name that options and files use.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Brdf => "brdf",
            Self::BrdfCos => "brdf_cos",
        }
    }
}

/// How to read a file.
#[derive(Debug, Clone, Default)]
pub struct ReadOptions {
    /// Overrides what sniffing finds.
    pub format: Option<Format>,
    /// Overrides what the file says of its quantity. A MERL table is the BRDF and an RGL file BRDF·cosθo by definition: the other
    /// one is refused for them.
    pub quantity: Option<Quantity>,
    /// Where in its bin a MERL entry is read; the centre where this is not set. Set, it is refused for other formats.
    pub merl_angles: Option<MerlAngles>,
}

/// What a written file could not hold; all zero when nothing was lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct WriteReport {
    /// Valid negative values (noise), written as not measured.
    pub lost_negative: u64,
    /// σ values left out.
    pub lost_sigma: u64,
    /// Shared error components left out.
    pub lost_common: u64,
}

/// Reads a measurement; the path `-` is stdin.
///
/// # Errors
/// [`MeasurementError`] naming file, place, what was expected and what was found.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Measurement, MeasurementError> {
    read_source(&Source::open(path)?, options)
}

/// Reads a measurement from `bytes`; messages call it `path`.
///
/// # Errors
/// As [`read`].
pub fn read_bytes(path: &Path, bytes: Vec<u8>, options: &ReadOptions) -> Result<Measurement, MeasurementError> {
    read_source(&Source::from_bytes(path, bytes), options)
}

/// Reads what a scan needs: the directions of a measurement, or of a CSV file that holds no values, with their weights. Directions
/// below the horizon are kept. The path `-` is stdin.
///
/// # Errors
/// As [`read`].
pub fn read_directions(
    path: &Path,
    options: &ReadOptions,
) -> Result<(Directions, Weights, Dimension), MeasurementError> {
    let source = Source::open(path)?;
    let table = match format_of(&source, options)? {
        Format::Csv => csv::read_directions(&source, options),
        _ => read_source(&source, options),
    }?;
    Ok((table.directions, table.weights, table.dimension))
}

/// The bytes of an input that can be read only once (`-` is stdin, a pipe), at most 1 GiB: whoever looks at its beginning before
/// choosing a reader hands them on to [`read_bytes`]. `None` for a regular file, which is better read in place.
///
/// # Errors
/// As [`read`], for what can't be opened, a directory, and a stream of more than 1 GiB.
pub fn read_stream(path: &Path) -> Result<Option<Vec<u8>>, MeasurementError> {
    Source::open(path).map(Source::into_stream)
}

fn format_of(source: &Source, options: &ReadOptions) -> Result<Format, MeasurementError> {
    options.format.map_or_else(|| sniff::sniff(source), Ok)
}

fn read_source(source: &Source, options: &ReadOptions) -> Result<Measurement, MeasurementError> {
    let format = format_of(source, options)?;
    if options.merl_angles.is_some() && format != Format::Merl {
        let reason = format!(
            "only a MERL table has bins to read; read this one ({}) without --merl-angles",
            format.description()
        );
        return Err(MeasurementError::unsupported(source.path(), reason));
    }
    let mut measurement = match format {
        Format::Merl => merl::read(source, options),
        Format::Csv => csv::read(source, options),
        Format::Alta => alta::read(source, options),
        Format::Zemax => zemax::read(source, options),
        Format::Fred => fred::read(source, options),
        Format::Rgl => rgl::read(source.path(), &source.whole()?, options),
    }?;
    measurement.origin = format.description().into();
    Ok(measurement)
}

/// Writes `measurement` to `out` as MERL or CSV and reports what the format could not hold. `path` is what messages call the
/// output; putting the file in place as a whole is up to the caller.
///
/// # Errors
/// [`MeasurementError::Unsupported`] for a format that is only read, or that can't hold this table (with what would work instead);
/// [`MeasurementError::Io`] when `out` refuses.
pub fn write(
    measurement: &Measurement,
    format: Format,
    path: &Path,
    out: &mut dyn Write,
) -> Result<WriteReport, MeasurementError> {
    match format {
        Format::Merl => merl::write(measurement, path, out),
        Format::Csv => csv::write(measurement, path, out).map(|()| WriteReport::default()),
        Format::Alta | Format::Rgl | Format::Zemax | Format::Fred => {
            let reason = format!("{} is read, not written; choose csv or merl", format.description());
            Err(MeasurementError::unsupported(path, reason))
        }
    }
}

/// Says before there is a table whether a file of this format holds channels of these names, as [`write()`] does of a table.
///
/// # Errors
/// [`MeasurementError::Unsupported`] naming the channel.
pub fn check_channels(channels: &[String], format: Format, path: &Path) -> Result<(), MeasurementError> {
    match format {
        Format::Merl => merl::check_channels(channels, path),
        Format::Csv => csv::check_channels(channels, path),
        Format::Alta | Format::Rgl | Format::Zemax | Format::Fred => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_extensions_find_their_formats() {
        for format in Format::ALL {
            assert_eq!(Format::from_name(format.name()), Some(format));
            assert_eq!(Format::from_name(&format.name().to_uppercase()), Some(format));
        }
        assert_eq!(Format::from_extension(Path::new("a/b.BINARY")), Some(Format::Merl));
        assert_eq!(Format::from_extension(Path::new("b.csv")), Some(Format::Csv));
        for none in ["b.bsdf", "b", "-", "b.xyz", "binary"] {
            assert_eq!(Format::from_extension(Path::new(none)), None, "{none}");
        }
    }
}
