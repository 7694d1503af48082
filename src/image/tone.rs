//! From linear radiance to 8-bit sRGB: exposure, clip, the sRGB transfer curve (IEC 61966-2-1). Nothing else: what is brighter
//! than white is cut off, so brightness below it can be compared between pictures.

use super::{Bitmap, Image};

/// The sRGB transfer curve: linear light in [0, 1] to the encoded value in [0, 1].
#[must_use]
pub fn srgb_encode(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The picture for eyes: value · 2^`exposure`, clipped to [0, 1], sRGB, rounded to 8 bits. Values that are not a number become
/// magenta, so that they are seen.
#[must_use]
pub fn develop(image: &Image, exposure: f64) -> Bitmap {
    let gain = exposure.exp2();
    let encode = |x: f64| (srgb_encode((gain * x).clamp(0.0, 1.0)) * 255.0).round() as u8;
    let pixel = |p: &[f64; 3]| if p.iter().any(|x| x.is_nan()) { [255, 0, 255] } else { p.map(encode) };
    Bitmap { width: image.width, height: image.height, pixels: image.radiance.iter().map(pixel).collect() }
}

/// The exposure (stops) at which the brightest channel of 99 % of the pixels is not clipped, lamps and mirror images of them (more than
/// 8 times the median of what is lit) left aside; 0 for a black picture.
#[must_use]
pub fn exposure_for(image: &Image) -> f64 {
    let brightest = |p: &[f64; 3]| p.iter().copied().fold(0.0, f64::max);
    let mut bright: Vec<f64> = image.radiance.iter().map(brightest).filter(|x| *x > 0.0 && x.is_finite()).collect();
    bright.sort_by(f64::total_cmp);
    let lamp = bright.get(bright.len() / 2).map_or(0.0, |median| 8.0 * median);
    let lit = &bright[..bright.partition_point(|x| *x <= lamp)];
    lit.get(lit.len() * 99 / 100).map_or(0.0, |white| -white.log2())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixel(value: f64) -> Image {
        Image { width: 1, height: 1, radiance: vec![[value; 3]], ..Image::default() }
    }

    #[test]
    fn published_values_of_the_transfer_curve() {
        // Linear 18 % grey is 118 of 255, 21.586 % is 128.
        assert_eq!(develop(&pixel(0.18), 0.0).pixels, [[118; 3]]);
        assert_eq!(develop(&pixel(0.215_860_5), 0.0).pixels, [[128; 3]]);
        assert_eq!(develop(&pixel(-1.0), 0.0).pixels, [[0; 3]]);
        assert_eq!(develop(&pixel(7.0), 0.0).pixels, [[255; 3]]);
        assert_eq!(develop(&pixel(f64::NAN), 0.0).pixels, [[255, 0, 255]]);
        // The two branches meet.
        assert!((srgb_encode(0.003_130_8) - srgb_encode(0.003_130_800_1)).abs() < 1e-7);
    }

    #[test]
    fn exposure_brings_the_white_point_to_one() {
        for scale in [1e-9, 0.25, 3.0, 1e12] {
            let exposure = exposure_for(&pixel(scale));
            assert!((scale * exposure.exp2() - 1.0).abs() < 1e-9, "{scale}: {exposure}");
        }
        assert!(exposure_for(&pixel(0.0)).abs() < 1e-15);
    }
}
