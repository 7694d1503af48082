//! Plots as papers have them: thin axes, few words, units, colours that colour-blind eyes tell apart.
//!
//! In: series of numbers. Out: a [`Figure`], drawn as SVG (alone or within a page, whose colours it then takes) or as PNG. The one decision to
//! know: a figure is a list of marks with classes, and what a class looks like stands in one place (`style`), once for paper and once for a
//! dark screen.

mod axes;
mod canvas;
mod chart;
mod disc;
mod heading;
mod heat;
mod legend;
mod loglog;
mod polar;
mod raster;
mod scale;
mod style;

pub use axes::Axis;
pub use chart::{Chart, LegendPlace, Marks, Point, Series};
pub use disc::{Disc, DiscCell};
pub use heading::Heading;
pub use heat::HeatMap;
pub(in crate::report) use heat::hex;
pub(in crate::report) use legend::{dot_class, line_class};
pub use loglog::{LogLog, Slope};
pub use polar::PolarChart;
pub use raster::RasterError;
pub(in crate::report) use scale::minus;
pub use scale::{Scale, Spacing, Tick};
pub(in crate::report) use style::{DARK, LIGHT, page_css, variables};

use askama::Template;
use canvas::Canvas;

/// A finished drawing.
#[derive(Debug, Clone)]
pub struct Figure {
    canvas: Canvas,
    title: String,
    description: String,
    data: Vec<(String, String)>,
}

/// How an SVG is embedded.
#[derive(Template)]
#[template(path = "figure.svg", config = "src/report/askama.toml", escape = "html")]
struct Markup<'a> {
    figure: &'a Figure,
    /// Style rules, for a figure that stands alone.
    style: Option<String>,
}

impl Figure {
    pub(in crate::report) fn new(canvas: Canvas, title: impl Into<String>, description: impl Into<String>) -> Self {
        Self { canvas, title: title.into(), description: description.into(), data: Vec::new() }
    }

    /// With a `data-…` attribute at its root, for a page's script.
    pub(in crate::report) fn with_data(mut self, name: &str, value: impl std::fmt::Display) -> Self {
        self.data.push((name.to_owned(), value.to_string()));
        self
    }

    /// Figures side by side, `columns` in a row.
    #[must_use]
    pub fn grid(figures: &[Self], columns: usize, title: &str) -> Self {
        let columns = columns.clamp(1, figures.len().max(1));
        let width = figures.iter().map(|f| f.canvas.width).fold(0.0, f64::max);
        let height = figures.iter().map(|f| f.canvas.height).fold(0.0, f64::max);
        let rows = figures.len().div_ceil(columns);
        let mut canvas = Canvas::new(width * columns as f64, height * rows as f64);
        for (k, figure) in figures.iter().enumerate() {
            canvas.place(&figure.canvas, (width * (k % columns) as f64, height * (k / columns) as f64));
        }
        let described: Vec<String> = figures.iter().map(|f| format!("{}: {}", f.title, f.description)).collect();
        Self::new(canvas, title, described.join(". "))
    }

    /// Width and height, in units of a CSS pixel.
    #[must_use]
    pub fn size(&self) -> (f64, f64) {
        (self.canvas.width, self.canvas.height)
    }

    /// An SVG file of its own: black on white, with its style inside.
    #[must_use]
    pub fn to_svg(&self) -> String {
        self.markup(Some(style::paper_css()))
    }

    /// SVG to stand in a page, which brings the style.
    #[must_use]
    pub fn inline(&self) -> String {
        self.markup(None)
    }

    /// A PNG file, `width` pixels wide.
    ///
    /// # Errors
    /// [`RasterError`] where the width is 0 or too large for memory.
    pub fn to_png(&self, width: u32) -> Result<Vec<u8>, RasterError> {
        raster::png(&self.to_svg(), width)
    }

    fn markup(&self, style: Option<String>) -> String {
        // Rendering writes to a string, which can't fail.
        Markup { figure: self, style }.render().unwrap_or_default()
    }
}
