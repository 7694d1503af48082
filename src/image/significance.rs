//! Whether two pictures differ by more than their noise.

use serde::Serialize;

use super::Image;
use super::blocks::Level;
use crate::numeric::stats::{normal_quantile, sidak, two_sided_p};

/// Samples a pixel below which its standard error says too little of its noise.
const MIN_SAMPLES: u32 = 16;

/// Probability that a family of tests flags two pictures that differ by nothing but noise.
const LEVEL: f64 = 0.01;

/// Edge of the blocks of [`BlockTest`], pixels.
const BLOCK: usize = 32;

/// A test of every pixel, every block of 2 × 2, 4 × 4, … pixels and the whole picture, channel by channel: differences too small
/// to be seen in a pixel add up in a block.
///
/// t = Σ (x − ref)/√Σ (σ² + σref²) over the block. A picture without standard errors counts as exact; half a unit in the last place of
/// the 32-bit floats of a file counts as noise. σ is estimated from few samples with heavy tails, so it is taken with care:
/// - σ² is the larger of the pixel's own and the mean of the three largest among its 3 × 3 known neighbours: few samples may all miss
///   an edge or a rare bright path, and an edge runs through two neighbours, which saw it.
/// - t has Student's distribution with ν = (Σ σ²)²/Σ (σ⁴/(samples − 1)) degrees of freedom (Welch 1947; infinite where the number of
///   samples is not known), and z is the normal variate that is as improbable (Wallace 1959).
/// - Values in which the pictures agree and that have no noise (a black sky) are not tested.
///
/// Measured with pictures of one scene and different seeds (the built-in cornell, sphere-on-plane and sphere at 48 × 48; 16:16,
/// 64:64, 16:256 and 64:1024 samples; 10 pairs each): none of 120 pairs is flagged, mean z² is 0.65 to 0.82. With every pixel's own
/// σ instead, 52 of the 60 pairs with unequal samples are flagged. A ball whose albedo is wrong by 5 % is found in 30 of 30 pairs
/// at 64 samples, in blocks of 4 to 32 pixels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Significance {
    /// Number of tests: pixels and blocks × channels whose noise is known.
    pub tests: usize,
    /// Largest |z|.
    pub max_z: f64,
    /// Column, row and channel of the largest |z|; the upper left pixel where it is of a block.
    pub at: (usize, usize, usize),
    /// Width and height of the block of the largest |z|, pixels; blocks at the picture's edge may be cut.
    pub block: usize,
    /// Probability that the largest of as many independent |z| is this large by chance (Šidák); an upper bound, since blocks overlap.
    pub p: f64,
    /// Mean z² of the single pixels: about 1 or, as σ is taken with care, somewhat below where pictures differ by nothing but noise.
    pub mean_z2: f64,
    /// Whether the pictures differ significantly, at 1 %.
    pub differs: bool,
    /// Pixels of which some channel was tested.
    pub pixels: usize,
    /// Those of them that differ by more than their noise at 1 % for all single pixels × channels together (Šidák).
    pub pixels_differing: usize,
    /// The test of the means over blocks of 32 × 32 pixels alone.
    pub blocks: BlockTest,
}

/// The test of the means over blocks of 32 × 32 pixels, channel by channel: it sees a bias far below the noise of a pixel, and with
/// fewer tests than over all sizes of blocks a smaller one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BlockTest {
    /// Width and height of a block, pixels: 32, or as much more than the picture's larger side as makes a power of two.
    pub block: usize,
    /// Number of tests: blocks × channels.
    pub tests: usize,
    /// Largest |z|.
    pub max_z: f64,
    /// Column and row of the upper left pixel of that block, and the channel.
    pub at: (usize, usize, usize),
    /// Mean of x − ref over that block, W/(sr·m²).
    pub difference: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Probability that the largest of as many independent |z| is this large by chance (Šidák).
    pub p: f64,
    /// Whether some block differs significantly, at 1 % for all blocks together.
    pub differs: bool,
}

impl BlockTest {
    fn of(level: &Level) -> Self {
        let found = level.outcome();
        let (p, differs) = judged(found.max_z, found.tests);
        let (difference, standard_error) = found.difference;
        Self {
            block: level.block,
            tests: found.tests,
            max_z: found.max_z,
            at: found.at,
            difference,
            standard_error,
            p,
            differs,
        }
    }
}

/// The probability that the largest of as many independent |z| is this large by chance, and whether that is below [`LEVEL`].
fn judged(max_z: f64, tests: usize) -> (f64, bool) {
    let p = two_sided_p(max_z);
    (-f64::exp_m1(tests as f64 * f64::ln_1p(-p)), p.is_nan() || p < sidak(LEVEL, tests))
}

