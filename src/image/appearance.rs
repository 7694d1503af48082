//! How different two pictures look: metrics of the pictures as eyes see them, after one tone curve.

use serde::Serialize;

use super::color::{Color, lab, luminance};
use super::delta_e::{delta_e_1976, delta_e_2000};
use super::filter::Plane;
use super::flip::{Flip, PIXELS_PER_DEGREE};
use super::ssim::{mean_ssim, ssim_map};
use super::{Image, ImageError, exposure_for, hdr_flip, srgb_encode};

/// How different two pictures look, over the pixels that neither masks.
///
/// Both are exposed alike and clipped to [0, 1]: value · 2^`exposure`, then sRGB's curve, as in the previews but not rounded. Metrics
/// that look at neighbours see the reference's value in both pictures where a pixel is masked, so what is unknown adds no difference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Appearance {
    /// Exposure of both, stops: asked for, or that of the reference's preview.
    pub exposure: f64,
    /// Peak signal-to-noise ratio of the encoded sRGB values, the peak being white = 1, dB; `None` where they are the same.
    pub psnr: Option<f64>,
    /// Mean SSIM (Wang et al. 2004; 11 × 11 Gaussian window, σ = 1.5, K₁ = 0.01, K₂ = 0.03) of the luminance of the clipped pictures
    /// after sRGB's curve, over the pixels whose window lies inside of the picture (over all where there is none).
    pub ssim: f64,
    /// Colour difference of CIE 1976, white D65.
    pub delta_e_76: MeanAndMax,
    /// Colour difference of CIE 2000.
    pub delta_e_2000: MeanAndMax,
    /// LDR-ꟻLIP (Andersson et al. 2020) at 67 pixels per degree, 0 to 1.
    pub flip: MeanAndMax,
    /// HDR-ꟻLIP (Andersson et al. 2021), the curve ACES, over exposures that the reference calls for, whatever `exposure` is;
    /// `None` where the reference is black.
    pub hdr_flip: Option<MeanAndMax>,
}

/// A metric over the pixels compared. Colour differences are in units of L*a*b*: about 1 is just noticeable, 100 is black to white.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeanAndMax {
    /// Mean over the pixels.
    pub mean: f64,
    /// Largest.
    pub max: f64,
}

impl MeanAndMax {
    fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let (mut sum, mut count, mut max) = (0.0, 0.0, 0.0f64);
        for value in values {
            sum += value;
            count += 1.0;
            max = max.max(value);
        }
        Self { mean: sum / count, max }
    }
}

/// How different two pictures look at an exposure, or at that of the reference's preview. `None` where no pixel is known in
/// both, or a known one is not finite.
///
/// # Errors
/// [`ImageError::Sizes`] where the sizes differ, [`ImageError::Layer`] where a layer does not fit its picture.
pub fn appearance(image: &Image, reference: &Image, exposure: Option<f64>) -> Result<Option<Appearance>, ImageError> {
    Ok(Pair::new(image, reference, exposure)?.map(|pair| pair.appearance()))
}

/// LDR-ꟻLIP of every pixel; `None` for a masked pixel. Nothing at all in the cases of [`appearance`].
///
/// # Errors
/// As [`appearance`].
pub fn flip_map(
    image: &Image,
    reference: &Image,
    exposure: Option<f64>,
) -> Result<Option<Vec<Option<f64>>>, ImageError> {
    Ok(Pair::new(image, reference, exposure)?.map(|pair| {
        let map = pair.flip(&Flip::new(PIXELS_PER_DEGREE));
        map.into_iter().zip(&pair.known).map(|(e, known)| known.then_some(e)).collect()
    }))
}

/// Two pictures of one size without gaps.
struct Pair {
    width: usize,
    height: usize,
    known: Vec<bool>,
    exposure: f64,
    /// Linear radiance.
    radiance: [Vec<Color>; 2],
    /// Exposed and clipped, linear.
    clipped: [Vec<Color>; 2],
}

