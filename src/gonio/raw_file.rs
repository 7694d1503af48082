//! Raw readings as a CSV file: the four angles, `kind`, `time_s`, `exposure_s`, `repeat`, and one `signal_<channel>` each.
//!
//! In the flat world (`# dimension: 2`) the angles are `theta_i_deg` and `theta_o_deg`, −90 to 90. Columns stand in any order. Rows are in order of time; angles may be empty in a row that is no `sample`, a signal where nothing was read. Rows of one
//! kind and pair of directions in a row are one stop of the axes. `# instrument: {…}`, JSON on one line, describes what made them, and `weight`,
//! a column that simulated files have, holds what a pair of directions stands for (`# weights: solid-angle`: the grid's solid angle).

use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::Path;

use glam::DVec3;

use super::instrument::Instrument;
use super::raw::Raw;
use super::reading::{Kind, Reading};
use crate::geometry::angles::direction_deg;
use crate::measurement::formats::{flat_deg, is_reserved, push_number, spherical_deg};
use crate::measurement::{Dimension, Directions, MeasurementError, STOPPED, Weights};

const ANGLES: [&str; 4] = ["theta_i_deg", "phi_i_deg", "theta_o_deg", "phi_o_deg"];
const FLAT_ANGLES: [&str; 2] = ["theta_i_deg", "theta_o_deg"];
const PLACES: [&str; 4] = ["kind", "time_s", "exposure_s", "repeat"];
const SIGNAL: &str = "signal_";
const WEIGHT: &str = "weight";
const INSTRUMENT: &str = "# instrument:";
const DIMENSION: &str = "# dimension:";
const NOTE: &str = "# note:";
const SOLID_ANGLE: &str = "# weights: solid-angle";
/// Largest magnitude of a signal, whose square is a number.
const LARGEST_SIGNAL: f64 = 1e150;
/// Largest magnitudes of the four angles, with room for rounding.
const LARGEST: [f64; 4] = [180.0001, 360.0001, 180.0001, 360.0001];
const FLAT_LARGEST: [f64; 2] = [90.0001, 90.0001];

/// Names of the angles in a world.
fn angle_names(dimension: Dimension) -> &'static [&'static str] {
    if dimension == Dimension::Flat { &FLAT_ANGLES } else { &ANGLES }
}

/// θ and φ (deg) that a direction is written as; in the flat world θ alone, φ being 0.
fn angles(dimension: Dimension, w: DVec3) -> [f64; 2] {
    if dimension == Dimension::Flat { [flat_deg(w), 0.0] } else { spherical_deg(w) }
}

/// The stop of a reading that comes after another: the same where nothing has moved.
fn stop_after(before: Option<Reading>, kind: Kind, entry: Option<u32>) -> u32 {
    before.map_or(0, |b| b.stop + u32::from(b.kind != kind || b.entry != entry))
}

impl Raw {
    /// The text of a file.
    #[must_use]
    pub fn to_csv(&self, instrument: &Instrument) -> String {
        let mut text = String::new();
        // Writing to a String can't fail.
        let _ = writeln!(text, "{INSTRUMENT} {}", serde_json::to_string(instrument).unwrap_or_default());
        if matches!(self.weights, Weights::SolidAngle(_) | Weights::Merl) {
            let _ = writeln!(text, "{SOLID_ANGLE}");
        }
        if self.dimension == Dimension::Flat {
            let _ = writeln!(text, "{DIMENSION} 2");
        }
        for note in &self.notes {
            let _ = writeln!(text, "{NOTE} {note}");
        }
        let names = angle_names(self.dimension).iter().chain(&PLACES).map(ToString::to_string);
        let signals = self.channels.iter().map(|c| format!("{SIGNAL}{c}"));
        let weight = self.weights.known().then(|| WEIGHT.to_string());
        let header: Vec<String> = names.chain(signals).chain(weight).collect();
        text.push_str(&header.join(","));
        text.push('\n');
        for (i, reading) in self.readings.iter().enumerate() {
            self.push_row(i, reading, &mut text);
        }
        text
    }

