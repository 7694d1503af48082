//! Contact sheets: pictures side by side under their names, with a title, captions and colour scales.

use ab_glyph::{Font, FontRef, ScaleFont, point};

use super::{Bitmap, ColorMap, ImageError};

const PAPER: [u8; 3] = [252, 252, 250];
const INK: [u8; 3] = [28, 30, 34];
const FAINT_INK: [u8; 3] = [104, 108, 116];
const FRAME: [u8; 3] = [214, 214, 210];

const MARGIN: usize = 36;
const GAP: usize = 24;
const TITLE_SIZE: f32 = 30.0;
const LABEL_SIZE: f32 = 19.0;
const SMALL_SIZE: f32 = 15.0;
const BAR_HEIGHT: usize = 12;

/// A picture on a sheet.
#[derive(Debug, Clone, PartialEq)]
pub struct Tile {
    /// The picture, shown pixel for pixel.
    pub picture: Bitmap,
    /// Its name, above it.
    pub label: String,
    /// One small line below it; may be empty.
    pub caption: String,
    /// The meaning of its colours, where they have one.
    pub scale: Option<Scale>,
}

impl Tile {
    /// A tile without a scale. A small picture is enlarged by a whole factor, so that labels have room.
    #[must_use]
    pub fn enlarged(picture: Bitmap, label: &str, caption: String) -> Self {
        let factor = 320usize.div_ceil(picture.width.max(1));
        Self { picture: picture.enlarged(factor), label: label.into(), caption, scale: None }
    }
}

/// A colour scale.
#[derive(Debug, Clone, PartialEq)]
pub struct Scale {
    /// The colours.
    pub map: ColorMap,
    /// Value at the left end.
    pub low: f64,
    /// Value at the right end.
    pub high: f64,
    /// Unit, such as `W/(sr m²)`.
    pub unit: String,
}

/// A sheet of pictures in a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// Title; may be empty.
    pub title: String,
    /// A line below the title; may be empty.
    pub subtitle: String,
    /// Pictures side by side, at least 1.
    pub columns: usize,
    /// The pictures, row by row.
    pub tiles: Vec<Tile>,
}

/// A sheet being drawn.
struct Page<'f> {
    bitmap: Bitmap,
    font: FontRef<'f>,
}

impl Sheet {
    /// Draws the sheet.
    ///
    /// # Errors
    /// [`ImageError::Font`] where the embedded font can't be read.
    pub fn draw(&self) -> Result<Bitmap, ImageError> {
        let font = FontRef::try_from_slice(epaint_default_fonts::UBUNTU_LIGHT);
        let font = font.map_err(|e| ImageError::Font(e.to_string()))?;
        let columns = self.columns.clamp(1, self.tiles.len().max(1));
        let largest = |size: &dyn Fn(&Bitmap) -> usize| self.tiles.iter().map(|t| size(&t.picture)).max().unwrap_or(0);
        let (cell_width, cell_height) = (largest(&|b| b.width).max(160), largest(&|b| b.height));
        let head = self.head_height();
        let grid = columns * cell_width + (columns - 1) * GAP;
        let width = 2 * MARGIN + grid.max(self.head_width(&font));
        let row_heights =
            self.tiles.chunks(columns).map(|row| LABEL_SIZE as usize + 12 + cell_height + below_height(row));
        let row_heights: Vec<usize> = row_heights.collect();
        let height = head + row_heights.iter().map(|h| h + GAP).sum::<usize>() + MARGIN - GAP.min(MARGIN);
        let mut page = Page { bitmap: Bitmap::filled(width, height, PAPER), font };
        page.head(&self.title, &self.subtitle);
        let mut y = head;
        for (row, height) in self.tiles.chunks(columns).zip(row_heights) {
            for (column, tile) in row.iter().enumerate() {
                page.tile(tile, MARGIN + column * (cell_width + GAP), y, cell_height);
            }
            y += height + GAP;
        }
        Ok(page.bitmap)
    }

    fn head_height(&self) -> usize {
        let title = if self.title.is_empty() { 0 } else { TITLE_SIZE as usize + 8 };
        let subtitle = if self.subtitle.is_empty() { 0 } else { SMALL_SIZE as usize + 8 };
        MARGIN + title + subtitle + if title + subtitle > 0 { 16 } else { 0 }
    }

    fn head_width(&self, font: &FontRef<'_>) -> usize {
        let title = text_width(font, &self.title, TITLE_SIZE);
        title.max(text_width(font, &self.subtitle, SMALL_SIZE)).ceil() as usize
    }
}

/// Height of what stands below the pictures of a row.
fn below_height(row: &[Tile]) -> usize {
    let caption = |t: &Tile| if t.caption.is_empty() { 0 } else { SMALL_SIZE as usize + 10 };
    let scale = |t: &Tile| if t.scale.is_some() { BAR_HEIGHT + SMALL_SIZE as usize + 18 } else { 0 };
    row.iter().map(|t| caption(t) + scale(t)).max().unwrap_or(0)
}

