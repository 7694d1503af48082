//! In which numbers two pictures differ, and whether they differ by more than their noise.

use serde::Serialize;

use super::significance::{Significance, significance};
use super::{Appearance, Image, ImageError, MASKED_SHARE, appearance};
use crate::numeric::float::larger;

/// Added to the squared reference in [`Comparison::rel_mse`], so that dark pixels do not dominate, (W/(sr·m²))².
pub(super) const REL_MSE_FLOOR: f64 = 1e-2;

/// Differences between a picture and its reference over all pixels that neither masks, all channels alike.
///
/// Where nothing could be compared, every mean and `max_abs` is NaN (`null` in JSON): no pixels agree with nothing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Pixels compared.
    pub pixels: usize,
    /// Pixels left out because one of the pictures masks them.
    pub masked: usize,
    /// √ mean (x − ref)², W/(sr·m²).
    pub rmse: f64,
    /// mean (x − ref)²/(ref² + 0.01).
    pub rel_mse: f64,
    /// 20 log₁₀(largest value of the reference / rmse), dB; `None` where the pictures are the same, or the reference is black.
    pub psnr: Option<f64>,
    /// Largest |x − ref|, W/(sr·m²).
    pub max_abs: f64,
    /// Mean per channel of the picture.
    pub mean: [f64; 3],
    /// Mean per channel of the reference.
    pub reference_mean: [f64; 3],
    /// Values of either picture that are not finite; they make the numbers above not finite too.
    pub not_finite: usize,
    /// The first of them, row by row; `None` where there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_not_finite: Option<NotFinite>,
    /// How different the pictures look; `None` where nothing is compared, or a value is not finite.
    pub appearance: Option<Appearance>,
    /// Whether the differences exceed the noise; `None` where that can't be said.
    pub significance: Option<Significance>,
    /// Why there is no `significance`, or why not to trust it.
    pub note: Option<String>,
}

/// Where a picture has a value that is not finite.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct NotFinite {
    /// Whether it is in the reference.
    pub in_reference: bool,
    /// Column and row of the pixel, and the channel.
    pub at: (usize, usize, usize),
}

/// Compares a picture with its reference, at the exposure of the reference's preview where looks are compared.
///
/// # Errors
/// [`ImageError::Sizes`] where the sizes differ, [`ImageError::Layer`] where a layer does not fit its picture.
pub fn compare(image: &Image, reference: &Image) -> Result<Comparison, ImageError> {
    compare_at(image, reference, None)
}

/// [`compare`], at an exposure (stops).
///
/// # Errors
/// As [`compare`].
pub fn compare_at(image: &Image, reference: &Image, exposure: Option<f64>) -> Result<Comparison, ImageError> {
    let known = image.known_with(reference)?;
    let pixels = known.iter().filter(|known| **known).count();
    let (mut squares, mut relative, mut max_abs, mut peak) = (0.0, 0.0, 0.0f64, 0.0f64);
    let (mut sum, mut reference_sum, mut not_finite, mut first) = ([0.0; 3], [0.0; 3], 0, None);
    for i in (0..known.len()).filter(|i| known[*i]) {
        for c in 0..3 {
            let (x, r) = (image.radiance[i][c], reference.radiance[i][c]);
            let d2 = (x - r) * (x - r);
            squares += d2;
            relative += d2 / (r * r + REL_MSE_FLOOR);
            max_abs = if (x - r).is_nan() { f64::NAN } else { larger(max_abs, (x - r).abs()) };
            peak = peak.max(r);
            sum[c] += x;
            reference_sum[c] += r;
            for (_, in_reference) in [(x, false), (r, true)].into_iter().filter(|(value, _)| !value.is_finite()) {
                not_finite += 1;
                first = first.or(Some(NotFinite { in_reference, at: (i % image.width, i / image.width, c) }));
            }
        }
    }
    // 0/0 where nothing was compared: NaN, on purpose.
    let mean = |sum: [f64; 3]| sum.map(|s| s / pixels as f64);
    let mean_of_all = |sum: f64| sum / (3 * pixels) as f64;
    let rmse = mean_of_all(squares).sqrt();
    let (significance, note) = match significance(image, reference, &known) {
        Ok(found) => (Some(found), same_noise(image, reference)),
        Err(why) => (None, Some(why)),
    };
    Ok(Comparison {
        pixels,
        masked: known.len() - pixels,
        rmse,
        rel_mse: mean_of_all(relative),
        psnr: (rmse > 0.0 && peak > 0.0).then(|| 20.0 * (peak / rmse).log10()),
        max_abs: if pixels == 0 { f64::NAN } else { max_abs },
        mean: mean(sum),
        reference_mean: mean(reference_sum),
        not_finite,
        first_not_finite: first,
        appearance: appearance(image, reference, exposure)?,
        significance,
        note,
    })
}

/// Pictures from one seed share their noise, which the test takes for independent.
fn same_noise(image: &Image, reference: &Image) -> Option<String> {
    let seed = image.metadata.seed.filter(|_| image.standard_error.is_some() && reference.standard_error.is_some())?;
    let shared = reference.metadata.seed == Some(seed) && image.metadata.scene == reference.metadata.scene;
    shared.then(|| {
        format!(
            "both pictures were rendered with seed {seed}: their noise is not independent, as the test takes it to be"
        )
    })
}

impl Image {
    /// Whether more of the light of pixel `i` is unknown than [`MASKED_SHARE`].
    #[must_use]
    pub fn is_masked(&self, i: usize) -> bool {
        self.mask.as_ref().and_then(|mask| mask.get(i)).is_some_and(|share| *share > MASKED_SHARE)
    }

