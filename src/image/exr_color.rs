//! The colours alone of an OpenEXR file, as 32-bit floats: for pictures that light a scene, which can be large.

use std::path::Path;

use exr::meta::header::Header;
use exr::prelude as ex;
use exr::prelude::{ReadChannels, ReadLayers};

use super::ImageError;
use super::exr_header::{invalid, open};

/// Linear RGB pixels along rows, row 0 on top.
#[derive(Debug, Clone, PartialEq)]
pub struct ColorGrid {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// `width`·`height` pixels.
    pub pixels: Vec<[f32; 3]>,
}

/// Reads `R`, `G` and `B` of the first layer that has them. A picture of more than `most` pixels is refused by its header, before
/// there is room made for it.
///
/// # Errors
/// [`ImageError`] naming the file and what was expected.
pub fn read_exr_colors(path: &Path, most: u64) -> Result<ColorGrid, ImageError> {
    let bytes = std::fs::read(path).map_err(|source| ImageError::Io { path: path.into(), source })?;
    let blocks = open(path, bytes, (most, u64::MAX))?;
    check_channels(path, blocks.headers())?;
    let create = |size: ex::Vec2<usize>, _: &_| ColorGrid {
        width: size.width(),
        height: size.height(),
        pixels: vec![[0.0; 3]; size.area()],
    };
    let set = |grid: &mut ColorGrid, at: ex::Vec2<usize>, (r, g, b): (f32, f32, f32)| {
        let index = at.y() * grid.width + at.x();
        if let Some(pixel) = grid.pixels.get_mut(index) {
            *pixel = [r, g, b];
        }
    };
    let channels = ex::read().no_deep_data().largest_resolution_level().rgb_channels(create, set);
    let file = channels.first_valid_layer().all_attributes().non_parallel().from_chunks(blocks);
    Ok(file.map_err(|e| invalid(path, &e))?.layer_data.channel_data.pixels)
}

/// Refuses what has no R, G and B.
fn check_channels(path: &Path, headers: &[Header]) -> Result<(), ImageError> {
    let names = |header: &Header| header.channels.list.iter().map(|c| c.name.to_string()).collect::<Vec<_>>();
    let has_rgb = |header| ["R", "G", "B"].iter().all(|c| names(header).iter().any(|n| n == c));
    if headers.iter().any(has_rgb) {
        return Ok(());
    }
    let found = format!("channels {}", headers.iter().flat_map(names).collect::<Vec<_>>().join(", "));
    Err(ImageError::Unsupported { path: path.into(), expected: "channels R, G and B".into(), found })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Image, encode_exr};

    #[test]
    fn colours_come_back_and_large_or_broken_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.exr");
        let radiance = (0..12).map(|i| [f64::from(i), 0.5, 1e5]).collect();
        let image = Image { width: 4, height: 3, radiance, ..Image::default() };
        let bytes = encode_exr(&image).unwrap();
        std::fs::write(&path, &bytes).unwrap();
        let grid = read_exr_colors(&path, 12).unwrap();
        assert_eq!((grid.width, grid.height, grid.pixels[7]), (4, 3, [7.0, 0.5, 1e5]));
        let message = read_exr_colors(&path, 11).unwrap_err().to_string();
        assert!(message.contains("sky.exr") && message.contains("found 4 x 3"), "{message}");
        for length in [0, 3, 100, bytes.len() / 2, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..length]).unwrap();
            let error = read_exr_colors(&path, 12).unwrap_err();
            assert!(matches!(error, ImageError::Invalid { .. }) && error.to_string().contains("sky.exr"), "{error}");
        }
    }
}