impl Page<'_> {
    fn head(&mut self, title: &str, subtitle: &str) {
        let mut y = MARGIN;
        if !title.is_empty() {
            self.text(title, MARGIN as f32, y, TITLE_SIZE, INK);
            y += TITLE_SIZE as usize + 8;
        }
        self.text(subtitle, MARGIN as f32, y, SMALL_SIZE, FAINT_INK);
    }

    fn tile(&mut self, tile: &Tile, x: usize, y: usize, cell_height: usize) {
        self.text(&tile.label, x as f32, y, LABEL_SIZE, INK);
        let top = y + LABEL_SIZE as usize + 12;
        self.bitmap.fill(x - 1, top - 1, tile.picture.width + 2, tile.picture.height + 2, FRAME);
        self.bitmap.paste(x, top, &tile.picture);
        let mut below = top + cell_height + 8;
        if let Some(scale) = &tile.scale {
            self.scale(scale, x, below, tile.picture.width.max(120));
            below += BAR_HEIGHT + SMALL_SIZE as usize + 14;
        }
        self.text(&tile.caption, x as f32, below, SMALL_SIZE, FAINT_INK);
    }

    fn scale(&mut self, scale: &Scale, x: usize, y: usize, width: usize) {
        self.bitmap.fill(x - 1, y - 1, width + 2, BAR_HEIGHT + 2, FRAME);
        for i in 0..width {
            let color = scale.map.color(i as f64 / (width - 1) as f64);
            self.bitmap.fill(x + i, y, 1, BAR_HEIGHT, color);
        }
        let labels = [scale.low, 0.5 * (scale.low + scale.high), scale.high];
        for (i, value) in labels.iter().enumerate() {
            let at = x + i * (width - 1) / 2;
            self.bitmap.fill(at, y + BAR_HEIGHT, 1, 4, FAINT_INK);
            let unit = if i == 2 { format!(" {}", scale.unit) } else { String::new() };
            let label = format!("{}{unit}", short(*value));
            // The first label starts, the last one ends with the bar.
            let shift = text_width(&self.font, &label, SMALL_SIZE) * i as f32 / 2.0;
            self.text(&label, at as f32 - shift, y + BAR_HEIGHT + 6, SMALL_SIZE, FAINT_INK);
        }
    }

    /// Draws a line of text whose upper left corner is (x, y).
    fn text(&mut self, text: &str, x: f32, y: usize, size: f32, color: [u8; 3]) {
        let scaled = self.font.as_scaled(size);
        let mut pen = x;
        let mut before = None;
        let mut glyphs = Vec::new();
        for letter in text.chars() {
            let id = scaled.glyph_id(letter);
            pen += before.map_or(0.0, |b| scaled.kern(b, id));
            glyphs.push(id.with_scale_and_position(size, point(pen, y as f32 + scaled.ascent())));
            pen += scaled.h_advance(id);
            before = Some(id);
        }
        for outline in glyphs.into_iter().filter_map(|glyph| self.font.outline_glyph(glyph)) {
            let corner = outline.px_bounds().min;
            let bitmap = &mut self.bitmap;
            outline.draw(|dx, dy, coverage| {
                let (column, row) = (corner.x + dx as f32, corner.y + dy as f32);
                if column < 0.0 || row < 0.0 {
                    return;
                }
                if let Some(pixel) = bitmap.pixel_mut(column as usize, row as usize) {
                    blend(pixel, color, coverage);
                }
            });
        }
    }
}

fn blend(pixel: &mut [u8; 3], color: [u8; 3], coverage: f32) {
    let c = coverage.clamp(0.0, 1.0);
    for (p, ink) in pixel.iter_mut().zip(color) {
        *p = (f32::from(*p) * (1.0 - c) + f32::from(ink) * c).round() as u8;
    }
}

fn text_width(font: &FontRef<'_>, text: &str, size: f32) -> f32 {
    let scaled = font.as_scaled(size);
    text.chars().map(|letter| scaled.h_advance(scaled.glyph_id(letter))).sum()
}

/// A number for a label: three digits, a true minus sign, powers of ten only where they are shorter.
fn short(value: f64) -> String {
    let size = value.abs();
    let text = if size == 0.0 || (1e-3..1e4).contains(&size) {
        let text = format!("{value:.4}");
        let trimmed = text.trim_end_matches('0').trim_end_matches('.');
        if trimmed.is_empty() || trimmed == "-" { "0".to_owned() } else { trimmed.to_owned() }
    } else {
        format!("{value:.0e}")
    };
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheet(tiles: usize, columns: usize) -> Sheet {
        let tile = Tile {
            picture: Bitmap::filled(200, 100, [40, 80, 120]),
            label: "label".into(),
            caption: "caption".into(),
            scale: Some(Scale { map: ColorMap::Diverging, low: -0.5, high: 0.5, unit: "W".into() }),
        };
        Sheet { title: "Title".into(), subtitle: "subtitle".into(), columns, tiles: vec![tile; tiles] }
    }

    #[test]
    fn a_sheet_holds_every_pixel_of_its_pictures() {
        for (tiles, columns) in [(1, 1), (5, 2), (6, 3), (2, 7)] {
            let bitmap = sheet(tiles, columns).draw().unwrap();
            let found = bitmap.pixels.iter().filter(|p| **p == [40, 80, 120]).count();
            assert_eq!(found, tiles * 200 * 100, "{tiles} tiles in {columns} columns");
            assert!(bitmap.pixels.iter().filter(|p| **p == INK).count() > 20, "no text");
            // Nothing is written into the outer margin.
            let edge = bitmap.pixels[..bitmap.width * 20]
                .iter()
                .chain(&bitmap.pixels[bitmap.pixels.len() - bitmap.width * 8..]);
            assert!(edge.clone().all(|p| *p == PAPER));
        }
        assert!(sheet(0, 3).draw().is_ok());
    }

    #[test]
    fn labels_are_short() {
        for (value, want) in
            [(0.0, "0"), (-0.5, "−0.5"), (0.002, "0.002"), (2e-5, "2e−5"), (1e6, "1e6"), (100.0, "100")]
        {
            assert_eq!(short(value), want);
        }
    }
}
