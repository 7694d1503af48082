//! Pictures of a reference and of what should look like it, with their differences, in one folder.

use std::path::Path;

use serde::Serialize;

use super::error::ChainError;
use super::output::write_bytes;
use crate::image::sheet::{Scale, Sheet, Tile};
use crate::image::{
    Bitmap, ColorMap, Comparison, Image, ImageError, compare_at, comparison_sheet, develop, difference, difference_map,
    difference_range, encode_exr, encode_png, exposure_for,
};

/// A picture with its name, in file names and above the picture.
#[derive(Debug, Clone)]
pub struct Shown {
    /// Stem of its files.
    pub file: String,
    /// Stem of its difference's files; none for the reference.
    pub difference_file: String,
    /// What stands above it.
    pub label: String,
    /// The picture.
    pub image: Image,
}

/// What was written, and the numbers.
#[derive(Debug, Clone, Serialize)]
pub struct Gallery {
    /// One for each picture that was compared.
    pub comparisons: Vec<Comparison>,
    /// Exposure of the previews, stops.
    pub exposure: f64,
}

/// Writes `reference` and every other picture as EXR and PNG, the differences likewise, and a contact sheet of all
/// (`sheet.png`). All previews share one exposure (stops; by the reference where none is given), all difference maps one scale.
///
/// # Errors
/// [`ChainError`] where sizes differ or the disk refuses.
pub fn write_gallery(
    folder: &Path,
    title: &str,
    subtitle: &str,
    reference: &Shown,
    others: &[Shown],
    exposure: Option<f64>,
) -> Result<Gallery, ChainError> {
    let exposure = exposure.unwrap_or_else(|| exposure_for(&reference.image));
    let preview = |shown: &Shown| -> Result<Bitmap, ChainError> {
        write_bytes(&folder.join(format!("{}.exr", shown.file)), &encode_exr(&shown.image)?)?;
        let bitmap = develop(&shown.image, exposure);
        write_bytes(&folder.join(format!("{}.png", shown.file)), &encode_png(&bitmap)?)?;
        Ok(bitmap)
    };
    let comparisons = others
        .iter()
        .map(|shown| compare_at(&shown.image, &reference.image, Some(exposure)))
        .collect::<Result<Vec<_>, _>>()?;
    let range = shared_range(&reference.image, others)?;
    let mut pictures = vec![Tile::enlarged(preview(reference)?, &reference.label, String::new())];
    let mut maps = vec![legend(&reference.image)];
    for (shown, comparison) in others.iter().zip(&comparisons) {
        pictures.push(Tile::enlarged(preview(shown)?, &shown.label, String::new()));
        let name = &shown.difference_file;
        let exact = difference(&shown.image, &reference.image, Some(exposure))?;
        write_bytes(&folder.join(format!("{name}.exr")), &encode_exr(&exact)?)?;
        write_maps(folder, shown, reference, comparison, exposure)?;
        let map = difference_map(&shown.image, &reference.image, Some(range))?;
        write_bytes(&folder.join(format!("{name}.png")), &encode_png(&map.bitmap)?)?;
        let looks = comparison.appearance.as_ref().map_or(String::new(), |a| format!("   FLIP {:.4}", a.flip.mean));
        let caption = format!("rmse {:.2e}   relMSE {:.2e}{looks}", comparison.rmse, comparison.rel_mse);
        let unit = "W/(sr m²)".to_owned();
        let scale = Scale { map: ColorMap::Diverging, low: -map.range, high: map.range, unit };
        let label = format!("{} less {}", shown.label, reference.label);
        maps.push(Tile { scale: Some(scale), ..Tile::enlarged(map.bitmap, &label, caption) });
    }
    let columns = pictures.len();
    let tiles = pictures.into_iter().chain(maps).collect();
    let grey = if comparisons.iter().any(|c| c.masked > 0) { ", grey: not measured, left out" } else { "" };
    let sheet = Sheet { title: title.into(), subtitle: format!("{subtitle}{grey}"), columns, tiles };
    write_bytes(&folder.join("sheet.png"), &encode_png(&sheet.draw()?)?)?;
    Ok(Gallery { comparisons, exposure })
}

/// All maps of one picture's difference with their scales, in the file of the difference with `maps` in the place of `difference`.
fn write_maps(
    folder: &Path,
    shown: &Shown,
    reference: &Shown,
    comparison: &Comparison,
    exposure: f64,
) -> Result<(), ChainError> {
    let (image, reference) = ((shown.label.as_str(), &shown.image), (reference.label.as_str(), &reference.image));
    let sheet = comparison_sheet(image, reference, comparison, Some(exposure))?;
    let name = shown.difference_file.replacen("difference", "maps", 1);
    write_bytes(&folder.join(format!("{name}.png")), &encode_png(&sheet.draw()?)?)
}

/// The range that shows every picture's difference: the largest of those that differ, 1 where none does.
fn shared_range(reference: &Image, others: &[Shown]) -> Result<f64, ImageError> {
    let mut range = None;
    for shown in others {
        let own = difference_range(&shown.image, reference)?;
        range = range.into_iter().chain(own).reduce(f64::max);
    }
    Ok(range.unwrap_or(1.0))
}

/// The reference's own noise, so that differences can be judged against it.
fn legend(reference: &Image) -> Tile {
    let noise = Image {
        radiance: reference.standard_error.clone().unwrap_or_else(|| vec![[0.0; 3]; reference.radiance.len()]),
        standard_error: None,
        ..reference.clone()
    };
    let exposure = exposure_for(&noise);
    Tile::enlarged(
        develop(&noise, exposure),
        "standard error of the pixels",
        format!("white is {:.1e} W/(sr m²)", (-exposure).exp2()),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_like_its_reference_does_not_hide_the_differences_of_others() {
        let picture = |value: f64| Image { width: 1, height: 1, radiance: vec![[value; 3]], ..Image::default() };
        let shown = |value: f64| Shown {
            file: String::new(),
            difference_file: String::new(),
            label: String::new(),
            image: picture(value),
        };
        for (values, want) in
            [(vec![0.0, 3e-5], 5e-5), (vec![3e-5, 4e-3, 0.0], 5e-3), (vec![0.0, 0.0], 1.0), (vec![], 1.0)]
        {
            let others: Vec<Shown> = values.iter().map(|v| shown(*v)).collect();
            let range = shared_range(&picture(0.0), &others).expect("same size");
            assert!((range / want - 1.0).abs() < 1e-12, "{values:?}: {range}");
        }
    }
}
