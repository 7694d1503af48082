//! What readings share, as components of the measurement's error.
//!
//! The noise of a visit is in all readings between it and the next ones; a certificate's error is in all. Each is a component: 1 σ of it in every
//! reading, fully correlated. Visits are many in a long scan, and components cost memory, so g visits in a row may be one: then a share 1/g
//! of the variance is common and the rest counts as each reading's own, which keeps the variance of a reading and of the mean over the group.

use super::alike::alike;
use super::budget::{Budget, Input, Type};
use super::stops::are_same;
use super::visits::{Gap, Timed, Visits};
use super::{Reduced, Table};
use crate::gonio::instrument::Instrument;

/// Most components of one kind of visits' errors, and most numbers that all may take.
const MOST_GROUPS: usize = 6;
const MOST_NUMBERS: usize = 50_000_000;
/// Most exposures whose errors have a component each, and how many have one however large the scan: more than a bracket has.
const MOST_EXPOSURES: usize = 12;
const FEWEST_EXPOSURES: usize = 3;
/// Terms of the series of a walk that is known at both ends, and times that one is cut in halves that is known at its beginning.
const MODES: usize = 2;
const HALVINGS: u32 = 3;

/// One component and what it belongs to.
struct Component {
    /// Its line of the budget; none where parts of it were attributed to several.
    family: Option<usize>,
    /// 1 σ in every reading, channel-major.
    plane: Vec<f64>,
}

/// A line of the budget.
struct Family {
    name: &'static str,
    kind: Type,
    unit: &'static str,
    /// Sums of squares of its input's σ and of the sensitivity to it over what was read, and how often.
    read: [f64; 3],
    /// Variance that is not in any component, by reading; empty for none.
    own: Vec<f64>,
    /// Its part of components and variances that belong to several, by reading; empty for none.
    attributed: Vec<f64>,
}

impl Family {
    fn was_read(&mut self, sigma: f64, sensitivity: f64) {
        let more = [sigma * sigma, sensitivity * sensitivity, 1.0];
        self.read.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
    }

    /// σ of its readings and the sensitivity to them, roots of the mean squares.
    fn rms(&self) -> [f64; 2] {
        let [sigma, sensitivity, count] = self.read;
        [sigma, sensitivity].map(|sum| (sum / count).sqrt())
    }
}

/// All of them.
pub(super) struct Shared<'a> {
    instrument: &'a Instrument,
    size: usize,
    width: usize,
    families: Vec<Family>,
    /// Variance of readings that was attributed; empty for none.
    own: Vec<f64>,
    components: Vec<Component>,
    /// What jitter does to all channels of a reading alike, 1 σ; empty for nothing.
    of_stops: Vec<f64>,
    /// Component of (family, group of visits, channel or mode).
    places: std::collections::HashMap<(usize, usize, usize), usize>,
    /// Visits to the base, and to the reference, that are one component.
    groups: [usize; 2],
    /// Exposures whose errors have a component, and how many may have one.
    exposures_s: Vec<f64>,
    most_exposures: usize,
    has_reference: bool,
    /// When the last reading was made.
    end_s: f64,
}

/// Kinds of visits.
const OF_BASE: usize = 0;
const OF_REFERENCE: usize = 1;
/// Families in the order of the budget.
pub(super) const READING: usize = 0;
const REFERENCE: usize = 1;
const BASE: usize = 2;
const CERTIFICATE: usize = 3;
const DRIFT: usize = 4;
const DARK: usize = 5;
const NONLINEARITY: usize = 6;
const EXPOSURES: usize = 7;
pub(super) const ZEROS: usize = 8;
pub(super) const TILT: usize = 9;
pub(super) const HEIGHT: usize = 10;
pub(super) const JITTER: usize = 11;
/// Name, how it is known, and the unit of what readings depend on.
const NAMES: [(&str, Type, &str); 12] = [
    ("noise of the reading", Type::A, "1/s"),
    ("noise of the reference", Type::A, "1/s"),
    ("noise of blank and dark", Type::A, "1/s"),
    ("certificate of the reference", Type::B, ""),
    ("source drift", Type::B, "1/√h"),
    ("dark drift", Type::B, "1/s/√h"),
    ("nonlinearity", Type::B, ""),
    ("exposure times", Type::B, ""),
    ("axis zeros", Type::B, "°"),
    ("sample tilt", Type::B, "°"),
    ("sample height", Type::B, "m"),
    ("axis jitter", Type::B, "°"),
];

