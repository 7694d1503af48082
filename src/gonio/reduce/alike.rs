//! What independent errors do to all channels of a reading alike: the one pattern that carries most of them.

use nalgebra::DMatrix;

/// Of the changes that errors of σ 1 make, `patterns[channel][error]`, the combination of errors that explains most of every channel's share: 1 σ of it,
/// signed, channel by channel. It has no more variance in any channel than all errors together.
pub(super) fn alike(patterns: &[Vec<f64>]) -> Vec<f64> {
    let errors = patterns.first().map_or(0, Vec::len);
    if errors == 0 {
        return vec![0.0; patterns.len()];
    }
    // Channels count alike, however bright they are.
    let scale = |pattern: &Vec<f64>| {
        let size = pattern.iter().map(|u| u * u).sum::<f64>().sqrt();
        if size > 0.0 { size.recip() } else { 0.0 }
    };
    let rows = DMatrix::from_fn(patterns.len(), errors, |c, k| patterns[c][k] * scale(&patterns[c]));
    let eigen = (rows.transpose() * rows).symmetric_eigen();
    let strongest = (0..errors).max_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let Some(strongest) = strongest else { return vec![0.0; patterns.len()] };
    let vector = eigen.eigenvectors.column(strongest);
    patterns.iter().map(|pattern| pattern.iter().zip(vector.iter()).map(|(u, v)| u * v).sum()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One error in proportion in all channels is all alike; of two that differ in a third channel the common one is found, and nothing exceeds a
    /// channel's own.
    #[test]
    fn what_is_in_proportion_is_alike() {
        let found = alike(&[vec![0.3, 0.4], vec![-3.0, -4.0], vec![0.0, 0.0]]);
        assert!((found[0].abs() - 0.5).abs() < 1e-12 && (found[0] * found[1] + 2.5).abs() < 1e-12 && found[2] == 0.0);
        let patterns = [vec![1.0, 0.1], vec![2.0, 0.2], vec![0.1, 1.0]];
        let found = alike(&patterns);
        assert!((found[0] * found[1] / 2.02 - 1.0).abs() < 0.05, "{found:?}");
        let size = |p: &Vec<f64>| p.iter().map(|u| u * u).sum::<f64>();
        assert!(patterns.iter().zip(&found).all(|(p, u)| u * u <= size(p) * (1.0 + 1e-12)));
        assert!(alike(&[]).is_empty() && alike(&[vec![], vec![]]) == [0.0, 0.0]);
    }
}
