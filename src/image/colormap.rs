//! False colours, and pictures of differences.

use super::color::luminance;
use super::{Bitmap, Image, ImageError};

/// What a value looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColorMap {
    /// Blue, white, red: signed values, white is 0. The map `RdBu` of Harrower and Brewer (2003), safe for colour-blind eyes.
    Diverging,
    /// Dark blue to yellow, equal steps to the eye: values from 0 up. Anchors of viridis (Smith & van der Walt 2015).
    Sequential,
    /// Black over purple to pale yellow, equal steps to the eye: ꟻLIP, as its authors show it. Anchors of magma (Smith & van der
    /// Walt 2015).
    Magma,
}

const DIVERGING: [[u8; 3]; 11] = [
    [5, 48, 97],
    [33, 102, 172],
    [67, 147, 195],
    [146, 197, 222],
    [209, 229, 240],
    [247, 247, 247],
    [253, 219, 199],
    [244, 165, 130],
    [214, 96, 77],
    [178, 24, 43],
    [103, 0, 31],
];

const SEQUENTIAL: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];

const MAGMA: [[u8; 3]; 9] = [
    [0, 0, 4],
    [29, 17, 71],
    [81, 18, 124],
    [130, 38, 129],
    [182, 54, 121],
    [230, 81, 100],
    [251, 136, 97],
    [254, 194, 135],
    [252, 253, 191],
];

/// What is unknown looks like this.
pub const UNKNOWN: [u8; 3] = [150, 150, 150];

impl ColorMap {
    /// Colour of a position `t` in [0, 1] along the map; beyond it the ends.
    #[must_use]
    pub fn color(self, t: f64) -> [u8; 3] {
        let anchors: &[[u8; 3]] = match self {
            Self::Diverging => &DIVERGING,
            Self::Sequential => &SEQUENTIAL,
            Self::Magma => &MAGMA,
        };
        let position = t.clamp(0.0, 1.0) * (anchors.len() - 1) as f64;
        let i = (position as usize).min(anchors.len() - 2);
        let f = position - i as f64;
        std::array::from_fn(|c| (f64::from(anchors[i][c]) * (1.0 - f) + f64::from(anchors[i + 1][c]) * f).round() as u8)
    }
}

/// A false-colour picture of a difference and what its colours mean.
#[derive(Debug, Clone, PartialEq)]
pub struct DifferenceMap {
    /// The picture; unknown pixels are grey.
    pub bitmap: Bitmap,
    /// The ends of the scale are −`range` and +`range`, W/(sr·m²).
    pub range: f64,
}

/// The signed difference of luminance, picture less reference, from −`range` to `range`. Without a range it is that of
/// [`difference_range`], or 1 where the pictures are the same.
///
/// # Errors
/// [`ImageError::Sizes`] where the sizes differ.
pub fn difference_map(image: &Image, reference: &Image, range: Option<f64>) -> Result<DifferenceMap, ImageError> {
    let differences = differences(image, reference)?;
    let range = range.or_else(|| range_of(&differences)).unwrap_or(1.0);
    let pixels = value_map(&differences, ColorMap::Diverging, range);
    Ok(DifferenceMap { bitmap: Bitmap { width: image.width, height: image.height, pixels }, range })
}

/// Colours of values from 0, or from −`range` where the map is diverging, to `range`.
pub(super) fn value_map(values: &[Option<f64>], map: ColorMap, range: f64) -> Vec<[u8; 3]> {
    let position = |v: f64| if map == ColorMap::Diverging { 0.5 + 0.5 * v / range } else { v / range };
    let color = |v: &Option<f64>| match v {
        None => UNKNOWN,
        Some(v) if v.is_nan() => [255, 0, 255],
        Some(v) => map.color(position(*v)),
    };
    values.iter().map(color).collect()
}

