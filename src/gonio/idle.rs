//! Settings of an instrument that do nothing beside the others, and what they need.

use super::effects::plan;
use super::instrument::Instrument;

/// Says of each number that is set but does nothing, when a material of these channels is read, what it needs.
#[must_use]
pub fn idle(instrument: &Instrument, channels: &[String]) -> Vec<String> {
    let Instrument { source, sample, detector, reference, .. } = instrument;
    let no_reference = !instrument.has_reference();
    let (no_beam, no_distance) =
        (source.beam_diameter_m == 0.0, source.distance_m == 0.0 && detector.distance_m == 0.0);
    let unseen = no_beam && sample.height_u_m == 0.0;
    let list = [
        (reference.reflectance_u > 0.0 && no_reference, "reference.reflectance_u", "reference.reflectance above 0"),
        (reference.shape > 0.0 && no_reference, "reference.shape", "reference.reflectance above 0"),
        (
            sample.height_u_m > 0.0 && no_distance,
            "sample.height_u_m",
            "detector.distance_m or source.distance_m above 0",
        ),
        (source.distance_m > 0.0 && unseen, "source.distance_m", "source.beam_diameter_m or sample.height_u_m above 0"),
        (
            detector.distance_m > 0.0 && unseen,
            "detector.distance_m",
            "source.beam_diameter_m or sample.height_u_m above 0",
        ),
        (
            detector.exposure_u > 0.0 && detector.exposures_s.len() < 2 && !no_reference,
            "detector.exposure_u",
            "two detector.exposures_s or more: an error that reference and sample share cancels",
        ),
        (sample.diameter_m > 0.0 && no_beam, "sample.diameter_m", "source.beam_diameter_m above 0"),
        (detector.field_diameter_m > 0.0 && no_beam, "detector.field_diameter_m", "source.beam_diameter_m above 0"),
    ];
    let said = |(is_idle, key, needs): (bool, &str, &str)| {
        is_idle.then(|| format!("instrument.{key} does nothing: it needs {needs}"))
    };
    let effects = plan(instrument, channels).effects;
    let band = effects.iter().find(|e| e.name == "spectral band" && !e.on && source.bandwidth_nm > 0.0);
    let band = band.map(|e| format!("instrument.source.bandwidth_nm does nothing: {}", e.why));
    list.into_iter().filter_map(said).chain(band).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::PRESETS;
    use crate::gonio::parts::Detector;

    #[test]
    fn what_does_nothing_says_what_it_needs_and_built_in_instruments_have_no_such_thing() {
        let spectrum = ["450nm", "550nm", "650nm"].map(str::to_owned);
        for preset in &PRESETS {
            let instrument = preset.spec().expect("reads").instrument;
            assert_eq!(idle(&instrument, &spectrum), Vec::<String>::new(), "{}", preset.name);
        }
        let mut instrument = Instrument::default();
        instrument.reference.reflectance_u = 0.01;
        instrument.sample.height_u_m = 1e-4;
        instrument.source.bandwidth_nm = 5.0;
        let far = Instrument { detector: Detector { distance_m: 0.5, ..Detector::default() }, ..Instrument::default() };
        let said_of_far = idle(&far, &spectrum);
        assert!(
            said_of_far.len() == 1 && said_of_far[0].contains("detector.distance_m does nothing"),
            "{said_of_far:?}"
        );
        let said = idle(&instrument, &["r".into()]);
        for (key, needs) in [
            ("reference.reflectance_u", "reference.reflectance "),
            ("sample.height_u_m", "detector.distance_m"),
            ("source.bandwidth_nm", "wavelengths"),
        ] {
            assert!(said.iter().any(|s| s.contains(key) && s.contains(needs)), "{key}: {said:?}");
        }
        assert_eq!(idle(&instrument, &spectrum).len(), 2);
        let mut timed = Instrument::default();
        (timed.reference.reflectance, timed.detector.exposure_u) = (0.9, 1e-3);
        let said = idle(&timed, &spectrum);
        assert!(said.len() == 1 && said[0].contains("detector.exposure_u does nothing"), "{said:?}");
        timed.detector.exposures_s = vec![0.1, 1.0];
        assert!(idle(&timed, &spectrum).is_empty());
        (timed.reference.reflectance, timed.detector.exposures_s) = (0.0, vec![1.0]);
        assert!(idle(&timed, &spectrum).is_empty());
    }
}
