//! The renders side by side.

use serde_json::{Value, json};

use super::data::data_uri;
use super::pixels::{packed, reduced};
use crate::chain::ChainError;
use crate::image::{Bitmap, Image, develop, difference_map, difference_range, encode_png, exposure_for};
use crate::report::run::{ReportError, Run, RunFit};
use crate::report::words::{count, number, percent};

/// What all pictures together may take in the page, pixels: at about 5.5 bytes each 3 MB.
const MOST_PIXELS: usize = 540_000;

/// A picture, and how it differs from the reference.
pub(super) struct Shot {
    pub label: String,
    pub file: String,
    pub alt: String,
    pub png: String,
    /// The difference's picture with its alternative text; none for the reference.
    pub difference: Option<(String, String)>,
}

/// A line of numbers of all compared pictures.
pub(super) struct Line {
    pub name: &'static str,
    pub cells: Vec<String>,
}

pub(super) struct Pictures {
    pub width: usize,
    pub height: usize,
    pub reference: String,
    pub shots: Vec<Shot>,
    /// Range of the difference maps, W/(sr·m²).
    pub range: String,
    pub exposure: String,
    pub compared: Vec<String>,
    pub lines: Vec<Line>,
    /// What must be known of them.
    pub note: String,
    pub data: Value,
}

pub(super) fn pictures(run: &Run) -> Result<Option<Pictures>, ReportError> {
    let Some(first) = run.pictures.first() else { return Ok(None) };
    let same_size =
        |p: &&crate::report::run::Picture| (p.image.width, p.image.height) == (first.image.width, first.image.height);
    let all: Vec<_> = run.pictures.iter().filter(same_size).collect();
    let factor = factor(first.image.width, first.image.height, all.len());
    let images: Vec<Image> =
        all.iter().map(|p| if factor == 1 { p.image.clone() } else { reduced(&p.image, factor) }).collect();
    let exposure = run.exposure.unwrap_or_else(|| exposure_for(&first.image));
    let range = images[1..]
        .iter()
        .map(|i| difference_range(i, &images[0]))
        .collect::<Result<Vec<_>, _>>()
        .map_err(ChainError::from)?;
    let range = range.into_iter().flatten().reduce(f64::max).unwrap_or(1.0);
    let mut shots = Vec::new();
    for (k, (picture, image)) in all.iter().zip(&images).enumerate() {
        let difference = if k == 0 { None } else { Some(difference_shot(&images[0], image, range, picture, first)?) };
        shots.push(Shot {
            label: picture.label.clone(),
            file: picture.file.clone(),
            alt: format!("{}, rendered in the scene {}", picture.label, run.scene.as_deref().unwrap_or("given")),
            png: png(&develop(image, exposure))?,
            difference,
        });
    }
    let encoded: Vec<Value> =
        all.iter().zip(&images).map(|(p, i)| json!({ "label": p.label, "pixels": packed(i) })).collect();
    let (width, height) = (images[0].width, images[0].height);
    let compared: Vec<&RunFit> = run.fits.iter().filter(|f| f.image.is_some()).collect();
    Ok(Some(Pictures {
        width,
        height,
        reference: first.label.clone(),
        shots,
        range: number(range),
        exposure: crate::report::plot::minus(&format!("{exposure:+.2}")),
        lines: lines(&compared),
        compared: compared.iter().map(|f| f.label.clone()).collect(),
        note: notes(run, factor, all.len()),
        data: json!({ "width": width, "height": height, "factor": factor, "exposure": exposure, "range": range, "pictures": encoded }),
    }))
}

/// What a reader must know of the pictures: that they are smaller here, that some are not shown, that they differ in what they show.
fn notes(run: &Run, factor: usize, shown: usize) -> String {
    let mut notes = Vec::new();
    if factor > 1 {
        notes.push(format!(
            "Pixels here are means over {factor}×{factor} pixels of the pictures; the numbers are of all pixels."
        ));
    }
    if shown < run.pictures.len() {
        notes.push("Pictures of another size than the first are left out.".into());
    }
    let through = |f: &&RunFit| f.material().fit.as_ref().is_some_and(|r| r.through.is_some());
    let surfaces: Vec<&str> = run.fits.iter().filter(through).map(|f| f.label.as_str()).collect();
    if run.reference == "table" && !surfaces.is_empty() {
        notes.push(format!(
            "{} was fitted through the instrument: its picture is of the surface, the table's of what the instrument saw, so that sharp highlights differ by \
             the instrument's own blur.",
            surfaces.join(", ")
        ));
    }
    notes.join(" ")
}

