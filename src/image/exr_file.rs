//! OpenEXR files: `R`, `G`, `B` hold the radiance, so any viewer opens it; `stderr.R` … its standard error, `mask` the expected
//! share of the pixel's light that nobody measured, 0 to 1 (1 too where a stopped render left a pixel without samples). Further
//! layers have the channels that [`LayerKind::channels`] names: `albedo.R` …, `normal.X` …, `depth.Z`, `samples`, `direct.R` ….
//!
//! Values are written as 32-bit floats, compressed without loss; how the picture came about stands in text attributes named
//! `goniofit.…`.

use std::io::Cursor;
use std::path::Path;

use exr::prelude as ex;
use exr::prelude::{ReadChannels, ReadLayers, WritableImage};

use super::exr_header::{invalid, open};
use super::{Image, ImageError, Layer, LayerKind, MAX_PIXELS, Metadata};

type Channel = ex::AnyChannel<ex::FlatSamples>;
type Attributes = std::collections::HashMap<ex::Text, ex::AttributeValue>;

/// The bytes of a file that holds a picture with its layers.
///
/// # Errors
/// [`ImageError::Layer`] where a layer's length disagrees with the size, [`ImageError::Encode`] where the encoder refuses.
pub fn encode_exr(image: &Image) -> Result<Vec<u8>, ImageError> {
    let channels = channels(image)?;
    let mut attributes = ex::LayerAttributes::default();
    // A single attribute: several would stand in the file in an order that changes from run to run.
    let text = serde_json::to_string(&image.metadata).map_err(|e| refused_text(&e))?;
    attributes.other.insert(ATTRIBUTE.into(), ex::AttributeValue::Text(text.as_str().into()));
    attributes.software_name = image.metadata.program.as_deref().map(ex::Text::from);
    let encoding = ex::Encoding { compression: ex::Compression::ZIP16, ..ex::Encoding::default() };
    let layer = ex::Layer::new(
        (image.width, image.height),
        attributes,
        encoding,
        ex::AnyChannels::sort(channels.into_iter().collect()),
    );
    let mut bytes = Cursor::new(Vec::new());
    let refused = |e: exr::error::Error| ImageError::Encode { format: "OpenEXR", reason: e.to_string() };
    ex::Image::from_layer(layer).write().to_buffered(&mut bytes).map_err(refused)?;
    Ok(bytes.into_inner())
}

/// Reads a picture: its first layer that has `R`, `G` and `B` (or `Y` alone), and the layers written by [`encode_exr`].
/// More pixels than [`MAX_PIXELS`], or more values than the largest picture with all layers has, are refused by the
/// header, before there is room made for them.
///
/// # Errors
/// [`ImageError`] naming the file and what was expected.
pub fn read_exr(path: &Path) -> Result<Image, ImageError> {
    decode_exr(path, std::fs::read(path).map_err(|source| ImageError::Io { path: path.into(), source })?)
}

/// [`read_exr`] from bytes; messages call them `path`.
///
/// # Errors
/// As [`read_exr`].
pub fn decode_exr(path: &Path, bytes: Vec<u8>) -> Result<Image, ImageError> {
    let file = read_all(path, bytes)?;
    let found = || file.layer_data.iter().flat_map(|l| &l.channel_data.list).map(|c| c.name.to_string());
    let unsupported = || ImageError::Unsupported {
        path: path.into(),
        expected: "channels R, G, B, or Y alone".into(),
        found: format!("channels {}", found().collect::<Vec<_>>().join(", ")),
    };
    let layer = file.layer_data.iter().find(|l| rgb(&l.channel_data.list, "").is_some()).ok_or_else(unsupported)?;
    let list = &layer.channel_data.list;
    Ok(Image {
        width: layer.size.0,
        height: layer.size.1,
        radiance: rgb(list, "").ok_or_else(unsupported)?,
        standard_error: rgb(list, "stderr."),
        mask: plane(list, "mask"),
        layers: LayerKind::ALL.into_iter().filter_map(|kind| further(list, kind)).collect(),
        metadata: metadata(&layer.attributes.other),
    })
}

