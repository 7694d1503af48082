//! Pictures: EXR in and out, PNG out, per-pixel metrics, and sheets that show several side by side.
//!
//! In: radiance per pixel in W/(sr·m²), linear RGB (sRGB's primaries), with standard errors and a mask where they are known. Out: files, and
//! the numbers in which two pictures differ. The one decision to know: numbers are always taken from linear radiance;
//! 8-bit pictures are only for eyes.

mod appearance;
mod bitmap;
mod blocks;
mod color;
mod colormap;
mod compare;
mod delta_e;
mod error;
mod exr_color;
mod exr_file;
mod exr_header;
mod filter;
mod flip;
mod hdr_flip;
mod layers;
mod maps;
pub mod sheet;
mod significance;
mod ssim;
mod tone;

pub use appearance::{Appearance, MeanAndMax, appearance, flip_map};
pub use bitmap::{Bitmap, encode_png};
pub use colormap::{ColorMap, DifferenceMap, difference_map, difference_range};
pub use compare::{Comparison, NotFinite, compare, compare_at};
pub use error::ImageError;
pub use exr_color::{ColorGrid, read_exr_colors};
pub use exr_file::{decode_exr, encode_exr, read_exr};
pub use layers::{Layer, LayerKind};
pub use maps::{comparison_sheet, difference, map_tiles};
pub use significance::{BlockTest, Significance};
pub use tone::{develop, exposure_for, srgb_encode};

/// Pixels of a picture at most: 8192 × 8192, of those that are read and of those that are rendered.
pub const MAX_PIXELS: u64 = 1 << 26;

/// A pixel of whose light a larger share is unknown is masked. The share is an expected value, so more samples find it more
/// exactly, but no more pixels beyond it: a table with a small gap keeps its pixels, however long it is rendered.
pub const MASKED_SHARE: f64 = 0.02;

/// A picture of linear radiance with its layers. Pixels run along rows, row 0 on top.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Image {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Radiance, W/(sr·m²); `width`·`height` pixels.
    pub radiance: Vec<[f64; 3]>,
    /// Standard error of the radiance, where it is known; the same shape.
    pub standard_error: Option<Vec<[f64; 3]>>,
    /// Expected share of the pixel's light that nobody measured, 0 to 1, where anything can be; one value a pixel. Above
    /// [`MASKED_SHARE`] the pixel is masked: it takes part in no comparison.
    pub mask: Option<Vec<f64>>,
    /// What else is known of the pixels; at most one of a kind.
    pub layers: Vec<Layer>,
    /// How the picture came about.
    pub metadata: Metadata,
}

/// How a picture came about, as far as is known.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct Metadata {
    /// Name of the scene.
    pub scene: Option<String>,
    /// Seed of the random numbers.
    pub seed: Option<u64>,
    /// Samples per pixel, of the pixel with the fewest.
    pub samples: Option<u32>,
    /// The same on average.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_samples: Option<f64>,
    /// Rendering time, s.
    pub seconds: Option<f64>,
    /// Program and version.
    pub program: Option<String>,
    /// How far off the picture is to be expected, relative, and at most with 95 % confidence (`render::PictureError`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative_error: Option<[f64; 2]>,
    /// In one line, what was computed: how long paths are, how lights are found, which layers were gathered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plan: Option<String>,
}
