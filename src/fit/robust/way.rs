//! The root of ln(s that is asked for) − ln(s) as a function of ln s.

/// Most that s shrinks in a round: the parameters must be able to follow.
pub(super) const SHRINK: f64 = 0.25;

/// What is known of the root of excess(ln s).
pub(super) struct Way {
    last: Option<(f64, f64)>,
    bracket: (f64, f64),
}

impl Default for Way {
    fn default() -> Self {
        Self { last: None, bracket: (f64::NEG_INFINITY, f64::INFINITY) }
    }
}

impl Way {
    /// The next ln s to try, where `here` asks for `excess` more.
    pub fn next(&mut self, here: f64, excess: f64) -> f64 {
        let wanted = here + excess;
        let (low, high) = self.bracket;
        if high - low < 1e-3 * excess.abs() {
            // The parameters jumped: what was known of the bracket no longer holds.
            *self = Self::default();
        }
        let (low, high) = self.bracket;
        let (low, high) = if excess > 0.0 { (low.max(here), high) } else { (low, high.min(here)) };
        let secant = self.last.map(|(x, e)| here - excess * (here - x) / (excess - e)).filter(|x| x.is_finite());
        let mut next = secant.filter(|x| (x - here).abs() < 4.0 * excess.abs()).unwrap_or(wanted);
        if next <= low || next >= high {
            next = if wanted > low && wanted < high { wanted } else { 0.5 * (low + high) };
        }
        *self = Self { last: Some((here, excess)), bracket: (low, high) };
        next.max(here + SHRINK.ln())
    }
}
