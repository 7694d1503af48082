//! Quantisation: the converter rounds to steps of full_well/(2^bits − 1), and reads no more than its last.
//!
//! The rounding of a signal with noise of more than half a step is even and independent: it adds a variance of step²/12
//! (JCGM 100:2008, F.2.2.1). Parameters: `detector.bits` and `detector.full_well` (electrons).
//!
//! Realistic: 10 to 24 bits. 10: a microcontroller (ATmega328PB); 16: usual in spectrometers (Ocean Optics' Flame
//! manual); 18 in 8 ranges: the goniometer RiGO 801; 20: a voltmeter of six digits; 24: delta-sigma converters
//! (nominal).

use super::{Block, Entry, Maker, Pass};
use crate::gonio::parts::Detector;

pub(super) const EFFECT: Entry = Entry {
    name: "quantisation",
    calls: |i, _| match i.detector.bits {
        0 => Err("detector.bits = 0".into()),
        bits => Ok(format!("detector.bits = {bits}: steps of {:.3} electrons", step(&i.detector))),
    },
    remove: |i| i.detector.bits = 0,
    make: |maker: &Maker<'_>| {
        let detector = &maker.instrument.detector;
        Some(Box::new(Quantisation { step: step(detector), most: detector.full_well }))
    },
};

/// Electrons between two readings of the converter; 0 where it has no steps.
pub(in crate::gonio) fn step(detector: &Detector) -> f64 {
    if detector.bits == 0 { 0.0 } else { detector.full_well / (2f64.powi(detector.bits as i32) - 1.0) }
}

struct Quantisation {
    step: f64,
    most: f64,
}

impl Pass for Quantisation {
    fn apply(&self, block: &mut Block<'_>) {
        // The offset of real converters keeps noise about 0: negative signals are rounded too. What is no number stays none, which `min` would not leave.
        for signal in &mut block.signal {
            let rounded = self.step * (*signal / self.step).round();
            *signal = if rounded > self.most { self.most } else { rounded };
        }
    }
}
