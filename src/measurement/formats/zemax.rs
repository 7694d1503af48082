//! Zemax BSDF data interchange text (`.bsdf`, Rykowski; Radiant's Imaging Sphere): a header of counts and angles, then one block of
//! values per spectral channel.
//!
//! Per angle of incidence θ there is a line `TIS v` and one line per scatter azimuth with one value per radial angle. Radial r is
//! the angle from the mirror direction m; azimuth A turns about m, 0° pointing from m towards the surface normal,
//! counter-clockwise seen against m:
//!
//! wo = cos r · m + sin r · (cos A · e1 + sin A · (m × e1)), m = (sinθ, 0, cosθ), e1 = (−cosθ, 0, sinθ), wi = (−sinθ, 0, cosθ).
//!
//! `PlaneSymmetrical` lists A in [0°, 180°], which stands for both halves. A value 0 is a node that was not measured: it is masked.
//!
//! Measured on a file and its FRED twin (see [`super::fred`]; detector angles up to 80°): with this reading the 193 zeros are exactly
//! those of the 912 nodes that have θo > 80°. With A = 0° towards the horizon 318 nodes contradict that, with r as a difference of direction
//! cosines 118, with r and A as polar coordinates in the plane of angles 19. The stated TIS is not ∫ f cosθo dω of the values (off
//! by +32, +27, +5, −24 % at 10°, 30°, 50°, 70°) but ½ ∫ f dω over the hemisphere round m (within 0.3, 0.4, 1.1, 3.7 %): it is kept as
//! stated, and a note tells where it is no albedo.

use glam::DVec3;

use super::rows::Rows;
use super::source::Source;
use super::text::{Line, Lines, quoted};
use super::{ReadOptions, cells};
use crate::geometry::angles::sin_cos_deg;
use crate::measurement::{Measurement, MeasurementError, Weights};

/// Largest relative difference between a stated TIS and ∫ f cosθo dω that passes without a note.
const TIS_TOLERANCE: f64 = 0.1;

