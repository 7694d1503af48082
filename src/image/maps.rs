//! Maps of where and how two pictures differ, with their scale bars, as tiles of a sheet.

use super::colormap::{differences, range_of, value_map};
use super::compare::REL_MSE_FLOOR;
use super::sheet::{Scale, Sheet, Tile};
use super::significance::z_map;
use super::{Bitmap, ColorMap, Comparison, Image, ImageError, Layer, LayerKind, develop, exposure_for, flip_map};

/// Half the width of the scale of differences over their noise, standard errors.
const Z_RANGE: f64 = 6.0;

/// (x − ref)/√(ref² + 0.01) of every value; its mean square is relMSE.
fn relative(image: &Image, reference: &Image) -> Vec<[f64; 3]> {
    let one = |x: f64, r: f64| (x - r) / (r * r + REL_MSE_FLOOR).sqrt();
    let pair = image.radiance.iter().zip(&reference.radiance);
    pair.map(|(x, r)| [0, 1, 2].map(|c| one(x[c], r[c]))).collect()
}

/// The picture less the reference, pixel by pixel, with the error of the difference; masked where either is. Its layers are the
/// relative difference and, where there is one, ꟻLIP (0 in masked pixels).
///
/// # Errors
/// [`ImageError::Sizes`] where the sizes differ, [`ImageError::Layer`] where a layer does not fit its picture.
pub fn difference(image: &Image, reference: &Image, exposure: Option<f64>) -> Result<Image, ImageError> {
    image.check_same_size(reference)?;
    let zip = |a: &[[f64; 3]], b: &[[f64; 3]], f: fn(f64, f64) -> f64| -> Vec<[f64; 3]> {
        a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| f(a[c], b[c]))).collect()
    };
    let errors = image.standard_error.as_ref().zip(reference.standard_error.as_ref());
    let mask = match (&image.mask, &reference.mask) {
        (Some(a), Some(b)) => Some(a.iter().zip(b).map(|(a, b)| a.max(*b)).collect()),
        (one, other) => one.clone().or_else(|| other.clone()),
    };
    let mut layers = vec![Layer::of_colors(LayerKind::Relative, &relative(image, reference))];
    if let Some(map) = flip_map(image, reference, exposure)? {
        layers.push(Layer::of_values(LayerKind::Flip, map.into_iter().map(|e| e.unwrap_or(0.0)).collect()));
    }
    Ok(Image {
        radiance: zip(&image.radiance, &reference.radiance, |a, b| a - b),
        standard_error: errors.map(|(a, b)| zip(a, b, f64::hypot)),
        mask,
        layers,
        ..image.clone()
    })
}

/// Maps of two pictures' difference, relative difference and, where there are, ꟻLIP and the difference over its noise.
///
/// # Errors
/// [`ImageError::Sizes`] where the sizes differ, [`ImageError::Layer`] where a layer does not fit its picture.
pub fn map_tiles(
    image: &Image,
    reference: &Image,
    comparison: &Comparison,
    exposure: Option<f64>,
) -> Result<Vec<Tile>, ImageError> {
    let known = image.known_with(reference)?;
    let noise = z_map(image, reference, &known).zip(comparison.significance.as_ref());
    let noise = noise.map(|(z, s)| Map {
        label: "difference over its noise",
        caption: format!("{} of {} pixels beyond noise (1 % for all)", s.pixels_differing, s.pixels),
        values: z,
        range: Some(Z_RANGE),
        colors: ColorMap::Diverging,
        unit: "σ",
    });
    let difference = Map {
        label: "difference of luminance",
        caption: format!("rmse {:.2e}   largest {:.2e}", comparison.rmse, comparison.max_abs),
        values: differences(image, reference)?,
        range: None,
        colors: ColorMap::Diverging,
        unit: "W/(sr m²)",
    };
    let mean = |p: &[f64; 3]| (p[0] + p[1] + p[2]) / 3.0;
    let relative = relative(image, reference);
    let relative = Map {
        label: "relative difference",
        caption: format!("relMSE {:.2e}", comparison.rel_mse),
        values: relative.iter().zip(&known).map(|(p, known)| known.then(|| mean(p))).collect(),
        range: None,
        colors: ColorMap::Diverging,
        unit: "",
    };
    let flip = flip_map(image, reference, exposure)?.zip(comparison.appearance.as_ref());
    let flip = flip.map(|(values, looks)| Map {
        label: "FLIP: how different it looks",
        caption: format!("mean {:.4}   largest {:.3}", looks.flip.mean, looks.flip.max),
        values,
        range: None,
        colors: ColorMap::Magma,
        unit: "",
    });
    let maps = noise.into_iter().chain([difference, relative]).chain(flip);
    Ok(maps.map(|map| map.tile(image.width, image.height)).collect())
}

