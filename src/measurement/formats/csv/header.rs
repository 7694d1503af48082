//! The comments and the header line: what each column holds.

use std::collections::{BTreeMap, HashMap, HashSet};

use super::Needs;
use super::{ANGLES, FLAT_ANGLES, GRIDS, MASK_REASON, SOLID_ANGLE, is_reserved};
use crate::measurement::formats::Quantity;
use crate::measurement::formats::text::{Line, Lines, quoted};
use crate::measurement::{Dimension, MeasurementError, MerlAngles, STOPPED};

/// What the comments say.
#[derive(Debug, Default)]
pub(super) struct Comments {
    /// Where it is stated.
    pub(super) quantity: Option<Quantity>,
    pub(super) dimension: Dimension,
    pub(super) grid: Option<MerlAngles>,
    pub(super) solid_angle: bool,
    pub(super) notes: Vec<String>,
}

/// Where every quantity's column is.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Columns {
    /// All names, in the file's order.
    pub(super) names: Vec<String>,
    /// The angle columns, in the order of [`ANGLES`] (space) or [`FLAT_ANGLES`].
    pub(super) angles: Vec<usize>,
    pub(super) channels: Vec<usize>,
    /// Empty, or one for each channel.
    pub(super) sigma: Vec<usize>,
    /// For each shared component, one for each channel.
    pub(super) common: Vec<Vec<usize>>,
    /// Empty, or one for each channel.
    pub(super) row: Vec<usize>,
    pub(super) weight: Option<usize>,
    pub(super) reason: Option<usize>,
}

/// Reads the `#` lines and the header, which must hold what `needs` says.
pub(super) fn read(lines: &mut Lines<'_>, needs: Needs) -> Result<(Comments, Columns), MeasurementError> {
    let mut comments = Comments::default();
    while let Some(line) = lines.next_filled()? {
        if let Some(comment) = line.text.trim_start().strip_prefix('#') {
            comments.take(line, comment)?;
        } else {
            let columns = Columns::parse(line, comments.dimension, needs)?;
            return comments.check(line).map(|()| (comments, columns));
        }
    }
    Err(lines.ends_too_early("a header line of column names"))
}

impl Comments {
    /// Takes in what follows the `#` of one line; free text is passed over.
    fn take(&mut self, line: Line<'_>, comment: &str) -> Result<(), MeasurementError> {
        let Some((key, value)) = comment.split_once(':') else { return Ok(()) };
        let value = value.trim();
        match key.trim() {
            "quantity" => {
                let known = [Quantity::Brdf, Quantity::BrdfCos].into_iter().find(|q| q.name() == value);
                let unknown = || line.invalid("quantity", "brdf or brdf_cos", quoted(value));
                self.quantity = Some(known.ok_or_else(unknown)?);
            }
            "dimension" => {
                self.dimension = match value {
                    "2" => Dimension::Flat,
                    "3" => Dimension::Space,
                    _ => return Err(line.invalid("dimension", "2 or 3", quoted(value))),
                }
            }
            "grid" => {
                self.grid = GRIDS.iter().find(|(name, _)| *name == value).map(|(_, angles)| *angles);
                if self.grid.is_none() {
                    self.notes.push(format!("line {}: the grid {} is unknown: ignored", line.number, quoted(value)));
                }
            }
            "weights" => self.solid_angle = value == SOLID_ANGLE,
            "note" if value.starts_with(STOPPED) => self.notes.push(value.into()),
            _ => {}
        }
        Ok(())
    }

    fn check(&self, line: Line<'_>) -> Result<(), MeasurementError> {
        if self.grid.is_some() && self.dimension == Dimension::Flat {
            return Err(line.invalid("", "a MERL grid in space", "both a MERL grid and dimension 2"));
        }
        Ok(())
    }
}

impl Columns {
    /// Sorts the names of the header line.
    fn parse(line: Line<'_>, dimension: Dimension, needs: Needs) -> Result<Self, MeasurementError> {
        let names = split(line)?;
        refuse_doubles(line, &names)?;
        refuse_raw_readings(line, &names)?;
        let find = |name: &str| names.iter().position(|n| n == name);
        let required: &[&str] = if dimension == Dimension::Flat { &FLAT_ANGLES } else { &ANGLES };
        let angle = |name: &&str| find(name).ok_or_else(|| missing(line, name, dimension));
        let angles: Vec<usize> = required.iter().map(angle).collect::<Result<_, _>>()?;
        let extra = names
            .iter()
            .find(|n| (n.starts_with("theta_") || n.starts_with("phi_")) && !required.contains(&n.as_str()));
        if let Some(extra) = extra {
            let expected = format!("the angles {} and no others", required.join(", "));
            return Err(line.invalid("header", expected, quoted(extra)));
        }
        let channels: Vec<usize> = (0..names.len()).filter(|&i| !is_reserved(&names[i])).collect();
        if channels.is_empty() && needs == Needs::Values {
            let expected = "a column of values besides the angles, under the channel's name";
            return Err(line.invalid("header", expected, quoted(line.text)));
        }
        let of_channels = OfChannels::new(line, &names, &channels);
        let sigma = of_channels.columns("sigma_", &with_prefix(&names, "sigma_"))?;
        let common = shared_components(&of_channels, &names)?;
        let row = of_channels.columns("row_", &with_prefix(&names, "row_"))?;
        if let (Some(&first), true) = (row.first(), sigma.is_empty()) {
            let expected = "sigma_… beside row_…, which is the part of it that the channels of a row share";
            return Err(line.invalid("header", expected, quoted(&names[first])));
        }
        let (weight, reason) = (find("weight"), find(MASK_REASON));
        Ok(Self { names, angles, channels, sigma, common, row, weight, reason })
    }