impl<'a> Shared<'a> {
    pub fn new(entries: usize, width: usize, (visits, end_s): (&Visits, f64), instrument: &'a Instrument) -> Self {
        let size = entries * width;
        let afforded = (MOST_NUMBERS / size.max(1) / (2 * width + 2 * MODES + 1)).clamp(1, MOST_GROUPS);
        let families = NAMES
            .map(|(name, kind, unit)| Family {
                name,
                kind,
                unit,
                read: [0.0; 3],
                own: Vec::new(),
                attributed: Vec::new(),
            })
            .into_iter()
            .collect();
        Self {
            instrument,
            size,
            width,
            families,
            own: Vec::new(),
            components: Vec::new(),
            of_stops: Vec::new(),
            places: std::collections::HashMap::new(),
            groups: visits.len().map(|count| count.div_ceil(afforded).max(1)),
            exposures_s: Vec::new(),
            most_exposures: (MOST_NUMBERS / size.max(1)).clamp(FEWEST_EXPOSURES, MOST_EXPOSURES),
            has_reference: visits.has[1],
            end_s,
        }
    }

    /// Adds 1 σ of a component at a reading.
    pub fn add(&mut self, family: usize, part: (usize, usize), place: usize, u: f64) {
        if u == 0.0 {
            return;
        }
        let (size, list) = (self.size, &mut self.components);
        let component = *self.places.entry((family, part.0, part.1)).or_insert_with(|| {
            list.push(Component { family: Some(family), plane: vec![0.0; size] });
            list.len() - 1
        });
        self.components[component].plane[place] += u;
    }

    /// Adds a variance of a reading's own.
    pub fn add_own(&mut self, family: usize, place: usize, variance: f64) {
        add_at(&mut self.families[family].own, self.size, place, variance);
    }

    /// Adds a component of several families, whose parts are attributed: 1 σ at these readings.
    pub fn add_plane(&mut self, of: impl Iterator<Item = (usize, f64)>) {
        let mut plane = vec![0.0; self.size];
        of.for_each(|(place, u)| plane[place] = u);
        self.components.push(Component { family: None, plane });
    }

    /// Adds what a stop's errors do to all channels of a reading alike; it is in their own variance already.
    pub fn add_of_stop(&mut self, place: usize, u: f64) {
        add_at(&mut self.of_stops, self.size, place, u);
    }

    /// The part of each reading's own σ that its channels share, channel-major: what a stop does, drift between visits, and exposures that are its own. None
    /// where there is no such part.
    pub fn row(&self, table: &Table, width: usize) -> Option<Vec<f64>> {
        let entries = self.size / width.max(1);
        let part = |family: usize, place: usize| self.families[family].own.get(place).copied().unwrap_or(0.0).sqrt();
        let parts = |place: usize| {
            let drift = part(DRIFT, place).copysign(table.values[place]);
            let mut parts = vec![self.of_stops.get(place).copied().unwrap_or(0.0), drift, part(DARK, place)];
            if !self.families[EXPOSURES].own.is_empty() {
                parts.push(part(EXPOSURES, place).copysign(table.values[place]));
            }
            parts
        };
        let is_there = width > 1 && (0..self.size).any(|place| parts(place).iter().any(|u| *u != 0.0));
        let mut row = vec![0.0; if is_there { self.size } else { 0 }];
        for entry in 0..if is_there { entries } else { 0 } {
            let places = (0..width).map(|c| c * entries + entry);
            let valid: Vec<usize> = places.filter(|place| table.values[*place].is_finite()).collect();
            let patterns: Vec<Vec<f64>> = valid.iter().map(|place| parts(*place)).collect();
            valid.iter().zip(alike(&patterns)).for_each(|(place, u)| row[*place] = u);
        }
        let masked = |(u, value): (f64, &f64)| if value.is_nan() { f64::NAN } else { u };
        is_there.then(|| row.into_iter().zip(&table.values).map(masked).collect())
    }

    /// Adds a variance of a reading's own that belongs to several families, whose parts are attributed.
    pub fn add_attributed(&mut self, place: usize, variance: f64) {
        add_at(&mut self.own, self.size, place, variance);
    }

    /// Says what a family has of such components and variances.
    pub fn attribute(&mut self, family: usize, place: usize, variance: f64) {
        add_at(&mut self.families[family].attributed, self.size, place, variance);
    }

    /// Adds an error that all readings between visits share, by group.
    fn add_grouped(&mut self, (family, kind): (usize, usize), visit: usize, part: usize, place: usize, u: f64) {
        let group = self.groups[kind];
        let count = group as f64;
        self.add(family, (visit / group, part), place, u / count.sqrt());
        if group > 1 {
            self.add_own(family, place, u * u * (1.0 - 1.0 / count));
        }
    }

