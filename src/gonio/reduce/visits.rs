//! Readings of the reference, the blank and the dark, and what they say of the time between them.
//!
//! Each kind has its own times: a blank may be read more often than the reference, and where one can't be used the next one counts. Of blank and dark those
//! of the same exposure count, which have the same offset, and where there are none those of the longest, whose rates are known best.

use super::ReduceError;
use super::positions;
use super::stops::{Rate, Stop, are_same, distinct};
use crate::gonio::instrument::Instrument;
use crate::gonio::raw::Raw;
use crate::gonio::reading::Kind;

/// What was read once, of one channel.
#[derive(Debug, Clone, Copy)]
struct Point {
    time_s: f64,
    /// Rate and its variance.
    mean: f64,
    variance: f64,
    /// Signal of one reading.
    signal: f64,
    exposure_s: f64,
    /// Number of the stop among those of its kind.
    visit: usize,
    /// Of its exposure, among those of blank or dark.
    list: usize,
}

impl Point {
    /// By how much its rate changes with the detector's nonlinearity, for a full well of 1.
    fn bent(&self) -> f64 {
        self.mean * self.signal
    }
}

/// The readings of one kind around a moment.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Gap {
    /// Number of the one before.
    pub number: usize,
    /// Where the moment lies between both, 0 to 1.
    pub late: f64,
    /// Seconds between both.
    pub span_s: f64,
    /// Seconds from the nearest where there is none on the other side.
    pub beyond_s: f64,
}

/// A reading of blank or dark in a reading of the sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct BasePart {
    /// Its number, and that of its exposure.
    pub visit: usize,
    pub list: usize,
    /// What the base at that moment has of it, and what the reference's net rate lost by it.
    pub direct: f64,
    pub through_reference: f64,
    /// σ of its rate.
    pub sigma: f64,
    pub timed: Timed,
}

impl BasePart {
    /// What a reading changes by with its rate, of `per_reference` with the reference's net rate and of `conversion` with its own.
    pub fn sensitivity(&self, per_reference: f64, conversion: f64) -> f64 {
        per_reference * self.through_reference - conversion * self.direct
    }
}

/// A reading of the reference in a reading of the sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct ReferencePart {
    /// Its number.
    pub visit: usize,
    /// Its share.
    pub share: f64,
    /// σ of its rate.
    pub sigma: f64,
    pub timed: Timed,
}

/// What an exposure's error acts on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Timed {
    pub exposure_s: f64,
    /// Signal a second of what comes while it lasts: without the offset of the electronics.
    pub rate: f64,
}

impl Timed {
    /// Of a rate that has an offset of so much signal in it.
    pub fn new(exposure_s: f64, mean: f64, offset: f64) -> Self {
        Self { exposure_s, rate: mean - offset / exposure_s }
    }
}

/// What is known of one moment and channel.
#[derive(Debug, Clone)]
pub(super) struct At {
    /// Rate without the sample's light.
    pub base: f64,
    /// The reference's net rate; 1 where there is none.
    pub reference: f64,
    /// What both are made from.
    pub base_parts: Vec<BasePart>,
    pub reference_parts: Vec<ReferencePart>,
    /// By how much base and reference change with the detector's nonlinearity: rate times signal, for a full well of 1.
    pub base_bent: f64,
    pub reference_bent: f64,
    /// Where the moment lies between readings of the base, and of the reference.
    pub base_gap: Gap,
    pub reference_gap: Gap,
}

/// All readings of base and reference, in order of time, channel by channel.
pub(super) struct Visits {
    base: Vec<Base>,
    reference: Vec<Vec<Point>>,
    /// Whether there is a base, and a reference.
    pub has: [bool; 2],
    /// What each reading has of the electronics, as described.
    offset: f64,
}

/// Readings of blank or dark in one channel, by exposure, the longest first.
struct Base(Vec<Vec<Point>>);

impl Base {
    /// From readings in order of time.
    fn new(all: &[Point]) -> Self {
        let exposures = distinct(all.iter().map(|p| p.exposure_s));
        let of = |(list, exposure): (usize, f64)| {
            all.iter().filter(|p| are_same(p.exposure_s, exposure)).map(|p| Point { list, ..*p }).collect()
        };
        Self(exposures.into_iter().enumerate().map(of).collect())
    }