/// What a map shows, and how.
struct Map {
    label: &'static str,
    caption: String,
    /// `None` is grey.
    values: Vec<Option<f64>>,
    /// The end of the scale; without one that which shows the values well.
    range: Option<f64>,
    colors: ColorMap,
    unit: &'static str,
}

impl Map {
    fn tile(self, width: usize, height: usize) -> Tile {
        let high = self.range.or_else(|| range_of(&self.values)).unwrap_or(1.0);
        let low = if self.colors == ColorMap::Diverging { -high } else { 0.0 };
        let picture = Bitmap { width, height, pixels: value_map(&self.values, self.colors, high) };
        let scale = Some(Scale { map: self.colors, low, high, unit: self.unit.into() });
        Tile { scale, ..Tile::enlarged(picture, self.label, self.caption) }
    }
}

/// A sheet of a picture, its reference and the maps of their difference.
///
/// # Errors
/// As [`map_tiles`].
pub fn comparison_sheet(
    image: (&str, &Image),
    reference: (&str, &Image),
    comparison: &Comparison,
    exposure: Option<f64>,
) -> Result<Sheet, ImageError> {
    let shown = exposure.unwrap_or_else(|| exposure_for(reference.1));
    let preview = |(name, p): (&str, &Image)| Tile::enlarged(develop(p, shown), name, String::new());
    let mut tiles = vec![preview(image), preview(reference)];
    tiles.extend(map_tiles(image.1, reference.1, comparison, exposure)?);
    let grey = "grey: masked or, over noise, equal without any";
    let subtitle = format!("{} pixels compared; {grey}; previews at {shown:+.2} stops", comparison.pixels);
    Ok(Sheet { title: format!("{} less {}", image.0, reference.0), subtitle, columns: 3, tiles })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::compare;

    fn picture(value: impl Fn(usize) -> f64) -> Image {
        Image { width: 6, height: 4, radiance: (0..24).map(|i| [value(i); 3]).collect(), ..Image::default() }
    }

    #[test]
    fn the_mean_square_of_the_relative_layer_is_rel_mse() {
        let (image, reference) = (picture(|i| i as f64), picture(|i| 1.1 * i as f64));
        let d = difference(&image, &reference, None).unwrap();
        let square: f64 = d.layers[0].planes.as_slice().concat().iter().map(|x| x * x).sum();
        let want = compare(&image, &reference).unwrap().rel_mse;
        assert!((square / 72.0 / want - 1.0).abs() < 1e-12);
        assert_eq!(d.layers[1].kind, LayerKind::Flip);
    }

    #[test]
    fn a_mask_of_one_picture_masks_the_difference() {
        let mut image = picture(|_| 1.0);
        image.mask = Some(vec![1.0; 24]);
        let d = difference(&picture(|_| 2.0), &image, None).unwrap();
        assert!(d.is_masked(3) && d.layers.len() == 1);
    }

    #[test]
    fn there_is_a_map_for_everything_that_is_known() {
        let mut image = picture(|i| i as f64);
        let reference = picture(|i| 1.1 * i as f64);
        let count = |image: &Image| {
            let c = compare(image, &reference).unwrap();
            let sheet = comparison_sheet(("a", image), ("b", &reference), &c, None).unwrap();
            assert!(sheet.draw().is_ok());
            sheet.tiles.len()
        };
        assert_eq!(count(&image), 5);
        image.standard_error = Some(vec![[0.1; 3]; 24]);
        assert_eq!(count(&image), 6);
        image.radiance[3][0] = f64::NAN;
        assert_eq!(count(&image), 4);
    }
}