/// All channels of all layers, if the header claims no more than there can be.
fn read_all(path: &Path, bytes: Vec<u8>) -> Result<ex::FlatImage, ImageError> {
    let blocks = open(path, bytes, (MAX_PIXELS, MAX_PIXELS * most_channels()))?;
    let read = ex::read().no_deep_data().largest_resolution_level().all_channels().all_layers().all_attributes();
    read.non_parallel().from_chunks(blocks).map_err(|e| invalid(path, &e))
}

/// Channels of a picture with all that [`encode_exr`] writes. Other programs' pictures may have more of them, the smaller
/// they are.
fn most_channels() -> u64 {
    let radiance_error_and_mask = 7;
    radiance_error_and_mask + LayerKind::ALL.iter().map(|kind| kind.channels().len() as u64).sum::<u64>()
}

fn channels(image: &Image) -> Result<Vec<Channel>, ImageError> {
    image.check_layers()?;
    let samples = |values: Vec<f32>| ex::FlatSamples::F32(values);
    let mut channels = Vec::new();
    let mut add = |prefix: &str, values: &[[f64; 3]]| {
        for (i, name) in ["R", "G", "B"].iter().enumerate() {
            let plane = values.iter().map(|p| p[i] as f32).collect();
            channels.push(Channel::new(format!("{prefix}{name}").as_str(), samples(plane)));
        }
    };
    add("", &image.radiance);
    if let Some(error) = &image.standard_error {
        add("stderr.", error);
    }
    if let Some(mask) = &image.mask {
        channels.push(Channel::new("mask", samples(mask.iter().map(|m| *m as f32).collect())));
    }
    for layer in &image.layers {
        for (name, plane) in layer.kind.channels().iter().zip(&layer.planes) {
            channels.push(Channel::new(*name, samples(plane.iter().map(|v| *v as f32).collect())));
        }
    }
    Ok(channels)
}

/// A layer of its kind, where all its channels are there.
fn further(list: &[Channel], kind: LayerKind) -> Option<Layer> {
    let planes = kind.channels().iter().map(|name| plane(list, name)).collect::<Option<Vec<_>>>()?;
    Some(Layer { kind, planes })
}

/// Name of the attribute that tells how the picture came about, as a JSON object.
const ATTRIBUTE: &str = "goniofit";

fn refused_text(e: &serde_json::Error) -> ImageError {
    ImageError::Encode { format: "OpenEXR", reason: e.to_string() }
}

fn metadata(attributes: &Attributes) -> Metadata {
    match attributes.get(&ex::Text::from(ATTRIBUTE)) {
        Some(ex::AttributeValue::Text(text)) => serde_json::from_str(&text.to_string()).unwrap_or_default(),
        _ => Metadata::default(),
    }
}

fn plane(list: &[Channel], name: &str) -> Option<Vec<f64>> {
    let channel = list.iter().find(|c| c.name.eq(name))?;
    Some(channel.sample_data.values_as_f32().map(f64::from).collect())
}

