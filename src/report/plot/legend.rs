//! What series are called, and the classes of their lines and dots.

use super::axes::text_width;
use super::canvas::Canvas;
use super::chart::{Marks, RING};
use super::style::{COLORS, REFERENCE};

/// The number of a colour that there is; those of models come again after the last.
pub(super) fn wrapped(color: usize) -> usize {
    if color == 0 { 0 } else { 1 + (color - 1) % (COLORS - 1) }
}

/// The class of a series' lines: colour and dash.
pub(in crate::report) fn line_class(color: usize) -> String {
    match (color, wrapped(color)) {
        (REFERENCE, _) => "ref".into(),
        (_, c @ (0 | 2)) => format!("line s{c}"),
        (_, c) => format!("line s{c} dash-{c}"),
    }
}

/// The class of a series' dots.
pub(in crate::report) fn dot_class(color: usize) -> String {
    format!("dot f{}", wrapped(color))
}

/// Rings by class, and what they mean.
pub(super) const RINGS: [(&str, &str); 2] = [("ring", "best in time and error"), ("ring dashed", "undecided")];

/// What a name in a legend stands beside.
#[derive(Debug, Clone, Copy)]
pub(in crate::report) enum Sample {
    /// A series of this colour.
    Series(Marks, usize),
    /// A ring of this class.
    Ring(&'static str),
}

/// A name in a legend, with its sample's place in its row.
pub(in crate::report) type Entry<'a> = (f64, &'a str, Sample);

/// Names in as many rows as they need.
pub(in crate::report) fn legend_rows<'a>(names: &[(&'a str, Sample)], width: f64) -> Vec<Vec<Entry<'a>>> {
    let (mut rows, mut x) = (vec![Vec::new()], 0.0);
    for &(name, sample) in names.iter().filter(|(name, ..)| !name.is_empty()) {
        let needed = 31.0 + text_width(name, 13.0) + 11.0;
        if x > 0.0 && x + needed > width {
            rows.push(Vec::new());
            x = 0.0;
        }
        if let Some(row) = rows.last_mut() {
            row.push((x, name, sample));
        }
        x += needed;
    }
    rows.retain(|row| !row.is_empty());
    rows
}

pub(in crate::report) fn draw_legend(canvas: &mut Canvas, rows: &[Vec<Entry<'_>>], left: f64, top: f64) {
    if rows.is_empty() {
        return;
    }
    canvas.group("legend", |c| {
        for (k, row) in rows.iter().enumerate() {
            let y = top + 18.0 * k as f64;
            for &(x, name, sample) in row {
                let x = left + x;
                draw_sample(c, sample, (x, y - 4.0));
                c.text("", (x + 31.0, y), name);
            }
        }
    });
}

fn draw_sample(canvas: &mut Canvas, sample: Sample, (x, y): (f64, f64)) {
    match sample {
        Sample::Ring(class) => canvas.circle(class, (x + 12.0, y), RING),
        Sample::Series(marks, color) => {
            if marks != Marks::Dots {
                canvas.segment(&line_class(color), (x, y), (x + 24.0, y));
            }
            if marks != Marks::Line {
                canvas.circle(&dot_class(color), (x + 12.0, y), 3.0);
            }
        }
    }
}
