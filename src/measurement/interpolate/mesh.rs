//! Samples scattered over the plane, interpolated linearly over their Delaunay triangulation.
//!
//! The plane holds direction cosines (x, y) with y ≥ 0: what was measured on the other side of the plane of incidence is
//! folded over, and its mirror image takes part in the triangulation, so that the interpolant is continuous across y = 0.

use glam::{DMat2, DVec2};
use spade::{DelaunayTriangulation, HasPosition, HierarchyHintGenerator, Point2, Triangulation as _};

/// Samples closer than this (in direction cosines) are one sample, and their values are averaged.
const SAME_PLACE: f64 = 1e-6;
/// How far outside of a triangle, in barycentric coordinates, a point may lie and still belong to it: round-off.
const SLACK: f64 = 1e-9;

/// A triangulated set of samples with `channels` values each.
pub(super) struct Mesh {
    channels: usize,
    /// Places of the samples, y ≥ 0.
    pub(super) points: Vec<DVec2>,
    /// Sample by sample; NaN where a sample is masked.
    values: Vec<f64>,
    /// Standard deviation between samples at the same place, relative to their mean, averaged over such places.
    pub(super) disagreement: f64,
    triangles: Vec<Triangle>,
    buckets: Buckets,
}

struct Triangle {
    samples: [u32; 3],
    origin: DVec2,
    /// From a point relative to `origin` (sample 0) to the barycentric coordinates of samples 1 and 2.
    to_barycentric: DMat2,
}

#[derive(Clone, Copy)]
struct Vertex {
    position: Point2<f64>,
    sample: u32,
}

impl HasPosition for Vertex {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.position
    }
}

type Delaunay = DelaunayTriangulation<Vertex, (), (), (), HierarchyHintGenerator<f64>>;

impl Mesh {
    /// Triangulates samples at `points` (of the unit disc, y ≥ 0) with `channels` values each, sample by sample. A sample with
    /// a NaN is masked in all channels. `None` when nothing spans an area.
    pub(super) fn new(points: &[DVec2], values: &[f64], channels: usize) -> Option<Self> {
        let mut merged = Merged::new(channels);
        for (point, value) in points.iter().zip(values.chunks(channels)) {
            merged.add(*point, value)?;
        }
        let triangles: Vec<Triangle> = merged
            .delaunay
            .inner_faces()
            .filter_map(|face| Triangle::new(face.vertices().map(|v| *v.data())))
            .collect();
        if triangles.is_empty() {
            return None;
        }
        let buckets = Buckets::new(&triangles, &merged.points);
        let (values, disagreement) = merged.means();
        Some(Self { channels, points: merged.points, values, disagreement, triangles, buckets })
    }

    /// Values of sample `i`, NaN where masked.
    pub(super) fn sample(&self, i: usize) -> &[f64] {
        &self.values[i * self.channels..(i + 1) * self.channels]
    }

    /// Number of samples that are not masked.
    pub(super) fn valid(&self) -> usize {
        (0..self.points.len()).filter(|&i| !self.is_masked(i)).count()
    }

    fn is_masked(&self, i: usize) -> bool {
        self.values[i * self.channels].is_nan()
    }

    /// Adds `weight` times the interpolated values at `p` to `out` and returns the weight that was added: less than `weight`
    /// next to masked samples, which are left out, and 0 outside of the convex hull.
    pub(super) fn add_interpolated(&self, p: DVec2, weight: f64, out: &mut [f64]) -> f64 {
        let Some((triangle, barycentric)) = self.locate(p) else { return 0.0 };
        let mut added = 0.0;
        for (&sample, b) in triangle.samples.iter().zip(barycentric) {
            let i = sample as usize;
            let share = weight * b.max(0.0);
            if share > 0.0 && !self.is_masked(i) {
                added += share;
                out.iter_mut().zip(self.sample(i)).for_each(|(sum, value)| *sum += share * value);
            }
        }
        added
    }

    /// The triangle that holds `p`, with the barycentric coordinates.
    fn locate(&self, p: DVec2) -> Option<(&Triangle, [f64; 3])> {
        let mut best: Option<(&Triangle, [f64; 3])> = None;
        let mut best_inside = -SLACK;
        for &t in self.buckets.candidates(p)? {
            let triangle = &self.triangles[t as usize];
            let barycentric = triangle.barycentric(p);
            let inside = barycentric[0].min(barycentric[1]).min(barycentric[2]);
            if inside >= best_inside {
                best = Some((triangle, barycentric));
                best_inside = inside;
                if inside >= 0.0 {
                    break;
                }
            }
        }
        best
    }
}

impl Triangle {
    /// `None` for a triangle without area or on the mirrored side only.
    fn new(corners: [Vertex; 3]) -> Option<Self> {
        let [a, b, c] = corners.map(|v| DVec2::new(v.position.x, v.position.y));
        let edges = DMat2::from_cols(b - a, c - a);
        if a.y.max(b.y).max(c.y) <= 0.0 || edges.determinant().abs() < SAME_PLACE * SAME_PLACE {
            return None;
        }
        Some(Self { samples: corners.map(|v| v.sample), origin: a, to_barycentric: edges.inverse() })
    }