    /// The readings as [`Self::from_csv`] gives them back from [`Self::to_csv`], but for pairs of directions that no reading belongs to: listed directions
    /// are those that the text says, 10⁻¹⁵ off, and stops those that rows tell. What is made of them is then the same to the bit. A grid stays one.
    #[must_use]
    pub fn as_written(mut self) -> Self {
        let dimension = self.dimension;
        if let Directions::List { wi, wo } = &mut self.directions {
            for w in wi.iter_mut().chain(wo) {
                let [theta, phi] = angles(dimension, *w);
                *w = direction_deg(theta, phi);
            }
        }
        let mut before = None;
        for reading in &mut self.readings {
            reading.stop = stop_after(before, reading.kind, reading.entry);
            before = Some(*reading);
        }
        self
    }

    fn push_row(&self, i: usize, reading: &Reading, text: &mut String) {
        let names = angle_names(self.dimension).len();
        match reading.entry.map(|e| self.directions.pair(e as usize)) {
            Some((wi, wo)) => {
                let of = |w| angles(self.dimension, w).into_iter().take(names / 2);
                of(wi).chain(of(wo)).for_each(|a| push_number(text, a));
            }
            None => (0..names).for_each(|_| text.push(',')),
        }
        text.push_str(reading.kind.name());
        text.push(',');
        [reading.time_s, reading.exposure_s, f64::from(reading.repeat)].into_iter().for_each(|v| push_number(text, v));
        self.signals(i).iter().for_each(|s| push_number(text, *s));
        if self.weights.known() {
            push_number(text, reading.entry.map_or(f64::NAN, |e| self.weights.get(e as usize)));
        }
        text.pop();
        text.push('\n');
    }

    /// Reads the text of a file called `path`, and the description of the instrument where it holds one.
    ///
    /// # Errors
    /// [`MeasurementError`] naming line, column, what was expected and found.
    pub fn from_csv(path: &Path, text: &str) -> Result<(Self, Option<Instrument>), MeasurementError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let (instrument, dimension) = (described(path, text)?, dimension_of(path, text)?);
        let mut reader = ::csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .trim(::csv::Trim::All)
            .has_headers(true)
            .from_reader(text.as_bytes());
        let header = reader.headers().map_err(|e| malformed(path, &e))?.clone();
        let columns = Columns::new(path, &header, dimension)?;
        let mut rows = Rows { path, columns: &columns, list: List::default() };
        for record in reader.records() {
            let record = record.map_err(|e| malformed(path, &e))?;
            rows.take(&record)?;
        }
        let is_grid = text.lines().take_while(|l| l.starts_with('#')).any(|l| l.trim_end() == SOLID_ANGLE);
        let raw = rows.list.finish(path, &columns, is_grid)?;
        Ok((Self { notes: notes(text), ..raw }, instrument))
    }
}

/// What comments say of where the readings end.
fn notes(text: &str) -> Vec<String> {
    let comments = text.lines().take_while(|l| l.starts_with('#')).filter_map(|l| l.strip_prefix(NOTE));
    comments.map(str::trim).filter(|note| note.starts_with(STOPPED)).map(str::to_owned).collect()
}

/// The world that a comment says, space by default.
fn dimension_of(path: &Path, text: &str) -> Result<Dimension, MeasurementError> {
    let comments = text.lines().enumerate().take_while(|(_, l)| l.starts_with('#'));
    let mut found = comments.filter_map(|(i, l)| l.strip_prefix(DIMENSION).map(|value| (i + 1, value.trim())));
    match found.next() {
        None => Ok(Dimension::Space),
        Some((_, "2")) => Ok(Dimension::Flat),
        Some((line, other)) => {
            let expected = "2, the flat world; readings in space have no such line";
            Err(MeasurementError::invalid(path, format!("line {line}, `{DIMENSION}`"), expected, format!("{other:?}")))
        }
    }
}

