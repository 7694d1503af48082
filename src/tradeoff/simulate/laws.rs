//! What theory says of errors against readings, exposure and step, as far as what it needs is given.
//!
//! Noise of independent readings averages out as the root of their number. A change of a reading is counted relative to the larger of both values, so that one that is
//! darker than its noise does not count for more the noisier it is: the mean then falls more slowly. Of a longer exposure shot noise is left as the root,
//! read noise as the exposure itself, and what saturates takes a shorter one. What all readings of an instrument share does not average out:
//! it adds to the square. Parameters follow noise as long as it is small enough for a fit to be linear in it.

use crate::brdf::Material;
use crate::chain::Source;
use crate::gonio::Instrument;
use crate::tradeoff::design::{Law, Theory};
use crate::tradeoff::knob::Knob;

/// Change of a reading by noise up to which none is dim: of thousands the largest is four standard deviations, an eighth each, with which the slope is
/// flatter by a tenth.
const DIM: f64 = 0.5;
/// Relative errors of parameters up to which a fit is linear in noise.
const LINEAR: f64 = 0.1;
/// n h² of a lobe's exponent n and the step h up to which a sum of cos²ⁿα in steps is its integral: off by 2 exp(−π²/(n h²)), 4.5 %.
const RESOLVED: f64 = 2.6;

/// What trials of a knob showed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::tradeoff) struct Shown {
    /// The largest change of a reading by noise.
    pub change: f64,
    /// The largest relative error of parameters.
    pub parameters: f64,
    /// Whether an exposure saturated.
    pub saturates: bool,
}

impl Shown {
    /// Nothing yet.
    pub const NOTHING: Self = Self { change: 0.0, parameters: 0.0, saturates: false };

    /// With another trial's.
    pub fn and(self, other: Self) -> Self {
        Self {
            change: self.change.max(other.change),
            parameters: self.parameters.max(other.parameters),
            saturates: self.saturates || other.saturates,
        }
    }

    fn is_dim(self) -> bool {
        self.change > DIM
    }
}

const COUNTED: Law = Law { theory: Theory::Exactly(-0.5), why: "noise of independent readings averages out" };
const DARK: &str = "noise of independent readings averages out, but some are darker than their noise, and a change of all of a reading counts for no more";
const STEPPED: &str = "noise averages out, steps of the converter that are wider than it do not";
const SHARED: &str = "noise averages out, what all readings of an instrument share does not";
const CURVED: Law = Law {
    theory: Theory::Unknown,
    why: "errors are as large as the parameters, and a fit is not linear in noise of that size",
};

/// Of errors of reading, reduced BRDF and parameters against the readings averaged.
pub(in crate::tradeoff) fn of_readings(instrument: &Instrument, shown: Shown) -> [Law; 3] {
    let flatter = |why: &'static str| Law { theory: Theory::AtLeast(-0.5), why };
    let reading = match (shown.is_dim(), is_stepped(instrument)) {
        (true, _) => flatter(DARK),
        (false, true) => flatter(STEPPED),
        (false, false) => COUNTED,
    };
    let parameters = if shown.parameters > LINEAR { CURVED } else { COUNTED };
    if instrument.is_plain() {
        [reading, reading, parameters]
    } else {
        [reading, flatter(SHARED), shared(parameters, -0.5, SHARED)]
    }
}

/// The same against the exposure.
fn of_exposure(instrument: &Instrument, shown: Shown) -> [Law; 3] {
    let flatter = |why: &'static str| Law { theory: Theory::AtLeast(-1.0), why };
    let is_pure = instrument.read_noise == 0.0 && instrument.detector.bits == 0;
    let mixed = Law {
        theory: Theory::Between(-1.0, -0.5),
        why: "shot noise falls as the root of the exposure, noise of read-out and converter as the exposure itself",
    };
    let noise =
        if is_pure { Law { theory: Theory::Exactly(-0.5), why: "shot noise: its square is the light" } } else { mixed };
    let reading = match (shown.is_dim(), shown.saturates) {
        (_, true) => flatter("read noise falls as the exposure, and readings that saturate take a shorter one"),
        (true, false) => flatter(
            "read noise falls as the exposure, and a change of all of a reading that is darker counts for no more",
        ),
        (false, false) => noise,
    };
    let parameters = if shown.parameters > LINEAR { CURVED } else { noise };
    let stays = "read noise falls as the exposure, what all readings of an instrument share stays";
    if instrument.is_plain() {
        [reading, reading, parameters]
    } else {
        [reading, flatter(stays), shared(parameters, -1.0, stays)]
    }
}

/// Of errors of parameters against the pairs of directions, the coarsest of steps being that, degrees.
fn of_step(instrument: &Instrument, truth: &Material, coarsest_deg: f64, shown: Shown) -> Law {
    let sampled = Law { theory: Theory::Exactly(-0.5), why: "as many independent readings" };
    if !resolves(truth, coarsest_deg) {
        return Law {
            theory: Theory::Unknown,
            why: "a lobe is narrower than the coarsest step: how many readings see it depends on where they stand",
        };
    }
    if shown.parameters > LINEAR {
        return CURVED;
    }
    if instrument.is_plain() { sampled } else { shared(sampled, -0.5, SHARED) }
}

