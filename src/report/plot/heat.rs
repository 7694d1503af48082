//! Values over a grid of cells, as colours with their scale.

use std::fmt::Write;

use super::Figure;
use super::axes::{Area, Axis};
use super::canvas::{Canvas, Mark, short};
use super::heading::Heading;
use super::scale::Scale;
use crate::image::ColorMap;

/// A map of values over two axes.
#[derive(Debug, Clone)]
pub struct HeatMap {
    /// What it shows.
    pub heading: Heading,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// Borders of the columns, rising.
    pub x_borders: Vec<f64>,
    /// Borders of the rows, rising.
    pub y_borders: Vec<f64>,
    /// Values, row by row from the bottom, each from the left; `None` is left empty.
    pub values: Vec<Option<f64>>,
    /// Colours.
    pub map: ColorMap,
    /// What the ends of the colours stand for.
    pub range: (f64, f64),
    /// What the colours stand for, with the unit.
    pub color_label: String,
    /// Width, CSS pixels.
    pub width: f64,
}

/// Colours that are told apart.
const LEVELS: usize = 41;

impl HeatMap {
    /// The drawing; its area is square.
    #[must_use]
    pub fn figure(&self) -> Figure {
        let top = self.heading.top();
        let side = self.width - 54.0 - 92.0;
        let area = Area { left: 54.0, top, width: side, height: side };
        let mut canvas = self.heading.canvas(self.width, top + side + 46.0);
        canvas.marks.push(Mark::Cells { layers: self.layers(&area) });
        area.frame(&mut canvas, (&self.x, 4), (&self.y, 5), false);
        self.bar(&mut canvas, &area);
        self.heading.figure(canvas).with_data("area", area.data())
    }

    fn level(&self, value: f64) -> usize {
        let place = (value - self.range.0) / (self.range.1 - self.range.0);
        (place.clamp(0.0, 1.0) * (LEVELS - 1) as f64).round() as usize
    }

    /// One path a colour, runs of cells of a row as one rectangle.
    fn layers(&self, area: &Area) -> Vec<(String, String)> {
        let columns = self.x_borders.len().max(2) - 1;
        let x: Vec<f64> = self.x_borders.iter().filter_map(|b| self.x.scale.place(*b).map(|p| area.x(p))).collect();
        let y: Vec<f64> = self.y_borders.iter().filter_map(|b| self.y.scale.place(*b).map(|p| area.y(p))).collect();
        let mut paths = vec![String::new(); LEVELS];
        for (row, values) in self.values.chunks(columns).enumerate() {
            let levels: Vec<Option<usize>> =
                values.iter().map(|v| v.filter(|v| !v.is_nan()).map(|v| self.level(v))).collect();
            let mut from = 0;
            for run in levels.chunk_by(|a, b| a == b) {
                if let Some(level) = run[0] {
                    // Writing to a String can't fail.
                    let (left, right) = (short(x[from]), short(x[from + run.len()]));
                    let _ = write!(paths[level], "M{left} {}H{right}V{}H{left}z", short(y[row]), short(y[row + 1]));
                }
                from += run.len();
            }
        }
        let color = |k: usize| hex(self.map.color(k as f64 / (LEVELS - 1) as f64));
        paths.into_iter().enumerate().filter(|(_, d)| !d.is_empty()).map(|(k, d)| (color(k), d)).collect()
    }

    /// The scale of colours, on the right.
    fn bar(&self, canvas: &mut Canvas, area: &Area) {
        color_bar(
            canvas,
            self.map,
            Scale::linear(self.range.0, self.range.1),
            &self.color_label,
            (area.right() + 18.0, area.top, area.height),
        );
    }
}

/// A scale of colours at (left, top) with a height, its label above.
pub(in crate::report) fn color_bar(
    canvas: &mut Canvas,
    map: ColorMap,
    scale: Scale,
    label: &str,
    (left, top, height): (f64, f64, f64),
) {
    const STEPS: usize = 60;
    let layers = (0..STEPS).map(|k| {
        let color = hex(map.color((k as f64 + 0.5) / STEPS as f64));
        let y = |k: usize| short(top + height * (1.0 - k as f64 / STEPS as f64));
        let (left, right) = (short(left), short(left + 12.0));
        (color, format!("M{left} {}H{right}V{}H{left}z", y(k), y(k + 1)))
    });
    canvas.marks.push(Mark::Cells { layers: layers.collect() });
    for tick in scale.ticks(4) {
        let Some(place) = scale.place(tick.value) else { continue };
        let y = top + height * (1.0 - place);
        canvas.segment("axis", (left + 12.0, y), (left + 16.0, y));
        canvas.text("tick", (left + 20.0, y + 4.0), &tick.label);
    }
    canvas.text("tick", (left, top - 12.0), label);
}

/// `#rrggbb`.
pub(in crate::report) fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_joined_and_gaps_left_empty() {
        let map = HeatMap {
            heading: Heading::default(),
            x: Axis::new("", Scale::linear(0.0, 1.0)),
            y: Axis::new("", Scale::linear(0.0, 1.0)),
            x_borders: vec![0.0, 0.5, 0.75, 1.0],
            y_borders: vec![0.0, 0.5, 1.0],
            values: vec![Some(1.0), Some(1.0), None, Some(f64::NAN), Some(-1.0), Some(1.0)],
            map: ColorMap::Diverging,
            range: (-1.0, 1.0),
            color_label: String::new(),
            width: 300.0,
        };
        let layers = map.layers(&Area { left: 0.0, top: 0.0, width: 8.0, height: 4.0 });
        let [low, high] = [0.0, 1.0].map(|t| hex(ColorMap::Diverging.color(t)));
        assert_eq!(layers, [(low, "M4 2H6V0H4z".to_owned()), (high, "M0 4H6V2H0zM6 2H8V0H6z".to_owned())]);
    }
}
