//! Which part of a picture of the sky lights a surface: its blocks in a tree, drawn in proportion to their light times the cosine.
//!
//! A node knows the light's mean direction m (the mean of its blocks' middles weighted by their light) and a radius r within which all of its directions lie
//! about m. For a unit normal n, what the node gives is its light times n·m where all of it is above the horizon (n·m ≥ r); nothing where
//! n·m ≤ −r; between them (n·m + r)²/4r, which joins both smoothly. A leaf is drawn by going down, at each fork in proportion to what the
//! branches give, with the number that was drawn stretched again: even points stay even.

use glam::{DVec2, DVec3, Vec3};

use super::lat_long::LatLong;

/// Leaves at most.
const MOST_LEAVES: usize = 1 << 13;
/// Added to a radius: more than f32 loses in n·m.
const ROUNDING: f32 = 2e-6;

/// Light of a range of blocks.
#[derive(Debug, Clone, Copy, Default)]
struct Node {
    mean: Vec3,
    reach: f32,
    /// ∫ brightness dω, as a share of the picture's.
    light: f64,
    /// Its first half; the second follows. 0 for a leaf.
    halves: u32,
}

impl Node {
    /// About the irradiance that it gives a surface with this normal, as a share.
    #[inline]
    fn gives(&self, normal: Vec3) -> f64 {
        let c = normal.dot(self.mean);
        let above = if c >= self.reach { c } else { (c + self.reach).max(0.0).powi(2) / (4.0 * self.reach) };
        self.light * f64::from(above)
    }
}

/// Columns and rows of blocks, the ends not included.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Range {
    columns: (usize, usize),
    rows: (usize, usize),
}

impl Range {
    fn is_leaf(&self) -> bool {
        self.columns.1 - self.columns.0 == 1 && self.rows.1 - self.rows.0 == 1
    }

    /// Both halves, and whether they lie below each other.
    fn halves(&self) -> (Self, Self, bool) {
        let (columns, rows) = (self.columns, self.rows);
        let by_rows = rows.1 - rows.0 >= columns.1 - columns.0;
        let (from, to) = if by_rows { rows } else { columns };
        let middle = usize::midpoint(from, to);
        if by_rows {
            (Self { columns, rows: (from, middle) }, Self { columns, rows: (middle, to) }, true)
        } else {
            (Self { columns: (from, middle), rows }, Self { columns: (middle, to), rows }, false)
        }
    }
}

/// The tree over a picture's blocks of cells.
#[derive(Debug)]
pub struct Above {
    nodes: Vec<Node>,
    whole: Range,
    /// Cells along the side of a block.
    block: usize,
}

/// A block that was drawn.
#[derive(Debug, Clone, Copy)]
pub struct Drawn {
    /// Columns of cells, the end not included.
    pub columns: (usize, usize),
    /// Rows of cells.
    pub rows: (usize, usize),
    /// Its share of the picture's light.
    pub light: f64,
    /// With which probability.
    pub probability: f64,
    /// The numbers that it was drawn with, from 0 to 1 again, 1 included.
    pub u: DVec2,
}

impl Above {
    /// The tree over a grid; `share` is the share of the whole light that a block of cells has: those in the columns (from, to) and
    /// rows (from, to).
    pub fn new(grid: &LatLong, share: impl Fn((usize, usize), (usize, usize)) -> f64) -> Self {
        let (width, height, block) = (grid.width, grid.height - 1, Self::block(grid));
        let whole = Range { columns: (0, width.div_ceil(block)), rows: (0, height.div_ceil(block)) };
        let mut tree = Self { nodes: vec![Node::default()], whole, block };
        tree.grow(0, whole, grid, &share);
        tree
    }

    /// Cells along the side of a block of a grid.
    pub fn block(grid: &LatLong) -> usize {
        let mut block = 1;
        while grid.width.div_ceil(block) * (grid.height - 1).div_ceil(block) > MOST_LEAVES {
            block *= 2;
        }
        block
    }

    fn grow(
        &mut self,
        at: usize,
        range: Range,
        grid: &LatLong,
        share: &impl Fn((usize, usize), (usize, usize)) -> f64,
    ) -> (DVec3, f64) {
        let (columns, rows) = self.cells(&range, grid);
        let (moment, light, halves) = if range.is_leaf() {
            let light = share(columns, rows);
            (light * grid.middle(columns, rows), light, 0)
        } else {
            let halves = self.nodes.len();
            self.nodes.extend([Node::default(); 2]);
            let (first, second, _) = range.halves();
            let (a, b) = (self.grow(halves, first, grid, share), self.grow(halves + 1, second, grid, share));
            (a.0 + b.0, a.1 + b.1, halves)
        };
        let mean = if light > 0.0 { (moment / light).as_vec3() } else { Vec3::ZERO };
        let reach = grid.farthest(mean.as_dvec3(), columns, rows) as f32 + ROUNDING;
        self.nodes[at] = Node { mean, reach, light, halves: halves as u32 };
        (moment, light)
    }