/// The header: what the values are listed over.
#[derive(Debug, Default)]
struct Header {
    mirrored: bool,
    channels: Vec<(&'static str, String)>,
    incidence: Vec<f64>,
    azimuth: Vec<f64>,
    radial: Vec<f64>,
    notes: Vec<String>,
}

/// The values of all channels, and the scatter that the file states for the first.
#[derive(Debug, Default)]
struct Data {
    /// Channel by channel, in the order incidence, azimuth, radial.
    values: Vec<Vec<f64>>,
    stated: Vec<(f64, f64)>,
}

/// Reads a Zemax file.
pub(super) fn read(source: &Source, options: &ReadOptions) -> Result<Measurement, MeasurementError> {
    let mut lines = Lines::new(source)?;
    let header = Header::read(&mut lines)?;
    let mut data = Data::default();
    for (indicator, _) in &header.channels {
        keyword(&mut lines, &[indicator])?;
        keyword(&mut lines, &["DataBegin"])?;
        data.read_channel(&mut lines, &header)?;
        keyword(&mut lines, &["DataEnd"])?;
    }
    let mut rows = Rows::new(header.channels.len(), options.quantity.unwrap_or_default());
    for (i, (incidence, azimuth, radial)) in header.nodes().enumerate() {
        let (wi, wo) = pair(incidence, azimuth, radial);
        let divisor = rows.directions(wi, wo);
        for (channel, values) in data.values.iter().enumerate() {
            let stored = values.get(i).copied().filter(|v| *v != 0.0);
            rows.value(channel, divisor, stored, || {
                format!("incidence {incidence}°, azimuth {azimuth}°, radial {radial}°")
            });
        }
    }
    let names = header.channels.iter().map(|(_, name)| name.clone()).collect();
    let mut measurement = rows.finish(source.name(), names);
    let weights = header.weights();
    measurement.notes.extend(header.notes.iter().cloned());
    measurement.notes.extend(scatter_note(&header, &measurement, &weights, &data.stated));
    measurement.stated_scatter = data.stated;
    measurement.weights = Weights::SolidAngle(weights);
    Ok(measurement)
}

/// The pair of directions of a node (degrees).
fn pair(incidence: f64, azimuth: f64, radial: f64) -> (DVec3, DVec3) {
    let (sin_i, cos_i) = sin_cos_deg(incidence);
    let (sin_a, cos_a) = sin_cos_deg(azimuth);
    let (sin_r, cos_r) = sin_cos_deg(radial);
    let mirror = DVec3::new(sin_i, 0.0, cos_i);
    let to_normal = DVec3::new(-cos_i, 0.0, sin_i);
    let wo = cos_r * mirror + sin_r * (cos_a * to_normal + sin_a * mirror.cross(to_normal));
    (DVec3::new(-sin_i, 0.0, cos_i), wo)
}

impl Header {
    fn read(lines: &mut Lines<'_>) -> Result<Self, MeasurementError> {
        let mut header = Self::default();
        let wavelength = source_and_wavelength(lines)?;
        let (word, line) = keyword_value(lines, "Symmetry")?;
        header.mirrored = match word.as_str() {
            "PlaneSymmetrical" => true,
            "ASymmetrical" | "Asymmetrical" | "ASymmetrical4D" | "Asymmetrical4D" => false,
            _ => return Err(lines.invalid_at(line, "Symmetry", "PlaneSymmetrical or ASymmetrical", quoted(&word))),
        };
        let (word, line) = keyword_value(lines, "SpectralContent")?;
        header.channels = match word.as_str() {
            "Monochrome" => vec![("Monochrome", wavelength.unwrap_or_else(|| "value".into()))],
            "XYZ" => ["x", "y", "z"]
                .into_iter()
                .zip(["TristimulusX", "TristimulusY", "TristimulusZ"])
                .map(|(n, i)| (i, n.into()))
                .collect(),
            _ => return Err(lines.invalid_at(line, "SpectralContent", "Monochrome or XYZ", quoted(&word))),
        };
        let (word, line) = keyword_value(lines, "ScatterType")?;
        if word != "BRDF" {
            let what = if word == "BTDF" {
                "a BTDF, light that passes through, which goniofit does not model".into()
            } else {
                quoted(&word)
            };
            return Err(lines.invalid_at(line, "ScatterType", "BRDF", what));
        }
        header.read_angles(lines)?;
        Ok(header)
    }

    fn read_angles(&mut self, lines: &mut Lines<'_>) -> Result<(), MeasurementError> {
        let rotation = angles(lines, "SampleRotation", (0.0, 360.0))?;
        if rotation.len() > 1 {
            let number = lines.number();
            let found = format!("{} (an anisotropic sample)", rotation.len());
            return Err(lines.invalid_at(number, "SampleRotation", "one rotation", found));
        }
        if rotation != [0.0] {
            self.notes
                .push(format!("the sample's rotation {rotation:?}° is left out: the sample is taken as isotropic"));
        }
        self.incidence = angles(lines, "AngleOfIncidence", (0.0, 90.0))?;
        self.azimuth = angles(lines, "ScatterAzimuth", (0.0, if self.mirrored { 180.0 } else { 360.0 }))?;
        self.radial = angles(lines, "ScatterRadial", (0.0, 180.0))?;
        Ok(())
    }

    /// (incidence, azimuth, radial) in the order of the values.
    fn nodes(&self) -> impl Iterator<Item = (f64, f64, f64)> + '_ {
        self.incidence
            .iter()
            .flat_map(move |&i| self.azimuth.iter().flat_map(move |&a| self.radial.iter().map(move |&r| (i, a, r))))
    }