    /// Names of the channels.
    pub(super) fn channel_names(&self) -> Vec<String> {
        self.channels.iter().filter_map(|&i| self.names.get(i).cloned()).collect()
    }

    /// "column `r`", for messages.
    pub(super) fn label(&self, column: usize) -> String {
        format!("column {}", self.names.get(column).map_or("?", String::as_str))
    }
}

/// The cells of the header line; names may stand in quotes.
fn split(line: Line<'_>) -> Result<Vec<String>, MeasurementError> {
    let mut reader =
        ::csv::ReaderBuilder::new().has_headers(false).trim(::csv::Trim::All).from_reader(line.text.as_bytes());
    let mut record = ::csv::StringRecord::new();
    let read = reader.read_record(&mut record).map_err(|e| line.invalid("header", "column names", e.to_string()))?;
    let names: Vec<String> = record.iter().map(str::to_string).collect();
    if !read || names.iter().any(String::is_empty) {
        return Err(line.invalid("header", "a name for every column", quoted(line.text)));
    }
    Ok(names)
}

fn refuse_doubles(line: Line<'_>, names: &[String]) -> Result<(), MeasurementError> {
    let mut seen = HashSet::with_capacity(names.len());
    match names.iter().find(|name| !seen.insert(name.as_str())) {
        Some(name) => Err(line.invalid("header", "each column once", format!("{} twice", quoted(name)))),
        None => Ok(()),
    }
}

fn refuse_raw_readings(line: Line<'_>, names: &[String]) -> Result<(), MeasurementError> {
    if names.iter().any(|n| n.starts_with("signal_")) {
        return Err(
            line.unsupported("these are raw readings (signal_…), not a BRDF: `goniofit reduce` makes one of them")
        );
    }
    Ok(())
}

fn missing(line: Line<'_>, name: &str, dimension: Dimension) -> MeasurementError {
    let one_cell = !line.text.contains(',');
    let hint = if one_cell && line.text.contains(';') {
        " (columns are separated by commas, not semicolons)"
    } else if one_cell && line.text.trim().contains('\t') {
        " (columns are separated by commas, not tabs)"
    } else if dimension == Dimension::Space && name.starts_with("phi_") {
        " (an in-plane scan of the flat world says so by a line `# dimension: 2`)"
    } else {
        ""
    };
    line.invalid("header", format!("a column {name}{hint}"), quoted(line.text))
}

/// A column and what its name holds besides the prefix.
type Suffixed<'a> = (usize, &'a str);

/// The columns whose names begin with `prefix`.
fn with_prefix<'a>(names: &'a [String], prefix: &str) -> Vec<Suffixed<'a>> {
    names.iter().enumerate().filter_map(|(i, name)| Some((i, name.strip_prefix(prefix)?))).collect()
}

/// Finds the columns that belong to channels.
struct OfChannels<'a> {
    line: Line<'a>,
    names: &'a [String],
    channels: &'a [usize],
    /// Number of each channel by its name.
    numbers: HashMap<&'a str, usize>,
}

impl<'a> OfChannels<'a> {
    fn new(line: Line<'a>, names: &'a [String], channels: &'a [usize]) -> Self {
        let numbers = channels.iter().enumerate().filter_map(|(c, &i)| Some((names.get(i)?.as_str(), c))).collect();
        Self { line, names, channels, numbers }
    }

    /// The `group` of columns `<prefix><channel>`, one for each channel in the channels' order, or none.
    fn columns(&self, prefix: &str, group: &[Suffixed<'_>]) -> Result<Vec<usize>, MeasurementError> {
        let mut ranked = Vec::with_capacity(group.len());
        for &(column, channel) in group {
            let Some(number) = self.numbers.get(channel) else {
                let expected = format!("{prefix} and the name of a channel ({})", self.list());
                return Err(self.line.invalid("header", expected, quoted(&self.names[column])));
            };
            ranked.push((*number, column));
        }
        if !group.is_empty() && group.len() != self.channels.len() {
            let expected = format!("{prefix}… for every channel ({}) or for none", self.list());
            return Err(self.line.invalid("header", expected, quoted(self.line.text)));
        }
        // No name stands twice, so each channel is met once.
        ranked.sort_unstable();
        Ok(ranked.into_iter().map(|(_, column)| column).collect())
    }

    /// The channels' names, the first ten of many.
    fn list(&self) -> String {
        let shown = self.channels.iter().take(10).filter_map(|&i| self.names.get(i).map(String::as_str));
        let more = if self.channels.len() > 10 { ", …" } else { "" };
        shown.collect::<Vec<_>>().join(", ") + more
    }
}

/// The columns `common_<k>_<channel>`, by ascending k, one for each channel.
fn shared_components(channels: &OfChannels<'_>, names: &[String]) -> Result<Vec<Vec<usize>>, MeasurementError> {
    let mut components: BTreeMap<u32, Vec<Suffixed<'_>>> = BTreeMap::new();
    for (column, rest) in with_prefix(names, "common_") {
        let parts = rest.split_once('_').and_then(|(k, channel)| Some((plain_number(k)?, channel)));
        let Some((k, channel)) = parts else {
            let expected = "common_<number>_<channel>, the number in plain digits (1, not 01 or +1)";
            return Err(channels.line.invalid("header", expected, quoted(&names[column])));
        };
        components.entry(k).or_default().push((column, channel));
    }
    components.iter().map(|(k, group)| channels.columns(&format!("common_{k}_"), group)).collect()
}

/// The number that `text` is the plain form of: one number has one name only.
fn plain_number(text: &str) -> Option<u32> {
    text.parse().ok().filter(|number: &u32| number.to_string() == text)
}