    /// Adds all that one reduced reading has of errors that do not depend on positions.
    pub fn reading(&mut self, place: usize, channel: usize, of: &Reduced) {
        let Reduced { value, conversion, rate, ref at, .. } = *of;
        self.add_own(READING, place, conversion * conversion * rate.variance);
        self.families[READING].was_read(rate.variance.sqrt(), conversion);
        for part in &at.reference_parts {
            let sensitivity = -value / at.reference * part.share;
            self.families[REFERENCE].was_read(part.sigma, sensitivity);
            let u = sensitivity * part.sigma;
            self.add_grouped((REFERENCE, OF_REFERENCE), part.visit, channel, place, u);
        }
        for part in &at.base_parts {
            let sensitivity = part.sensitivity(value / at.reference, conversion);
            self.families[BASE].was_read(part.sigma, sensitivity);
            let u = sensitivity * part.sigma;
            self.add_grouped((BASE, OF_BASE), part.visit, channel + self.width * part.list, place, u);
        }
        self.add(CERTIFICATE, (0, 0), place, value * self.instrument.reference.reflectance_u);
        // Stray light drifts with the source, between visits to the blank.
        let instrument = self.instrument;
        let stray = conversion * instrument.gain() * instrument.surroundings.stray_per_sr;
        let (drift, has_reference) = (instrument.source.drift_per_sqrt_hour, self.has_reference);
        self.bridge((DRIFT, OF_BASE), place, &at.base_gap, stray * drift);
        if has_reference {
            self.bridge((DRIFT, OF_REFERENCE), place, &at.reference_gap, value * drift);
        } else {
            // Nothing tells how far the power has walked since the start.
            self.walk(DRIFT, place, of.time_s, value * drift);
        }
        self.bridge(
            (DARK, OF_BASE),
            place,
            &at.base_gap,
            conversion * self.instrument.detector.dark_drift_per_sqrt_hour,
        );
        let detector = &self.instrument.detector;
        if detector.nonlinearity_u > 0.0 {
            let of_reference = if has_reference { value / at.reference * at.reference_bent } else { 0.0 };
            let bent = conversion * (rate.mean * rate.signal - at.base_bent) - of_reference;
            self.add(NONLINEARITY, (0, 0), place, detector.nonlinearity_u / detector.full_well * bent);
        }
        if detector.exposure_u > 0.0 {
            self.exposures(place, of);
        }
    }

    /// Adds what errors of exposure times do to one reading: each exposure has its own, in all that was read in it. What sample, reference and base share
    /// cancels in their ratio. Exposures beyond the most that have a component are of an instrument that sets them anew each time: the error of one is
    /// the reading's own, or the visit's.
    fn exposures(&mut self, place: usize, of: &Reduced) {
        let Reduced { value, conversion, rate, ref at, .. } = *of;
        let detector = &self.instrument.detector;
        let own = Timed::new(rate.exposure_s, rate.mean, detector.offset);
        // Parts 1 and up of the family are visits', 0 is an exposure's.
        let of_reference =
            at.reference_parts.iter().map(|p| (p.timed, -value / at.reference * p.share, (OF_REFERENCE, p.visit, 1)));
        let of_base = at
            .base_parts
            .iter()
            .map(|p| (p.timed, p.sensitivity(value / at.reference, conversion), (OF_BASE, p.visit, 2 + p.list)));
        let parts: Vec<_> = of_reference.chain(of_base).collect();
        let is_own = |timed: Timed| are_same(timed.exposure_s, rate.exposure_s);
        if self.has_reference && parts.iter().all(|(timed, ..)| is_own(*timed)) {
            return;
        }
        // What a reading has of an exposure that is its own alone.
        let mut alone = 0.0;
        let mut add = |(timed, sensitivity): (Timed, f64), visit: Option<(usize, usize, usize)>| {
            let u = detector.exposure_u * sensitivity * timed.rate;
            match (self.exposure(timed.exposure_s), visit.filter(|_| !is_own(timed))) {
                (Some(component), _) => self.add(EXPOSURES, (component, 0), place, u),
                (None, Some((kind, visit, part))) => self.add_grouped((EXPOSURES, kind), visit, part, place, u),
                (None, None) => alone += u,
            }
        };
        add((own, conversion), None);
        parts.into_iter().for_each(|(timed, sensitivity, visit)| add((timed, sensitivity), Some(visit)));
        if alone != 0.0 {
            self.add_own(EXPOSURES, place, alone * alone);
        }
    }