impl Pair {
    fn new(image: &Image, reference: &Image, exposure: Option<f64>) -> Result<Option<Self>, ImageError> {
        let known = image.known_with(reference)?;
        let finite = |p: &Color| p.iter().all(|x| x.is_finite());
        let both = |i: usize| finite(&image.radiance[i]) && finite(&reference.radiance[i]);
        if !known.contains(&true) || !(0..known.len()).filter(|i| known[*i]).all(both) {
            return Ok(None);
        }
        let exposure = exposure.unwrap_or_else(|| exposure_for(reference));
        let theirs = |i: usize| if finite(&reference.radiance[i]) { reference.radiance[i] } else { [0.0; 3] };
        let ours = |i: usize| if known[i] { image.radiance[i] } else { theirs(i) };
        let radiance = [(0..known.len()).map(ours).collect(), (0..known.len()).map(theirs).collect::<Vec<_>>()];
        let gain = exposure.exp2();
        let clip = |p: &Color| p.map(|x| (gain * x).clamp(0.0, 1.0));
        let clipped = [0, 1].map(|k: usize| radiance[k].iter().map(clip).collect());
        Ok(Some(Self { width: image.width, height: image.height, known, exposure, radiance, clipped }))
    }

    fn appearance(&self) -> Appearance {
        let flip = Flip::new(PIXELS_PER_DEGREE);
        let [a, b] = &self.clipped;
        let colors = |d: fn(Color, Color) -> f64| self.over_known(|i| d(lab(a[i]), lab(b[i])));
        let of_map = |map: &[f64]| self.over_known(|i| map[i]);
        let [test, reference] = &self.radiance;
        let hdr = hdr_flip::map(&flip, self.width, self.height, test, reference);
        Appearance {
            exposure: self.exposure,
            psnr: self.psnr(),
            ssim: self.ssim(),
            delta_e_76: colors(delta_e_1976),
            delta_e_2000: colors(delta_e_2000),
            flip: of_map(&self.flip(&flip)),
            hdr_flip: hdr.as_deref().map(of_map),
        }
    }

    fn over_known(&self, value: impl Fn(usize) -> f64) -> MeanAndMax {
        MeanAndMax::of((0..self.known.len()).filter(|i| self.known[*i]).map(value))
    }

    fn flip(&self, flip: &Flip) -> Vec<f64> {
        flip.map(self.width, self.height, &self.clipped[0], &self.clipped[1])
    }

    fn psnr(&self) -> Option<f64> {
        let [a, b] = &self.clipped;
        let square = |i: usize, c: usize| (srgb_encode(a[i][c]) - srgb_encode(b[i][c])).powi(2);
        let mse = self.over_known(|i| (square(i, 0) + square(i, 1) + square(i, 2)) / 3.0).mean;
        (mse > 0.0).then(|| -10.0 * mse.log10())
    }

    fn ssim(&self) -> f64 {
        let luma = |p: &[Color]| Plane::new(self.width, self.height, |i| srgb_encode(luminance(p[i])));
        let map = ssim_map(&luma(&self.clipped[0]), &luma(&self.clipped[1]));
        mean_ssim(&map, self.width, self.height, &self.known)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: usize, height: usize, value: impl Fn(usize) -> f64) -> Image {
        let radiance = (0..width * height).map(|i| [value(i), 0.7 * value(i), 0.4 * value(i)]).collect();
        Image { width, height, radiance, ..Image::default() }
    }

    fn look(a: &Image, b: &Image) -> Appearance {
        appearance(a, b, None).unwrap().unwrap()
    }

