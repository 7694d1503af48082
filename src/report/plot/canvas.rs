//! The marks that a figure is made of, in CSS pixels, y downwards.

use std::fmt::Write;

/// Marks in the order in which they are painted.
#[derive(Debug, Clone, Default)]
pub(in crate::report) struct Canvas {
    pub width: f64,
    pub height: f64,
    pub marks: Vec<Mark>,
}

/// One mark; `class` says what it looks like.
#[derive(Debug, Clone)]
pub(in crate::report) enum Mark {
    /// SVG path data.
    Path {
        class: String,
        d: String,
    },
    Circle {
        class: String,
        x: Px,
        y: Px,
        r: Px,
    },
    /// A circle that says something where a pointer rests on it.
    Tip {
        x: Px,
        y: Px,
        says: String,
    },
    Text {
        class: String,
        x: Px,
        y: Px,
        spans: Vec<Span>,
    },
    /// Coloured areas: colour and path data.
    Cells {
        layers: Vec<(String, String)>,
    },
    /// What follows up to [`Mark::End`] belongs together.
    Begin {
        class: String,
    },
    /// What follows up to [`Mark::End`] belongs together and is turned by an angle (degrees, with the clock) about a point.
    Turn {
        class: String,
        degrees: Px,
        x: Px,
        y: Px,
    },
    /// What follows up to [`Mark::End`] is drawn this far to the right and down.
    Shift {
        x: Px,
        y: Px,
    },
    End,
}

/// A length in CSS pixels, written short.
#[derive(Debug, Clone, Copy)]
pub(in crate::report) struct Px(pub f64);

impl std::fmt::Display for Px {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&short(self.0))
    }
}

/// A piece of text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::report) struct Span {
    pub text: String,
    /// Raised, as an exponent.
    pub raised: bool,
    /// Whether it follows a raised one, so that the line goes down again.
    pub lowered: bool,
}

/// Text in which `^{…}` is raised.
pub(in crate::report) fn spans(text: &str) -> Vec<Span> {
    let mut found = Vec::new();
    let mut push = |text: &str, raised: bool, lowered: bool| {
        if !text.is_empty() {
            found.push(Span { text: text.to_owned(), raised, lowered });
        }
    };
    let mut lowered = false;
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("^{") {
        let Some((raised, after)) = after.split_once('}') else { break };
        push(before, false, lowered);
        push(raised, true, false);
        lowered = true;
        rest = after;
    }
    push(rest, false, lowered);
    found
}

/// A coordinate to a hundredth of a pixel.
pub(in crate::report) fn short(x: f64) -> String {
    let text = format!("{x:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

/// Path data of a line through points.
pub(in crate::report) fn line(points: impl IntoIterator<Item = (f64, f64)>) -> String {
    let mut d = String::new();
    for (x, y) in points {
        let command = if d.is_empty() { 'M' } else { 'L' };
        // Writing to a String can't fail.
        let _ = write!(d, "{command}{} {}", short(x), short(y));
    }
    d
}

impl Canvas {
    pub fn new(width: f64, height: f64) -> Self {
        Self { width, height, marks: Vec::new() }
    }

    pub fn path(&mut self, class: &str, d: String) {
        if !d.is_empty() {
            self.marks.push(Mark::Path { class: class.into(), d });
        }
    }

    pub fn segment(&mut self, class: &str, from: (f64, f64), to: (f64, f64)) {
        self.path(class, line([from, to]));
    }

    pub fn circle(&mut self, class: &str, (x, y): (f64, f64), r: f64) {
        self.marks.push(Mark::Circle { class: class.into(), x: Px(x), y: Px(y), r: Px(r) });
    }

    /// What is said where a pointer rests on a place.
    pub fn tip(&mut self, (x, y): (f64, f64), says: &str) {
        self.marks.push(Mark::Tip { x: Px(x), y: Px(y), says: says.into() });
    }

    /// `class` carries the anchor: `start`, `middle` or `end`.
    pub fn text(&mut self, class: &str, (x, y): (f64, f64), text: &str) {
        self.marks.push(Mark::Text { class: class.into(), x: Px(x), y: Px(y), spans: spans(text) });
    }

    /// Another canvas, its corner at (x, y).
    pub fn place(&mut self, other: &Self, (x, y): (f64, f64)) {
        self.marks.push(Mark::Shift { x: Px(x), y: Px(y) });
        self.marks.extend(other.marks.iter().cloned());
        self.marks.push(Mark::End);
    }

    pub fn group(&mut self, class: &str, fill: impl FnOnce(&mut Self)) {
        self.marks.push(Mark::Begin { class: class.into() });
        fill(self);
        self.marks.push(Mark::End);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_are_raised_and_the_line_comes_down_again() {
        let found = spans("10^{−3} 1/sr");
        let want = [("10", false, false), ("−3", true, false), (" 1/sr", false, true)];
        assert_eq!(found.len(), want.len());
        for (span, (text, raised, lowered)) in found.iter().zip(want) {
            assert_eq!((span.text.as_str(), span.raised, span.lowered), (text, raised, lowered));
        }
        assert_eq!(spans("a^{b").len(), 1, "an open brace is text");
    }

    #[test]
    fn coordinates_are_short() {
        assert_eq!([short(1.0), short(0.125), short(-0.001), short(10.5)], ["1", "0.12", "0", "10.5"]);
    }
}
