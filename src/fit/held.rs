//! A fit whose parameters are all held has no standard errors to speak of.

use crate::brdf::{FitRecord, LobeRecord, PerChannel};

/// Takes what is said of standard errors out of the warnings where every parameter is held.
pub(super) fn tell(record: &mut FitRecord) {
    if record.standard_error.iter().all(is_held) {
        record.warnings.iter_mut().for_each(|warning| warning.truncate(said(warning)));
    }
}

fn is_held(errors: &LobeRecord<Option<f64>>) -> bool {
    let held = |error: &Option<f64>| *error == Some(0.0);
    let of_shape = |of: &PerChannel<Option<f64>>| match of {
        PerChannel::Shared(error) => held(error),
        PerChannel::Each(list) => list.iter().all(held),
    };
    errors.weight.iter().all(held) && errors.shape.iter().all(|(_, of)| of_shape(of))
}

/// Where the clause begins that speaks of standard errors; the end of the text if none does.
fn said(warning: &str) -> usize {
    let Some(at) = warning.find("standard error") else { return warning.len() };
    warning[..at].rfind([',', ';', ':']).unwrap_or(warning.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clause_on_standard_errors_goes_and_what_stands_before_it_stays() {
        let shown = |text: &str| text[..said(text)].to_owned();
        assert_eq!(
            shown("88 % is structure (noise 1e-3); the standard errors are of noise alone"),
            "88 % is structure (noise 1e-3)"
        );
        assert_eq!(shown("it may be overstated, and the standard errors with it"), "it may be overstated");
        assert_eq!(shown("channel r has no positive value"), "channel r has no positive value");
    }
}
