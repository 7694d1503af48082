//! Tables on the unit square that depend on the incidence: plain interpolation, and the warp that a density defines.
//!
//! A density is given at the nodes of an `nx` × `ny` grid for each slice (one per incidence of the file), bilinear between
//! them; between incidences slices are mixed linearly, each normalised first. The warp is the inversion method: a marginal
//! over rows (y), then a conditional along the row (x). Everything it needs is linear in the density, so a mix of slices is
//! warped by mixing their cumulative sums.

use glam::DVec2;

/// A few slices of a table and their weights, which add up to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Mix {
    slices: [(usize, f64); 4],
    len: usize,
}

impl Mix {
    /// One slice alone.
    pub fn one(slice: usize) -> Self {
        Self { slices: [(slice, 1.0); 4], len: 1 }
    }

    /// Slices with weight 0 are left out: they are never looked at, whatever they hold.
    pub fn new(parts: impl IntoIterator<Item = (usize, f64)>) -> Self {
        let mut mix = Self { slices: [(0, 0.0); 4], len: 0 };
        for part in parts.into_iter().filter(|part| part.1 > 0.0) {
            if let Some(slot) = mix.slices.get_mut(mix.len) {
                *slot = part;
                mix.len += 1;
            }
        }
        mix
    }

    /// (slice, weight) of every part.
    pub fn parts(&self) -> &[(usize, f64)] {
        &self.slices[..self.len]
    }
}

/// Index of the interval of the sorted `nodes` that holds `x`, and the place in it (0 to 1), clamped at the ends.
pub(super) fn interval(nodes: &[f64], x: f64) -> (usize, f64) {
    let last = nodes.len().saturating_sub(2);
    let i = nodes.partition_point(|&node| node <= x).saturating_sub(1).min(last);
    match (nodes.get(i), nodes.get(i + 1)) {
        (Some(a), Some(b)) => (i, ((x - a) / (b - a)).clamp(0.0, 1.0)),
        _ => (0, 0.0),
    }
}

/// A cell of a grid and the place in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cell {
    pub i: usize,
    pub j: usize,
    pub fx: f64,
    pub fy: f64,
}

impl Cell {
    /// The cell of an `nx` × `ny` grid (both at least 2) over the unit square that holds `u`.
    pub fn at(nx: usize, ny: usize, u: DVec2) -> Self {
        let split = |x: f64, n: usize| {
            let scaled = x.clamp(0.0, 1.0) * (n - 1) as f64;
            let i = (scaled as usize).min(n - 2);
            (i, scaled - i as f64)
        };
        let ((i, fx), (j, fy)) = (split(u.x, nx), split(u.y, ny));
        Self { i, j, fx, fy }
    }

    /// The four corners' offsets in x and y, and the weights of bilinear interpolation.
    pub fn corners(&self) -> [(usize, usize, f64); 4] {
        let (fx, fy) = (self.fx, self.fy);
        [
            (self.i, self.j, (1.0 - fx) * (1.0 - fy)),
            (self.i + 1, self.j, fx * (1.0 - fy)),
            (self.i, self.j + 1, (1.0 - fx) * fy),
            (self.i + 1, self.j + 1, fx * fy),
        ]
    }
}

/// Values at the nodes of a grid over the unit square, `channels` side by side, bilinear between the nodes.
#[derive(Debug, Clone)]
pub(super) struct Table {
    pub nx: usize,
    pub ny: usize,
    pub channels: usize,
    /// Slice by slice, row by row, node by node, channel by channel.
    pub values: Vec<f32>,
}

impl Table {
    /// Values of node (i, j) of a slice.
    pub fn node(&self, slice: usize, i: usize, j: usize) -> &[f32] {
        let start = ((slice * self.ny + j) * self.nx + i) * self.channels;
        &self.values[start..start + self.channels]
    }

