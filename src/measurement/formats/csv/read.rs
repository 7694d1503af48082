//! Rows to a table, line by line: no more memory than the table takes.

use glam::DVec3;

use super::Needs;
use super::header::{self, Columns, Comments};
use crate::geometry::angles::direction_deg;
use crate::measurement::formats::limits::{AZIMUTH_DEG, FLAT_POLAR_DEG, Limit, POLAR_DEG};
use crate::measurement::formats::rows::{Divisor, Rows, concat};
use crate::measurement::formats::source::Source;
use crate::measurement::formats::text::{Line, Lines, quoted};
use crate::measurement::formats::{Quantity, ReadOptions};
use crate::measurement::{Dimension, Directions, MaskReason, Measurement, MeasurementError, MerlGrid, Weights};

/// How far (rad) a row's directions may be from the MERL grid's: wider than any rounding, narrower than any bin.
const GRID_TOLERANCE: f64 = 1e-7;

/// Reads a CSV measurement.
pub(in crate::measurement::formats) fn read(
    source: &Source,
    options: &ReadOptions,
) -> Result<Measurement, MeasurementError> {
    read_table(source, options, Needs::Values)
}

/// Reads the directions and weights of a CSV file that need not hold values: without any the table has no channel.
pub(in crate::measurement::formats) fn read_directions(
    source: &Source,
    options: &ReadOptions,
) -> Result<Measurement, MeasurementError> {
    read_table(source, options, Needs::Directions)
}

fn read_table(source: &Source, options: &ReadOptions, needs: Needs) -> Result<Measurement, MeasurementError> {
    let mut lines = Lines::new(source)?;
    let (comments, columns) = header::read(&mut lines, needs)?;
    let stated = comments.quantity.unwrap_or_default();
    let mut table = Table::new(&comments, &columns, options.quantity.unwrap_or(stated));
    let mut cells = Vec::new();
    while let Some(line) = lines.next_filled()? {
        cells.clear();
        cells.extend(split_offsets(line.text));
        table.row(line, &cells)?;
    }
    let expected = comments.grid.map_or(1, |_| MerlGrid::LEN);
    if table.read < expected {
        let rows = if expected == 1 { "a row of data".into() } else { format!("{expected} rows of the MERL grid") };
        return Err(lines.ends_too_early(rows));
    }
    let mut measurement = table.finish(source.name());
    measurement.notes.extend(overridden(comments.quantity, options.quantity));
    measurement.notes.extend(lines.cut_note());
    Ok(measurement)
}

/// What to tell where the values are read as something else than the file says.
fn overridden(stated: Option<Quantity>, asked: Option<Quantity>) -> Option<String> {
    let (stated, asked) = stated.zip(asked).filter(|(stated, asked)| stated != asked)?;
    Some(format!(
        "the file says `# quantity: {}`; its values are read as {}, as asked for",
        stated.name(),
        asked.name()
    ))
}

/// Where the cells of a row stand.
fn split_offsets(text: &str) -> impl Iterator<Item = (usize, usize)> {
    let commas = text.match_indices(',').map(|(i, _)| i);
    let starts = std::iter::once(0).chain(commas.clone().map(|i| i + 1));
    starts.zip(commas.chain(std::iter::once(text.len())))
}

/// A table under construction.
struct Table<'a> {
    comments: &'a Comments,
    columns: &'a Columns,
    quantity: Quantity,
    rows: Rows,
    /// Rows read so far.
    read: usize,
    sigma: Vec<Vec<f64>>,
    common: Vec<Vec<Vec<f64>>>,
    row: Vec<Vec<f64>>,
    weight: Vec<f64>,
    reasons: Vec<Option<MaskReason>>,
}

impl<'a> Table<'a> {
    fn new(comments: &'a Comments, columns: &'a Columns, quantity: Quantity) -> Self {
        let channels = columns.channels.len();
        Self {
            comments,
            columns,
            quantity,
            rows: Rows::of_world(comments.dimension, channels, quantity),
            read: 0,
            sigma: vec![Vec::new(); columns.sigma.len()],
            common: vec![vec![Vec::new(); channels]; columns.common.len()],
            row: vec![Vec::new(); columns.row.len()],
            weight: Vec::new(),
            reasons: Vec::new(),
        }
    }

