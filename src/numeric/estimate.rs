//! What repeated trials say: a value with the ends of its 95 % interval, and what one more trial stays below.

use super::stats::student_quantile;

/// A value and its 95 % interval. An end that nothing is known of is infinite (0 below, for what is positive).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Estimate {
    /// A value without any uncertainty.
    #[must_use]
    pub fn exact(value: f64) -> Self {
        Self { value, low: value, high: value }
    }

    /// A positive value of which nothing else is known.
    #[must_use]
    pub fn alone(value: f64) -> Self {
        Self { value, low: 0.0, high: f64::INFINITY }
    }

    /// With something exact on top.
    #[must_use]
    pub fn plus(self, more: f64) -> Self {
        Self { value: self.value + more, low: self.low + more, high: self.high + more }
    }

    /// Whether both ends are known.
    #[must_use]
    pub fn is_bounded(&self) -> bool {
        self.high.is_finite()
    }

    /// Standard deviation of the logarithm that the interval stands for, taken for a normal one: infinite where an end is not known.
    #[must_use]
    pub fn log_deviation(&self) -> f64 {
        if self.low == self.high { 0.0 } else { (self.high / self.low).ln() / (2.0 * 1.96) }
    }
}

/// Median of times or other positive values. From six values on the interval is that of order statistics, which holds whatever the
/// distribution; below, Student's of the logarithms, where all have one. `None` where there is no value.
#[must_use]
pub fn median(values: &[f64]) -> Option<Estimate> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    let value = match n {
        0 => return None,
        n if n % 2 == 1 => sorted[n / 2],
        n => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    };
    if let Some(rank) = order(n) {
        return Some(Estimate { value, low: sorted[rank], high: sorted[n - 1 - rank] });
    }
    let logs: Vec<f64> = sorted.iter().map(|v| v.ln()).collect();
    let Some((_, deviation)) = moments(&logs).filter(|m| m.1.is_finite()) else { return Some(Estimate::alone(value)) };
    let reach = (student_quantile(0.975, n as f64 - 1.0) * deviation / (n as f64).sqrt()).exp();
    Some(Estimate { value, low: value / reach, high: value * reach })
}

/// The largest k for which the median lies between the values of rank k and n − 1 − k (from 0) with 95 % confidence: the number of
/// values below it is binomial. `None` below six values.
fn order(n: usize) -> Option<usize> {
    // Logarithms, for 2⁻ⁿ is 0 from n = 1075 on; terms that are 0 in themselves are too small to count.
    let (mut log_term, mut sum, mut rank) = (-(n as f64) * std::f64::consts::LN_2, 0.0, None);
    for k in 0..n {
        sum += log_term.exp();
        if sum > 0.025 {
            break;
        }
        rank = Some(k);
        log_term += ((n - k) as f64 / (k + 1) as f64).ln();
    }
    rank
}

/// Root of the mean square of errors. The interval is Student's of the mean square, by way of its logarithm, so that it stays positive.
/// `None` where there is no value, or their mean square is not finite.
#[must_use]
pub fn root_mean_square(errors: &[f64]) -> Option<Estimate> {
    let n = errors.len() as f64;
    let squares: Vec<f64> = errors.iter().map(|e| e * e).collect();
    let mean = squares.iter().sum::<f64>() / n;
    if !mean.is_finite() {
        return None;
    }
    let value = mean.sqrt();
    let Some((_, deviation)) = moments(&squares) else { return Some(Estimate::alone(value)) };
    if deviation == 0.0 || value == 0.0 {
        return Some(Estimate::exact(value));
    }
    let reach = (0.5 * student_quantile(0.975, n - 1.0) * deviation / (mean * n.sqrt())).exp();
    Some(Estimate { value, low: value / reach, high: value * reach })
}

/// Mean and standard deviation; `None` below two values.
#[must_use]
pub fn moments(values: &[f64]) -> Option<(f64, f64)> {
    let n = values.len() as f64;
    if values.len() < 2 {
        return None;
    }
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    Some((mean, variance.sqrt()))
}

/// Scatter of the logarithms of positive values, pooled over groups that scatter alike.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LogScatter {
    sum: f64,
    freedom: f64,
    /// How far values lie above the mean of their group, as far as they would above a mean that they had no part in.
    above: Vec<f64>,
}

impl LogScatter {
    /// Adds a group's logarithms; a group of one says nothing.
    pub fn add(&mut self, logs: &[f64]) {
        if let Some((mean, deviation)) = moments(logs) {
            let n = logs.len() as f64;
            self.sum += (n - 1.0) * deviation * deviation;
            self.freedom += n - 1.0;
            self.above.extend(logs.iter().map(|x| (x - mean) * (n / (n - 1.0)).sqrt()));
        }
    }