/// The instrument of the comment that describes it, `None` where a text has none.
///
/// # Errors
/// [`MeasurementError`] naming the line and what is wrong with the description.
pub fn described(path: &Path, text: &str) -> Result<Option<Instrument>, MeasurementError> {
    let comments = text.lines().enumerate().take_while(|(_, l)| l.starts_with('#'));
    let mut found = comments.filter_map(|(i, l)| l.strip_prefix(INSTRUMENT).map(|json| (i + 1, json.trim())));
    let Some((line, json)) = found.next() else { return Ok(None) };
    let wrong = |found: String| {
        MeasurementError::invalid(
            path,
            format!("line {line}, `{INSTRUMENT}`"),
            "the description of an instrument",
            found,
        )
    };
    let instrument: Instrument = serde_json::from_str(json).map_err(|e| wrong(e.to_string()))?;
    match instrument.fault() {
        Some(fault) => Err(wrong(fault)),
        None => Ok(Some(instrument)),
    }
}

fn malformed(path: &Path, error: &::csv::Error) -> MeasurementError {
    let place = error.position().map_or("the header".to_owned(), |p| format!("line {}", p.line()));
    let found = match error.kind() {
        ::csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            return MeasurementError::invalid(
                path,
                place,
                format!("{expected_len} cells, one a column of the header"),
                len.to_string(),
            );
        }
        _ => error.to_string(),
    };
    MeasurementError::invalid(path, place, "rows of raw readings", found)
}

/// Where the columns stand.
struct Columns {
    dimension: Dimension,
    angles: Vec<usize>,
    /// kind, `time_s`, `exposure_s`, repeat.
    places: [usize; 4],
    channels: Vec<(String, usize)>,
    weight: Option<usize>,
}

impl Columns {
    fn new(path: &Path, header: &::csv::StringRecord, dimension: Dimension) -> Result<Self, MeasurementError> {
        let wrong = |expected: String, found: String| MeasurementError::invalid(path, "the header", expected, found);
        let mut seen = HashMap::new();
        for (column, name) in header.iter().enumerate() {
            if seen.insert(name, column).is_some() {
                return Err(wrong("each column once".into(), format!("`{name}` twice")));
            }
        }
        let find = |name: &str| {
            seen.get(name)
                .copied()
                .ok_or_else(|| wrong(format!("a column `{name}`"), format!("{:?}", header.iter().collect::<Vec<_>>())))
        };
        let names = angle_names(dimension);
        let angles = names.iter().map(|name| find(name)).collect::<Result<Vec<_>, _>>()?;
        let [kind, time, exposure, repeat] = PLACES;
        let places = [find(kind)?, find(time)?, find(exposure)?, find(repeat)?];
        let mut channels = Vec::new();
        for (column, name) in header.iter().enumerate() {
            match name.strip_prefix(SIGNAL) {
                Some(channel) if is_reserved(channel) => {
                    return Err(wrong("a channel's name".into(), format!("`{name}`")));
                }
                Some(channel) => channels.push((channel.to_owned(), column)),
                None if name == WEIGHT || names.contains(&name) || PLACES.contains(&name) => {}
                None => {
                    return Err(wrong(format!("angles, {} or `{SIGNAL}…`", PLACES.join(", ")), format!("`{name}`")));
                }
            }
        }
        if channels.is_empty() {
            return Err(wrong(format!("a column `{SIGNAL}…`"), "none".into()));
        }
        Ok(Self { dimension, angles, places, channels, weight: seen.get(WEIGHT).copied() })
    }
}

/// What has been read so far.
#[derive(Default)]
struct List {
    entries: HashMap<[u64; 4], u32>,
    wi: Vec<DVec3>,
    wo: Vec<DVec3>,
    weight: Vec<f64>,
    readings: Vec<Reading>,
    signal: Vec<f64>,
}

impl List {
    fn finish(self, path: &Path, columns: &Columns, is_grid: bool) -> Result<Raw, MeasurementError> {
        if self.readings.is_empty() {
            return Err(MeasurementError::invalid(path, "after the header", "a row of data", "the end of the file"));
        }
        let weights = match (columns.weight, is_grid) {
            (None, _) => Weights::Uniform,
            (Some(_), true) => Weights::SolidAngle(self.weight),
            (Some(_), false) => Weights::Column(self.weight),
        };
        Ok(Raw {
            channels: columns.channels.iter().map(|(name, _)| name.clone()).collect(),
            dimension: columns.dimension,
            directions: Directions::List { wi: self.wi, wo: self.wo },
            weights,
            readings: self.readings,
            signal: self.signal,
            quadrature_error: 0.0,
            notes: Vec::new(),
        })
    }
}

