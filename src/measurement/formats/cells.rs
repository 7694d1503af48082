//! Solid angles of the cells of a goniometer's grid: a node stands for everything nearer to it than to its neighbours, and
//! an outermost node reaches as far outwards as inwards.

use std::f64::consts::{FRAC_PI_2, TAU};

use crate::geometry::grid::{cell_borders, cos_difference};

/// ∫ sinθ dθ over the cell round each ascending polar angle (deg); cells stay within [0°, 90°], or within the nodes where these
/// reach further. A single node stands for the whole hemisphere.
pub(super) fn polar(theta_deg: &[f64]) -> Vec<f64> {
    let theta: Vec<f64> = theta_deg.iter().map(|t| t.to_radians()).collect();
    let (low, high) = match theta.as_slice() {
        [first, second, ..] => {
            let last_step = theta.windows(2).last().map_or(0.0, |w| w[1] - w[0]);
            let last = theta.last().copied().unwrap_or(FRAC_PI_2);
            ((first - 0.5 * (second - first)).max(0.0), (last + 0.5 * last_step).min(FRAC_PI_2.max(last)))
        }
        _ => (0.0, FRAC_PI_2),
    };
    cell_borders(&theta, low, high).windows(2).map(|b| cos_difference(b[0], b[1])).collect()
}

/// Width (rad) of the azimuth cell round each ascending node (deg). With `mirrored` the nodes cover [0°, 180°] and each
/// stands for its mirror image too; else they go round the circle. Either way the widths add up to 2π.
pub(super) fn azimuth(phi_deg: &[f64], mirrored: bool) -> Vec<f64> {
    if mirrored {
        let borders = cell_borders(phi_deg, 0.0, 180.0);
        return borders.windows(2).map(|b| 2.0 * (b[1] - b[0]).to_radians()).collect();
    }
    let n = phi_deg.len();
    if n == 1 {
        return vec![TAU];
    }
    let gap = |i: usize| if i + 1 < n { phi_deg[i + 1] - phi_deg[i] } else { phi_deg[0] + 360.0 - phi_deg[i] };
    (0..n).map(|i| 0.5 * (gap((i + n - 1) % n) + gap(i)).to_radians()).collect()
}

/// The first place at which `nodes` do not ascend: (index, value).
pub(super) fn not_ascending(nodes: &[f64]) -> Option<(usize, f64)> {
    nodes.windows(2).position(|w| w[1] <= w[0]).map(|i| (i + 1, nodes[i + 1]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn cells_fill_what_the_nodes_cover() {
        let sum = |w: &[f64]| w.iter().sum::<f64>();
        // 0° to 82.5°: 1 − cos 82.5°.
        let theta: Vec<f64> = (0..17).map(|i| 5.0 * f64::from(i)).collect();
        assert!((sum(&polar(&theta)) - (1.0 - 82.5f64.to_radians().cos())).abs() < 1e-14);
        assert!((sum(&polar(&[10.0, 30.0, 50.0, 70.0])) - (1.0 - 80f64.to_radians().cos())).abs() < 1e-14);
        assert!((sum(&polar(&[0.0, 30.0, 90.0])) - 1.0).abs() < 1e-14);
        assert!((sum(&polar(&[45.0])) - 1.0).abs() < 1e-14);
        let half: Vec<f64> = (0..19).map(|i| 10.0 * f64::from(i)).collect();
        assert!((sum(&azimuth(&half, true)) - TAU).abs() < 1e-14);
        for turn in [vec![0.0, 90.0, 180.0, 270.0], vec![0.0, 10.0, 200.0, 360.0], vec![5.0], vec![-170.0, 0.0, 20.0]] {
            let widths = azimuth(&turn, false);
            assert!((sum(&widths) - TAU).abs() < 1e-14 && widths.iter().all(|w| *w > 0.0), "{turn:?}: {widths:?}");
        }
        assert!((azimuth(&[0.0, 90.0], false)[0] - PI).abs() < 1e-15);
    }

    #[test]
    fn disorder_is_found_where_it_starts() {
        assert_eq!(not_ascending(&[0.0, 5.0, 5.0, 7.0]), Some((2, 5.0)));
        assert_eq!(not_ascending(&[0.0, 5.0]), None);
    }
}