/// Tests two pictures of one size where both are `known`, or says why they can't be tested.
pub(super) fn significance(image: &Image, reference: &Image, known: &[bool]) -> Result<Significance, String> {
    let pictures = [image, reference];
    let noisy = || pictures.into_iter().filter(|p| p.standard_error.is_some());
    if noisy().next().is_none() {
        return Err("no standard errors are stored".into());
    }
    if !known.contains(&true) {
        return Err("no pixel is known in both pictures".into());
    }
    if let Some(samples) = noisy().filter_map(|p| p.metadata.samples).min().filter(|n| *n < MIN_SAMPLES) {
        return Err(format!("too few samples ({samples}) to tell noise from difference; use at least {MIN_SAMPLES}"));
    }
    let mut level = Level::pixels(image, reference, known);
    let pixels = level.outcome();
    if pixels.tests == 0 {
        return Err("no pixel has a known noise".into());
    }
    let mut all = pixels.clone();
    let (tested, differing) = level.beyond(-normal_quantile(0.5 * sidak(LEVEL, pixels.tests)));
    let mut blocks = BlockTest::of(&level);
    while level.width * level.height > 1 {
        level = level.halved();
        all.join(&level.outcome());
        if level.block <= BLOCK {
            blocks = BlockTest::of(&level);
        }
    }
    let (p, differs) = judged(all.max_z, all.tests);
    Ok(Significance {
        tests: all.tests,
        max_z: all.max_z,
        at: all.at,
        block: all.block,
        p,
        mean_z2: pixels.squares / pixels.tests as f64,
        differs,
        pixels: tested,
        pixels_differing: differing,
        blocks,
    })
}

