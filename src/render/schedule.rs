//! How many samples the tiles of a picture get, round after round.

use std::time::Instant;

use super::film::Options;
use super::noise::{DOUBT_OF_ONE, Noise, PictureError, doubt_at};

/// Samples of the first round where later ones depend on it.
const FIRST: u32 = 16;
/// In one round a tile's samples grow at most by this factor: what the first say of their error is not sure.
const GROWTH: f64 = 4.0;
/// Tiles have at least this share of the mean number of samples: what they hide may not have shown yet.
const LEAST_SHARE: f64 = 1.0 / 16.0;
/// Samples come in such portions.
const PORTION: u32 = 8;

/// When the picture is good enough, and who gets samples until then.
#[derive(Debug)]
pub(super) struct Schedule {
    most: u32,
    target: Option<f64>,
    start: Instant,
    deadline: Option<Instant>,
    /// Samples that tiles have, which all pixels of a tile share.
    have: Vec<u32>,
    /// How often the picture was looked at.
    looks: u32,
}

impl Schedule {
    pub fn new(options: &Options, tiles: usize, start: Instant) -> Self {
        let (target, deadline) = (options.target_error, options.deadline);
        Self { most: options.samples, target, start, deadline, have: vec![0; tiles], looks: 0 }
    }

    /// Whether rounds depend on what earlier ones found.
    pub fn adapts(&self) -> bool {
        self.target.is_some() || self.deadline.is_some()
    }

    /// What the bound of the picture's error may be wrong with.
    pub fn doubt(&self) -> f64 {
        if self.target.is_some() { doubt_at(self.looks) } else { DOUBT_OF_ONE }
    }

    /// When work ends, at the latest.
    pub fn deadline(&self) -> Option<Instant> {
        self.deadline
    }

    /// The tiles' samples so far.
    pub fn have(&self) -> &[u32] {
        &self.have
    }

    /// Tiles have got what was planned for them.
    pub fn advance(&mut self, more: &[u32]) {
        self.have.iter_mut().zip(more).for_each(|(have, more)| *have += more);
    }

    /// What the first round brings, for portions of at least `least`.
    pub fn first(&self, least: u32) -> Vec<u32> {
        let wanted = match (self.adapts(), self.deadline) {
            (false, _) => least,
            (true, Some(_)) => least.max(2),
            (true, None) => FIRST,
        };
        vec![wanted.min(self.most); self.have.len()]
    }

    /// What the next round brings every tile, whose errors are `noise`; `None` where the picture is done.
    pub fn next(&mut self, noise: &[Noise]) -> Option<Vec<u32>> {
        if !self.adapts() {
            let done = self.have.first().copied().unwrap_or(0);
            let pass = done.clamp(1, 32).min(self.most - done);
            return (pass > 0).then(|| vec![pass; self.have.len()]);
        }
        self.looks += 1;
        let all = Noise::all(noise);
        if all.sum.is_nan() {
            return None; // no samples mend a value that is no number
        }
        if self.target.is_some_and(|target| all.error(self.doubt()).at_most <= target) {
            return None;
        }
        let total: f64 = self.have.iter().map(|n| f64::from(*n)).sum();
        let mut affordable = f64::INFINITY;
        if let Some(deadline) = self.deadline {
            let now = Instant::now();
            let spent = (now - self.start).as_secs_f64();
            let left = deadline.saturating_duration_since(now).as_secs_f64();
            // Rounds double the work while there is time for two of them.
            affordable = total * (left / spent).min(1.0);
            if left <= 0.0 || affordable < 0.02 * total {
                return None;
            }
        }
        let wanted = self.shares(noise, &all.error(doubt_at(self.looks + 1)), affordable + total);
        let mut more: Vec<u32> = wanted.iter().zip(&self.have).map(|(want, have)| self.portion(*want, *have)).collect();
        if more.iter().all(|n| *n == 0) {
            // The plan's aim is met but not surely enough, or nothing varies: some more everywhere.
            more = self.have.iter().map(|have| self.portion(1.05 * f64::from(*have) + 1.0, *have)).collect();
        }
        more.iter().any(|n| *n > 0).then_some(more)
    }

