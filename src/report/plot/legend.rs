//! What series are called, and the classes of their lines and dots.

use super::axes::text_width;
use super::canvas::Canvas;
use super::chart::Marks;
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

/// The class of a series' rings.
pub(super) fn ring_class(color: usize) -> String {
    if color == 0 { "ring".into() } else { "ring ring-1".into() }
}

/// A name in a legend, with its sample's place in its row.
pub(in crate::report) type Entry<'a> = (f64, &'a str, Marks, usize);

/// Names in as many rows as they need.
pub(in crate::report) fn legend_rows<'a>(names: &[(&'a str, Marks, usize)], width: f64) -> Vec<Vec<Entry<'a>>> {
    let (mut rows, mut x) = (vec![Vec::new()], 0.0);
    for &(name, marks, color) in names.iter().filter(|(name, ..)| !name.is_empty()) {
        let needed = 31.0 + text_width(name, 13.0) + 11.0;
        if x > 0.0 && x + needed > width {
            rows.push(Vec::new());
            x = 0.0;
        }
        if let Some(row) = rows.last_mut() {
            row.push((x, name, marks, color));
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
            for &(x, name, marks, color) in row {
                let x = left + x;
                let (middle, line) = ((x + 12.0, y - 4.0), line_class(color));
                if marks.has_line() {
                    c.segment(&line, (x, y - 4.0), (x + 24.0, y - 4.0));
                }
                match marks {
                    Marks::Line => {}
                    Marks::Dots | Marks::Both => c.circle(&dot_class(color), middle, 3.0),
                    Marks::Rings => c.circle(&ring_class(color), middle, 5.5),
                }
                c.text("", (x + 31.0, y), name);
            }
        }
    });
}
