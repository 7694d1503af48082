//! Radiance for a page's script: half precision, compressed.

use base64::{Engine, engine::general_purpose::STANDARD};
use half::f16;
use miniz_oxide::deflate::compress_to_vec;

use crate::image::Image;

/// A picture whose pixels are means over squares of `factor`² pixels; masked where any of them is. What does not fill a square at the right and
/// the bottom is left out.
pub(super) fn reduced(image: &Image, factor: usize) -> Image {
    let (width, height) = (image.width / factor, image.height / factor);
    let mut radiance = Vec::with_capacity(width * height);
    let mut mask = image.mask.as_ref().map(|_| Vec::with_capacity(width * height));
    for y in 0..height {
        for x in 0..width {
            let places =
                (0..factor * factor).map(|k| (y * factor + k / factor) * image.width + x * factor + k % factor);
            let mut sum = [0.0; 3];
            let mut masked = 0.0f64;
            for i in places {
                (0..3).for_each(|c| sum[c] += image.radiance[i][c]);
                masked = masked.max(image.mask.as_ref().map_or(0.0, |m| m[i]));
            }
            radiance.push(sum.map(|s| s / (factor * factor) as f64));
            if let Some(mask) = &mut mask {
                mask.push(masked);
            }
        }
    }
    Image { width, height, radiance, mask, metadata: image.metadata.clone(), ..Image::default() }
}

/// Half-precision RGB, NaN where masked: all low bytes, then all high bytes, deflated, in base64.
pub(super) fn packed(image: &Image) -> String {
    let known = |i: usize| !image.is_masked(i);
    let value = |i: usize, v: f64| if known(i) { f16::from_f64(v.clamp(-65504.0, 65504.0)) } else { f16::NAN };
    let halves: Vec<u16> =
        image.radiance.iter().enumerate().flat_map(|(i, p)| p.map(|v| value(i, v).to_bits())).collect();
    let bytes: Vec<u8> = halves.iter().map(|h| *h as u8).chain(halves.iter().map(|h| (h >> 8) as u8)).collect();
    STANDARD.encode(compress_to_vec(&bytes, 8))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_packed_comes_back_to_half_precision_and_masks_as_nan() {
        let values: Vec<f64> = (0..24).map(|k| 0.013 * f64::from(k) * f64::from(k)).collect();
        let radiance: Vec<[f64; 3]> = values.chunks(3).map(|c| [c[0], c[1], c[2]]).collect();
        let mask = Some((0..8).map(|i| if i == 5 { 1.0 } else { 0.0 }).collect());
        let image = Image { width: 4, height: 2, radiance, mask, ..Image::default() };
        let bytes = miniz_oxide::inflate::decompress_to_vec(&STANDARD.decode(packed(&image)).expect("base64"))
            .expect("deflate");
        assert_eq!(bytes.len(), 48);
        for (k, want) in values.iter().enumerate() {
            let found = f16::from_bits(u16::from(bytes[k]) | u16::from(bytes[24 + k]) << 8).to_f64();
            let is_masked = k / 3 == 5;
            assert!(
                if is_masked { found.is_nan() } else { (found - want).abs() <= 5e-4 * want },
                "{k}: {found} vs {want}"
            );
        }
    }

    #[test]
    fn squares_are_averaged() {
        let radiance = (0..12).map(|k| [f64::from(k); 3]).collect();
        let image = Image { width: 4, height: 3, radiance, ..Image::default() };
        let small = reduced(&image, 2);
        assert_eq!((small.width, small.height), (2, 1));
        assert_eq!(small.radiance, [[2.5; 3], [4.5; 3]]);
    }
}
