//! How far pictures are off the truth, told apart: what differs from seed to seed, and what does not.

use glam::DVec3;

use crate::image::Image;
use crate::numeric::estimate::{Estimate, moments, root_mean_square};
use crate::numeric::stats::student_quantile;
use crate::render::relative_squares;

/// A picture's squared difference from the reference must be this many times the reference's own squared error.
const CLEAR: f64 = 4.0;

/// The reference: the mean of two pictures whose difference tells how good it is.
#[derive(Debug)]
pub(in crate::tradeoff) struct Truth {
    image: Image,
    mean: f64,
    /// Its own mean squared error, relative as all errors are.
    square: f64,
}

impl Truth {
    pub fn of(a: &Image, b: &Image) -> Self {
        let mut image = a.clone();
        image.radiance.iter_mut().zip(&b.radiance).for_each(|(a, b)| *a = [0, 1, 2].map(|c| 0.5 * (a[c] + b[c])));
        image.standard_error = None;
        let mean = image.radiance.iter().flatten().sum::<f64>() / (3 * image.radiance.len()) as f64;
        let mut truth = Self { image, mean, square: 0.0 };
        let half = |a: &[f64; 3], b: &[f64; 3]| 0.5 * (DVec3::from_array(*a) - DVec3::from_array(*b));
        let off: Vec<DVec3> = a.radiance.iter().zip(&b.radiance).map(|(a, b)| half(a, b)).collect();
        truth.square = truth.norm(&off);
        truth
    }

    /// A picture's error without that of the reference; NaN where the two are too near to each other.
    pub fn error(&self, image: &Image) -> f64 {
        let square = self.norm(&self.off(image));
        let clear = square > CLEAR * self.square || self.square == 0.0;
        if clear { (square - self.square).sqrt() } else { f64::NAN }
    }

    /// What an error that could not be told stays below: the picture is no farther from the reference than the root of [`CLEAR`] of the reference's errors, and the
    /// reference one of them from the truth.
    pub fn untold(&self) -> f64 {
        (CLEAR.sqrt() + 1.0) * self.square.sqrt()
    }

    fn off(&self, image: &Image) -> Vec<DVec3> {
        let off = |(p, q): (&[f64; 3], &[f64; 3])| DVec3::from_array(*p) - DVec3::from_array(*q);
        image.radiance.iter().zip(&self.image.radiance).map(off).collect()
    }

    /// The reference's own error, relative as all are.
    pub fn deviation(&self) -> f64 {
        self.square.sqrt()
    }

    pub fn image(&self) -> &Image {
        &self.image
    }

    /// Mean of the squared differences, relative to the truth.
    fn norm(&self, off: &[DVec3]) -> f64 {
        let at =
            |(i, d): (usize, &DVec3)| relative_squares(*d * *d, DVec3::from_array(self.image.radiance[i]), self.mean);
        off.iter().enumerate().map(at).sum::<f64>() / (3 * off.len()) as f64
    }

    /// What the reference is, and how good.
    pub fn said(&self, samples: u32, smallest: f64) -> String {
        let own = self.deviation();
        let times = if smallest.is_finite() && own > 0.0 {
            format!("; the smallest error measured is {:.1} times that", smallest / own)
        } else {
            String::new()
        };
        format!(
            "the mean of two pictures of {samples} samples a pixel by the scene's plan, off by {own:.2e} by their difference, which is taken off{times}"
        )
    }
}

/// Pictures of one setting, without the pictures.
#[derive(Debug, Default)]
pub(in crate::tradeoff) struct Gathered {
    sum: Vec<DVec3>,
    squares: Vec<f64>,
}

impl Gathered {
    /// Bytes that it takes of each pixel.
    pub const PIXEL: usize = size_of::<DVec3>();

    /// Adds a picture.
    pub fn add(&mut self, truth: &Truth, image: &Image) {
        let off = truth.off(image);
        self.squares.push(truth.norm(&off));
        self.sum.resize(off.len(), DVec3::ZERO);
        self.sum.iter_mut().zip(&off).for_each(|(sum, d)| *sum += *d);
    }

    /// The mean product of the differences of two trials: their noise is independent, so that it leaves the squared bias, with the reference's own
    /// squared error.
    fn shared(&self, truth: &Truth) -> Option<f64> {
        let n = self.squares.len() as f64;
        let all = n * n * truth.norm(&self.sum.iter().map(|d| *d / n).collect::<Vec<_>>());
        (n >= 2.0).then(|| (all - self.squares.iter().sum::<f64>()) / (n * (n - 1.0)))
    }

    /// What differs from seed to seed, as sure as the error is.
    pub fn noise(&self, truth: &Truth) -> Option<Estimate> {
        let n = self.squares.len() as f64;
        let square = self.squares.iter().sum::<f64>() / n - self.shared(truth)?;
        let whole = root_mean_square(&self.squares.iter().map(|s| s.sqrt()).collect::<Vec<_>>())?;
        if square <= 0.0 || whole.value == 0.0 {
            // No noise is seen: it is not more than all of the error.
            return Some(Estimate { value: 0.0, low: 0.0, high: whole.high });
        }
        let value = square.sqrt();
        Some(Estimate { value, low: value * (whole.low / whole.value), high: value * (whole.high / whole.value) })
    }

