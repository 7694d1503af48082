//! Laws of the camera: what a thin lens blurs, and what each filter makes of an edge, by packets and one path at a time.

#![allow(clippy::expect_used, clippy::panic, clippy::float_cmp)] // these are tests

mod common;

use common::{both_ways, picture_by, scene};
use glam::DVec2;
use goniofit::control::Control;
use goniofit::numeric::stats::two_sided_p;
use goniofit::render::{Film, Options, Scene, render};

/// Tangent of half the field of view of the cameras here, which look along −z from the origin.
fn half_width() -> f64 {
    10f64.to_radians().tan()
}

/// Such a camera, and a shining rectangle that faces it at distance `d`: its middle and half-edges in units of d.
fn facing(lens: &str, filter: &str, d: f64, middle: DVec2, half: DVec2) -> Scene {
    scene(&format!(
        "version = 1\nname = \"facing\"\nmax_bounces = 1\n[camera]\nposition = [0, 0, 0]\ntarget = [0, 0, -1]\n\
         fov_deg = 20\n{lens}[film]\nfilter = \"{filter}\"\n[[light.quad]]\ncenter = [{:?}, {:?}, {:?}]\n\
         u = [{:?}, 0, 0]\nv = [0, {:?}, 0]\nradiance = [1, 1, 1]\n",
        d * middle.x,
        d * middle.y,
        -d,
        d * half.x,
        d * half.y
    ))
}

const SIZE: u32 = 33;
/// Radius of the lens and distance in focus, m.
const RADIUS: f64 = 0.25;
const FOCUS: f64 = 2.0;
/// Where the lamp's middle appears, pixels to the right of the picture's middle and above it.
const AT: DVec2 = DVec2::new(3.0, 2.0);

/// Width of a pixel, in units of the distance.
fn pixel() -> f64 {
    2.0 * half_width() / f64::from(SIZE)
}

/// A lamp at distance `d` that a pinhole sees in 3 × 3 whole pixels.
fn lamp(lens_radius: f64, d: f64) -> Scene {
    let lens = format!("lens_radius = {lens_radius:?}\nfocus_distance = {FOCUS:?}\n");
    facing(&lens, "box", d, pixel() * AT, DVec2::splat(1.5 * pixel()))
}

/// Middles of the pixels, in pixels from where the lamp's appears.
fn places() -> impl Iterator<Item = (u32, u32, DVec2)> {
    let middle = |k: u32| f64::from(k) - 0.5 * f64::from(SIZE - 1);
    (0..SIZE).flat_map(move |y| (0..SIZE).map(move |x| (x, y, DVec2::new(middle(x), -middle(y)) - AT)))
}

/// Σ weight·radiance over the pixels, and its standard error.
fn total(film: &Film, weight: impl Fn(DVec2) -> f64) -> (f64, f64) {
    let (mut sum, mut variance) = (0.0, 0.0);
    for (x, y, place) in places() {
        sum += weight(place) * film.radiance(x, y).expect("a pixel").x;
        variance += (weight(place) * film.standard_error(x, y).expect("a pixel").x).powi(2);
    }
    (sum, variance.sqrt())
}

/// Mean of a value over the picture's light, and its standard error.
fn mean_of(film: &Film, value: impl Fn(DVec2) -> f64) -> (f64, f64) {
    let sum = total(film, |_| 1.0).0;
    let mean = total(film, &value).0 / sum;
    (mean, total(film, |place| value(place) - mean).1 / sum)
}

