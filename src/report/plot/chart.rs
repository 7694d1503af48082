//! A chart of lines and points over two straight axes.

use super::Figure;
use super::axes::{Area, Axis};
use super::canvas::{Canvas, line};
use super::heading::Heading;
use super::legend::{RINGS, Sample, dot_class, draw_legend, legend_rows, line_class, wrapped};
use super::scale::Scale;

/// Radius of a ring, CSS pixels.
pub(super) const RING: f64 = 5.5;

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Marks {
    /// A line.
    #[default]
    Line,
    /// Dots, with error bars where errors are known.
    Dots,
    /// Dots on a line.
    Both,
}

/// A point of a series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Its place along the horizontal axis.
    pub x: f64,
    /// Its value; NaN breaks a line.
    pub y: f64,
    /// What its error bar spans, where it has one.
    pub bar: Option<(f64, f64)>,
}

impl Point {
    /// A point without an error bar.
    #[must_use]
    pub fn new(x: f64, y: f64) -> Self {
        Self { x, y, bar: None }
    }
}

/// A named list of points.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// What the legend calls it.
    pub name: String,
    /// How it is drawn.
    pub marks: Marks,
    /// Its points, in the order of a line through them.
    pub points: Vec<Point>,
    /// Its colour and dash: 0 is the ink, what is measured; from 1 on models.
    pub color: usize,
}

/// Where the legend stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LegendPlace {
    /// In rows below the plot.
    #[default]
    Below,
    /// Nowhere.
    None,
}

/// A chart.
#[derive(Debug, Clone)]
pub struct Chart {
    /// What it shows.
    pub heading: Heading,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// What is drawn.
    pub series: Vec<Series>,
    /// Whether error bars are drawn.
    pub bars: bool,
    /// Places with rings about them: whole ones, and dashed ones.
    pub rings: [Vec<Point>; 2],
    /// What is said where a pointer rests on a place.
    pub tips: Vec<(Point, String)>,
    /// Where the legend stands.
    pub legend: LegendPlace,
    /// Width and height of all, CSS pixels; a legend below comes on top.
    pub size: (f64, f64),
}

impl Default for Chart {
    fn default() -> Self {
        Self {
            heading: Heading::default(),
            x: Axis::new("", Scale::linear(0.0, 1.0)),
            y: Axis::new("", Scale::linear(0.0, 1.0)),
            series: Vec::new(),
            bars: true,
            rings: [Vec::new(), Vec::new()],
            tips: Vec::new(),
            legend: LegendPlace::Below,
            size: (430.0, 330.0),
        }
    }
}

impl Chart {
    /// The drawing.
    #[must_use]
    pub fn figure(&self) -> Figure {
        let (width, height) = self.size;
        let top = self.heading.top();
        let area = Area { left: 54.0, top, width: width - 54.0 - 16.0, height: height - top - 46.0 };
        let of_series = self.series.iter().map(|s| (s.name.as_str(), Sample::Series(s.marks, s.color)));
        let of_rings = RINGS.iter().zip(&self.rings).filter(|(_, places)| !places.is_empty());
        let names: Vec<_> = of_series.chain(of_rings.map(|((class, name), _)| (*name, Sample::Ring(class)))).collect();
        let rows = if self.legend == LegendPlace::Below { legend_rows(&names, width - 20.0) } else { Vec::new() };
        let mut canvas = self.heading.canvas(width, height + 18.0 * rows.len() as f64);
        area.frame(&mut canvas, (&self.x, (area.width / 64.0) as usize), (&self.y, 6), true);
        canvas.group("series", |c| self.series.iter().for_each(|s| self.draw(c, &area, s)));
        draw_legend(&mut canvas, &rows, 10.0, height + 8.0);
        for ((class, _), places) in RINGS.iter().zip(&self.rings) {
            places.iter().filter_map(|p| self.inside(&area, p)).for_each(|at| canvas.circle(class, at, RING));
        }
        let tips = self.tips.iter().filter_map(|(point, says)| Some((self.inside(&area, point)?, says)));
        tips.for_each(|(at, says)| canvas.tip(at, says));
        self.heading
            .figure(canvas)
            .with_data("area", area.data())
            .with_data("x", self.x.scale.data())
            .with_data("y", self.y.scale.data())
    }

    fn draw(&self, canvas: &mut Canvas, area: &Area, series: &Series) {
        if self.bars {
            let d: String = series.points.iter().filter_map(|p| self.bar(area, p)).collect();
            canvas.path(&format!("error s{}", wrapped(series.color)), d);
        }
        if series.marks != Marks::Dots {
            let pieces = self.pieces(area, &series.points);
            canvas.path(&line_class(series.color), pieces.into_iter().map(line).collect());
        }
        if series.marks != Marks::Line {
            for at in series.points.iter().filter_map(|p| self.inside(area, p)) {
                canvas.circle(&dot_class(series.color), at, if series.points.len() > 60 { 1.8 } else { 2.6 });
            }
        }
    }