    /// The number of an exposure that has a component; none where as many have one as may.
    fn exposure(&mut self, exposure_s: f64) -> Option<usize> {
        let found = self.exposures_s.iter().position(|known| are_same(*known, exposure_s));
        found.or_else(|| {
            (self.exposures_s.len() < self.most_exposures).then(|| {
                self.exposures_s.push(exposure_s);
                self.exposures_s.len() - 1
            })
        })
    }

    /// A walk of σ `per_sqrt_hour` that is 0 at the start and known nowhere else, as Lévy made it: to its end in a line, and in the middle of each half, quarter
    /// … off the line between its ends by half the root of its length. Within the last pieces it is a bridge, each reading's own: readings in two of them
    /// differ as much as they do, two in one by no less.
    fn walk(&mut self, family: usize, place: usize, time_s: f64, per_sqrt_hour: f64) {
        if per_sqrt_hour == 0.0 || self.end_s <= 0.0 {
            return;
        }
        let (late, sigma) = ((time_s / self.end_s).clamp(0.0, 1.0), per_sqrt_hour * (self.end_s / 3600.0).sqrt());
        self.add(family, (0, 0), place, sigma * late);
        let piece = |pieces: f64| {
            let number = (late * pieces).floor().min(pieces - 1.0);
            (number as usize, late * pieces - number)
        };
        for halving in 0..HALVINGS {
            let pieces = f64::from(1 << halving);
            let (number, along) = piece(pieces);
            let off = 0.5 * (1.0 - (2.0 * along - 1.0).abs()) / pieces.sqrt();
            self.add(family, (0, (1 << halving) + number), place, sigma * off);
        }
        let pieces = f64::from(1 << HALVINGS);
        let (_, along) = piece(pieces);
        self.add_own(family, place, sigma * sigma * along * (1.0 - along) / pieces);
    }

    /// A walk of σ `per_sqrt_hour` that two visits know the ends of: a Brownian bridge, √2 Σ sin(mπτ)/(mπ) times normal numbers and √span. Before the
    /// first and after the last visit it walks on.
    fn bridge(&mut self, (family, kind): (usize, usize), place: usize, gap: &Gap, per_sqrt_hour: f64) {
        self.add(family, (usize::MAX, gap.number), place, per_sqrt_hour * (gap.beyond_s / 3600.0).sqrt());
        let sigma = per_sqrt_hour * (gap.span_s / 3600.0).sqrt();
        let (interval, late) = (gap.number, gap.late);
        let mut left = late * (1.0 - late);
        for mode in 1..=MODES {
            let at = std::f64::consts::PI * mode as f64;
            let share = 2f64.sqrt() * (at * late).sin() / at;
            left -= share * share;
            // Intervals of base and reference are the same ones where both were visited together.
            let apart = if self.groups[OF_BASE] == self.groups[OF_REFERENCE] { 0 } else { kind * (MODES + 1) };
            self.add_grouped((family, kind), interval, mode + apart, place, sigma * share);
        }
        if sigma != 0.0 {
            self.add_own(family, place, sigma * sigma * left.max(0.0));
        }
    }

    /// The variance of each reading that it shares with no other, added up into the table.
    pub fn own_into(&self, table: &mut Table) {
        for list in self.families.iter().map(|f| &f.own).chain([&self.own]) {
            table.variance.iter_mut().zip(list).for_each(|(to, own)| *to += own);
        }
    }

    /// Where the uncertainty comes from.
    pub fn budget(&self, table: &Table) -> Budget {
        let mut variances = vec![vec![0.0; self.size]; self.families.len()];
        for (to, family) in variances.iter_mut().zip(&self.families) {
            for list in [&family.own, &family.attributed] {
                to.iter_mut().zip(list).for_each(|(to, variance)| *to += variance);
            }
        }
        for Component { family, plane } in &self.components {
            let Some(family) = family else { continue };
            variances[*family].iter_mut().zip(plane).for_each(|(to, u)| *to += u * u);
        }
        let input = |k: usize| {
            let Family { name, kind, unit, .. } = self.families[k];
            let [sigma, sensitivity] = self.families[k].rms();
            let (u, sensitivity) = self.described(k).map_or((sigma, Some(sensitivity)), |u| (u, None));
            Input { name, kind, u: Some(u), unit, sensitivity }
        };
        let lines = variances.into_iter().enumerate().map(|(k, variance)| (input(k), variance));
        Budget::new(lines.collect(), &table.values)
    }