    /// What all seeds share. A squared error scatters by the square of the noise, which the mean of n(n − 1)/2 products has less of by the root of
    /// n(n − 1), and by noise times bias, less by the root of n; the second has the share 2b²/(V + 2b²) of its variance. The reference's own error
    /// stands beside the bias in the same way.
    pub fn bias(&self, truth: &Truth) -> Option<Estimate> {
        let n = self.squares.len() as f64;
        let square = self.shared(truth)? - truth.square;
        let (mean, deviation) = moments(&self.squares).filter(|m| m.0.is_finite() && m.1.is_finite())?;
        let (bias, noise) = (square.max(0.0), (mean - truth.square - square).max(0.0));
        let variance = deviation * deviation;
        let crossed = if bias > 0.0 { variance * 2.0 * bias / (noise + 2.0 * bias) } else { 0.0 };
        let of_reference = if noise > 0.0 { crossed * truth.square / noise } else { 0.0 };
        let variance = (variance - crossed) / (n * (n - 1.0)) + crossed / n + of_reference;
        let reach = student_quantile(0.975, n - 1.0) * variance.sqrt();
        let root = |x: f64| x.max(0.0).sqrt();
        // A square below 0 is noise: of the bias it leaves a limit, not the certainty that there is none.
        Some(Estimate { value: root(square), low: root(square - reach), high: root(bias + reach) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::{Purpose, stream};
    use rand_distr::{Distribution, Normal};

    /// A grey picture of radiance 1, with noise and an offset.
    fn noisy(seed: u64, noise: f64, offset: f64) -> Image {
        let (mut rng, normal) = (stream(seed, Purpose::Study, 3), Normal::new(0.0, 1.0).expect("a distribution"));
        let pixel = |_| [0; 3].map(|_| 1.0 + offset + noise * normal.sample(&mut rng));
        Image { width: 40, height: 40, radiance: (0..1600).map(pixel).collect(), ..Image::default() }
    }

    #[test]
    fn bias_and_noise_come_back_as_they_were_put_in() {
        // Relative to 1² + 0.1².
        let unit = 1.01f64.sqrt();
        for (noise, bias) in [(0.2, 0.05), (0.2, 0.0), (0.05, 0.1)] {
            let truth = Truth::of(&noisy(1, 0.02, 0.0), &noisy(2, 0.02, 0.0));
            let mut gathered = Gathered::default();
            let pictures = (10..16).map(|seed| noisy(seed, noise, bias));
            let errors: Vec<f64> = pictures.inspect(|p| gathered.add(&truth, p)).map(|p| truth.error(&p)).collect();
            let error = root_mean_square(&errors).expect("errors").value * unit;
            // 4800 values scatter by 1 % of their root mean square, six times as many by 0.4 %.
            assert!((error / noise.hypot(bias) - 1.0).abs() < 0.02, "{error} of {noise} and {bias}");
            let found = gathered.noise(&truth).expect("trials").value * unit;
            assert!((found / noise - 1.0).abs() < 0.02, "{found} of {noise}");
            let found = gathered.bias(&truth).expect("trials");
            assert!(found.low * unit <= bias && bias <= found.high * unit, "{found:?} of {bias}");
            assert!(found.high * unit < bias + 0.03, "{found:?} of {bias}");
        }
    }

    #[test]
    fn a_picture_as_good_as_the_reference_is_not_judged() {
        let truth = Truth::of(&noisy(1, 0.1, 0.0), &noisy(2, 0.1, 0.0));
        assert!(truth.error(&noisy(3, 0.1, 0.0)).is_nan());
        assert!(!truth.error(&noisy(3, 0.3, 0.0)).is_nan());
        // The mean of two pictures with noise of 0.1 each has 0.1/√2; that of 4800 values is known to 1 %.
        let unit = 1.01f64.sqrt();
        assert!((truth.untold() * unit / (3.0 * 0.1 * 0.5f64.sqrt()) - 1.0).abs() < 0.04, "{}", truth.untold());
    }

    #[test]
    fn pictures_without_error_have_no_noise_and_endless_ones_no_estimate() {
        let flat = noisy(1, 0.0, 0.0);
        let truth = Truth::of(&flat, &flat);
        let of = |picture: &Image| {
            let mut gathered = Gathered::default();
            (0..3).for_each(|_| gathered.add(&truth, picture));
            [gathered.noise(&truth), gathered.bias(&truth)]
        };
        assert_eq!(of(&flat), [Some(Estimate::exact(0.0)); 2]);
        assert_eq!(of(&noisy(1, 0.0, f64::INFINITY)), [None; 2]);
    }
}
