//! Error against cost over two logarithmic axes, with the slopes that theory expects.

use super::Figure;
use super::axes::Axis;
use super::chart::{Chart, Marks, Point, Series};
use super::heading::Heading;
use super::scale::Scale;

/// A reference line of known slope.
#[derive(Debug, Clone, PartialEq)]
pub struct Slope {
    /// What the legend calls it, "−½" say.
    pub name: String,
    /// d log y / d log x.
    pub slope: f64,
    /// The series through whose middle point it goes, beside it by a factor of 1.6 so that both are seen.
    pub beside: usize,
}

/// A chart of cost and error.
#[derive(Debug, Clone, Default)]
pub struct LogLog {
    /// What it shows.
    pub heading: Heading,
    /// Label of the horizontal axis, `time [s]` say.
    pub x_label: String,
    /// Label of the vertical axis.
    pub y_label: String,
    /// The measured points, each with its error bar where it has one; points that are not positive are left out.
    pub series: Vec<Series>,
    /// Reference lines.
    pub slopes: Vec<Slope>,
    /// Settings that no other beats in time and error, and those of which that is undecided: places with rings about them, whole and dashed.
    pub front: [Vec<Point>; 2],
    /// What is said where a pointer rests on a place.
    pub tips: Vec<(Point, String)>,
}

impl LogLog {
    /// The drawing.
    #[must_use]
    pub fn figure(&self) -> Figure {
        let mut series = self.series.clone();
        for one in &mut series {
            one.points.retain(|p| p.x > 0.0 && p.y > 0.0);
        }
        let all = || series.iter().flat_map(|s| &s.points);
        let x = Scale::log_around(all().map(|p| p.x), 12.0);
        let ends = all().flat_map(|p| [Some(p.y), p.bar.map(|b| b.0), p.bar.map(|b| b.1)]).flatten();
        let y = Scale::log_around(ends, 12.0);
        let references: Vec<Series> = self.slopes.iter().filter_map(|s| reference(s, &series, x)).collect();
        let mut chart = Chart {
            heading: self.heading.clone(),
            x: Axis::new(&*self.x_label, x),
            y: Axis::new(&*self.y_label, y),
            series,
            rings: self.front.clone(),
            tips: self.tips.clone(),
            ..Chart::default()
        };
        chart.series.extend(references);
        chart.figure()
    }
}

/// The line of a slope beside the middle of its series, over the length of that.
fn reference(slope: &Slope, series: &[Series], x: Scale) -> Option<Series> {
    let of = series.get(slope.beside)?;
    let middle = of.points.get(of.points.len() / 2)?;
    let first = of.points.iter().map(|p| p.x).fold(f64::INFINITY, f64::min).max(x.low);
    let last = of.points.iter().map(|p| p.x).fold(0.0, f64::max).min(x.high);
    let at = |x: f64| Point::new(x, middle.y / 1.6 * (x / middle.x).powf(slope.slope));
    (last > first).then(|| Series {
        name: slope.name.clone(),
        marks: Marks::Line,
        points: vec![at(first), at(last)],
        color: super::style::REFERENCE,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reference_has_its_slope_and_stands_beside_its_series() {
        let points = [1.0, 4.0, 16.0].map(|x: f64| Point::new(x, 2.0 / x.sqrt())).to_vec();
        let series = vec![Series { name: "s".into(), marks: Marks::Both, points, color: 1 }];
        let slope = Slope { name: "−½".into(), slope: -0.5, beside: 0 };
        let found =
            reference(&slope, &series, Scale { low: 1.0, high: 20.0, spacing: super::super::scale::Spacing::Log })
                .expect("a line");
        let [a, b] = [found.points[0], found.points[1]];
        assert!(((b.y / a.y).ln() / (b.x / a.x).ln() + 0.5).abs() < 1e-12);
        assert!((a.y * 1.6 - 2.0).abs() < 1e-12, "{a:?}");
    }
}