/// Whether a step (degrees) is finer than every lobe.
pub(in crate::tradeoff) fn resolves(truth: &Material, step_deg: f64) -> bool {
    let shapes = (0..truth.channels.len()).flat_map(|c| truth.lobes.iter().filter_map(move |lobe| lobe.shape_of(c)));
    let sharpest = shapes.flatten().fold(0.0, f64::max);
    sharpest * step_deg.to_radians().powi(2) <= RESOLVED
}

/// What trials of a knob showed says of its laws; `steps_deg` are those of the scan that were tried.
pub(super) fn of(
    knob: Knob,
    (instrument, source): (&Instrument, &Source),
    steps_deg: &[f64],
    shown: Shown,
) -> Option<Vec<Option<Law>>> {
    match knob {
        Knob::Readings => Some(of_readings(instrument, shown).map(Some).to_vec()),
        Knob::Dwell => Some(of_exposure(instrument, shown).map(Some).to_vec()),
        Knob::Step => {
            let coarsest = steps_deg.iter().copied().fold(0.0, f64::max);
            let law = |truth: &Material| of_step(instrument, truth, coarsest, shown);
            // Of a table there are no parameters to compare with.
            let law = if let Source::Fitted(truth) = source { Some(law(truth)) } else { None };
            Some(vec![None, None, law])
        }
        _ => None,
    }
}

/// A law of noise beside what all readings share, which adds to the square.
fn shared(noise: Law, steepest: f64, why: &'static str) -> Law {
    if noise.theory == Theory::Unknown { noise } else { Law { theory: Theory::AtLeast(steepest), why } }
}

/// Whether the converter's steps are so wide that noise does not even them out: with less than half a step of it rounding is not independent.
fn is_stepped(instrument: &Instrument) -> bool {
    let detector = &instrument.detector;
    detector.bits > 0 && detector.full_well / (2f64.powi(detector.bits as i32) - 1.0) > 2.0 * instrument.read_noise
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::BuiltInMaterial;
    use crate::gonio::Preset;

    const BRIGHT: Shown = Shown { change: 0.1, parameters: 0.01, saturates: false };
    const EXACT: Theory = Theory::Exactly(-0.5);
    const FLATTER: Theory = Theory::AtLeast(-0.5);
    const SLOWER: Theory = Theory::AtLeast(-1.0);
    const MIXED: Theory = Theory::Between(-1.0, -0.5);

    fn theories(laws: [Law; 3]) -> [Theory; 3] {
        laws.map(|law| law.theory)
    }

    fn preset(name: &str) -> Instrument {
        Preset::find(name).expect("built in").spec().expect("a spec").instrument
    }

    #[test]
    fn readings_average_out_as_far_as_they_are_bright_and_share_nothing() {
        let plain = Instrument::default();
        let of = |instrument: &Instrument, shown: Shown| theories(of_readings(instrument, shown));
        assert_eq!(of(&plain, BRIGHT), [EXACT; 3]);
        // Parameters are means over all readings, dim ones too.
        assert_eq!(of(&plain, Shown { change: 1.0, ..BRIGHT }), [FLATTER, FLATTER, EXACT]);
        assert_eq!(of(&plain, Shown { parameters: 0.5, ..BRIGHT }), [EXACT, EXACT, Theory::Unknown]);
        assert_eq!(of(&preset("commercial"), BRIGHT), [EXACT, FLATTER, FLATTER]);
        // A step of the converter that is wider than twice the noise of read-out.
        let mut coarse = preset("commercial");
        coarse.detector.bits = 8;
        assert_eq!(of(&coarse, BRIGHT), [FLATTER; 3]);
        assert_ne!(of_readings(&coarse, BRIGHT)[0].why, of_readings(&coarse, Shown { change: 1.0, ..BRIGHT })[0].why);
    }

    #[test]
    fn an_exposure_has_the_slope_of_shot_noise_where_there_is_no_other() {
        let of = |instrument: &Instrument, shown: Shown| theories(of_exposure(instrument, shown));
        let pure = Instrument { read_noise: 0.0, ..Instrument::default() };
        assert_eq!(of(&pure, BRIGHT), [EXACT; 3]);
        assert_eq!(of(&Instrument::default(), BRIGHT), [MIXED; 3]);
        assert_eq!(of(&Instrument::default(), Shown { change: 1.0, ..BRIGHT }), [SLOWER, SLOWER, MIXED]);
        assert_eq!(of(&preset("commercial"), Shown { saturates: true, ..BRIGHT }), [SLOWER; 3]);
    }

    #[test]
    fn a_step_counts_where_it_is_finer_than_every_lobe() {
        let of = |name: &str, steps: &[f64], instrument: &Instrument| {
            let truth = BuiltInMaterial::find(name).expect("built in").material();
            let source = Source::Fitted(Box::new(truth));
            of(Knob::Step, (instrument, &source), steps, BRIGHT).expect("laws")[2].expect("of parameters").theory
        };
        let plain = Instrument::default();
        // n = 12 and 90: n h² of 15° is 0.8 and 6.2, of 7.5° a quarter.
        assert_eq!(of("satin", &[7.5, 15.0], &plain), EXACT);
        assert_eq!(of("glossy-paint", &[7.5, 15.0], &plain), Theory::Unknown);
        assert_eq!(of("glossy-paint", &[5.0, 7.5], &plain), EXACT);
        assert_eq!(of("satin", &[15.0], &preset("commercial")), FLATTER);
    }
}