    /// The pictures of data-fixtures/reference/appearance.py.
    fn formula(steepness: f64) -> (Image, Image) {
        let of = |test: bool| {
            let pixel = |i: usize| {
                let (x, y) = ((i % 48) as f64, (i / 48) as f64);
                let ripple = if test { 0.9 + 0.1 * (1.3 * x + 0.5 * y).sin() } else { 1.0 };
                let gain = ripple * (steepness * x / 48.0).exp2();
                [0.0, 1.0, 2.0].map(|c: f64| gain * (0.5 + 0.4 * (0.7 * x + c).sin() * (0.3 * y - c).cos()))
            };
            Image { width: 48, height: 40, radiance: (0..48 * 40).map(pixel).collect(), ..Image::default() }
        };
        (of(true), of(false))
    }

    #[test]
    fn numbers_are_those_of_the_reference_programs() {
        let (test, reference) = formula(0.0);
        let a = appearance(&test, &reference, Some(0.0)).unwrap().unwrap();
        let (test, reference) = formula(9.0);
        let hdr = look(&test, &reference).hdr_flip.unwrap();
        // flip-evaluator computes in 32 bits.
        for (name, got, want, bound) in [
            ("FLIP, mean", a.flip.mean, 0.1853965, 2e-5),
            ("FLIP, max", a.flip.max, 0.3193610, 2e-5),
            ("HDR-FLIP, mean", hdr.mean, 0.1493364, 2e-5),
            ("HDR-FLIP, max", hdr.max, 0.2180377, 2e-5),
            ("SSIM", a.ssim, 0.960002107, 1e-9),
        ] {
            println!("{name}: {got:.9}, theirs {want:.9}");
            assert!((got - want).abs() < bound, "{name}: {got} vs {want}");
        }
    }

    #[test]
    fn a_picture_looks_like_itself() {
        for (width, height) in [(1, 1), (5, 3), (40, 30)] {
            let p = picture(width, height, |i| 0.1 + (i % 7) as f64);
            let a = look(&p, &p);
            assert_eq!((a.psnr, a.delta_e_76.max, a.delta_e_2000.max, a.flip.max), (None, 0.0, 0.0, 0.0));
            assert!((a.ssim - 1.0).abs() < 1e-12 && a.hdr_flip.unwrap().max == 0.0);
        }
    }

    #[test]
    fn radiance_of_any_size_looks_the_same() {
        let of = |s: f64| look(&picture(30, 20, |i| s * (i % 11) as f64), &picture(30, 20, |i| s * (i % 13) as f64));
        let one = of(1.0);
        for scale in [1e-20, 1e20] {
            let other = of(scale);
            let pairs = [
                (one.ssim, other.ssim),
                (one.flip.mean, other.flip.mean),
                (one.delta_e_2000.mean, other.delta_e_2000.mean),
                (one.hdr_flip.clone().unwrap().mean, other.hdr_flip.unwrap().mean),
            ];
            assert!(pairs.iter().all(|(a, b)| (a - b).abs() < 1e-9 && *a != 0.0), "{scale}: {pairs:?}");
        }
    }

    #[test]
    fn a_black_reference_has_no_hdr_flip_but_all_else() {
        let a = look(&picture(20, 20, |_| 1.0), &picture(20, 20, |_| 0.0));
        assert!(a.hdr_flip.is_none() && a.flip.mean > 0.5 && a.delta_e_76.mean > 50.0 && a.exposure == 0.0, "{a:?}");
    }

    #[test]
    fn what_is_masked_adds_nothing_even_where_it_is_not_finite() {
        let reference = picture(24, 24, |i| 0.2 + (i % 5) as f64 * 0.1);
        let mut image = reference.clone();
        image.radiance[100] = [f64::NAN, 9.0, 9.0];
        assert!(appearance(&image, &reference, None).unwrap().is_none());
        image.mask = Some((0..576).map(|i| f64::from(u8::from(i == 100))).collect());
        let a = look(&image, &reference);
        assert!(a.flip.max == 0.0 && a.delta_e_76.max == 0.0 && a.psnr.is_none());
        assert_eq!(flip_map(&image, &reference, None).unwrap().unwrap()[100], None);
        image.mask = Some(vec![1.0; 576]);
        assert!(appearance(&image, &reference, None).unwrap().is_none());
    }
}