    /// Those that tell what a reading of this exposure has of them; none where there are none.
    fn of(&self, exposure_s: f64) -> &[Point] {
        let same = |list: &&Vec<Point>| are_same(list[0].exposure_s, exposure_s);
        self.0.iter().find(same).or(self.0.first()).map_or(&[], Vec::as_slice)
    }
}

impl Visits {
    /// From all stops.
    ///
    /// # Errors
    /// [`ReduceError`] where no reading of the reference can be used, or one is no brighter than the blank.
    pub fn new(stops: &[Stop], raw: &Raw, instrument: &Instrument) -> Result<Self, ReduceError> {
        let width = raw.channels.len();
        let points = |kind: Kind, c: usize| -> Vec<Point> {
            let of_kind: Vec<&Stop> = stops.iter().filter(|s| s.kind == kind).collect();
            let visits = of_kind.chunk_by(|a, b| a.number == b.number).enumerate();
            let numbered = visits.flat_map(|(visit, stops)| stops.iter().map(move |stop| (visit, stop)));
            let point = |(visit, stop): (usize, &&Stop)| {
                let Rate { mean, variance, signal, exposure_s } = stop.rates[c]?;
                Some(Point { time_s: stop.time_s, mean, variance, signal, exposure_s, visit, list: 0 })
            };
            numbered.filter_map(point).collect()
        };
        // The blank where there is one, else the dark.
        let base =
            |c: usize| Some(points(Kind::Blank, c)).filter(|b| !b.is_empty()).unwrap_or_else(|| points(Kind::Dark, c));
        let count = |kind: Kind| stops.iter().filter(|s| s.kind == kind).count();
        let counts = [Kind::Blank, Kind::Dark, Kind::Reference].map(count);
        let mut visits = Self {
            base: (0..width).map(|c| Base::new(&base(c))).collect(),
            reference: (0..width).map(|c| points(Kind::Reference, c)).collect(),
            has: [counts[0] + counts[1] > 0, counts[2] > 0],
            offset: instrument.detector.offset,
        };
        visits.check(raw)?;
        let jitter = positions::of_reference(instrument, raw.dimension);
        let moved = |c: usize, point: &Point| (jitter * (point.mean - visits.under(c, point))).powi(2);
        let all = visits.reference.iter().enumerate();
        let variances: Vec<Vec<f64>> = all.map(|(c, list)| list.iter().map(|p| moved(c, p)).collect()).collect();
        for (point, variance) in visits.reference.iter_mut().flatten().zip(variances.into_iter().flatten()) {
            point.variance += variance;
        }
        Ok(visits)
    }

    fn check(&self, raw: &Raw) -> Result<(), ReduceError> {
        if !self.has[1] {
            return Ok(());
        }
        for (c, channel) in raw.channels.iter().enumerate() {
            if self.reference[c].is_empty() {
                return Err(ReduceError::UnreadableReference { channel: channel.clone() });
            }
            for point in &self.reference[c] {
                let base = self.under(c, point);
                if point.mean <= base {
                    let (channel, time_s) = (channel.clone(), point.time_s);
                    return Err(ReduceError::DarkReference { channel, time_s, rate: point.mean, base });
                }
            }
        }
        Ok(())
    }

    /// The base's rate in a reading of the reference.
    fn under(&self, channel: usize, point: &Point) -> f64 {
        self.base_at(channel, point.time_s, point.exposure_s).0
    }

    /// The base's rate at a moment in a reading of this exposure, what it is made from with its list, and where the moment lies.
    fn base_at(&self, channel: usize, time_s: f64, exposure_s: f64) -> (f64, (&[Point], Around), Gap) {
        let list = self.base[channel].of(exposure_s);
        let (rate, around, gap) = interpolated(list, time_s);
        (rate + self.offset_beside(list, exposure_s), (list, around), gap)
    }

    /// By how much the rate of a described offset is larger in a reading of this exposure than in these of the base.
    fn offset_beside(&self, list: &[Point], exposure_s: f64) -> f64 {
        match list.first() {
            Some(point) if are_same(point.exposure_s, exposure_s) => 0.0,
            Some(point) => self.offset * (exposure_s.recip() - point.exposure_s.recip()),
            None => self.offset / exposure_s,
        }
    }

