//! Lobes as powers: what the transforms make sums of.

use nalgebra::DMatrix;

use super::passes::ShapedLobe;

/// A lobe constant·e^{nx}; without an exponent, a constant on all samples.
pub(super) struct PowerLobe {
    pub exponent: Option<f64>,
}

/// A column (constant + linear·x)·e^{nx}: a lobe or its slope by t.
pub(super) struct PowerColumn {
    pub lobe: usize,
    pub constant: f64,
    pub linear: f64,
}

pub(super) struct PowerColumns {
    pub lobes: Vec<PowerLobe>,
    pub list: Vec<PowerColumn>,
}

impl PowerColumns {
    pub fn new(lobes: &[ShapedLobe], slopes: bool) -> Self {
        let (mut powers, mut values, mut derivatives) = (Vec::new(), Vec::new(), Vec::new());
        for (lobe, shaped) in lobes.iter().enumerate() {
            let exponent = shaped.shape.first().copied();
            let norm = exponent.and_then(|n| shaped.kind.lobe().power(n));
            let constant = norm.map_or_else(|| shaped.kind.lobe().value(&[], 0.0, &mut []), |(c, _)| c);
            values.push(PowerColumn { lobe, constant, linear: 0.0 });
            if let (true, Some(n), Some((norm, slope))) = (slopes, exponent, norm) {
                derivatives.push(PowerColumn { lobe, constant: n * slope, linear: n * norm });
            }
            powers.push(PowerLobe { exponent });
        }
        Self { lobes: powers, list: values.into_iter().chain(derivatives).collect() }
    }

    /// Writes the sums of products of the columns of lobes `a` and `b` from the transform's jet at the sum of their exponents.
    pub fn products(&self, a: usize, b: usize, jet: &[f64; 3], gram: &mut DMatrix<f64>) {
        for (i, first) in self.list.iter().enumerate().filter(|(_, column)| column.lobe == a) {
            for (j, second) in self.list.iter().enumerate().filter(|(_, column)| column.lobe == b) {
                let cross = first.constant * second.linear + first.linear * second.constant;
                let sum =
                    first.constant * second.constant * jet[0] + cross * jet[1] + first.linear * second.linear * jet[2];
                gram[(i, j)] = sum;
                gram[(j, i)] = sum;
            }
        }
    }
}
