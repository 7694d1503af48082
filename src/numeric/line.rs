//! A straight line through points, with the uncertainty of its slope.

use super::estimate::Estimate;
use super::stats::student_quantile;

/// y = `intercept` + `slope`·x by least squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Value at x = 0.
    pub intercept: f64,
    /// Slope, with its 95 % interval.
    pub slope: Estimate,
}

impl Line {
    /// Through points (x, y, standard deviation of y), all counting alike. The slope's interval comes from how far points lie off the line, and
    /// from their own deviations where those say more. `None` below two different x.
    #[must_use]
    pub fn through(points: &[(f64, f64, f64)]) -> Option<Self> {
        let n = points.len() as f64;
        let mean = |of: fn(&(f64, f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
        let (x, y) = (mean(|p| p.0), mean(|p| p.1));
        let spread: f64 = points.iter().map(|p| (p.0 - x).powi(2)).sum();
        if !(spread > 0.0 && spread.is_finite()) {
            return None;
        }
        let slope = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / spread;
        let intercept = y - slope * x;
        let own = points.iter().map(|p| ((p.0 - x) * p.2).powi(2)).sum::<f64>().sqrt() / spread;
        let freedom = n - 2.0;
        let off = points.iter().map(|p| (p.1 - intercept - slope * p.0).powi(2)).sum::<f64>();
        let scattered =
            if freedom > 0.0 { student_quantile(0.975, freedom) * (off / freedom / spread).sqrt() } else { 0.0 };
        let reach = scattered.max(1.96 * own);
        Some(Self { intercept, slope: Estimate { value: slope, low: slope - reach, high: slope + reach } })
    }

    /// Value at x.
    #[must_use]
    pub fn at(&self, x: f64) -> f64 {
        self.intercept + self.slope.value * x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_and_their_errors_are_those_of_a_certified_regression() {
        // Anscombe's first quartet, slope 0.500091, its standard error 0.117906.
        let x = [10.0, 8.0, 13.0, 9.0, 11.0, 14.0, 6.0, 4.0, 12.0, 7.0, 5.0];
        let y = [8.04, 6.95, 7.58, 8.81, 8.33, 9.96, 7.24, 4.26, 10.84, 4.82, 5.68];
        let points: Vec<_> = x.iter().zip(y).map(|(x, y)| (*x, y, 0.0)).collect();
        let line = Line::through(&points).expect("a line");
        assert!((line.slope.value - 0.500_091).abs() < 1e-6 && (line.at(0.0) - 3.000_091).abs() < 1e-6, "{line:?}");
        let reach = (line.slope.high - line.slope.value) / student_quantile(0.975, 9.0);
        assert!((reach - 0.117_906).abs() < 1e-6, "{reach}");
    }

    #[test]
    fn the_points_own_deviations_count_where_they_lie_on_the_line() {
        let line = Line::through(&[(0.0, 0.0, 0.1), (1.0, 1.0, 0.1)]).expect("a line");
        // Each end's deviation moves the slope by itself.
        assert!((line.slope.high - 1.0 - 1.96 * 0.1 * 2f64.sqrt()).abs() < 1e-12, "{line:?}");
        assert_eq!(Line::through(&[(1.0, 0.0, 0.1), (1.0, 1.0, 0.1)]), None);
        assert_eq!(Line::through(&[]), None);
    }
}
