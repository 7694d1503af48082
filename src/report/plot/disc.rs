//! A hemisphere seen from above, each cell as large as its solid angle.

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};
use std::fmt::Write;

use super::Figure;
use super::canvas::{Canvas, Mark, short};
use super::heading::Heading;
use super::heat::{color_bar, hex};
use super::scale::Scale;
use crate::image::ColorMap;

/// A cell of the hemisphere, from θ and φ to θ and φ, degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DiscCell {
    /// Polar angles of its borders.
    pub theta_deg: (f64, f64),
    /// Azimuths of its borders; 0 is to the right, as seen by who looks down.
    pub phi_deg: (f64, f64),
    /// What its colour stands for.
    pub value: f64,
}

/// Values over a hemisphere in Lambert's equal-area projection.
#[derive(Debug, Clone)]
pub struct Disc {
    /// What it shows.
    pub heading: Heading,
    /// The cells that there is something to show of.
    pub cells: Vec<DiscCell>,
    /// What the colours stand for.
    pub scale: Scale,
    /// What the colours stand for.
    pub color_label: String,
    /// Polar angles of incidence, degrees; drawn as ticks on the left.
    pub incidences_deg: Vec<f64>,
    /// Width, CSS pixels.
    pub width: f64,
}

impl Disc {
    /// The drawing.
    #[must_use]
    pub fn figure(&self) -> Figure {
        let top = self.heading.top();
        let radius = 0.5 * (self.width - 36.0 - 110.0);
        let center = (36.0 + radius, top + radius);
        let mut canvas = self.heading.canvas(self.width, top + 2.0 * radius + 30.0);
        let layers = self.cells.iter().map(|cell| (self.color(cell.value), outline(center, radius, cell)));
        canvas.marks.push(Mark::Cells { layers: layers.collect() });
        frame(&mut canvas, center, radius);
        for theta in &self.incidences_deg {
            let r = radius * projected(*theta);
            canvas.circle("incidence", (center.0 - r, center.1), 2.8);
        }
        let bar = (center.0 + radius + 30.0, top, 2.0 * radius);
        color_bar(&mut canvas, ColorMap::Sequential, self.scale, &self.color_label, bar);
        self.heading.figure(canvas).with_data("disc", format!("{} {} {radius}", center.0, center.1))
    }

    fn color(&self, value: f64) -> String {
        hex(ColorMap::Sequential.color(self.scale.place(value).unwrap_or(0.0)))
    }
}

/// The radius of a polar angle, 1 at the horizon: √2 sin(θ/2).
fn projected(theta_deg: f64) -> f64 {
    SQRT_2 * (0.5 * theta_deg.to_radians()).sin()
}

fn frame(canvas: &mut Canvas, center: (f64, f64), radius: f64) {
    canvas.group("frame", |c| {
        for theta in [30.0, 60.0] {
            let r = radius * projected(theta);
            c.path("zero", ring(center, r));
            let along = r * FRAC_1_SQRT_2;
            c.text("tick halo", (center.0 + along + 2.0, center.1 + along + 10.0), &format!("{theta}°"));
        }
        c.path("axis", ring(center, radius));
        for (x, y, class, text) in [
            (1.0, 0.0, "tick", "0°"),
            (0.0, -1.0, "tick middle", "90°"),
            (-1.0, 0.0, "tick end", "180°"),
            (0.0, 1.0, "tick middle", "270°"),
        ] {
            let away = if y > 0.0 { 15.0 } else { 5.0 };
            let (px, py) = (center.0 + x * (radius + away), center.1 + y * (radius + away));
            c.text(class, (px, if y == 0.0 { py + 4.0 } else { py }), text);
        }
    });
}

fn ring(center: (f64, f64), radius: f64) -> String {
    let (left, right, y, r) = (short(center.0 - radius), short(center.0 + radius), short(center.1), short(radius));
    format!("M{left} {y}A{r} {r} 0 0 1 {right} {y}A{r} {r} 0 0 1 {left} {y}Z")
}

/// The border of a cell.
fn outline(center: (f64, f64), radius: f64, cell: &DiscCell) -> String {
    let at = |theta: f64, phi: f64| {
        let (sin, cos) = phi.to_radians().sin_cos();
        let r = radius * projected(theta);
        (center.0 + r * cos, center.1 - r * sin)
    };
    let (inner, outer) = cell.theta_deg;
    let (from, to) = cell.phi_deg;
    if inner == 0.0 && to - from >= 360.0 {
        return ring(center, radius * projected(outer));
    }
    let mut d = String::new();
    let point = |(x, y): (f64, f64)| format!("{} {}", short(x), short(y));
    let arc = |theta: f64, sweep: u8, phi: f64| {
        let r = short(radius * projected(theta));
        format!("A{r} {r} 0 0 {sweep} {}", point(at(theta, phi)))
    };
    // Writing to a String can't fail. Azimuth runs against the clock, as y points down.
    let _ = write!(d, "M{}{}", point(at(outer, from)), arc(outer, 0, to));
    if inner > 0.0 {
        let _ = write!(d, "L{}{}Z", point(at(inner, to)), arc(inner, 1, from));
    } else {
        let _ = write!(d, "L{}Z", point(center));
    }
    d
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_are_solid_angles() {
        // The area within θ over that of the disc is 1 − cosθ.
        for theta in [10.0f64, 30.0, 60.0, 90.0] {
            assert!((projected(theta).powi(2) - (1.0 - theta.to_radians().cos())).abs() < 1e-14);
        }
    }
}