    /// Says so where blank or dark were read in several exposures, and not in that of what they are subtracted from.
    pub fn unmatched(&self, stops: &[Stop]) -> Option<String> {
        let of_stop = |stop: &Stop| {
            let rates =
                stop.rates.iter().enumerate().filter_map(|(c, rate)| Some((&self.base[c], rate.as_ref()?.exposure_s)));
            let lone = |(base, exposure): &(&Base, f64)| {
                base.0.len() > 1 && !are_same(base.of(*exposure)[0].exposure_s, *exposure)
            };
            let mut lone = rates.filter(lone);
            lone.next().map(|(base, exposure)| (exposure, base.0[0][0].exposure_s))
        };
        let light = |stop: &&Stop| matches!(stop.kind, Kind::Sample | Kind::Reference);
        let (exposure, longest) = stops.iter().filter(light).find_map(of_stop).filter(|_| self.offset == 0.0)?;
        Some(format!(
            "no blank or dark has the exposure of {exposure} s that others have: those of {longest} s are taken, and an electronic offset does not come off"
        ))
    }

    /// How many there are of base and reference.
    pub fn len(&self) -> [usize; 2] {
        let last = |all: &mut dyn Iterator<Item = &Point>| all.map(|p| p.visit + 1).max().unwrap_or(0);
        [last(&mut self.base.iter().flat_map(|b| b.0.iter().flatten())), last(&mut self.reference.iter().flatten())]
    }

    /// What they say of `time_s` and of this exposure: linear between two, the nearest before the first and after the last.
    pub fn at(&self, time_s: f64, channel: usize, exposure_s: f64) -> At {
        let reference_list = &self.reference[channel];
        let (base, (base_list, around), base_gap) = self.base_at(channel, time_s, exposure_s);
        let (mut base_parts, mut base_bent) = (Vec::with_capacity(4), 0.0);
        for (i, share) in around {
            base_bent += share * base_list[i].bent();
            self.add_part(&mut base_parts, base_list, i, (share, 0.0));
        }
        let (mut reference, mut reference_bent, mut reference_parts) = (0.0, 0.0, Vec::with_capacity(2));
        let (_, around, reference_gap) = interpolated(reference_list, time_s);
        for (i, share) in around {
            let point = reference_list[i];
            let (under, (base_list, of_base), _) = self.base_at(channel, point.time_s, point.exposure_s);
            reference += share * (point.mean - under);
            reference_bent += share * point.bent();
            let (sigma, timed) = (point.variance.sqrt(), self.timed(&point));
            reference_parts.push(ReferencePart { visit: point.visit, share, sigma, timed });
            for (k, part) in of_base {
                self.add_part(&mut base_parts, base_list, k, (0.0, share * part));
                reference_bent -= share * part * base_list[k].bent();
            }
        }
        if reference_list.is_empty() {
            reference = 1.0;
        }
        At { base, reference, base_parts, reference_parts, base_bent, reference_bent, base_gap, reference_gap }
    }

    /// Adds what a moment has of a reading of the base, directly and through the reference.
    fn add_part(&self, parts: &mut Vec<BasePart>, points: &[Point], i: usize, (direct, through_reference): (f64, f64)) {
        let Point { visit, list, variance, .. } = points[i];
        if let Some(part) = parts.iter_mut().find(|part| (part.visit, part.list) == (visit, list)) {
            part.direct += direct;
            part.through_reference += through_reference;
        } else {
            let (sigma, timed) = (variance.sqrt(), self.timed(&points[i]));
            parts.push(BasePart { visit, list, direct, through_reference, sigma, timed });
        }
    }

    fn timed(&self, point: &Point) -> Timed {
        Timed::new(point.exposure_s, point.mean, self.offset)
    }
}

/// Value at a moment, the places in the list of what it is made from with their shares, and where it lies; nothing of an empty list.
fn interpolated(list: &[Point], time_s: f64) -> (f64, Around, Gap) {
    let after = list.partition_point(|p| p.time_s < time_s);
    let (Some(last), before) = (list.len().checked_sub(1), after.saturating_sub(1)) else {
        return (0.0, Around::default(), Gap::default());
    };
    let (a, b) = (before, after.min(last));
    let span_s = list[b].time_s - list[a].time_s;
    let late = if span_s > 0.0 { (time_s - list[a].time_s) / span_s } else { 0.0 };
    let beyond_s = if a == b { (time_s - list[a].time_s).abs() } else { 0.0 };
    let value = (1.0 - late) * list[a].mean + late * list[b].mean;
    let around = Around(if a == b { [Some((a, 1.0)), None] } else { [Some((a, 1.0 - late)), Some((b, late))] });
    (value, around, Gap { number: list[a].visit, late, span_s, beyond_s })
}