    /// Standard uncertainty of what a family's readings depend on, where it is described.
    fn described(&self, family: usize) -> Option<f64> {
        let Instrument { source, sample, detector, reference, axes, .. } = self.instrument;
        Some(match family {
            CERTIFICATE => reference.reflectance_u,
            DRIFT => source.drift_per_sqrt_hour,
            DARK => detector.dark_drift_per_sqrt_hour,
            NONLINEARITY => detector.nonlinearity_u,
            EXPOSURES => detector.exposure_u,
            ZEROS => axes.zero_u_deg,
            TILT => sample.tilt_u_deg,
            HEIGHT => sample.height_u_m,
            JITTER => axes.jitter_deg,
            _ => return None,
        })
    }

    /// The components' planes.
    pub fn planes(self) -> Vec<Vec<f64>> {
        self.components.into_iter().map(|c| c.plane).collect()
    }
}

fn add_at(list: &mut Vec<f64>, size: usize, place: usize, variance: f64) {
    if list.is_empty() {
        list.resize(size, 0.0);
    }
    list[place] += variance;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::raw::Raw;
    use crate::gonio::reduce::stops::Rate;
    use crate::gonio::reduce::visits::{At, ReferencePart};

    const EXPOSURE_U: f64 = 0.01;

    /// A reading of value 1, beside a reference as bright in another exposure: 1 σ of either is `EXPOSURE_U`.
    fn reduced(own_s: f64, reference_s: f64, visit: usize) -> Reduced {
        let rate = Rate { mean: 1000.0, variance: 0.0, signal: 1000.0, exposure_s: own_s };
        let timed = Timed::new(reference_s, 1000.0, 0.0);
        let gap = Gap::default();
        let at = At {
            base: 0.0,
            reference: 1000.0,
            base_parts: vec![],
            reference_parts: vec![ReferencePart { visit, share: 1.0, sigma: 0.0, timed }],
            base_bent: 0.0,
            reference_bent: 0.0,
            base_gap: gap,
            reference_gap: gap,
        };
        Reduced { value: 1.0, conversion: 1e-3, rate, at, time_s: 0.0 }
    }

    /// An instrument that sets exposures anew each time has as many as readings and visits; memory does not grow with them, and no variance is lost.
    #[test]
    fn exposures_without_end_have_a_few_components_and_all_of_their_variance() {
        const READINGS: usize = 200;
        let mut instrument = Instrument::default();
        instrument.detector.exposure_u = EXPOSURE_U;
        let visits = Visits::new(&[], &Raw::nothing_read(), &instrument).expect("nothing to refuse");
        for (is_set_anew, most) in [(false, MOST_EXPOSURES), (true, MOST_EXPOSURES + MOST_GROUPS)] {
            let mut shared = Shared::new(READINGS, 1, (&visits, 0.0), &instrument);
            // Of 20 visits four in a row are one component.
            (shared.has_reference, shared.groups) = (true, [1, 4]);
            for i in 0..READINGS {
                let visit = i / 10;
                let reference_s = if is_set_anew { 100.0 + visit as f64 } else { 0.5 };
                shared.exposures(i, &reduced(1.0 + 0.1 * i as f64, reference_s, visit));
            }
            let own = shared.families[EXPOSURES].own.clone();
            let planes = shared.planes();
            assert!(planes.len() <= most, "{} components", planes.len());
            for i in 0..READINGS {
                let shares: f64 = planes.iter().map(|plane| plane[i] * plane[i]).sum();
                let want = 2.0 * EXPOSURE_U * EXPOSURE_U;
                assert!(((own[i] + shares) / want - 1.0).abs() < 1e-12, "reading {i}: {} and {shares}", own[i]);
            }
        }
    }

    /// A reading in the reference's exposure is as exact as without any error of it, whichever exposures had a component before.
    #[test]
    fn an_exposure_shared_with_the_reference_cancels_beyond_the_most_too() {
        let mut instrument = Instrument::default();
        instrument.detector.exposure_u = EXPOSURE_U;
        let visits = Visits::new(&[], &Raw::nothing_read(), &instrument).expect("nothing to refuse");
        let mut shared = Shared::new(30, 1, (&visits, 0.0), &instrument);
        shared.has_reference = true;
        (0..29).for_each(|i| shared.exposures(i, &reduced(1.0 + i as f64, 0.5, 0)));
        let components = shared.components.len();
        shared.exposures(29, &reduced(77.0, 77.0, 1));
        assert_eq!((shared.components.len(), shared.families[EXPOSURES].own[29]), (components, 0.0));
        assert!(shared.components.iter().all(|c| c.plane[29] == 0.0));
    }
}