/// About how wide the picture beside the title is, pixels.
const COVER: usize = 220;

/// The first picture, small, with its alternative text.
pub(super) fn cover(run: &Run) -> Option<(String, String)> {
    let first = run.pictures.first()?;
    let Image { width, height, .. } = first.image;
    let image = reduced(&first.image, (width / COVER).min(height).max(1));
    let exposure = run.exposure.unwrap_or_else(|| exposure_for(&first.image));
    Some((png(&develop(&image, exposure)).ok()?, format!("{}, rendered", first.label)))
}

/// By how much so many pictures are made smaller so that all fit; a strip keeps a pixel of its narrow side.
fn factor(width: usize, height: usize, pictures: usize) -> usize {
    let pixels = (width * height * pictures) as f64;
    let wanted = (pixels / MOST_PIXELS as f64).sqrt().ceil() as usize;
    wanted.min(width).min(height).max(1)
}

fn difference_shot(
    reference: &Image,
    image: &Image,
    range: f64,
    picture: &crate::report::run::Picture,
    first: &crate::report::run::Picture,
) -> Result<(String, String), ReportError> {
    let map = difference_map(image, reference, Some(range)).map_err(ChainError::from)?;
    let alt = format!(
        "Difference of luminance, {} less {}: red where it is brighter, blue where darker",
        picture.label, first.label
    );
    Ok((png(&map.bitmap)?, alt))
}

fn png(bitmap: &Bitmap) -> Result<String, ReportError> {
    Ok(data_uri("image/png", &encode_png(bitmap).map_err(ChainError::from)?))
}

/// What of a comparison stands in a line.
type Said = fn(&Value) -> Option<String>;

fn lines(fits: &[&RunFit]) -> Vec<Line> {
    let list: [(&'static str, Said); 9] = [
        ("rmse [W/(sr·m²)]", |c| c["rmse"].as_f64().map(number)),
        ("relMSE", |c| c["rel_mse"].as_f64().map(number)),
        ("PSNR [dB]", |c| c["psnr"].as_f64().map(number)),
        ("SSIM", |c| c["appearance"]["ssim"].as_f64().map(number)),
        ("ꟻLIP, mean", |c| c["appearance"]["flip"]["mean"].as_f64().map(number)),
        ("ΔE 2000, mean", |c| c["appearance"]["delta_e_2000"]["mean"].as_f64().map(number)),
        ("largest difference [W/(sr·m²)]", |c| c["max_abs"].as_f64().map(number)),
        ("pixels beyond their noise", |c| {
            let s = &c["significance"];
            let (differing, pixels) = (s["pixels_differing"].as_u64()?, s["pixels"].as_u64()?);
            let share = percent(differing as f64 / pixels.max(1) as f64);
            Some(if differing == 0 { "none".into() } else { format!("{} ({share})", count(differing)) })
        }),
        ("pixels not measured", |c| c["masked"].as_u64().map(count)),
    ];
    let of = |say: Said| {
        let cell = |f: &&RunFit| f.image.as_ref().and_then(say).unwrap_or_else(|| "–".into());
        fits.iter().map(cell).collect::<Vec<_>>()
    };
    list.into_iter().map(|(name, say)| Line { name, cells: of(say) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_become_as_small_as_they_must_and_strips_stay_pictures() {
        assert_eq!(factor(360, 360, 4), 1);
        assert_eq!(factor(1000, 1000, 3), 3);
        for (width, height) in [(1000, 3), (1, 4_000_000), (2_000_000, 1), (900_000, 4)] {
            let by = factor(width, height, 3);
            assert!(width / by >= 1 && height / by >= 1, "{width}×{height} by {by}");
        }
    }

    #[test]
    fn a_strip_has_a_cover_and_a_place_among_the_pictures() {
        let strip = |label: &str, level: f64| crate::report::run::Picture {
            label: label.into(),
            file: format!("{label}.exr"),
            image: Image { width: 600_000, height: 1, radiance: vec![[level; 3]; 600_000], ..Image::default() },
        };
        let run = Run { pictures: vec![strip("truth", 0.5), strip("fit", 0.4)], ..Run::empty() };
        assert!(cover(&run).is_some_and(|(png, _)| png.len() > 100));
        let shown = pictures(&run).expect("encodes").expect("two");
        assert_eq!((shown.width, shown.height, shown.shots.len()), (600_000, 1, 2));
    }
}