    /// Adds the interpolated values at `u`, times `scale`, to `out`.
    pub fn add_at(&self, u: DVec2, mix: &Mix, scale: f64, out: &mut [f64]) {
        let corners = Cell::at(self.nx, self.ny, u).corners();
        for &(slice, share) in mix.parts() {
            for (i, j, weight) in corners {
                let weight = weight * share * scale;
                if weight != 0.0 {
                    for (o, &v) in out.iter_mut().zip(self.node(slice, i, j)) {
                        *o += weight * f64::from(v);
                    }
                }
            }
        }
    }

    /// The interpolated value at `u` of a table of one slice and one channel.
    pub fn scalar(&self, u: DVec2) -> f64 {
        let mut out = [0.0];
        self.add_at(u, &Mix::one(0), 1.0, &mut out);
        out[0]
    }
}

/// Which slice of a density can't be normalised: it is zero everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ZeroSlice(pub usize);

/// A conditional density on the unit square with its warp. Each slice integrates to 1.
#[derive(Debug, Clone)]
pub(super) struct Warp {
    nx: usize,
    ny: usize,
    density: Vec<f64>,
    /// ∫ density along a row from x = 0 to each node.
    conditional: Vec<f64>,
    /// ∫ of whole rows from y = 0 to each row.
    marginal: Vec<f64>,
}

impl Warp {
    /// Samples nearer than this to the border of the unit square are moved in: where the density has zero rows at its border
    /// the warp is then their limit from inside.
    const INSET: f64 = 1.0 / (1u64 << 40) as f64;

    /// From non-negative finite `values` (slice by slice, row by row); `nx`, `ny` ≥ 2.
    pub fn new(nx: usize, ny: usize, values: &[f32]) -> Result<Self, ZeroSlice> {
        let mut warp = Self {
            nx,
            ny,
            density: values.iter().map(|&v| f64::from(v)).collect(),
            conditional: vec![0.0; values.len()],
            marginal: vec![0.0; values.len() / nx],
        };
        let slices = warp.density.chunks_exact_mut(nx * ny).zip(warp.conditional.chunks_exact_mut(nx * ny));
        for (k, ((density, conditional), marginal)) in slices.zip(warp.marginal.chunks_exact_mut(ny)).enumerate() {
            for (row, sums) in density.chunks_exact(nx).zip(conditional.chunks_exact_mut(nx)) {
                cumulate(row.iter().copied(), sums);
            }
            cumulate(conditional.chunks_exact(nx).map(|sums| sums[nx - 1]), marginal);
            let total = marginal[ny - 1];
            if total.is_nan() || total <= 0.0 {
                return Err(ZeroSlice(k));
            }
            density.iter_mut().chain(conditional).chain(marginal).for_each(|v| *v /= total);
        }
        Ok(warp)
    }

    /// Cells of the grid in x and y.
    pub fn cells(&self) -> (usize, usize) {
        (self.nx - 1, self.ny - 1)
    }

    /// Density at `u`.
    pub fn density(&self, u: DVec2, mix: &Mix) -> f64 {
        let cell = Cell::at(self.nx, self.ny, u);
        let (left, right) = self.edges(&cell, mix);
        lerp(cell.fx, left, right)
    }

    /// The uniform sample that the warp takes to `u`, and the density at `u`.
    pub fn invert(&self, u: DVec2, mix: &Mix) -> (DVec2, f64) {
        let cell = Cell::at(self.nx, self.ny, u);
        let (left, right) = self.edges(&cell, mix);
        let (mut below, mut low, mut high, mut rows_below) = (0.0, 0.0, 0.0, 0.0);
        for &(slice, share) in mix.parts() {
            let start = (slice * self.ny + cell.j) * self.nx;
            let rows = &self.conditional[start..start + 2 * self.nx];
            below += share * lerp(cell.fy, rows[cell.i], rows[self.nx + cell.i]);
            low += share * rows[self.nx - 1];
            high += share * rows[2 * self.nx - 1];
            rows_below += share * self.marginal[slice * self.ny + cell.j];
        }
        let row = lerp(cell.fy, low, high);
        let along = below + trapezoid(left, right, cell.fx) / (self.nx - 1) as f64;
        // A row without any density has no inverse: any x serves.
        let x = if row > 0.0 { along / row } else { u.x };
        let y = rows_below + trapezoid(low, high, cell.fy) / (self.ny - 1) as f64;
        (DVec2::new(x, y).clamp(DVec2::ZERO, DVec2::ONE), lerp(cell.fx, left, right))
    }

