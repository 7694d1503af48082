//! Lobes in the plane of incidence: the length of a ray is the reflectance in its direction.

use std::f64::consts::FRAC_PI_2;

use super::Figure;
use super::canvas::{Canvas, Mark, Px, line, short};
use super::chart::{Marks, Series};
use super::heading::Heading;
use super::legend::{Sample, dot_class, draw_legend, legend_rows, line_class};
use super::scale::Scale;

/// A polar chart over the half-plane above a surface: angles from −90° to 90°, 0° upwards, positive to the right.
#[derive(Debug, Clone)]
pub struct PolarChart {
    /// What it shows.
    pub heading: Heading,
    /// What the length of a ray is, with its unit.
    pub label: String,
    /// Lengths; a logarithmic one begins at the centre with its low end.
    pub scale: Scale,
    /// Series over angles in degrees.
    pub series: Vec<Series>,
    /// Where the light comes from, degrees; drawn on the left.
    pub incidence_deg: Option<f64>,
    /// Whether there is a legend.
    pub legend: bool,
    /// Width, CSS pixels.
    pub width: f64,
}

const MARGIN: f64 = 30.0;

impl PolarChart {
    /// The drawing.
    #[must_use]
    pub fn figure(&self) -> Figure {
        let radius = 0.5 * self.width - MARGIN;
        let top = if self.heading.drawn { 46.0 } else { 26.0 };
        let center = (0.5 * self.width, top + radius);
        let base = center.1 + 46.0;
        let names: Vec<_> = self.series.iter().map(|s| (s.name.as_str(), Sample::Series(s.marks, s.color))).collect();
        let rows = if self.legend { legend_rows(&names, self.width - 20.0) } else { Vec::new() };
        let mut canvas = self.heading.canvas(self.width, base + 6.0 + 18.0 * rows.len() as f64);
        self.frame(&mut canvas, center, radius);
        if let Some(angle) = self.incidence_deg {
            incident(&mut canvas, center, radius, angle);
        }
        canvas.group("series", |c| self.series.iter().for_each(|s| self.draw(c, center, radius, s)));
        draw_legend(&mut canvas, &rows, 10.0, base + 12.0);
        self.heading
            .figure(canvas)
            .with_data("polar", format!("{} {} {radius}", center.0, center.1))
            .with_data("r", self.scale.data())
    }

    fn frame(&self, canvas: &mut Canvas, center: (f64, f64), radius: f64) {
        canvas.group("frame", |c| {
            let ticks = self.scale.ticks(4);
            for tick in ticks.iter().filter(|t| !t.label.is_empty()) {
                let Some(place) = self.scale.place(tick.value).filter(|p| (1e-6..=1.0 + 1e-6).contains(p)) else {
                    continue;
                };
                c.path("grid", half_circle(center, place * radius));
                if place > 0.12 {
                    c.text("tick middle", (center.0 + place * radius, center.1 + 15.0), &tick.label);
                }
            }
            c.path("axis", half_circle(center, radius));
            c.segment("axis", (center.0 - radius, center.1), (center.0 + radius, center.1));
            for degrees in [-60, -30, 0, 30, 60] {
                let end = ray(center, radius, f64::from(degrees));
                c.segment("grid", center, end);
                let label = ray(center, radius + 13.0, f64::from(degrees));
                let text = format!("{degrees}°").replace('-', "−");
                c.text("tick middle", (label.0, label.1 + 4.0), &text);
            }
            c.text("middle", (center.0, center.1 + 33.0), &self.label);
        });
    }

    fn draw(&self, canvas: &mut Canvas, center: (f64, f64), radius: f64, series: &Series) {
        let at = |p: &super::Point| {
            let place = self.scale.place(p.y).unwrap_or(if p.y.is_nan() { f64::NAN } else { 0.0 });
            (!place.is_nan()).then(|| ray(center, place.clamp(0.0, 1.0) * radius, p.x))
        };
        if series.marks != Marks::Dots {
            let pieces = series.points.split(|p| at(p).is_none());
            canvas.path(&line_class(series.color), pieces.map(|piece| line(piece.iter().filter_map(at))).collect());
        }
        if series.marks != Marks::Line {
            series.points.iter().filter_map(at).for_each(|p| canvas.circle(&dot_class(series.color), p, 1.8));
        }
    }
}

/// The end of a ray at an angle from the normal.
fn ray(center: (f64, f64), length: f64, degrees: f64) -> (f64, f64) {
    let angle = FRAC_PI_2 - degrees.to_radians();
    (center.0 + length * angle.cos(), center.1 - length * angle.sin())
}

fn half_circle(center: (f64, f64), radius: f64) -> String {
    let r = short(radius);
    let (left, right, y) = (short(center.0 - radius), short(center.0 + radius), short(center.1));
    format!("M{left} {y}A{r} {r} 0 0 1 {right} {y}")
}

/// The incident light, an arrow to the centre: drawn upright, then turned.
fn incident(canvas: &mut Canvas, (x, y): (f64, f64), radius: f64, degrees: f64) {
    let tip = y - 0.06 * radius;
    canvas.marks.push(Mark::Turn { class: "incident".into(), degrees: Px(-degrees), x: Px(x), y: Px(y) });
    canvas.segment("ray", (x, y - radius), (x, tip - 7.0));
    canvas.path("head-of-ray", line([(x - 3.6, tip - 9.0), (x, tip), (x + 3.6, tip - 9.0)]) + "Z");
    canvas.marks.push(Mark::End);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_stand_where_their_angles_are() {
        let near = |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).hypot(a.1 - b.1) < 1e-9;
        assert!(near(ray((0.0, 0.0), 2.0, 0.0), (0.0, -2.0)));
        assert!(near(ray((0.0, 0.0), 2.0, 90.0), (2.0, 0.0)), "positive angles to the right");
        assert!(near(ray((1.0, 1.0), 1.0, -90.0), (0.0, 1.0)));
    }
}