    /// Columns and rows of cells of a range of blocks.
    fn cells(&self, range: &Range, grid: &LatLong) -> ((usize, usize), (usize, usize)) {
        let of = |(from, to): (usize, usize), end: usize| (from * self.block, (to * self.block).min(end));
        (of(range.columns, grid.width), of(range.rows, grid.height - 1))
    }

    /// A block that lights a surface with this normal, drawn with two numbers in [0, 1); `None` where nothing does.
    pub fn draw(&self, grid: &LatLong, normal: DVec3, mut u: DVec2) -> Option<Drawn> {
        let normal = normal.as_vec3();
        let (mut node, mut range, mut probability) = (&self.nodes[0], self.whole, 1.0);
        if node.gives(normal) <= 0.0 {
            return None;
        }
        while node.halves > 0 {
            let (first, second) = (&self.nodes[node.halves as usize], &self.nodes[node.halves as usize + 1]);
            let p = share_of_first(first, second, normal);
            let (a, b, by_rows) = range.halves();
            let number = if by_rows { &mut u.x } else { &mut u.y };
            if *number < p {
                (node, range, probability) = (first, a, probability * p);
                *number /= p;
            } else {
                (node, range, probability) = (second, b, probability * (1.0 - p));
                *number = (*number - p) / (1.0 - p);
            }
        }
        let (columns, rows) = self.cells(&range, grid);
        Some(Drawn { columns, rows, light: node.light, probability, u: u.clamp(DVec2::ZERO, DVec2::ONE) })
    }

    /// The block in which a cell lies, and the probability with which [`Above::draw`] draws it for a surface with this normal.
    pub fn find(&self, grid: &LatLong, normal: DVec3, column: usize, row: usize) -> Drawn {
        let normal = normal.as_vec3();
        let (column, row) = (column / self.block, row / self.block);
        let (mut node, mut range, mut probability) = (&self.nodes[0], self.whole, 1.0);
        while node.halves > 0 {
            let (first, second) = (&self.nodes[node.halves as usize], &self.nodes[node.halves as usize + 1]);
            let p = share_of_first(first, second, normal);
            let (a, b, by_rows) = range.halves();
            let in_first = if by_rows { row < a.rows.1 } else { column < a.columns.1 };
            (node, range) = if in_first { (first, a) } else { (second, b) };
            probability *= if in_first { p } else { 1.0 - p };
        }
        let (columns, rows) = self.cells(&range, grid);
        Drawn { columns, rows, light: node.light, probability, u: DVec2::ZERO }
    }
}

/// The probability of the first of two branches. Where neither gives light, the horizon having cut a corner of both together, it does not matter, but
/// what is dark is never drawn.
#[inline]
fn share_of_first(first: &Node, second: &Node, normal: Vec3) -> f64 {
    let (a, b) = (first.gives(normal), second.gives(normal));
    let (a, b) = if a + b > 0.0 { (a, b) } else { (first.light, second.light) };
    if a + b > 0.0 { a / (a + b) } else { 0.5 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::uniform_sphere;
    use crate::numeric::random::{Purpose, RngExt, stream};

    /// Light is lost only where none is: a node that gives nothing lies below the horizon with all of its directions.
    #[test]
    fn a_node_gives_nothing_only_below_the_horizon() {
        let mut rng = stream(9, Purpose::Study, 0);
        let grid = LatLong::new(48, 25, 0.4);
        let shares: Vec<f64> =
            (0..48 * 24).map(|k| if k % 5 == 0 { 0.0 } else { rng.random::<f64>().powi(8) }).collect();
        let tree = Above::new(&grid, |(a, b), (c, d)| {
            (c..d).map(|row| shares[row * 48 + a..row * 48 + b].iter().sum::<f64>()).sum()
        });
        let mut nothing = 0;
        let mut waiting = vec![(0, tree.whole)];
        while let Some((at, range)) = waiting.pop() {
            let node = &tree.nodes[at];
            let (columns, rows) = tree.cells(&range, &grid);
            for _ in 0..20 {
                let normal = uniform_sphere(DVec2::new(rng.random(), rng.random()));
                let gives = node.gives(normal.as_vec3());
                let above = (0..200).any(|_| {
                    let column = rng.random_range(columns.0..columns.1);
                    let row = rng.random_range(rows.0..rows.1);
                    grid.direction(column, row, rng.random(), rng.random()).dot(normal) > 0.0
                });
                assert!(gives > 0.0 || node.light == 0.0 || !above, "node {at} below {normal}");
                assert!(gives <= node.light, "a cosine is at most 1");
                nothing += usize::from(node.light > 0.0 && gives == 0.0);
            }
            if node.halves > 0 {
                let (first, second, _) = range.halves();
                waiting.extend([(node.halves as usize, first), (node.halves as usize + 1, second)]);
            }
        }
        assert!(nothing > 10_000, "only {nothing} nodes were dark");
    }
}