    /// Takes in one row, whose cells stand at `cells`.
    fn row(&mut self, line: Line<'_>, cells: &[(usize, usize)]) -> Result<(), MeasurementError> {
        let columns = self.columns;
        if cells.len() != columns.names.len() {
            let expected = format!("{} cells, one a column of the header", columns.names.len());
            return Err(line.invalid("", expected, format!("{}", cells.len())));
        }
        let cell = |column: usize| {
            let text = cells.get(column).and_then(|&(a, b)| line.text.get(a..b)).unwrap_or_default();
            text.trim().trim_matches('"')
        };
        let divisor = self.directions(line, &cell)?;
        let mut whole = !columns.channels.is_empty();
        for (channel, &column) in columns.channels.iter().enumerate() {
            let valid = self.value(line, divisor, channel, column, cell(column))?;
            whole &= valid;
            self.errors(line, divisor, channel, valid, &cell)?;
        }
        if let Some(column) = columns.weight {
            self.weight.push(not_negative(line, &columns.label(column), cell(column))?);
        }
        if let Some(column) = columns.reason {
            self.reasons.push(reason(line, &columns.label(column), cell(column), whole)?);
        }
        self.read += 1;
        Ok(())
    }

    /// Adds the row's directions, or checks them against the grid.
    fn directions<'t>(
        &mut self,
        line: Line<'_>,
        cell: &impl Fn(usize) -> &'t str,
    ) -> Result<Divisor, MeasurementError> {
        let columns = self.columns;
        let limits: &[Limit] = match self.comments.dimension {
            Dimension::Space => &[POLAR_DEG, AZIMUTH_DEG, POLAR_DEG, AZIMUTH_DEG],
            Dimension::Flat => &[FLAT_POLAR_DEG, FLAT_POLAR_DEG],
        };
        let angle = |(&column, limit): (&usize, &Limit)| {
            let angle = line.finite(&columns.label(column), cell(column))?;
            limit.check(line, || columns.label(column), angle)
        };
        let angles: Vec<f64> = columns.angles.iter().zip(limits).map(angle).collect::<Result<_, _>>()?;
        let (wi, wo) = match angles.as_slice() {
            [theta_i, phi_i, theta_o, phi_o] => (direction_deg(*theta_i, *phi_i), direction_deg(*theta_o, *phi_o)),
            [theta_i, theta_o] => (direction_deg(*theta_i, 0.0), direction_deg(*theta_o, 0.0)),
            _ => (DVec3::NAN, DVec3::NAN),
        };
        let Some(grid) = self.comments.grid else { return Ok(self.rows.directions(wi, wo)) };
        self.check_grid(line, MerlGrid { angles: grid }, wi, wo)?;
        // The grid's entries below the horizon are the format's own affair, but a cosine of 0 can't be divided out.
        Ok(if self.quantity == Quantity::Brdf { Divisor::One } else { Divisor::of(self.quantity, wi, wo) })
    }

    fn check_grid(&self, line: Line<'_>, grid: MerlGrid, wi: DVec3, wo: DVec3) -> Result<(), MeasurementError> {
        let index = self.read;
        if index >= MerlGrid::LEN {
            let expected = format!("no more than the {} rows of the MERL grid", MerlGrid::LEN);
            return Err(line.invalid("", expected, "another row"));
        }
        let (grid_wi, grid_wo) = grid.pair(index);
        if (wi - grid_wi).length() > GRID_TOLERANCE || (wo - grid_wo).length() > GRID_TOLERANCE {
            let expected = format!("the directions of entry {index} of the MERL grid, wi {grid_wi} and wo {grid_wo}");
            return Err(line.invalid("", expected, format!("wi {wi} and wo {wo}")));
        }
        Ok(())
    }

    /// Adds a channel's value and says whether it is valid.
    fn value(
        &mut self,
        line: Line<'_>,
        divisor: Divisor,
        channel: usize,
        column: usize,
        text: &str,
    ) -> Result<bool, MeasurementError> {
        let columns = self.columns;
        let number = || text.parse().map_err(|_| line.invalid(&columns.label(column), "a number", quoted(text)));
        let stored: Option<f64> = if text.is_empty() { None } else { Some(number()?) };
        self.rows.value(channel, divisor, stored, || line.place(&columns.label(column)));
        Ok(stored.is_some_and(f64::is_finite) && divisor != Divisor::None)
    }

    /// Adds σ and the shared components of a channel; where its value is masked their cells may be empty.
    fn errors<'t>(
        &mut self,
        line: Line<'_>,
        divisor: Divisor,
        channel: usize,
        valid: bool,
        cell: &impl Fn(usize) -> &'t str,
    ) -> Result<(), MeasurementError> {
        let columns = self.columns;
        if let (Some(sigma), Some(&column)) = (self.sigma.get_mut(channel), columns.sigma.get(channel)) {
            let value =
                if valid { error_of(line, &columns.label(column), cell(column), not_negative)? } else { f64::NAN };
            sigma.push(divisor.apply(value));
        }
        if let (Some(row), Some(&column)) = (self.row.get_mut(channel), columns.row.get(channel)) {
            let sigma = columns.sigma.get(channel).map_or(0.0, |&sigma| cell(sigma).parse().unwrap_or(0.0));
            let part = |line: Line<'_>, label: &str, text: &str| part_of(line, label, text, sigma);
            let value = if valid { error_of(line, &columns.label(column), cell(column), part)? } else { f64::NAN };
            row.push(divisor.apply(value));
        }
        for (component, of_channel) in self.common.iter_mut().zip(&columns.common) {
            if let (Some(common), Some(&column)) = (component.get_mut(channel), of_channel.get(channel)) {
                let finite = |line: Line<'_>, column: &str, text: &str| line.finite(column, text);
                let value =
                    if valid { error_of(line, &columns.label(column), cell(column), finite)? } else { f64::NAN };
                common.push(divisor.apply(value));
            }
        }
        Ok(())
    }

    fn finish(self, name: String) -> Measurement {
        let channels = self.columns.channel_names();
        let mut measurement = match self.comments.grid {
            Some(angles) => self.rows.finish_with(name, channels, Directions::Merl(MerlGrid { angles })),
            None => self.rows.finish(name, channels),
        };
        measurement.sigma = (!self.sigma.is_empty()).then(|| concat(self.sigma));
        measurement.common = self.common.into_iter().map(concat).collect();
        measurement.row = (!self.row.is_empty()).then(|| concat(self.row));
        measurement.weights = match (self.columns.weight, self.comments.grid) {
            (Some(_), _) if self.comments.solid_angle => Weights::SolidAngle(self.weight),
            (Some(_), _) => Weights::Column(self.weight),
            (None, Some(_)) => Weights::Merl,
            (None, None) => Weights::Uniform,
        };
        measurement.reasons = self.reasons;
        measurement.notes.extend(self.comments.notes.iter().cloned());
        measurement
    }
}