    /// dωi dωo of every node, up to a constant: the cells of the grid about the mirror direction.
    fn weights(&self) -> Vec<f64> {
        let (radial, azimuth) = (cells::polar(&self.radial), cells::azimuth(&self.azimuth, self.mirrored));
        let incidence = cells::polar(&self.incidence);
        let products = incidence.iter().flat_map(|i| azimuth.iter().map(move |a| i * a));
        products.flat_map(|ia| radial.iter().map(move |r| ia * r)).collect()
    }
}

impl Data {
    /// Reads the block of one channel, between `DataBegin` and `DataEnd`.
    fn read_channel(&mut self, lines: &mut Lines<'_>, header: &Header) -> Result<(), MeasurementError> {
        let mut values = Vec::new();
        let first = self.values.is_empty();
        for &incidence in &header.incidence {
            let (word, number) = keyword_value(lines, "TIS")?;
            let tis = word.parse::<f64>().ok().filter(|v| v.is_finite());
            let tis = tis.ok_or_else(|| lines.invalid_at(number, "TIS", "a finite number", quoted(&word)))?;
            if first {
                self.stated.push((incidence, tis));
            }
            for &azimuth in &header.azimuth {
                let what = format!("the {} values of incidence {incidence}°, azimuth {azimuth}°", header.radial.len());
                let Some(line) = lines.next_content()? else { return Err(lines.ends_too_early(what)) };
                let row = line.numbers_of(&what)?;
                if row.len() != header.radial.len() {
                    return Err(line.invalid("", what, row.len().to_string()));
                }
                values.extend(row);
            }
        }
        self.values.push(values);
        Ok(())
    }
}

/// Reads the lines up to `Source`, and takes the channel's name from the comments, where they state a wavelength.
fn source_and_wavelength(lines: &mut Lines<'_>) -> Result<Option<String>, MeasurementError> {
    let mut wavelength = None;
    while let Some(line) = lines.next_filled()? {
        match line.text.trim_start().strip_prefix('#') {
            Some(comment) => wavelength = wavelength.or_else(|| stated_wavelength(comment)),
            None if line.text.split_whitespace().next() == Some("Source") => return Ok(wavelength),
            None => return Err(line.invalid("", "Source", quoted(line.text))),
        }
    }
    Err(lines.ends_too_early("Source"))
}

/// "650nm" from a comment on the light source or wavelength.
fn stated_wavelength(comment: &str) -> Option<String> {
    let lower = comment.to_lowercase();
    if !["light", "laser", "wavelength", "lambda"].iter().any(|word| lower.contains(word)) {
        return None;
    }
    let spaced = lower.replace("nm", " nm ");
    let words: Vec<&str> =
        spaced.split(|c: char| c.is_whitespace() || "(),;:=".contains(c)).filter(|w| !w.is_empty()).collect();
    let at = words.windows(2).find(|w| w[1] == "nm" && w[0].parse().is_ok_and(|x: f64| x > 0.0))?;
    Some(format!("{}nm", at[0]))
}

/// The line `<key> <value>`: the value, and the line's number.
fn keyword_value(lines: &mut Lines<'_>, key: &str) -> Result<(String, u64), MeasurementError> {
    let Some(line) = lines.next_content()? else { return Err(lines.ends_too_early(key)) };
    let mut words = line.text.split_whitespace();
    match (words.next(), words.next()) {
        (Some(word), Some(value)) if word == key => Ok((value.to_string(), line.number)),
        _ => Err(line.invalid("", format!("{key} and its value"), quoted(line.text))),
    }
}

/// The line that consists of `words`.
fn keyword(lines: &mut Lines<'_>, words: &[&str]) -> Result<(), MeasurementError> {
    let expected = words.join(" ");
    let Some(line) = lines.next_content()? else { return Err(lines.ends_too_early(expected)) };
    if line.text.split_whitespace().eq(words.iter().copied()) {
        return Ok(());
    }
    Err(line.invalid("", expected, quoted(line.text)))
}