/// A ray through the point s of the lens meets the plane at distance d by s·(1 − d/f) away from where the pinhole's does. So
/// a point there is seen as an even disc of radius R·|d − f|/f in its own plane, R·|d − f|/d in the plane in focus; its mean
/// square is half the radius's.
///
/// Pixels add their own, along each axis: that the lamp is three of them adds (3² − 1)/12, and that each of these lies over
/// two pixels of the picture, with the shares t and 1 − t, adds t·(1 − t), between 0 and ¼; means stay.
#[test]
fn a_lens_blurs_a_point_to_a_disc_of_the_circle_of_confusion() {
    for d in [1.1, 1.25, FOCUS, 3.5, 8.0] {
        let radius = RADIUS * (d - FOCUS).abs() / (d * FOCUS) / pixel();
        let least = 0.5 * radius * radius + 2.0 * 8.0 / 12.0;
        let built = lamp(RADIUS, d);
        for plan in both_ways(&built) {
            let what = format!("d {d}, packets {}", plan.packets);
            let film = picture_by(plan, &built, SIZE, 512, 1);
            let (sum, noise) = total(&film, |_| 1.0);
            assert!((sum - 9.0).abs() <= 5.0 * noise + 1e-9, "{what}: {sum} ± {noise} pixels of light vs 9");
            for axis in [DVec2::X, DVec2::Y] {
                let (off, noise) = mean_of(&film, |place| place.dot(axis));
                assert!(off.abs() <= 5.0 * noise + 1e-9, "{what}: its middle {off} ± {noise} pixels off along {axis}");
            }
            let (square, noise) = mean_of(&film, DVec2::length_squared);
            let off = (square - least - 0.25).abs();
            let most = least + 0.5;
            assert!(off <= 0.25 + 5.0 * noise + 1e-9, "{what}: ⟨r²⟩ {square} ± {noise} vs {least} to {most}");
            assert!(noise <= 0.01 * square, "{what}: noise {noise} of {square}: the check is sharp");
            // Half a lamp and half a pixel beyond the disc, two pixels along both axes, there is nothing.
            let reach = radius + 8f64.sqrt();
            let beyond = total(&film, |place| if place.length() > reach { 1.0 } else { 0.0 }).0;
            assert!(beyond == 0.0, "{what}: {beyond} farther than {reach} pixels");
        }
    }
}

#[test]
fn what_is_in_focus_is_as_sharp_as_by_a_pinhole() {
    for (lens_radius, d) in [(RADIUS, FOCUS), (0.0, FOCUS), (0.0, 8.0)] {
        let built = lamp(lens_radius, d);
        for plan in both_ways(&built) {
            let film = picture_by(plan, &built, SIZE, 64, 2);
            for (x, y, place) in places() {
                let (got, want) = (film.radiance(x, y).expect("a pixel").x, f64::from(place.abs().max_element() < 1.5));
                assert!(got == want, "lens {lens_radius}, packets {}, {x} {y}: {got} vs {want}", plan.packets);
            }
        }
    }
}

/// Integral of a filter's weight beyond `t` pixels from the pixel's middle, along one axis.
fn beyond(filter: &str, t: f64) -> f64 {
    let tail = |z: f64| if z < 0.0 { 1.0 - 0.5 * two_sided_p(z) } else { 0.5 * two_sided_p(z) };
    match filter {
        "box" => (0.5 - t).clamp(0.0, 1.0),
        "tent" if t < 0.0 => 1.0 - beyond("tent", -t),
        "tent" => 0.5 * (1.0 - t).max(0.0).powi(2),
        // σ is half a pixel; cut off at 3 σ.
        _ => ((tail(2.0 * t) - tail(3.0)) / (1.0 - 2.0 * tail(3.0))).clamp(0.0, 1.0),
    }
}

/// Half of the picture shines, from `edge` pixels from its upper left on, across it or down.
fn half_plane(filter: &str, down: bool, edge: f64) -> Scene {
    let pixel = 2.0 * half_width() / if down { 2.0 } else { 8.0 };
    let (far, start) = (50.0, pixel * (edge - 4.0));
    let middle = if down { DVec2::new(0.0, -start - far) } else { DVec2::new(start + far, 0.0) };
    facing("", filter, 1.0, middle, DVec2::splat(far))
}

/// The first 2ᵐ points of each half of a pixel's samples have one coordinate in every interval of 2⁻ᵐ, so that a pixel of
/// n = 2ᵐ⁺¹ samples is off by less than 2/n.
#[test]
fn an_edge_shows_the_integral_of_the_filter() {
    let samples = 4096;
    for filter in ["box", "tent", "gaussian"] {
        for (down, edge) in [false, true].into_iter().flat_map(|down| [3.5, 4.0, 4.3].map(|edge| (down, edge))) {
            let built = half_plane(filter, down, edge);
            let (width, height) = if down { (2, 8) } else { (8, 2) };
            for plan in both_ways(&built) {
                let options = Options { width, height, samples, plan: Some(plan), ..Options::default() };
                let film = render(&built, &options, Control::silent()).expect("options are in range");
                for (k, other) in (0..8).flat_map(|k| [(k, 0), (k, 1)]) {
                    let (x, y) = if down { (other, k) } else { (k, other) };
                    let got = film.radiance(x, y).expect("a pixel").x;
                    let want = beyond(filter, edge - (f64::from(k) + 0.5));
                    assert!(
                        (got - want).abs() <= 2.0 / f64::from(samples) + 1e-9,
                        "{filter}, down {down}, edge {edge}, packets {}, pixel {k}: {got} vs {want}",
                        plan.packets
                    );
                }
            }
        }
    }
}