struct Rows<'a> {
    path: &'a Path,
    columns: &'a Columns,
    list: List,
}

impl Rows<'_> {
    fn take(&mut self, record: &::csv::StringRecord) -> Result<(), MeasurementError> {
        let line = record.position().map_or(0, ::csv::Position::line);
        let path = self.path;
        let wrong = |column: &str, expected: &str, found: &str| {
            MeasurementError::invalid(path, format!("line {line}, column `{column}`"), expected, format!("{found:?}"))
        };
        let cell = |column: usize| record.get(column).unwrap_or_default();
        let number = |column: usize, name: &str, least: f64, expected: &str| {
            let text = cell(column);
            text.parse::<f64>().ok().filter(|v| v.is_finite() && *v >= least).ok_or_else(|| wrong(name, expected, text))
        };
        let [kind, time, exposure, repeat] = self.columns.places;
        let kind = Kind::ALL
            .into_iter()
            .find(|k| k.name() == cell(kind))
            .ok_or_else(|| wrong("kind", "sample, blank, reference or dark", cell(kind)))?;
        let time_s = number(time, "time_s", 0.0, "seconds from the start")?;
        let before = self.list.readings.last().copied();
        if before.is_some_and(|b| time_s < b.time_s) {
            return Err(wrong("time_s", "rows in order of time", cell(time)));
        }
        let exposure_s = number(exposure, "exposure_s", f64::MIN_POSITIVE, "seconds, above 0")?;
        let repeat = cell(repeat).parse().map_err(|_| wrong("repeat", "a whole number from 0", cell(repeat)))?;
        let entry = if kind == Kind::Sample { Some(self.entry(record, &wrong)?) } else { None };
        for (name, column) in &self.columns.channels {
            let text = cell(*column);
            let signal = if text.is_empty() { Ok(f64::NAN) } else { text.parse() };
            let expected = "a number up to 1e150, inf where it is too large, or nothing";
            let usable = |s: &f64| s.is_nan() || *s == f64::INFINITY || s.abs() <= LARGEST_SIGNAL;
            let signal = signal.ok().filter(usable).ok_or_else(|| wrong(&format!("{SIGNAL}{name}"), expected, text))?;
            self.list.signal.push(signal);
        }
        let stop = stop_after(before, kind, entry);
        self.list.readings.push(Reading { kind, entry, time_s, exposure_s, repeat, stop });
        Ok(())
    }

    /// The pair of directions of a row of the sample.
    fn entry(
        &mut self,
        record: &::csv::StringRecord,
        wrong: &impl Fn(&str, &str, &str) -> MeasurementError,
    ) -> Result<u32, MeasurementError> {
        let is_flat = self.columns.dimension == Dimension::Flat;
        let (names, largest) =
            (angle_names(self.columns.dimension), if is_flat { &FLAT_LARGEST[..] } else { &LARGEST });
        let mut typed = [0.0; 4];
        for (k, (angle, column)) in typed.iter_mut().zip(&self.columns.angles).enumerate() {
            let text = record.get(*column).unwrap_or_default();
            let parsed = text.parse::<f64>().ok().filter(|a| a.abs() <= largest[k]);
            *angle = parsed.ok_or_else(|| wrong(names[k], "an angle in degrees", text))?;
        }
        let angles = if is_flat { [typed[0], 0.0, typed[1], 0.0] } else { typed };
        // −0 is 0.
        let key = angles.map(|a| (a + 0.0).to_bits());
        if let Some(entry) = self.list.entries.get(&key) {
            return Ok(*entry);
        }
        if let Some(column) = self.columns.weight {
            let text = record.get(column).unwrap_or_default();
            let weight = text.parse::<f64>().ok().filter(|w| w.is_finite() && *w >= 0.0);
            self.list.weight.push(weight.ok_or_else(|| wrong(WEIGHT, "a number ≥ 0", text))?);
        }
        let entry = self.list.wi.len() as u32;
        self.list.entries.insert(key, entry);
        self.list.wi.push(direction_deg(angles[0], angles[1]));
        self.list.wo.push(direction_deg(angles[2], angles[3]));
        Ok(entry)
    }
}
