//! What a figure says of itself.

use super::Figure;
use super::canvas::Canvas;

/// What a figure shows.
#[derive(Debug, Clone, Default)]
pub struct Heading {
    /// In a few words.
    pub title: String,
    /// More of that, read out where it is asked for.
    pub description: String,
    /// Whether the title is drawn; a page has its own captions.
    pub drawn: bool,
}

impl Heading {
    /// Where the plot's area begins, CSS pixels.
    pub(super) fn top(&self) -> f64 {
        if self.drawn { 52.0 } else { 30.0 }
    }

    /// An empty drawing with the title, where that is drawn.
    pub(super) fn canvas(&self, width: f64, height: f64) -> Canvas {
        let mut canvas = Canvas::new(width, height);
        if self.drawn {
            canvas.text("head", (10.0, 20.0), &self.title);
        }
        canvas
    }

    /// The finished figure.
    pub(super) fn figure(&self, canvas: Canvas) -> Figure {
        Figure::new(canvas, &self.title, &self.description)
    }
}