/// The difference of every pixel in units of its noise, with its sign: that of the channel where it is largest. `None` for a pixel
/// that is not tested; nothing where pictures can't be tested, or a value is not a number.
pub(super) fn z_map(image: &Image, reference: &Image, known: &[bool]) -> Option<Vec<Option<f64>>> {
    significance(image, reference, known).ok().filter(|s| s.max_z.is_finite())?;
    Some(Level::pixels(image, reference, known).signed())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Metadata;
    use crate::image::blocks::normal_of_student;
    use crate::numeric::random::{Purpose, stream};
    use crate::numeric::stats::{normal_quantile, student_quantile};
    use rand_distr::{Distribution, StandardNormal};

    fn picture(width: usize, height: usize, samples: Option<u32>, value: impl Fn(usize) -> f64) -> Image {
        let radiance = (0..width * height).map(|i| [value(3 * i), value(3 * i + 1), value(3 * i + 2)]).collect();
        Image { width, height, radiance, metadata: Metadata { samples, ..Metadata::default() }, ..Image::default() }
    }

    fn test(image: &Image, reference: &Image) -> Result<Significance, String> {
        significance(image, reference, &vec![true; image.radiance.len()])
    }

    fn noise(count: usize) -> Vec<f64> {
        let mut rng = stream(5, Purpose::Study, 0);
        (0..count).map(|_| StandardNormal.sample(&mut rng)).collect()
    }

    #[test]
    fn noise_is_accepted_and_a_six_sigma_pixel_is_found() {
        let noise = noise(3 * 64 * 64);
        let mut image = picture(64, 64, None, |i| 1.0 + 0.01 * noise[i]);
        image.standard_error = Some(vec![[0.01; 3]; 64 * 64]);
        let reference = picture(64, 64, None, |_| 1.0);
        let s = test(&image, &reference).unwrap();
        // mean z² of 12,288 tests: 1 ± 5·√(2/12288). Levels of 64², 32², … 1 cells.
        assert!(!s.differs && (s.mean_z2 - 1.0).abs() < 5.0 * (2.0f64 / 12288.0).sqrt(), "{s:?}");
        assert_eq!(s.tests, 3 * (4096 + 1024 + 256 + 64 + 16 + 4 + 1));
        image.radiance[64 * 7 + 9][2] = 1.06;
        let s = test(&image, &reference).unwrap();
        assert!(s.differs && s.at == (9, 7, 2) && s.block == 1 && (s.max_z - 6.0).abs() < 1e-4, "{s:?}");
    }

    #[test]
    fn a_difference_far_below_the_noise_of_a_pixel_is_found_in_a_block() {
        let noise = noise(3 * 64 * 64);
        let inside = |i: usize| (32..48).contains(&(i / 3 % 64)) && (16..32).contains(&(i / 192));
        let mut image = picture(64, 64, None, |i| 1.0 + 0.01 * noise[i] + if inside(i) { 0.006 } else { 0.0 });
        image.standard_error = Some(vec![[0.01; 3]; 64 * 64]);
        let s = test(&image, &picture(64, 64, None, |_| 1.0)).unwrap();
        // 0.6 σ in 16 × 16 pixels: 9.6 ± 1 there.
        assert!(s.differs && s.block == 16 && (s.at.0, s.at.1) == (32, 16) && (s.max_z - 9.6).abs() < 4.0, "{s:?}");
    }

    #[test]
    fn block_means_see_a_bias_that_no_pixel_shows() {
        let noise = noise(3 * 128 * 128);
        let biased = |bias: f64| {
            let errors = Some(vec![[0.01; 3]; 128 * 128]);
            Image { standard_error: errors, ..picture(128, 128, None, |i| 1.0 + bias + 0.01 * noise[i]) }
        };
        let exact = picture(128, 128, None, |_| 1.0);
        let none = test(&biased(0.0), &exact).unwrap();
        assert!(!none.blocks.differs && none.pixels_differing == 0 && none.pixels == 128 * 128, "{none:?}");
        // 0.2 σ of a pixel is 6.4 σ of a block of 32 × 32.
        let s = test(&biased(0.002), &exact).unwrap();
        assert!(s.blocks.differs && s.pixels_differing == 0 && s.blocks.tests == 3 * 16, "{s:?}");
        assert!((s.blocks.difference - 0.002).abs() < 5.0 * s.blocks.standard_error, "{s:?}");
        assert!((s.blocks.standard_error / (0.01 / 32.0) - 1.0).abs() < 1e-6 && s.blocks.block == 32, "{s:?}");
    }

    #[test]
    fn pixels_beyond_their_noise_are_counted() {
        let mut image = picture(6, 1, None, |i| if i == 4 || i == 6 { 2.0 } else { 1.0 });
        image.standard_error = Some(vec![[0.1; 3]; 6]);
        let s = test(&image, &picture(6, 1, None, |_| 1.0)).unwrap();
        assert_eq!((s.pixels, s.pixels_differing, s.blocks.block), (6, 2, 8));
    }

    #[test]
    fn neighbours_lend_their_noise() {
        // A pixel whose samples all agreed by chance, on an edge that its neighbours saw.
        let mut image = picture(9, 9, Some(64), |i| if i / 3 == 40 { 1.5 } else { 1.0 });
        let mut errors = vec![[0.3; 3]; 81];
        errors[40] = [0.0; 3];
        image.standard_error = Some(errors);
        let s = test(&image, &picture(9, 9, None, |_| 1.0)).unwrap();
        assert!(!s.differs && s.max_z < 2.0, "{s:?}");
        // Alone it is what it says.
        let mut known = vec![false; 81];
        known[40] = true;
        assert!(significance(&image, &picture(9, 9, None, |_| 1.0), &known).unwrap().differs);
    }

    #[test]
    fn what_can_not_be_tested_says_why() {
        let noisy = |samples: Option<u32>, error: f64| {
            let errors = Some(vec![[error; 3]; 16]);
            Image { standard_error: errors, ..picture(4, 4, samples, |_| 1.0) }
        };
        let exact = picture(4, 4, None, |_| 0.5);
        for (image, reference, why) in [
            (
                noisy(Some(4), 0.1),
                noisy(Some(64), 0.1),
                "too few samples (4) to tell noise from difference; use at least 16",
            ),
            (noisy(Some(15), 0.1), exact.clone(), "too few samples (15)"),
            (noisy(None, f64::INFINITY), exact.clone(), "no pixel has a known noise"),
            (exact.clone(), exact.clone(), "no standard errors are stored"),
        ] {
            let reason = test(&image, &reference).expect_err(why);
            assert!(reason.contains(why), "{reason}");
        }
        let reason = significance(&noisy(None, 0.1), &exact, &[false; 16]).unwrap_err();
        assert!(reason.contains("no pixel is known"), "{reason}");
        assert!(test(&noisy(Some(16), 0.1), &noisy(Some(16), 0.1)).is_ok());
    }

    #[test]
    fn a_black_sky_does_not_dilute() {
        let sky = |i: usize| i / 3 >= 256;
        let noise = noise(3 * 1024);
        let mut image = picture(32, 32, Some(64), |i| if sky(i) { 0.0 } else { 1.0 + 0.2 * noise[i] });
        image.standard_error = Some((0..1024).map(|i| [if sky(3 * i) { 0.0 } else { 0.1 }; 3]).collect());
        let reference = picture(32, 32, None, |i| if sky(i) { 0.0 } else { 1.0 });
        // Twice the stated noise: mean z² is 4, less for the row that borders on the sky's zeros (their own σ is kept) and Student.
        let s = test(&image, &reference).unwrap();
        assert!((3.0..4.5).contains(&s.mean_z2), "{s:?}");
    }

    #[test]
    fn nan_is_never_agreement() {
        let mut image = picture(8, 8, Some(64), |_| 1.0);
        image.standard_error = Some(vec![[0.1; 3]; 64]);
        let reference = picture(8, 8, None, |_| 1.0);
        image.radiance[13][1] = f64::NAN;
        let s = test(&image, &reference).unwrap();
        assert!(s.differs && s.max_z.is_nan() && s.at == (5, 1, 1) && s.block == 1, "{s:?}");
        image.radiance[13][1] = 1.5;
        image.standard_error = Some((0..64).map(|i| [if i == 13 { f64::NAN } else { 0.1 }; 3]).collect());
        assert!(test(&image, &reference).unwrap().differs);
    }

    #[test]
    fn student_s_t_becomes_the_normal_variate_of_its_probability() {
        for freedom in [15.0, 30.0, 126.0, 1e4] {
            for z in [0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0] {
                let p = 0.5 * two_sided_p(z);
                let t = -student_quantile(p, freedom);
                let got = normal_of_student(t, freedom);
                assert!((got - z).abs() < 0.01 * z, "freedom {freedom}, z {z}: t {t} gives {got}");
                assert!((normal_quantile(p) + z).abs() < 1e-6);
            }
        }
    }
}
