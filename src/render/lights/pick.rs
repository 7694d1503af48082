//! Picking an item in proportion to its weight.

/// The step of a running sum in which the share u of its height lies, and how far through it, 0 to 1. A step of height 0 is never picked.
pub fn pick(sums: &[f64], u: f64) -> (usize, f64) {
    let total = sums.last().copied().unwrap_or(0.0);
    let target = u * total;
    let index = if target < total {
        sums.partition_point(|sum| *sum <= target)
    } else {
        sums.partition_point(|sum| *sum < total) // rounded up: the last step that has a height
    };
    let low = if index == 0 { 0.0 } else { sums.get(index - 1).copied().unwrap_or(0.0) };
    let high = sums.get(index).copied().unwrap_or(low);
    (index, ((target - low) / (high - low)).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_without_height_are_never_picked() {
        let sums = [0.0, 0.0, 2.0, 2.0, 3.0, 3.0];
        for (u, index, share) in
            [(0.0, 2, 0.0), (0.5, 2, 0.75), (2.0 / 3.0, 4, 0.0), (1.0f64.next_down(), 4, 1.0), (1.0, 4, 1.0)]
        {
            let (i, t) = pick(&sums, u);
            assert!(i == index && (t - share).abs() < 1e-12, "u {u}: {i}, {t}");
        }
    }
}
