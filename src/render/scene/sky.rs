//! The environments that the program makes.

use std::f64::consts::{PI, SQRT_2, TAU};

use glam::DVec3;

use super::light_spec::BuiltInSky;
use crate::geometry::angles::angle_between;
use crate::image::ColorGrid;

impl BuiltInSky {
    /// Its picture, W/(sr·m²), in 32-bit floats as a file would hold it.
    #[must_use]
    pub fn picture(self) -> ColorGrid {
        match self {
            Self::SunAndSky => grid(512, 256, sun_and_sky),
        }
    }
}

/// L = (.20, .25, .30) + (.5, .4, .3)·½(1 + cosθ), and within 3° of the sun (400, 360, 300) more.
fn sun_and_sky(d: DVec3) -> DVec3 {
    let sky = DVec3::new(0.20, 0.25, 0.30) + DVec3::new(0.5, 0.4, 0.3) * (0.5 * (1.0 + d.y));
    let near = angle_between(d, DVec3::new(0.5, 0.5 * SQRT_2, 0.5)).to_degrees() <= 3.0;
    if near { sky + DVec3::new(400.0, 360.0, 300.0) } else { sky }
}

fn grid(width: usize, height: usize, radiance: impl Fn(DVec3) -> DVec3) -> ColorGrid {
    let pixel = |i: usize| {
        let (column, row) = ((i % width) as f64, (i / width) as f64);
        let (sin_t, cos_t) = (PI * row / (height - 1) as f64).sin_cos();
        let (sin_p, cos_p) = (TAU * (column + 0.5) / width as f64).sin_cos();
        radiance(DVec3::new(sin_p * sin_t, cos_t, -cos_p * sin_t)).to_array().map(|x| x as f32)
    };
    ColorGrid { width, height, pixels: (0..width * height).map(pixel).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::read_exr_colors;
    use std::path::Path;

    #[test]
    fn the_sky_is_that_of_the_reference_scene() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/reference/scenes/s4_env.exr");
        if !path.exists() {
            eprintln!("skipped: the reference's environment is not here");
            return;
        }
        let (want, got) = (read_exr_colors(&path, 1 << 20).unwrap(), BuiltInSky::SunAndSky.picture());
        assert_eq!((got.width, got.height), (want.width, want.height));
        let ulp = |a: f32, b: f32| (a - b).abs() <= f32::EPSILON * a.abs();
        let differ = got.pixels.iter().zip(&want.pixels).filter(|(a, b)| !(0..3).all(|c| ulp(a[c], b[c]))).count();
        assert_eq!(differ, 0, "pixels that differ by more than their rounding");
    }
}