    /// Which pixels neither picture masks.
    pub(super) fn known_with(&self, reference: &Self) -> Result<Vec<bool>, ImageError> {
        self.check_same_size(reference)?;
        Ok((0..self.radiance.len()).map(|i| !self.is_masked(i) && !reference.is_masked(i)).collect())
    }

    /// Whether two pictures have the same size and layers of that size.
    pub(super) fn check_same_size(&self, reference: &Self) -> Result<(), ImageError> {
        let (image, other) = ((self.width, self.height), (reference.width, reference.height));
        if image != other {
            return Err(ImageError::Sizes { image, reference: other });
        }
        self.check_layers()?;
        reference.check_layers()
    }

    /// Whether all layers have as many pixels as the picture.
    pub(super) fn check_layers(&self) -> Result<(), ImageError> {
        let (width, height) = (self.width, self.height);
        let layers = [
            ("radiance", Some(self.radiance.len())),
            ("stderr", self.standard_error.as_ref().map(Vec::len)),
            ("mask", self.mask.as_ref().map(Vec::len)),
        ];
        let further = self.layers.iter().flat_map(|l| l.kind.channels().iter().zip(&l.planes));
        let further = further.map(|(name, plane)| (*name, Some(plane.len())));
        for (layer, found) in layers.into_iter().chain(further) {
            if let Some(found) = found.filter(|found| *found != width * height) {
                return Err(ImageError::Layer { layer, width, height, found });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: usize, height: usize, value: impl Fn(usize) -> f64) -> Image {
        let radiance = (0..width * height).map(|i| [value(3 * i), value(3 * i + 1), value(3 * i + 2)]).collect();
        Image { width, height, radiance, ..Image::default() }
    }

    #[test]
    fn numbers_of_a_constant_difference_are_closed_forms() {
        for (reference, d) in [(0.5, 0.1), (0.0, 1e-3), (4.0, -1.0)] {
            let c = compare(&picture(8, 4, |_| reference + d), &picture(8, 4, |_| reference)).unwrap();
            assert!((c.rmse - d.abs()).abs() < 1e-15 && (c.max_abs - d.abs()).abs() < 1e-15);
            assert!((c.rel_mse / (d * d / (reference * reference + 0.01)) - 1.0).abs() < 1e-12);
            let psnr = (reference > 0.0).then(|| 20.0 * (reference / d.abs()).log10());
            assert!(psnr.zip(c.psnr).is_none_or(|(a, b)| (a - b).abs() < 1e-9) && psnr.is_some() == c.psnr.is_some());
            assert!((c.mean[1] - reference - d).abs() < 1e-14 && c.significance.is_none());
        }
        let same = compare(&picture(3, 3, |i| i as f64), &picture(3, 3, |i| i as f64)).unwrap();
        assert_eq!((same.rmse, same.psnr, same.max_abs), (0.0, None, 0.0));
    }

    #[test]
    fn masked_pixels_do_not_count_and_nan_is_not_hidden() {
        let mut image = picture(4, 1, |i| if i < 3 { 1e9 } else { 1.0 });
        let reference = picture(4, 1, |_| 1.0);
        assert!(compare(&image, &reference).unwrap().max_abs > 1e8);
        image.mask = Some(vec![0.25, 0.0, 0.0, 0.0]);
        let c = compare(&image, &reference).unwrap();
        assert_eq!((c.rmse, c.pixels, c.masked), (0.0, 3, 1));
        image.radiance[2][1] = f64::NAN;
        let c = compare(&image, &reference).unwrap();
        assert!(c.rmse.is_nan() && c.max_abs.is_nan() && c.not_finite == 1 && c.appearance.is_none());
        assert_eq!(c.first_not_finite, Some(NotFinite { in_reference: false, at: (2, 0, 1) }));
    }

    #[test]
    fn comparing_nothing_is_not_agreement() {
        let mut image = picture(4, 2, |_| 1.0);
        image.standard_error = Some(vec![[0.1; 3]; 8]);
        image.mask = Some(vec![1.0; 8]);
        for (image, reference) in [(image, picture(4, 2, |_| 1.0)), (Image::default(), Image::default())] {
            let c = compare(&image, &reference).unwrap();
            let numbers = [c.rmse, c.rel_mse, c.max_abs, c.mean[0], c.reference_mean[2]];
            assert!(c.pixels == 0 && numbers.iter().all(|x| x.is_nan()), "{c:?}");
            assert!(c.psnr.is_none() && c.significance.is_none() && c.note.is_some(), "{c:?}");
            let json = serde_json::to_value(&c).unwrap();
            assert!(json["rmse"].is_null() && json["max_abs"].is_null(), "{json}");
        }
    }

    #[test]
    fn a_small_unknown_share_does_not_mask() {
        let mut image = picture(4, 1, |_| 1.0);
        image.mask = Some(vec![0.0, MASKED_SHARE, 1.01 * MASKED_SHARE, 1.0]);
        assert_eq!(compare(&image, &picture(4, 1, |_| 1.0)).unwrap().masked, 2);
    }

    #[test]
    fn sizes_and_layers_must_agree() {
        let error = compare(&picture(4, 2, |_| 0.0), &picture(2, 4, |_| 0.0)).unwrap_err();
        assert!(error.to_string().contains("4x2") && error.to_string().contains("2x4"), "{error}");
        let mut broken = picture(4, 2, |_| 0.0);
        broken.mask = Some(vec![0.0; 3]);
        assert!(matches!(compare(&broken, &picture(4, 2, |_| 0.0)), Err(ImageError::Layer { layer: "mask", .. })));
    }
}
