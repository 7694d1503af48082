//! The spectral band: a channel of one wavelength is lit and read with its neighbours, over the triangle that equal
//! slits of a monochromator make.
//!
//! Of a smooth spectrum a band of full width at half maximum B adds B²/12 times its second derivative: the triangle's
//! variance is B²/6. Between channels the spectrum is the parabola through the nearest and its two neighbours; beyond
//! the first and the last it is as there. B is `source.bandwidth_nm`, nm; CIE 214 treats the effect.
//!
//! Realistic: 1 to 20 nm (typical). The BSDF bench of KU Leuven states 3.5 nm, NIST's STARR 14 nm.

use super::{Block, Entry, Maker, Pass, stated};
use crate::numeric::quadrature::integrate;

pub(super) const EFFECT: Entry = Entry {
    name: "spectral band",
    remove: |i| i.source.bandwidth_nm = 0.0,
    calls: |i, channels| {
        let why = stated(i.source.bandwidth_nm, "source.bandwidth_nm", " nm")?;
        wavelengths(channels)
            .map(|_| why)
            .ok_or_else(|| "the channels are not wavelengths, 550nm say, three at least, ascending".into())
    },
    make: |maker: &Maker<'_>| {
        let band = Band::new(&wavelengths(maker.channels)?, maker.instrument.source.bandwidth_nm);
        Some(Box::new(band))
    },
};

/// Wavelengths of channels that are called by them, nm; `None` unless all are, three at least, ascending.
fn wavelengths(channels: &[String]) -> Option<Vec<f64>> {
    let of = |name: &String| name.strip_suffix("nm")?.trim().parse::<f64>().ok().filter(|w| w.is_finite());
    let list = channels.iter().map(of).collect::<Option<Vec<f64>>>()?;
    (list.len() >= 3 && list.windows(2).all(|w| w[0] < w[1])).then_some(list)
}

/// What each channel reads of every other, row by row; rows add up to 1.
struct Band(Vec<Vec<f64>>);

/// Points of the quadrature of each half of the triangle.
const ORDER: usize = 64;

impl Band {
    fn new(wavelengths: &[f64], width: f64) -> Self {
        let row = |at: &f64| {
            let share = |j: usize| {
                let half = |from: f64, to: f64| {
                    integrate(from, to, ORDER, |u| (1.0 - u.abs()) * weight(wavelengths, at + width * u, j))
                };
                half(-1.0, 0.0) + half(0.0, 1.0)
            };
            (0..wavelengths.len()).map(share).collect()
        };
        Self(wavelengths.iter().map(row).collect())
    }
}

/// Weight of channel `j` in the value between channels at `wavelength`.
fn weight(wavelengths: &[f64], wavelength: f64, j: usize) -> f64 {
    let last = wavelengths.len() - 1;
    let x = wavelength.clamp(wavelengths[0], wavelengths[last]);
    let after = wavelengths.partition_point(|w| *w < x).clamp(1, last);
    let nearest = if x - wavelengths[after - 1] < wavelengths[after] - x { after - 1 } else { after };
    let middle = nearest.clamp(1, last - 1);
    if j + 1 < middle || j > middle + 1 {
        return 0.0;
    }
    let others = (middle - 1..=middle + 1).filter(|k| *k != j);
    others.map(|k| (x - wavelengths[k]) / (wavelengths[j] - wavelengths[k])).product()
}

impl Pass for Band {
    fn apply(&self, block: &mut Block<'_>) {
        for i in 0..block.readings.len() {
            let own = block.of(i).to_vec();
            let mix = |row: &Vec<f64>| row.iter().zip(&own).map(|(w, s)| w * s).sum();
            block.of(i).iter_mut().zip(&self.0).for_each(|(signal, row)| *signal = mix(row));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(spectrum: impl Fn(f64) -> f64, width: f64) -> Vec<(f64, f64)> {
        let wavelengths: Vec<f64> = (0..31).map(|k| 400.0 + 10.0 * f64::from(k)).collect();
        let values: Vec<f64> = wavelengths.iter().map(|w| spectrum(*w)).collect();
        let band = Band::new(&wavelengths, width);
        let of = |row: &Vec<f64>| row.iter().zip(&values).map(|(w, v)| w * v).sum();
        wavelengths.iter().zip(&band.0).map(|(w, row)| (*w, of(row))).collect()
    }

    /// A constant stays, a parabola gains B²/12 of its second derivative, and what a band adds to a smooth spectrum fades as its square.
    #[test]
    fn a_band_adds_a_twelfth_of_its_square_times_the_second_derivative() {
        for width in [1.0, 7.0, 30.0] {
            assert!(read(|_| 0.3, width).iter().all(|(_, v)| (v - 0.3).abs() < 1e-13));
            let inner = |(w, _): &&(f64, f64)| (*w - 550.0).abs() < 100.0;
            for (w, v) in read(|w| 1e-4 * (w - 500.0).powi(2), width).iter().filter(inner) {
                assert!((v - 1e-4 * (w - 500.0).powi(2) - width * width / 12.0 * 2e-4).abs() < 1e-11, "{width} {w}");
            }
        }
        let line = |w: f64| (-0.5 * ((w - 550.0) / 40.0).powi(2)).exp();
        let off = |width: f64| read(line, width).iter().map(|(w, v)| (v - line(*w)).abs()).fold(0.0, f64::max);
        let order = (off(4.0) / off(2.0)).log2();
        println!("spectral band: order {order}");
        assert!((order - 2.0).abs() < 0.01, "{order}");
    }

    #[test]
    fn channels_are_wavelengths_or_not() {
        let of = |names: &[&str]| wavelengths(&names.iter().map(ToString::to_string).collect::<Vec<_>>());
        assert_eq!(of(&["400nm", "500.5nm", "600 nm"]), Some(vec![400.0, 500.5, 600.0]));
        assert!(of(&["r", "g", "b"]).is_none() && of(&["600nm", "500nm", "400nm"]).is_none() && of(&["5nm"]).is_none());
    }
}