/// By how much a part may exceed the whole: what rounding to three digits makes of the same number twice.
const DIGITS: f64 = 1e-2;

/// The stated error of a value that is there, read by `read`.
fn error_of(
    line: Line<'_>,
    column: &str,
    text: &str,
    read: impl FnOnce(Line<'_>, &str, &str) -> Result<f64, MeasurementError>,
) -> Result<f64, MeasurementError> {
    if text.is_empty() {
        let expected = "a number, 1 σ of the value in this row (only where that is empty too may it be left out)";
        return Err(line.invalid(column, expected, quoted(text)));
    }
    read(line, column, text)
}

/// A finite number no larger than `sigma`, whatever its sign, but for the last digits of a file of few.
fn part_of(line: Line<'_>, column: &str, text: &str, sigma: f64) -> Result<f64, MeasurementError> {
    let value = line.finite(column, text)?;
    if value.abs() <= sigma * (1.0 + DIGITS) {
        return Ok(value);
    }
    Err(line.invalid(column, format!("a part of sigma_…, so {sigma} at most, of either sign"), quoted(text)))
}

/// Why a row has no value, where anybody says; nothing where it is `whole`, with a value in every channel.
fn reason(line: Line<'_>, column: &str, text: &str, whole: bool) -> Result<Option<MaskReason>, MeasurementError> {
    if text.is_empty() {
        return Ok(None);
    }
    if whole {
        return Err(line.invalid(column, "nothing, for every channel has a value in this row", quoted(text)));
    }
    let expected = || format!("{}, or nothing", MaskReason::ALL.map(MaskReason::name).join(", "));
    MaskReason::find(text).map(Some).ok_or_else(|| line.invalid(column, expected(), quoted(text)))
}

/// A finite number ≥ 0.
fn not_negative(line: Line<'_>, column: &str, text: &str) -> Result<f64, MeasurementError> {
    let value = line.finite(column, text)?;
    if value >= 0.0 {
        return Ok(value);
    }
    Err(line.invalid(column, "a number ≥ 0", quoted(text)))
}
