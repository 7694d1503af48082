//! What the headers of an OpenEXR file claim, checked before there is room made for it.

use std::io::Cursor;
use std::path::Path;

use exr::block::reader::Reader;
use exr::meta::header::Header;
use exr::prelude::Compression;

use super::ImageError;

/// The blocks of a file, whose header claims at most so many pixels a layer, so many values over all channels of all layers, and no more than its bytes can
/// hold.
pub(super) fn open(
    path: &Path,
    bytes: Vec<u8>,
    (most_pixels, most_values): (u64, u64),
) -> Result<Reader<Cursor<Vec<u8>>>, ImageError> {
    let length = bytes.len();
    let blocks = exr::block::read(Cursor::new(bytes), false).map_err(|e| invalid(path, &e))?;
    check_pixels(path, blocks.headers(), most_pixels)?;
    check_values(path, blocks.headers(), most_values)?;
    check_length(path, blocks.headers(), length)?;
    Ok(blocks)
}

/// What the reader says is wrong with a file.
pub(super) fn invalid(path: &Path, error: &exr::error::Error) -> ImageError {
    ImageError::Invalid { path: path.into(), format: "OpenEXR", reason: error.to_string() }
}

/// Refuses a layer of more than `most` pixels.
fn check_pixels(path: &Path, headers: &[Header], most: u64) -> Result<(), ImageError> {
    let large = headers.iter().find(|header| pixels(header) > most);
    large.map_or(Ok(()), |header| Err(unsupported(path, format!("at most {most} pixels"), size(header))))
}

/// Refuses more than `most` values, of all channels of all layers together.
fn check_values(path: &Path, headers: &[Header], most: u64) -> Result<(), ImageError> {
    let values = |header: &Header| pixels(header).saturating_mul(header.channels.list.len() as u64);
    let found = headers.iter().map(values).fold(0, u64::saturating_add);
    if found <= most {
        return Ok(());
    }
    Err(unsupported(path, format!("at most {most} values"), format!("{found}: {}", claims(headers))))
}

/// Refuses what the file's `length` bytes can't hold, however well it is compressed.
fn check_length(path: &Path, headers: &[Header], length: usize) -> Result<(), ImageError> {
    let least = headers.iter().map(least_bytes).fold(0, u64::saturating_add);
    if least <= length as u64 {
        return Ok(());
    }
    let claims = claims(headers);
    let reason = format!("its header says {claims}, which take {least} bytes at least; the file holds {length}");
    Err(ImageError::Invalid { path: path.into(), format: "OpenEXR", reason })
}

fn unsupported(path: &Path, expected: String, found: String) -> ImageError {
    ImageError::Unsupported { path: path.into(), expected, found }
}

fn pixels(header: &Header) -> u64 {
    (header.layer_size.width() as u64).saturating_mul(header.layer_size.height() as u64)
}

fn size(header: &Header) -> String {
    format!("{} x {}", header.layer_size.width(), header.layer_size.height())
}

fn claims(headers: &[Header]) -> String {
    let claim = |header: &Header| format!("{} pixels in {} channels", size(header), header.channels.list.len());
    headers.iter().map(claim).collect::<Vec<_>>().join(", ")
}

/// Bytes that a layer takes in a file at the least.
fn least_bytes(header: &Header) -> u64 {
    let of_pixel = header.channels.list.iter().map(|c| c.sample_type.bytes_per_sample() as u64).sum();
    pixels(header).saturating_mul(of_pixel) / most_expansion(header.compression)
}

/// How many bytes of pixels a byte of the file can stand for at most.
fn most_expansion(compression: Compression) -> u64 {
    match compression {
        Compression::Uncompressed => 1,
        // Deflate can say 258 bytes in 2 bits, 1032 a byte; PXR24 deflates 3 of each 4. Below that are runs of RLE (128
        // in 2 bytes), PIZ (255 values of 2 bytes in 9 bits) and flat blocks of B44A (32 bytes in 3).
        Compression::RLE
        | Compression::ZIP1
        | Compression::ZIP16
        | Compression::PIZ
        | Compression::PXR24
        | Compression::B44
        | Compression::B44A => 1032 * 4 / 3,
        // DWA deflates what is short already, so its bound would bound nothing.
        _ => u64::MAX,
    }
}
