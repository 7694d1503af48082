//! Grids of directions and the solid angle that each of their nodes stands for.

use std::f64::consts::FRAC_PI_2;

/// Borders of the cells round sorted nodes: midpoints between neighbours, `low` and `high` at the ends.
#[must_use]
pub fn cell_borders(nodes: &[f64], low: f64, high: f64) -> Vec<f64> {
    let middle = nodes.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
    std::iter::once(low).chain(middle).chain(std::iter::once(high)).collect()
}

/// ∫ sinθ dθ over the cell round each sorted polar angle (rad) of a grid that covers [0, π/2]; the cells add up to 1.
/// Times the azimuth cell's width it is the cell's solid angle in sr.
#[must_use]
pub fn polar_cells(theta: &[f64]) -> Vec<f64> {
    let high = theta.last().copied().unwrap_or(0.0).max(FRAC_PI_2);
    cell_borders(theta, 0.0, high).windows(2).map(|b| cos_difference(b[0], b[1])).collect()
}

/// cos a − cos b = 2 sin((a + b)/2) sin((b − a)/2), without cancellation.
#[must_use]
pub fn cos_difference(a: f64, b: f64) -> f64 {
    2.0 * (0.5 * (a + b)).sin() * (0.5 * (b - a)).sin()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_a_polar_grid_add_up_to_the_hemisphere() {
        let theta: Vec<f64> = (0..18).map(|i| f64::from(i) * 5f64.to_radians()).collect();
        let sum: f64 = polar_cells(&theta).iter().sum();
        assert!((sum - 1.0).abs() < 1e-14, "{sum}");
        assert!(polar_cells(&[]).len() <= 1);
    }
}