    /// The point that the uniform sample `s` is taken to, and the density there.
    pub fn sample(&self, s: DVec2, mix: &Mix) -> (DVec2, f64) {
        let s = s.clamp(DVec2::splat(Self::INSET), DVec2::splat(1.0 - Self::INSET));
        let mixed = |table: &[f64], stride: usize, at: usize| -> f64 {
            mix.parts().iter().map(|&(slice, share)| share * table[slice * stride + at]).sum()
        };
        let (nx, ny) = (self.nx, self.ny);

        let marginal = |j: usize| mixed(&self.marginal, ny, j);
        let j = last_at_most(ny, s.y, marginal);
        let row_sum = |j: usize| mixed(&self.conditional, nx * ny, j * nx + nx - 1);
        let (low, high) = (row_sum(j), row_sum(j + 1));
        let fy = inverse_trapezoid(low, high, (s.y - marginal(j)) * (ny - 1) as f64);

        let start = j * nx;
        let conditional = |i: usize| {
            let at = |k: usize| mixed(&self.conditional, nx * ny, k);
            lerp(fy, at(start + i), at(start + nx + i))
        };
        let target = s.x * lerp(fy, low, high);
        let i = last_at_most(nx, target, conditional);
        let (left, right) = self.edges(&Cell { i, j, fx: 0.0, fy }, mix);
        let fx = inverse_trapezoid(left, right, (target - conditional(i)) * (nx - 1) as f64);

        let u = DVec2::new((i as f64 + fx) / (nx - 1) as f64, (j as f64 + fy) / (ny - 1) as f64);
        (u, lerp(fx, left, right))
    }

    /// Density on the left and right edge of a cell at height `fy`.
    fn edges(&self, cell: &Cell, mix: &Mix) -> (f64, f64) {
        let (mut left, mut right) = (0.0, 0.0);
        for &(slice, share) in mix.parts() {
            let start = (slice * self.ny + cell.j) * self.nx + cell.i;
            let nodes = &self.density[start..start + self.nx + 2];
            left += share * lerp(cell.fy, nodes[0], nodes[self.nx]);
            right += share * lerp(cell.fy, nodes[1], nodes[self.nx + 1]);
        }
        (left, right)
    }
}

/// Cumulative trapezoid sums of values at equidistant nodes over [0, 1].
fn cumulate(values: impl Iterator<Item = f64>, sums: &mut [f64]) {
    let step = 1.0 / (sums.len() - 1) as f64;
    let (mut sum, mut previous) = (0.0, None);
    for (value, out) in values.zip(sums) {
        sum += previous.map_or(0.0, |p: f64| 0.5 * step * (p + value));
        previous = Some(value);
        *out = sum;
    }
}

fn lerp(t: f64, a: f64, b: f64) -> f64 {
    (1.0 - t) * a + t * b
}

/// ∫₀ˣ (a + (b − a) t) dt.
fn trapezoid(a: f64, b: f64, x: f64) -> f64 {
    x * (a + 0.5 * x * (b - a))
}

/// The x in [0, 1] with ∫₀ˣ (a + (b − a) t) dt = `area`, for a, b ≥ 0: the root in the form that does not cancel.
fn inverse_trapezoid(a: f64, b: f64, area: f64) -> f64 {
    let discriminant = a * a + 2.0 * area * (b - a);
    let denominator = a + discriminant.clamp(0.0, f64::INFINITY).sqrt();
    if denominator > 0.0 { (2.0 * area / denominator).clamp(0.0, 1.0) } else { 0.0 }
}