fn rgb(list: &[Channel], prefix: &str) -> Option<Vec<[f64; 3]>> {
    let named = |name: &str| plane(list, &format!("{prefix}{name}"));
    if let (Some(r), Some(g), Some(b)) = (named("R"), named("G"), named("B")) {
        return Some(r.into_iter().zip(g).zip(b).map(|((r, g), b)| [r, g, b]).collect());
    }
    Some(named("Y")?.into_iter().map(|y| [y; 3]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::read_exr_colors;

    fn layer(kind: LayerKind) -> Layer {
        let plane = |c: usize| (0..12).map(|i| (i * 8 + c) as f64 * 0.5).collect();
        Layer { kind, planes: (0..kind.channels().len()).map(plane).collect() }
    }

    fn example() -> Image {
        let values = |k: usize| (0..12).map(|i| std::array::from_fn(|c| 0.25 * (i * 3 + c + k) as f64)).collect();
        Image {
            width: 4,
            height: 3,
            radiance: values(0),
            standard_error: Some(values(100)),
            mask: Some((0..12).map(|i| f64::from(i) / 16.0).collect()),
            metadata: Metadata {
                scene: Some("cornell".into()),
                seed: Some(u64::MAX),
                samples: Some(64),
                seconds: Some(0.1),
                program: Some("goniofit 0.1.0".into()),
                mean_samples: Some(6.5),
                relative_error: Some([0.01, 0.011]),
                plan: None,
            },
            layers: LayerKind::ALL.map(layer).to_vec(),
        }
    }

    #[test]
    fn files_come_back_with_all_layers_and_metadata() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let full = example();
        let bare = Image {
            standard_error: None,
            mask: None,
            layers: Vec::new(),
            metadata: Metadata::default(),
            ..full.clone()
        };
        for image in [full, bare] {
            std::fs::write(&path, encode_exr(&image).unwrap()).unwrap();
            assert_eq!(read_exr(&path).unwrap(), image);
        }
    }

    #[test]
    fn extreme_values_and_nan_are_written_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let mut image = example();
        image.radiance[0] = [f64::from(1e-20f32), f64::from(1e20f32), f64::INFINITY];
        image.radiance[1][0] = f64::NAN;
        std::fs::write(&path, encode_exr(&image).unwrap()).unwrap();
        let back = read_exr(&path).unwrap();
        assert!(back.radiance[0].iter().zip(&image.radiance[0]).all(|(a, b)| a.to_bits() == b.to_bits()));
        assert!(back.radiance[1][0].is_nan());
    }

    #[test]
    fn missing_channels_are_named() {
        let plane = |name: &str| Channel::new(name, ex::FlatSamples::F32(vec![0.0; 4]));
        let list = ex::AnyChannels::sort(["G", "R", "depth.Z"].map(plane).into_iter().collect());
        let layer = ex::Layer::new((2, 2), ex::LayerAttributes::default(), ex::Encoding::default(), list);
        let mut bytes = Cursor::new(Vec::new());
        ex::Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
        let error = decode_exr(Path::new("a.exr"), bytes.into_inner()).unwrap_err().to_string();
        assert_eq!(error, "a.exr: expected channels R, G, B, or Y alone, found channels G, R, depth.Z");
    }

    /// The file with another size in its header, whose optional count of blocks is renamed.
    fn claiming(mut bytes: Vec<u8>, [width, height]: [i32; 2]) -> Vec<u8> {
        let mut put = |attribute: &[u8], skip: usize, new: &[u8]| {
            let start = bytes.windows(attribute.len()).position(|w| w == attribute).unwrap() + skip;
            bytes[start..start + new.len()].copy_from_slice(new);
        };
        put(b"chunkCount\0", 0, b"otherCount\0");
        let window = b"dataWindow\0box2i\0";
        let least_corner_and_length = 4 + 8;
        let greatest = [width - 1, height - 1].map(i32::to_le_bytes).concat();
        put(window, window.len() + least_corner_and_length, &greatest);
        bytes
    }

    /// A file of 2 × 2 pixels, all 0.
    fn of_channels(names: &[String], compression: ex::Compression) -> Vec<u8> {
        let plane = |name: &String| Channel::new(name.as_str(), ex::FlatSamples::F32(vec![0.0; 4]));
        let list = ex::AnyChannels::sort(names.iter().map(plane).collect());
        let encoding = ex::Encoding { compression, ..ex::Encoding::default() };
        let layer = ex::Layer::new((2, 2), ex::LayerAttributes::default(), encoding, list);
        let mut bytes = Cursor::new(Vec::new());
        ex::Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn more_than_the_largest_picture_is_refused_by_the_header() {
        let refusal = |bytes| decode_exr(Path::new("a.exr"), bytes).unwrap_err();
        let bytes = encode_exr(&example()).unwrap();
        assert_eq!(decode_exr(Path::new("a.exr"), claiming(bytes.clone(), [4, 3])).unwrap(), example());
        for size in [[1_000_000_000, 1_000_000_000], [8193, 8192], [1, (1 << 26) + 1], [(1 << 26) + 1, 1]] {
            let error = refusal(claiming(bytes.clone(), size));
            let want = format!("a.exr: expected at most 67108864 pixels, found {} x {}", size[0], size[1]);
            assert!(matches!(error, ImageError::Unsupported { .. }), "{error:?}");
            assert_eq!(error.to_string(), want);
        }
        let names = |count: usize| (0..count).map(|i| format!("c{i:02}")).collect::<Vec<_>>();
        let channels = |count| refusal(claiming(of_channels(&names(count), ex::Compression::ZIP16), [8192, 8192]));
        let most = usize::try_from(most_channels()).unwrap();
        let (values, more) = (most << 26, (most + 1) << 26);
        assert_eq!(
            channels(most + 1).to_string(),
            format!(
                "a.exr: expected at most {values} values, found {more}: 8192 x 8192 pixels in {} channels",
                most + 1
            )
        );
        assert!(
            matches!(channels(most), ImageError::Invalid { .. }),
            "as many values as there may be, but not in this file"
        );
    }

    #[test]
    fn a_file_that_is_too_short_for_its_size_is_refused_by_the_header() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let names = ["R", "G", "B"].map(String::from);
        for (compression, most) in [(ex::Compression::Uncompressed, 1), (ex::Compression::ZIP16, 1376)] {
            let bytes = of_channels(&names, compression);
            for [w, h] in [[1000, 1000], [8192, 8192], [1 << 26, 1], [1, 1 << 26]] {
                std::fs::write(&path, claiming(bytes.clone(), [w, h])).unwrap();
                let least = 12 * u64::from(w.unsigned_abs()) * u64::from(h.unsigned_abs()) / most;
                let want = format!(
                    "{}: not a valid OpenEXR file: its header says {w} x {h} pixels in 3 channels, which take \
                     {least} bytes at least; the file holds {}",
                    path.display(),
                    bytes.len()
                );
                assert_eq!(read_exr(&path).unwrap_err().to_string(), want);
                assert_eq!(read_exr_colors(&path, MAX_PIXELS).unwrap_err().to_string(), want);
            }
        }
    }

    #[test]
    fn what_compresses_best_is_read() {
        let compressions = {
            use ex::Compression::{B44A, PIZ, PXR24, RLE, Uncompressed, ZIP1, ZIP16};
            [Uncompressed, RLE, ZIP1, ZIP16, PIZ, PXR24, B44A]
        };
        let (width, height) = (1024, 512);
        for compression in compressions {
            let plane = |name: &str| Channel::new(name, ex::FlatSamples::F32(vec![0.0; width * height]));
            let list = ex::AnyChannels::sort(["R", "G", "B"].map(plane).into_iter().collect());
            let encoding = ex::Encoding { compression, ..ex::Encoding::UNCOMPRESSED };
            let layer = ex::Layer::new((width, height), ex::LayerAttributes::default(), encoding, list);
            let mut bytes = Cursor::new(Vec::new());
            ex::Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
            let ratio = (12 * width * height) as f64 / bytes.get_ref().len() as f64;
            let image = decode_exr(Path::new("black.exr"), bytes.into_inner());
            let image = image.unwrap_or_else(|e| panic!("{compression:?}, {ratio} to 1: {e}"));
            assert!(image.radiance.iter().all(|p| *p == [0.0; 3]), "{compression:?}");
        }
    }

    #[test]
    fn broken_files_are_named_and_a_wrong_layer_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let bytes = encode_exr(&example()).unwrap();
        for length in [0, 3, 100, bytes.len() / 2, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..length]).unwrap();
            let error = read_exr(&path).unwrap_err();
            assert!(matches!(error, ImageError::Invalid { .. }) && error.to_string().contains("a.exr"), "{error}");
        }
        assert!(matches!(read_exr(&folder.path().join("none.exr")), Err(ImageError::Io { .. })));
        let mut wrong = example();
        wrong.radiance.pop();
        assert!(matches!(encode_exr(&wrong), Err(ImageError::Layer { layer: "radiance", found: 11, .. })));
    }
}