/// The line `<key> <count>` and the `count` ascending angles (deg) within `range` that follow, on one line or several.
fn angles(lines: &mut Lines<'_>, key: &str, range: (f64, f64)) -> Result<Vec<f64>, MeasurementError> {
    let (word, number) = keyword_value(lines, key)?;
    let count: usize = word
        .parse()
        .ok()
        .filter(|n| *n > 0)
        .ok_or_else(|| lines.invalid_at(number, key, "how many angles follow", quoted(&word)))?;
    let mut list: Vec<f64> = Vec::new();
    let what = format!("{count} angles of {key}");
    while list.len() < count {
        let Some(line) = lines.next_content()? else { return Err(lines.ends_too_early(what)) };
        list.extend(line.numbers_of(&what)?);
        check_angles(line, key, count, range, &list)?;
    }
    Ok(list)
}

fn check_angles(
    line: Line<'_>,
    key: &str,
    count: usize,
    range: (f64, f64),
    list: &[f64],
) -> Result<(), MeasurementError> {
    if list.len() > count {
        return Err(line.invalid(key, format!("{count} angles"), list.len().to_string()));
    }
    if let Some(angle) = list.iter().find(|a| !(range.0..=range.1).contains(*a)) {
        return Err(line.invalid(key, format!("angles from {} to {} degrees", range.0, range.1), angle.to_string()));
    }
    if let Some((i, angle)) = cells::not_ascending(list) {
        return Err(line.invalid(key, "ascending angles", format!("{angle} as number {}", i + 1)));
    }
    Ok(())
}

/// Says where the stated TIS is not ∫ f cosθo dω over the listed values of the first channel.
fn scatter_note(header: &Header, table: &Measurement, weights: &[f64], stated: &[(f64, f64)]) -> Option<String> {
    let per_incidence = header.azimuth.len() * header.radial.len();
    let incidence_cells = cells::polar(&header.incidence);
    let mut differences = Vec::new();
    for (i, (&(theta, tis), cell)) in stated.iter().zip(&incidence_cells).enumerate() {
        let node = |k: usize| {
            let cos_o = table.directions.pair(k).1.z.max(0.0);
            Some(table.value(0, k)? * cos_o * weights.get(k)? / cell)
        };
        let integral: f64 = (i * per_incidence..(i + 1) * per_incidence).filter_map(node).sum();
        if (integral - tis).abs() > TIS_TOLERANCE * tis.abs() {
            differences.push(format!("{tis} against {integral:.4} at {theta}°"));
        }
    }
    (!differences.is_empty()).then(|| {
        let list = differences.join(", ");
        format!("the scatter that the file states (TIS) is not the integral of BRDF·cosθo over its values: {list}")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{mirror, theta_of};

    #[test]
    fn radial_angles_count_from_the_mirror_direction() {
        for incidence in [0.0, 10.0, 70.0] {
            let (wi, wo) = pair(incidence, 123.0, 0.0);
            assert!((wo - mirror(wi)).length() < 1e-15);
            for azimuth in [0.0, 40.0, 180.0, 300.0] {
                let (_, wo) = pair(incidence, azimuth, 25.0);
                assert!((wo.dot(mirror(wi)) - 25f64.to_radians().cos()).abs() < 1e-15);
                assert!((wo.length() - 1.0).abs() < 1e-15);
            }
            // Azimuth 0 leads to the normal and past it.
            assert!((pair(incidence, 0.0, incidence).1 - DVec3::Z).length() < 1e-15);
            assert!((theta_of(pair(incidence, 180.0, 15.0).1) - (incidence + 15.0).to_radians()).abs() < 1e-14);
        }
    }

    #[test]
    fn the_channel_is_called_after_the_wavelength() {
        assert_eq!(stated_wavelength(" Light source: red laser (650 nm, 3.5mm spot)").as_deref(), Some("650nm"));
        assert_eq!(stated_wavelength(" wavelength=532.5nm").as_deref(), Some("532.5nm"));
        assert_eq!(stated_wavelength(" steps of 5 nm"), None);
        assert_eq!(stated_wavelength(" a laser"), None);
    }
}