/// Places in a list with their shares: none, one or two.
#[derive(Debug, Clone, Copy, Default)]
struct Around([Option<(usize, f64)>; 2]);

impl IntoIterator for Around {
    type Item = (usize, f64);
    type IntoIter = std::iter::Flatten<std::array::IntoIter<Option<(usize, f64)>, 2>>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stop(kind: Kind, time_s: f64, mean: f64) -> Stop {
        let rate = Rate { mean, variance: 1.0, signal: mean, exposure_s: 1.0 };
        Stop {
            kind,
            entry: None,
            number: time_s as u32,
            time_s,
            rates: vec![(!mean.is_nan()).then_some(rate)],
            saturated: vec![false],
        }
    }

    fn visits(list: &[(Kind, f64, f64)]) -> Result<Visits, ReduceError> {
        let stops: Vec<Stop> = list.iter().map(|(kind, time, mean)| stop(*kind, *time, *mean)).collect();
        Visits::new(&stops, &Raw::nothing_read(), &Instrument::default())
    }

    /// Whichever kind was read when: constant rates give the same net rate everywhere.
    #[test]
    fn every_kind_has_its_own_times() {
        use Kind::{Blank, Reference};
        for list in [
            vec![(Reference, 0.0, 1000.0), (Blank, 2.0, 10.0), (Blank, 12.0, 10.0)],
            vec![(Blank, 0.0, 10.0), (Reference, 10.0, 1000.0), (Blank, 12.0, 10.0)],
            vec![(Blank, 0.0, 10.0), (Reference, 10.0, 1000.0)],
            vec![
                (Reference, 0.0, 1000.0),
                (Blank, 1.0, 10.0),
                (Blank, 5.5, 10.0),
                (Reference, 9.0, 1000.0),
                (Blank, 10.0, 10.0),
            ],
            vec![(Reference, 0.0, 1000.0), (Reference, 9.0, f64::NAN), (Blank, 1.0, 10.0), (Blank, 10.0, f64::NAN)],
        ] {
            let at = visits(&list).expect("readable").at(5.0, 0, 1.0);
            assert!((at.base - 10.0).abs() < 1e-12 && (at.reference - 990.0).abs() < 1e-12, "{list:?}: {at:?}");
            let shares: f64 = at.base_parts.iter().map(|p| p.direct).sum();
            let through: f64 = at.base_parts.iter().map(|p| p.through_reference).sum();
            let reference: f64 = at.reference_parts.iter().map(|p| p.share).sum();
            assert!([shares, through, reference].iter().all(|s| (s - 1.0).abs() < 1e-12), "{list:?}: {at:?}");
        }
    }

    /// Drifting rates are followed in each one's own time.
    #[test]
    fn each_kind_is_interpolated_at_its_own_times() {
        use Kind::{Blank, Reference};
        let list = [(Reference, 0.0, 1000.0), (Blank, 2.0, 10.0), (Reference, 10.0, 1020.0), (Blank, 12.0, 12.0)];
        let at = visits(&list).expect("readable").at(5.0, 0, 1.0);
        // The blank at 5 s is 10.6; under the reference it was 10 (the nearest) and 11.6.
        assert!((at.base - 10.6).abs() < 1e-12 && (at.reference - (1010.0 - 10.8)).abs() < 1e-12, "{at:?}");
    }

    #[test]
    fn a_reference_that_says_nothing_is_refused_with_the_place() {
        use Kind::{Blank, Reference};
        let dark = visits(&[(Reference, 3.0, 10.0), (Blank, 0.0, 10.0)]).err().expect("refused");
        assert!(dark.to_string().contains("channel y: the reference reads 10 a second at 3 s"), "{dark}");
        let none = visits(&[(Reference, 3.0, f64::NAN), (Blank, 0.0, 10.0)]).err().expect("refused");
        assert!(none.to_string().contains("every reading of the reference is saturated or missing"), "{none}");
        let at = visits(&[]).expect("nothing to refuse").at(1.0, 0, 1.0);
        assert!(at.base == 0.0 && at.reference == 1.0 && at.base_parts.is_empty());
    }
}