/// The largest i in 0..=n − 2 with f(i) ≤ x for the non-decreasing f, 0 if there is none.
fn last_at_most(n: usize, x: f64, f: impl Fn(usize) -> f64) -> usize {
    let (mut low, mut high) = (0, n - 1);
    while high - low > 1 {
        let middle = usize::midpoint(low, high);
        if f(middle) <= x { low = middle } else { high = middle }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two slices of 5 × 4 nodes, one with a zero row and a zero column at its border.
    fn warp() -> Warp {
        let bumpy = (0..20).map(|k| 1.0 + ((k * 7) % 5) as f32);
        let edged = (0..20).map(|k| if k < 5 || k % 5 == 0 { 0.0 } else { (k % 3) as f32 + 0.5 });
        Warp::new(5, 4, &bumpy.chain(edged).collect::<Vec<_>>()).expect("positive")
    }

    fn mixes() -> [Mix; 3] {
        [Mix::one(0), Mix::one(1), Mix::new([(0, 0.3), (1, 0.7)])]
    }

    #[test]
    fn sample_and_invert_undo_each_other() {
        let warp = warp();
        for mix in mixes() {
            for a in 0..=40 {
                for b in 0..=40 {
                    let s = DVec2::new(f64::from(a) / 40.0, f64::from(b) / 40.0);
                    let (u, density) = warp.sample(s, &mix);
                    let (back, again) = warp.invert(u, &mix);
                    assert!((back - s).abs().max_element() < 4.0 * Warp::INSET, "{s} → {u} → {back}");
                    assert!((density - again).abs() < 1e-9 * density.max(1.0), "{density} vs {again}");
                    assert!((density - warp.density(u, &mix)).abs() < 1e-9 * density.max(1.0));
                }
            }
        }
    }

    #[test]
    fn the_density_is_the_warp_s_jacobian() {
        // The image of a small square of side h in u has area density·h² in s, to O(h²) relative.
        let (warp, h) = (warp(), 1e-4);
        for mix in mixes() {
            for (x, y) in [(0.31, 0.42), (0.55, 0.81), (0.9, 0.15), (0.12, 0.6)] {
                let at = |dx: f64, dy: f64| warp.invert(DVec2::new(x + dx * h, y + dy * h), &mix).0;
                let (e1, e2) = (at(0.5, 0.0) - at(-0.5, 0.0), at(0.0, 0.5) - at(0.0, -0.5));
                let area = e1.perp_dot(e2) / (h * h);
                let density = warp.density(DVec2::new(x, y), &mix);
                assert!((area / density - 1.0).abs() < 1e-6, "{area} vs {density}");
            }
        }
    }

    #[test]
    fn every_slice_integrates_to_one() {
        let warp = warp();
        for mix in mixes() {
            // Bilinear: the mean over a cell is the value at its centre.
            let centres = (0..12).map(|k| DVec2::new((f64::from(k % 4) + 0.5) / 4.0, (f64::from(k / 4) + 0.5) / 3.0));
            let mean = centres.map(|u| warp.density(u, &mix)).sum::<f64>() / 12.0;
            assert!((mean - 1.0).abs() < 1e-14, "{mean}");
        }
        assert_eq!(Warp::new(2, 2, &[1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]).err(), Some(ZeroSlice(1)));
    }

    #[test]
    fn intervals_clamp_at_the_ends() {
        let nodes = [0.0, 1.0, 3.0];
        assert_eq!(interval(&nodes, -1.0), (0, 0.0));
        assert_eq!(interval(&nodes, 2.0), (1, 0.5));
        assert_eq!(interval(&nodes, 3.0), (1, 1.0));
        assert_eq!(interval(&nodes, 9.0), (1, 1.0));
        assert_eq!(interval(&[0.5], 9.0), (0, 0.0));
    }
}