    fn inside(&self, area: &Area, p: &Point) -> Option<(f64, f64)> {
        let (x, y) = (self.x.scale.place(p.x)?, self.y.scale.place(p.y)?);
        let is_inside = |place: f64| (-1e-6..=1.0 + 1e-6).contains(&place);
        (is_inside(x) && is_inside(y)).then(|| (area.x(x), area.y(y)))
    }

    /// Lines between breaks; where one leaves the frame it ends on it.
    fn pieces(&self, area: &Area, points: &[Point]) -> Vec<Vec<(f64, f64)>> {
        let mut pieces = vec![Vec::new()];
        let mut last: Option<(f64, f64)> = None;
        for p in points {
            let place = self.x.scale.place(p.x).zip(self.y.scale.place(p.y));
            if let (Some(from), Some(to)) = (last, place)
                && let Some((a, b)) = clipped(from, to)
            {
                if b != to || pieces.last().is_none_or(Vec::is_empty) {
                    pieces.extend((pieces.last().is_some_and(|p| !p.is_empty()) && a != from).then(Vec::new));
                }
                if let Some(piece) = pieces.last_mut() {
                    if piece.is_empty() {
                        piece.push((area.x(a.0), area.y(a.1)));
                    }
                    piece.push((area.x(b.0), area.y(b.1)));
                }
                if b != to {
                    pieces.push(Vec::new());
                }
            } else if place.is_none() {
                pieces.push(Vec::new());
            }
            last = place;
        }
        pieces
    }

    fn bar(&self, area: &Area, p: &Point) -> Option<String> {
        let (x, _) = self.inside(area, p)?;
        let (low, high) = p.bar?;
        let end = |v: f64, or: f64| area.y(self.y.scale.place(v).unwrap_or(or).clamp(0.0, 1.0));
        Some(line([(x, end(low, 0.0)), (x, end(high, 1.0))]))
    }
}

/// The part of a segment that lies in the unit square (Liang and Barsky 1984).
fn clipped(from: (f64, f64), to: (f64, f64)) -> Option<((f64, f64), (f64, f64))> {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let (mut begin, mut end) = (0.0f64, 1.0f64);
    for (p, q) in [(-dx, from.0), (dx, 1.0 - from.0), (-dy, from.1), (dy, 1.0 - from.1)] {
        if p == 0.0 {
            if q < -1e-9 {
                return None;
            }
        } else if p < 0.0 {
            begin = begin.max(q / p);
        } else {
            end = end.min(q / p);
        }
    }
    let at = |t: f64| match t {
        0.0 => from,
        1.0 => to,
        _ => (from.0 + t * dx, from.1 + t * dy),
    };
    (begin <= end).then(|| (at(begin), at(end)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_on_the_frame_and_break_at_gaps() {
        let points = [(0.0, 0.5), (0.5, 1.5), (1.0, 0.5)].map(|(x, y)| Point::new(x, y));
        let chart = Chart::default();
        let area = Area { left: 0.0, top: 0.0, width: 1.0, height: 1.0 };
        let pieces: Vec<_> = chart.pieces(&area, &points).into_iter().filter(|p| !p.is_empty()).collect();
        assert_eq!(pieces.len(), 2, "{pieces:?}");
        assert_eq!(pieces[0], [(0.0, 0.5), (0.25, 0.0)]);
        assert_eq!(pieces[1], [(0.75, 0.0), (1.0, 0.5)]);
        let gap = [(0.0, 0.5), (0.2, 0.5), (0.3, f64::NAN), (0.4, 0.5), (0.6, 0.5)].map(|(x, y)| Point::new(x, y));
        let pieces: Vec<_> = chart.pieces(&area, &gap).into_iter().filter(|p| !p.is_empty()).collect();
        assert_eq!(pieces.iter().map(Vec::len).collect::<Vec<_>>(), [2, 2]);
    }

    #[test]
    fn names_are_escaped() {
        let series = Series { name: "<b>&\"x".into(), marks: Marks::Line, points: vec![], color: 1 };
        let chart = Chart {
            heading: Heading { title: "<script>".into(), ..Heading::default() },
            series: vec![series],
            ..Chart::default()
        };
        let svg = chart.figure().to_svg();
        assert!(!svg.contains("<script>") && !svg.contains("<b>"), "{svg}");
        assert!(svg.contains("&#60;b&#62;&#38;&#34;x") || svg.contains("&lt;b&gt;&amp;&quot;x"), "{svg}");
    }
}
