//! How far off a picture is, from the picture itself.
//!
//! Samples of a pixel are points of a net, which are more even than independent ones, so their scatter overstates the error of their mean. The
//! difference of two independent halves doesn't, but one such number says little. So pixels of a tile whose samples scatter
//! alike share one ratio of the two.

use glam::DVec3;

use super::pixel::Pixel;
use super::tiles::{TILE, Tile};
use crate::numeric::stats::{chi_square_quantile, normal_quantile};

/// A relative error counts against the radiance where it is above this share of the picture's mean, else against that.
const DARK: f64 = 0.1;

/// What the scatter of samples must be multiplied with: by the power of 4 by which it lies under the tile's largest, the sums of both.
#[derive(Debug, Default)]
struct Ratios {
    largest: f64,
    classes: Vec<(i32, f64, f64)>,
}

/// What pixels alike say of one counts so many times as much as its own halves' difference: an edge among smooth pixels shows there.
const TRUST: f64 = 3.0;

/// Values that speak for samples that know nothing of each other, before any others.
const DOUBT: f64 = 2.0;

impl Ratios {
    /// Of pairs of scatter and disagreement.
    fn of(pairs: &[(f64, f64)]) -> Self {
        let known = || pairs.iter().filter(|(scatter, _)| *scatter > 0.0 && scatter.is_finite());
        let largest = known().fold(0.0f64, |m, p| m.max(p.0));
        let mut ratios = Self { largest, classes: Vec::new() };
        known().for_each(|(scatter, disagreement)| ratios.add(*scatter, *disagreement));
        ratios
    }

    fn class(&self, scatter: f64) -> i32 {
        (((scatter / self.largest).to_bits() >> 52) as i32) >> 1
    }

    fn add(&mut self, scatter: f64, disagreement: f64) {
        let class = self.class(scatter);
        match self.classes.iter_mut().find(|c| c.0 == class) {
            Some(found) => {
                found.1 += scatter;
                found.2 += disagreement;
            }
            None => self.classes.push((class, (1.0 + DOUBT) * scatter, disagreement + DOUBT * scatter)),
        }
    }

    fn variance(&self, scatter: f64) -> f64 {
        let class = self.class(scatter);
        let found = self.classes.iter().find(|c| c.0 == class);
        found.map_or(scatter, |(_, scatters, found)| scatter * (found / scatters))
    }
}

/// Standard error of every pixel of a tile, in its place; infinite below two samples.
pub(super) fn standard_errors(tile: Tile, pixels: &[Pixel]) -> Vec<DVec3> {
    let values = |slot: usize| {
        let (scatter, found) = (pixels[slot].scatter().to_array(), pixels[slot].disagreement().to_array());
        scatter.into_iter().zip(found)
    };
    let ratios = Ratios::of(&tile.slots().flat_map(values).collect::<Vec<_>>());
    let error = |pixel: &Pixel| {
        let (scatter, own) = (pixel.scatter().to_array(), pixel.disagreement().to_array());
        DVec3::from_array([0, 1, 2].map(|c| ((TRUST * ratios.variance(scatter[c]) + own[c]) / (TRUST + 1.0)).sqrt()))
    };
    pixels.iter().map(error).collect()
}

/// Squared errors of a pixel's channels against its radiance, summed; `mean` is the picture's. What [`PictureError`] is the root of the mean of.
#[must_use]
pub fn relative_squares(squares: DVec3, radiance: DVec3, mean: f64) -> f64 {
    let floor = (DARK * mean).powi(2).max(f64::MIN_POSITIVE);
    (squares / (radiance * radiance + floor)).element_sum()
}

/// What an error of a pixel counts against: its radiance, or its neighbours' mean in the tile where that is less. A sample that is far too bright raises the
/// pixel's own mean with its error, and would hide it so.
fn likely_radiance(tile: Tile, pixels: &[Pixel], slot: usize) -> DVec3 {
    let (x, y) = (slot % TILE, slot / TILE);
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for v in y.saturating_sub(1)..(y + 2).min(tile.height) {
        for u in x.saturating_sub(1)..(x + 2).min(tile.width) {
            if (u, v) != (x, y) {
                sum += pixels[v * TILE + u].mean();
                count += 1.0;
            }
        }
    }
    let own = pixels[slot].mean();
    if count > 0.0 { own.min(sum / count) } else { own }
}

/// Sums over pixels: of the squared relative errors, and of what says how sure that is.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Noise {
    /// Of the relative variance, all channels.
    pub sum: f64,
    /// Of the squares of the same.
    pub squares: f64,
    pub pixels: u64,
}

impl Noise {
    /// That of a tile, of a picture whose mean radiance is `mean`.
    pub fn of(tile: Tile, pixels: &[Pixel], mean: f64) -> Self {
        let mut noise = Self::default();
        for slot in tile.slots() {
            let value = relative_squares(pixels[slot].disagreement(), likely_radiance(tile, pixels, slot), mean);
            noise.sum += value;
            noise.squares += value * value;
            noise.pixels += 1;
        }
        noise
    }

    /// That of several tiles.
    pub fn all(parts: &[Self]) -> Self {
        parts.iter().fold(Self::default(), |all, part| Self {
            sum: all.sum + part.sum,
            squares: all.squares + part.squares,
            pixels: all.pixels + part.pixels,
        })
    }

    /// Values in the sum.
    pub fn values(&self) -> f64 {
        3.0 * self.pixels as f64
    }

    /// What the picture is to be expected off by, relative.
    pub fn relative(&self) -> f64 {
        (self.sum / self.values()).sqrt()
    }

    /// The picture's error; its bound holds but for a chance of `doubt`.
    pub fn error(&self, doubt: f64) -> PictureError {
        let relative = self.relative();
        if self.sum <= 0.0 {
            return PictureError { relative, at_most: relative };
        }
        // A pixel's channels rise and fall together, so its value is about 3V·χ² of one degree: mean square 27V², variance two thirds
        // of that. So the sum is like χ² of 2·sum²/variance degrees (Satterthwaite 1946), at most one a pixel; halved, as what the
        // picture is off by scatters about what was to be expected too.
        let freedom = 0.5 * (3.0 * self.sum * self.sum / self.squares).min(self.pixels as f64).max(LEAST_FREEDOM);
        let factor = if freedom < 1000.0 {
            freedom / chi_square_quantile(doubt, freedom)
        } else {
            1.0 + normal_quantile(1.0 - doubt) * (2.0 / freedom).sqrt()
        };
        PictureError { relative, at_most: relative * factor.sqrt() }
    }
}

/// Of fewer degrees of freedom nothing is concluded: a picture of a pixel or two.
const LEAST_FREEDOM: f64 = 1.0;

/// What [`PictureError::at_most`] may be wrong with, of a picture that is judged once.
pub(super) const DOUBT_OF_ONE: f64 = 0.05;

/// The same at look `k` = 1, 2, … of a picture that is done at the first look that is good enough: one that underrates the error would end the work, so
/// that all looks share [`DOUBT_OF_ONE`], 1/(k(k + 1)) of it each; from the sixth on, which hardly any picture comes to, as much as that.
pub(super) fn doubt_at(look: u32) -> f64 {
    let k = f64::from(look.clamp(1, 6));
    DOUBT_OF_ONE / (k * (k + 1.0))
}

/// How far off a picture is: the root of the mean, over pixels and channels, of (x − truth)²/(truth² + (L̄/10)²), L̄ being the picture's mean radiance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureError {
    /// What is to be expected.
    pub relative: f64,
    /// What it is at most, with 95 % confidence.
    pub at_most: f64,
}
