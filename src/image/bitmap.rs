//! 8-bit pictures and PNG files.

use super::ImageError;

/// An 8-bit sRGB picture. Pixels run along rows, row 0 on top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bitmap {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// `width`·`height` pixels.
    pub pixels: Vec<[u8; 3]>,
}

impl Bitmap {
    /// A picture of one colour.
    #[must_use]
    pub fn filled(width: usize, height: usize, color: [u8; 3]) -> Self {
        Self { width, height, pixels: vec![color; width * height] }
    }

    /// Every pixel as a square of `factor`² pixels; as it is for 0 or 1.
    #[must_use]
    pub fn enlarged(self, factor: usize) -> Self {
        if factor < 2 {
            return self;
        }
        let (width, height) = (self.width * factor, self.height * factor);
        let pixel = |i: usize| self.pixels[i / width / factor * self.width + i % width / factor];
        Self { width, height, pixels: (0..width * height).map(pixel).collect() }
    }

    /// The pixel in column x and row y, if it is inside.
    pub fn pixel_mut(&mut self, x: usize, y: usize) -> Option<&mut [u8; 3]> {
        (x < self.width).then(|| self.pixels.get_mut(y * self.width + x))?
    }

    /// Paints a rectangle; what lies outside of the picture is cut off.
    pub fn fill(&mut self, x: usize, y: usize, width: usize, height: usize, color: [u8; 3]) {
        for row in y..(y + height).min(self.height) {
            for column in x..(x + width).min(self.width) {
                self.pixels[row * self.width + column] = color;
            }
        }
    }

    /// Copies a picture to column x and row y; what lies outside is cut off.
    pub fn paste(&mut self, x: usize, y: usize, other: &Self) {
        let columns = other.width.min(self.width.saturating_sub(x));
        if other.width == 0 || columns == 0 {
            return;
        }
        for (row, line) in other.pixels.chunks_exact(other.width).enumerate().take(self.height.saturating_sub(y)) {
            let start = (y + row) * self.width + x;
            self.pixels[start..start + columns].copy_from_slice(&line[..columns]);
        }
    }
}

/// The bytes of an 8-bit PNG file marked as sRGB.
///
/// # Errors
/// [`ImageError::Layer`] where the pixels do not fit the size, [`ImageError::Encode`] where the encoder refuses.
pub fn encode_png(bitmap: &Bitmap) -> Result<Vec<u8>, ImageError> {
    let (width, height, found) = (bitmap.width, bitmap.height, bitmap.pixels.len());
    if found != width * height {
        return Err(ImageError::Layer { layer: "pixels", width, height, found });
    }
    let refused = |e: png::EncodingError| ImageError::Encode { format: "PNG", reason: e.to_string() };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    let mut writer = encoder.write_header().map_err(refused)?;
    writer.write_image_data(bitmap.pixels.as_flattened()).map_err(refused)?;
    writer.finish().map_err(refused)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_outside_is_cut_off() {
        let mut canvas = Bitmap::filled(4, 3, [0; 3]);
        canvas.paste(2, 1, &Bitmap::filled(5, 5, [9; 3]));
        canvas.fill(0, 0, 1, 100, [7; 3]);
        let painted = |color| canvas.pixels.iter().filter(|p| **p == color).count();
        assert_eq!((painted([9; 3]), painted([7; 3]), painted([0; 3])), (4, 3, 5));
    }

    #[test]
    fn enlarging_repeats_pixels() {
        let mut small = Bitmap::filled(2, 1, [1; 3]);
        *small.pixel_mut(1, 0).unwrap() = [9; 3];
        let large = small.enlarged(2);
        assert_eq!((large.width, large.height), (4, 2));
        assert_eq!(large.pixels, [[1; 3], [1; 3], [9; 3], [9; 3], [1; 3], [1; 3], [9; 3], [9; 3]]);
    }

    #[test]
    fn png_files_come_back() {
        let mut bitmap = Bitmap::filled(7, 5, [1, 2, 3]);
        *bitmap.pixel_mut(6, 4).unwrap() = [200, 100, 50];
        let file = encode_png(&bitmap).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
        let mut bytes = vec![0; 7 * 5 * 3];
        reader.next_frame(&mut bytes).unwrap();
        assert_eq!(bytes, bitmap.pixels.as_flattened());
        assert!(reader.info().srgb.is_some());
        bitmap.pixels.pop();
        assert!(matches!(encode_png(&bitmap), Err(ImageError::Layer { found: 34, .. })));
    }
}