/// The range that shows the difference of two pictures well, W/(sr·m²): the 99.5th percentile of the absolute difference of
/// luminance (the largest one where that is 0), rounded up to 1, 2 or 5 times a power of ten. `None` where the pictures are the same.
///
/// # Errors
/// [`ImageError::Sizes`] where the sizes differ.
pub fn difference_range(image: &Image, reference: &Image) -> Result<Option<f64>, ImageError> {
    Ok(range_of(&differences(image, reference)?))
}

/// [`difference_range`] of any values.
pub(super) fn range_of(differences: &[Option<f64>]) -> Option<f64> {
    let mut sizes: Vec<f64> = differences.iter().flatten().map(|d| d.abs()).filter(|d| d.is_finite()).collect();
    sizes.sort_by(f64::total_cmp);
    let most = sizes.get(sizes.len() * 995 / 1000).filter(|d| **d > 0.0);
    most.or(sizes.last()).filter(|d| **d > 0.0).map(|d| round_up(*d))
}

/// Luminance of the picture less that of the reference, pixel by pixel; `None` where one of them is masked.
pub(super) fn differences(image: &Image, reference: &Image) -> Result<Vec<Option<f64>>, ImageError> {
    image.check_same_size(reference)?;
    let difference = |i: usize| {
        let known = !image.is_masked(i) && !reference.is_masked(i);
        known.then(|| luminance(image.radiance[i]) - luminance(reference.radiance[i]))
    };
    Ok((0..image.radiance.len()).map(difference).collect())
}

/// The next 1, 2 or 5 times a power of ten, for x > 0.
fn round_up(x: f64) -> f64 {
    let decade = 10f64.powf(x.log10().floor());
    let steps = [1.0, 2.0, 5.0];
    steps.iter().map(|s| s * decade).find(|r| *r >= x * (1.0 - 1e-12)).unwrap_or(10.0 * decade)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_is_zero_and_the_ends_are_the_range() {
        let picture = |values: [f64; 4]| Image {
            width: 4,
            height: 1,
            radiance: values.map(|v| [v; 3]).to_vec(),
            mask: Some(vec![0.0, 0.0, 0.0, 1.0]),
            ..Image::default()
        };
        let map = difference_map(&picture([1.0, 3.0, 2.0, 9.0]), &picture([2.0, 2.0, 2.0, 2.0]), None).unwrap();
        assert!((map.range - 1.0).abs() < 1e-15);
        assert_eq!(map.bitmap.pixels, [DIVERGING[0], DIVERGING[10], DIVERGING[5], UNKNOWN]);
    }

    #[test]
    fn ranges_are_round_numbers() {
        for (x, want) in [(1.0, 1.0), (1.1e-5, 2e-5), (4.0, 5.0), (7e9, 1e10), (0.002, 0.002)] {
            assert!((round_up(x) / want - 1.0).abs() < 1e-12, "{x}: {}", round_up(x));
        }
    }

    #[test]
    fn the_range_shows_what_differs() {
        let picture = |value: &dyn Fn(usize) -> f64| Image {
            width: 1000,
            height: 1,
            radiance: (0..1000).map(|i| [value(i); 3]).collect(),
            ..Image::default()
        };
        let black = picture(&|_| 0.0);
        let range = |image: &Image| difference_range(image, &black).unwrap();
        assert_eq!(range(&black), None);
        assert!((difference_map(&black, &black, None).unwrap().range - 1.0).abs() < 1e-15);
        // One pixel far off does not set the scale, but the only one that differs does.
        let spike = |i: usize| if i == 7 { 0.3 } else { 0.0 };
        for (value, want) in [(&(|i| 3e-5 + spike(i)) as &dyn Fn(usize) -> f64, 5e-5), (&spike, 0.5)] {
            assert!((range(&picture(value)).unwrap() / want - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn colors_run_from_end_to_end() {
        assert_eq!(ColorMap::Sequential.color(-1.0), SEQUENTIAL[0]);
        assert_eq!(ColorMap::Sequential.color(1.0), SEQUENTIAL[8]);
        assert_eq!(ColorMap::Diverging.color(0.55), [250, 233, 223]);
    }
}