    fn barycentric(&self, p: DVec2) -> [f64; 3] {
        let b = self.to_barycentric * (p - self.origin);
        [1.0 - b.x - b.y, b.x, b.y]
    }

    fn corners(&self) -> [DVec2; 3] {
        let edges = self.to_barycentric.inverse();
        [self.origin, self.origin + edges.x_axis, self.origin + edges.y_axis]
    }
}

/// Samples on their way into a mesh: those at the same place in one.
struct Merged {
    delaunay: Delaunay,
    channels: usize,
    points: Vec<DVec2>,
    counts: Vec<u32>,
    sums: Vec<f64>,
    /// Σ v² of the first channel.
    squares: Vec<f64>,
}

impl Merged {
    fn new(channels: usize) -> Self {
        let delaunay = Delaunay::new();
        Self { delaunay, channels, points: vec![], counts: vec![], sums: vec![], squares: vec![] }
    }

    fn add(&mut self, point: DVec2, value: &[f64]) -> Option<()> {
        let folded = if point.y.abs() < SAME_PLACE { DVec2::new(point.x, 0.0) } else { point };
        let i = match self.nearest(folded) {
            Some(i) => i,
            None => self.insert(folded)?,
        };
        if value.iter().all(|v| v.is_finite()) {
            self.counts[i] += 1;
            let start = i * self.channels;
            self.sums[start..start + self.channels].iter_mut().zip(value).for_each(|(sum, v)| *sum += v);
            self.squares[i] += value[0] * value[0];
        }
        Some(())
    }

    /// The sample at the same place.
    fn nearest(&self, p: DVec2) -> Option<usize> {
        let vertex = self.delaunay.nearest_neighbor(Point2::new(p.x, p.y))?;
        let at = vertex.position();
        (DVec2::new(at.x, at.y).distance(p) < SAME_PLACE).then_some(vertex.data().sample as usize)
    }

    fn insert(&mut self, p: DVec2) -> Option<usize> {
        let sample = u32::try_from(self.points.len()).ok()?;
        self.delaunay.insert(Vertex { position: Point2::new(p.x, p.y), sample }).ok()?;
        if p.y > 0.0 {
            self.delaunay.insert(Vertex { position: Point2::new(p.x, -p.y), sample }).ok()?;
        }
        self.points.push(p);
        self.counts.push(0);
        self.squares.push(0.0);
        self.sums.resize(self.sums.len() + self.channels, 0.0);
        Some(sample as usize)
    }

    /// Mean values sample by sample, NaN where nothing was added; and the disagreement of samples at the same place.
    fn means(&self) -> (Vec<f64>, f64) {
        let count = |i: usize| f64::from(self.counts[i]);
        // 0/0 is the NaN that marks a sample as masked.
        let means = self.sums.iter().enumerate().map(|(k, sum)| sum / count(k / self.channels)).collect();
        let (mut deviation, mut level) = (0.0, 0.0);
        for i in (0..self.points.len()).filter(|&i| self.counts[i] > 1) {
            let mean = self.sums[i * self.channels] / count(i);
            deviation += (self.squares[i] / count(i) - mean * mean).max(0.0).sqrt();
            level += mean.abs();
        }
        (means, if level > 0.0 { deviation / level } else { 0.0 })
    }
}

/// A regular grid over the box of the samples; each cell lists the triangles that may reach into it.
struct Buckets {
    low: DVec2,
    per_cell: DVec2,
    columns: usize,
    rows: usize,
    starts: Vec<u32>,
    entries: Vec<u32>,
}

impl Buckets {
    /// About four cells a triangle.
    fn new(triangles: &[Triangle], points: &[DVec2]) -> Self {
        let low = DVec2::new(points.iter().fold(f64::INFINITY, |m, p| m.min(p.x)), 0.0);
        let high = points.iter().fold(DVec2::splat(f64::NEG_INFINITY), |m, p| m.max(*p));
        let rows = ((2.0 * triangles.len() as f64).sqrt() as usize).clamp(4, 256);
        let columns = 2 * rows;
        let per_cell = DVec2::new(columns as f64, rows as f64) / (high - low).max(DVec2::splat(SAME_PLACE));
        let mut grid = Self { low, per_cell, columns, rows, starts: vec![0; columns * rows + 1], entries: vec![] };
        let boxes: Vec<_> = triangles.iter().map(|t| grid.reach(&t.corners())).collect();
        for_each_cell(&boxes, columns, |cell, _| grid.starts[cell + 1] += 1);
        for cell in 1..grid.starts.len() {
            grid.starts[cell] += grid.starts[cell - 1];
        }
        let mut next = grid.starts.clone();
        grid.entries = vec![0; grid.starts.last().map_or(0, |&n| n as usize)];
        for_each_cell(&boxes, columns, |cell, t| {
            grid.entries[next[cell] as usize] = t as u32;
            next[cell] += 1;
        });
        grid
    }