    /// What one more value of a group of `n` values with mean logarithm `mean` stays below with probability 95 %: Student's prediction
    /// limit, or the 95th hundredth of what was seen where that is more, as it is where rare values are large. `None` where no scatter is known.
    #[must_use]
    pub fn upper_limit(&self, mean: f64, n: usize) -> Option<f64> {
        let student = student_quantile(0.95, self.freedom) * (self.sum / self.freedom).sqrt();
        let mut seen = self.above.clone();
        seen.sort_by(f64::total_cmp);
        let rank = (0.95 * (seen.len() + 1) as f64).ceil() as usize;
        let seen = *seen.get(rank.min(seen.len()).checked_sub(1)?)?;
        Some((mean + student.max(seen) * (1.0 + 1.0 / n as f64).sqrt()).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::{Purpose, stream};
    use rand_distr::{Distribution, Normal};

    fn normals(seed: u64, n: usize) -> Vec<f64> {
        let mut rng = stream(seed, Purpose::Study, 0);
        let normal = Normal::new(0.0, 1.0).expect("a distribution");
        (0..n).map(|_| normal.sample(&mut rng)).collect()
    }

    /// Share of 2000 draws in which `holds`.
    fn share(holds: impl Fn(u64) -> bool) -> f64 {
        (0..2000).filter(|seed| holds(*seed)).count() as f64 / 2000.0
    }

    #[test]
    fn medians_and_their_ends_are_the_published_ones() {
        // Conover, Practical Nonparametric Statistics, table A3: n = 6 takes the extremes, n = 10 the second ones, n = 20 the sixth.
        assert_eq!([5, 6, 8, 9, 10, 20].map(order), [None, Some(0), Some(0), Some(1), Some(1), Some(5)]);
        // The binomial's sums in whole numbers: 2⁻ⁿ is 0 from n = 1075 on.
        assert_eq!([1074, 1075, 2000, 10_000].map(order), [504, 504, 955, 4901].map(Some));
        let many: Vec<f64> = (1..=2000).map(f64::from).collect();
        assert_eq!(median(&many), Some(Estimate { value: 1000.5, low: 956.0, high: 1045.0 }));
        let found = median(&[3.0, 1.0, 2.0, 6.0, 5.0, 4.0]).expect("values");
        assert_eq!(found, Estimate { value: 3.5, low: 1.0, high: 6.0 });
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[2.0]), Some(Estimate::alone(2.0)));
    }

    #[test]
    fn ends_are_numbers_or_there_is_no_estimate() {
        assert_eq!(root_mean_square(&[0.0; 3]), Some(Estimate::exact(0.0)));
        for errors in [&[1.0, f64::INFINITY][..], &[1.0, f64::NAN], &[1e200, 1e200], &[]] {
            assert_eq!(root_mean_square(errors), None, "{errors:?}");
        }
        assert_eq!(median(&[0.0, 2.0, 3.0]), Some(Estimate::alone(2.0)));
    }

    /// The binomial's standard deviation over 2000 draws is 0.5 %.
    #[test]
    fn intervals_hold_as_often_as_they_say() {
        // A picture's error: the mean over many values, here 100.
        let picture = |seed: u64| {
            let errors: Vec<f64> =
                normals(seed, 800).chunks(100).map(|c| (c.iter().map(|x| x * x).sum::<f64>() / 100.0).sqrt()).collect();
            root_mean_square(&errors).expect("errors")
        };
        let held = share(|seed| picture(seed).low <= 1.0 && picture(seed).high >= 1.0);
        assert!((0.93..=0.97).contains(&held), "pictures: {held}");
        // The error of one parameter: a normal's absolute value, the hardest case.
        let one = |seed: u64| root_mean_square(&normals(seed, 8)).expect("errors");
        let held = share(|seed| one(seed).low <= 1.0 && one(seed).high >= 1.0);
        assert!((0.86..=0.97).contains(&held), "single values: {held}");
        let times = |seed: u64| median(&normals(seed, 9).iter().map(|x| x.exp()).collect::<Vec<_>>()).expect("times");
        let held = share(|seed| times(seed).low <= 1.0 && times(seed).high >= 1.0);
        assert!(held >= 0.94, "medians: {held}");
    }

    #[test]
    fn one_more_trial_stays_below_the_limit_nineteen_times_of_twenty() {
        let held = share(|seed| {
            let all = normals(seed, 16);
            let mut scatter = LogScatter::default();
            all[..15].chunks(5).for_each(|group| scatter.add(group));
            let mean = all[..5].iter().sum::<f64>() / 5.0;
            scatter.upper_limit(mean, 5).expect("a scatter") >= all[15].exp()
        });
        assert!((0.94..=0.985).contains(&held), "{held}");
        assert_eq!(LogScatter::default().upper_limit(0.0, 1), None);
    }
}