    /// From `have` samples towards `want`.
    fn portion(&self, want: f64, have: u32) -> u32 {
        let grown = want.min(GROWTH * f64::from(have)) - f64::from(have);
        let portions = (grown / f64::from(PORTION)).ceil().max(0.0);
        ((portions * f64::from(PORTION)) as u32).min(self.most.saturating_sub(have))
    }

    /// Samples of the tiles: those for which the sum of errors a/n is least, n ∝ √a, but nobody loses any; as many as the target takes,
    /// and together at most `affordable`.
    fn shares(&self, noise: &[Noise], error: &PictureError, affordable: f64) -> Vec<f64> {
        let have: Vec<f64> = self.have.iter().map(|n| f64::from(*n)).collect();
        let load: Vec<f64> = noise.iter().zip(&have).map(|(e, n)| e.sum * n).collect();
        let shares = |scale: f64| -> Vec<f64> {
            let raw: Vec<f64> = load.iter().zip(&have).map(|(a, n)| n.max(scale * a.sqrt())).collect();
            let least = LEAST_SHARE * raw.iter().sum::<f64>() / raw.len() as f64;
            raw.iter().map(|n| n.max(least)).collect()
        };
        // The bound is above the estimate; both shrink alike.
        let aim = self.target.map(|t| (t * error.relative / error.at_most).powi(2) * Noise::all(noise).values());
        let enough = |n: &[f64]| {
            let reached = aim.is_some_and(|aim| load.iter().zip(n).map(|(a, n)| a / n).sum::<f64>() <= aim);
            reached || n.iter().sum::<f64>() >= affordable
        };
        let largest = load.iter().fold(0.0f64, |m, a| m.max(*a)).sqrt();
        if !(largest > 0.0 && largest.is_finite()) {
            return have;
        }
        // Where scale·largest is as many samples as any tile may have, no more can be had.
        let (mut low, mut high) = (0.0, GROWTH * f64::from(self.most) / largest);
        if !enough(&shares(high)) {
            return shares(high);
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if enough(&shares(middle)) { high = middle } else { low = middle }
        }
        shares(high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(sums: &[f64]) -> Vec<Noise> {
        sums.iter().map(|sum| Noise { sum: *sum, ..Noise::default() }).collect()
    }

    fn schedule(target: f64, have: &[u32]) -> Schedule {
        let options = Options { samples: 1 << 20, target_error: Some(target), ..Options::default() };
        let mut schedule = Schedule::new(&options, have.len(), Instant::now());
        schedule.advance(have);
        schedule
    }

    /// With n ∝ √a the error is least for the samples: moving any from one tile to another makes it larger.
    #[test]
    fn samples_go_where_they_help_most() {
        let have = [16, 16, 16, 16];
        let sums = [1.0, 4.0, 9.0, 0.25];
        let plan = schedule(1e-3, &have);
        let shares = plan.shares(&noise(&sums), &PictureError { relative: 1.0, at_most: 1.0 }, 4000.0);
        assert!((shares.iter().sum::<f64>() - 4000.0).abs() < 1.0, "{shares:?}");
        for (share, sum) in shares.iter().zip(&sums) {
            let want = 4000.0 * sum.sqrt() / 6.5;
            assert!((share / want - 1.0).abs() < 1e-3, "{share} of {want}");
        }
        // A tile that has more than its share keeps it.
        let plan = schedule(1e-3, &[16, 16, 16, 4000]);
        let shares =
            plan.shares(&noise(&[1.0, 4.0, 9.0, 0.001]), &PictureError { relative: 1.0, at_most: 1.0 }, 5000.0);
        assert!(shares[3] == 4000.0 && (shares.iter().sum::<f64>() - 5000.0).abs() < 1.0, "{shares:?}");
    }

    #[test]
    fn work_ends_where_the_target_is_met_or_nothing_more_is_allowed() {
        let parts = |sum: f64| vec![Noise { sum, pixels: 256, ..Noise::default() }; 2];
        let mut plan = schedule(1e-2, &[16, 16]);
        assert!(plan.next(&parts(0.0)).is_none() && plan.next(&parts(0.7e-4 * 768.0)).is_none());
        assert!(plan.next(&parts(0.9e-4 * 768.0)).is_some_and(|more| more.iter().all(|n| *n > 0 && *n % PORTION == 0)));
        plan.most = 16;
        assert!(plan.next(&parts(1.0)).is_none());
    }
}