    /// First and last (column, row) that a triangle's box, a little enlarged, touches.
    fn reach(&self, corners: &[DVec2; 3]) -> [(usize, usize); 2] {
        let [a, b, c] = *corners;
        let slack = DVec2::splat(1e-7);
        [self.clamped(a.min(b).min(c) - slack), self.clamped(a.max(b).max(c) + slack)]
    }

    fn clamped(&self, p: DVec2) -> (usize, usize) {
        let cell = (p - self.low) * self.per_cell; // a negative float casts to 0
        ((cell.x as usize).min(self.columns - 1), (cell.y as usize).min(self.rows - 1))
    }

    /// The triangles that may hold `p`; `None` well outside.
    fn candidates(&self, p: DVec2) -> Option<&[u32]> {
        let cell = (p - self.low) * self.per_cell;
        let limit = DVec2::new(self.columns as f64, self.rows as f64) + DVec2::splat(1e-3);
        if !(cell.x >= -1e-3 && cell.y >= -1e-3 && cell.x <= limit.x && cell.y <= limit.y) {
            return None;
        }
        let (column, row) = self.clamped(p);
        let cell = row * self.columns + column;
        Some(&self.entries[self.starts[cell] as usize..self.starts[cell + 1] as usize])
    }
}

fn for_each_cell(boxes: &[[(usize, usize); 2]], columns: usize, mut visit: impl FnMut(usize, usize)) {
    for (t, [low, high]) in boxes.iter().enumerate() {
        for row in low.1..=high.1 {
            for column in low.0..=high.0 {
                visit(row * columns + column, t);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::{Purpose, RngExt, stream};

    fn scattered(n: u64) -> Vec<DVec2> {
        let mut rng = stream(3, Purpose::Study, n);
        let draw = || DVec2::new(2.0 * rng.random::<f64>() - 1.0, rng.random::<f64>());
        std::iter::repeat_with(draw).filter(|p| p.length() < 1.0).take(n as usize).collect()
    }

    #[test]
    fn a_linear_function_of_x_comes_back_everywhere_inside_and_nothing_outside() {
        let points = scattered(500);
        let values: Vec<f64> = points.iter().map(|p| 2.0 + 3.0 * p.x).collect();
        let mesh = Mesh::new(&points, &values, 1).expect("a mesh");
        let mut inside = 0;
        for p in scattered(20_000) {
            let mut out = [0.0];
            let added = mesh.add_interpolated(p, 1.0, &mut out);
            if added > 0.0 {
                inside += 1;
                assert!((added - 1.0).abs() < 1e-8 && (out[0] - (2.0 + 3.0 * p.x)).abs() < 1e-8, "{p}: {out:?}");
            }
        }
        assert!(inside > 19_000, "{inside}");
        for p in [DVec2::new(-1.1, 0.2), DVec2::new(0.8, 0.8), DVec2::new(0.0, 1.2), DVec2::new(f64::NAN, 0.1)] {
            assert!(mesh.locate(p).is_none(), "{p}");
        }
    }

    #[test]
    fn samples_come_back_at_their_places_and_those_at_one_place_as_their_mean() {
        let mut points = scattered(300);
        let mut values: Vec<f64> = points.iter().map(|p| (9.0 * p.x).sin() + p.y).collect();
        points.push(points[7] + DVec2::new(1e-9, -1e-9));
        values.push(values[7] + 1.0);
        let mesh = Mesh::new(&points, &values, 1).expect("a mesh");
        for (i, p) in mesh.points.iter().enumerate() {
            let mut out = [0.0];
            mesh.add_interpolated(*p, 1.0, &mut out);
            let want = values[i] + if i == 7 { 0.5 } else { 0.0 };
            assert!((out[0] - want).abs() < 1e-8, "{i}: {} vs {want}", out[0]);
        }
        assert!(mesh.disagreement > 0.0);
    }

    #[test]
    fn masked_samples_take_no_part_and_hide_what_only_they_reach() {
        let points: Vec<DVec2> = (0..11)
            .flat_map(|i| (0..6).map(move |j| DVec2::new(f64::from(i) / 5.0 - 1.0, f64::from(j) / 5.0)))
            .collect();
        let masked = |p: DVec2| p.x > 0.1 && p.y < 0.7;
        let values: Vec<f64> = points.iter().map(|&p| if masked(p) { f64::NAN } else { 1.0 }).collect();
        let mesh = Mesh::new(&points, &values, 1).expect("a mesh");
        assert_eq!(mesh.valid(), values.iter().filter(|v| !v.is_nan()).count());
        let mut out = [0.0];
        assert!(mesh.add_interpolated(DVec2::new(0.5, 0.3), 1.0, &mut out) <= 0.0);
        let added = mesh.add_interpolated(DVec2::new(0.15, 0.3), 1.0, &mut out);
        assert!(added > 0.0 && added < 1.0 && (out[0] / added - 1.0).abs() < 1e-12, "{added} {out:?}");
    }

    #[test]
    fn points_on_a_line_have_no_mesh() {
        let line: Vec<DVec2> = (0..20).map(|i| DVec2::new(f64::from(i) / 20.0, 0.0)).collect();
        assert!(Mesh::new(&line, &[1.0; 20], 1).is_none());
        assert!(Mesh::new(&[], &[], 1).is_none());
    }
}
