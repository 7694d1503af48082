//! The frame of a plot with two straight axes.

use super::canvas::Canvas;
use super::scale::Scale;

/// An axis: its label, with the unit, and its scale.
#[derive(Debug, Clone)]
pub struct Axis {
    /// The label.
    pub label: String,
    /// The scale.
    pub scale: Scale,
}

impl Axis {
    /// An axis of this label and scale.
    #[must_use]
    pub fn new(label: impl Into<String>, scale: Scale) -> Self {
        Self { label: label.into(), scale }
    }
}

/// Where a plot's data are drawn, CSS pixels.
#[derive(Debug, Clone, Copy)]
pub(in crate::report) struct Area {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

/// About how wide text is, CSS pixels; marks of raised text do not count.
pub(in crate::report) fn text_width(text: &str, size: f64) -> f64 {
    0.54 * size * text.chars().filter(|c| !"^{}".contains(*c)).count() as f64
}

impl Area {
    pub fn right(&self) -> f64 {
        self.left + self.width
    }

    pub fn bottom(&self) -> f64 {
        self.top + self.height
    }

    pub fn x(&self, place: f64) -> f64 {
        self.left + place * self.width
    }

    pub fn y(&self, place: f64) -> f64 {
        self.bottom() - place * self.height
    }

    /// As a script reads it.
    pub fn data(&self) -> String {
        format!("{} {} {} {}", self.left, self.top, self.width, self.height)
    }

    /// Grid, axes, about so many marks with labels; the label of y stands above its axis, where it reads without turning the head.
    pub fn frame(&self, canvas: &mut Canvas, (x, x_labels): (&Axis, usize), (y, y_labels): (&Axis, usize), grid: bool) {
        canvas.group("frame", |c| {
            for tick in x.scale.ticks(x_labels) {
                let Some(at) = x.scale.place(tick.value).map(|p| self.x(p)) else { continue };
                if grid && !tick.label.is_empty() {
                    c.segment("grid", (at, self.top), (at, self.bottom()));
                }
                let length = if tick.label.is_empty() { 3.0 } else { 5.0 };
                c.segment("axis", (at, self.bottom()), (at, self.bottom() + length));
                c.text("tick middle", (at, self.bottom() + 18.0), &tick.label);
            }
            for tick in y.scale.ticks(y_labels) {
                let Some(at) = y.scale.place(tick.value).map(|p| self.y(p)) else { continue };
                if grid && !tick.label.is_empty() {
                    c.segment("grid", (self.left, at), (self.right(), at));
                }
                let length = if tick.label.is_empty() { 3.0 } else { 5.0 };
                c.segment("axis", (self.left - length, at), (self.left, at));
                c.text("tick end", (self.left - 8.0, at + 4.0), &tick.label);
            }
            let corner = [(self.left, self.top), (self.left, self.bottom()), (self.right(), self.bottom())];
            c.path("axis", super::canvas::line(corner));
            c.text("middle", (self.left + 0.5 * self.width, self.bottom() + 36.0), &x.label);
            c.text("", (self.left - 8.0 - 36.0, self.top - 12.0), &y.label);
        });
    }
}
