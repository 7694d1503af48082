//! From SVG to PNG. Type is set in the font that comes with the program, so that a picture is the same on every machine.

use std::sync::Arc;

use epaint_default_fonts::UBUNTU_LIGHT;
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};

/// Why a figure can't be made a PNG.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RasterError {
    /// The drawing can't be read back.
    #[error("the drawing can't be painted: {0}")]
    Drawing(String),
    /// No picture has this size.
    #[error("a picture {width} pixels wide: expected 1 to 20000")]
    Size {
        /// The width asked for.
        width: u32,
    },
}

const FAMILY: &str = "Ubuntu";

/// The PNG of an SVG, `width` pixels wide.
pub(super) fn png(svg: &str, width: u32) -> Result<Vec<u8>, RasterError> {
    let refused = |e: String| RasterError::Drawing(e);
    let mut fonts = fontdb::Database::new();
    fonts.load_font_data(UBUNTU_LIGHT.to_vec());
    fonts.set_sans_serif_family(FAMILY);
    let options = Options { fontdb: Arc::new(fonts), font_family: FAMILY.into(), ..Options::default() };
    let tree = Tree::from_str(svg, &options).map_err(|e| refused(e.to_string()))?;
    let scale = width as f32 / tree.size().width();
    let height = (tree.size().height() * scale).ceil() as u32;
    if !(1..=20_000).contains(&width) {
        return Err(RasterError::Size { width });
    }
    let mut picture = Pixmap::new(width, height).ok_or(RasterError::Size { width })?;
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut picture.as_mut());
    picture.encode_png().map_err(|e| refused(e.to_string()))
}
