//! The pairs of directions that were chosen so far.

use super::Adaptive;
use super::bend::Gap;
use crate::geometry::angles::direction_deg;
use crate::geometry::grid::cell_borders;
use crate::gonio::scan::{IN_PLANE_DEG, MOST_DEG, Scan};
use crate::measurement::{Directions, Weights};

/// Step of the first look, degrees. It divides 15°, the step of incidences, so that every mirror direction is in it.
const STEP_DEG: f64 = 5.0;
/// Steps of the first look to each side of the normal.
const STEPS: i32 = (MOST_DEG / STEP_DEG) as i32;
/// Pairs of the first look.
pub(in crate::gonio) const FIRST_PAIRS: u32 = IN_PLANE_DEG.len() as u32 * (2 * STEPS + 1) as u32;

/// One incidence: pairs by index in the order of time, sorted by θo.
type Line = Vec<usize>;

/// Pairs of directions in the order in which they are read.
pub(super) struct Chosen {
    /// Signed θo of each, degrees: positive on the side of the mirror direction.
    pub theta_o_deg: Vec<f64>,
    /// The incidence of each.
    line_of: Vec<usize>,
    /// Whether the axes stand at the last incidence.
    at_end: bool,
    pub lines: Vec<Line>,
}

impl Chosen {
    /// The plane of incidence at the coarse step.
    pub fn first_look() -> Self {
        let mut new = Self {
            theta_o_deg: Vec::new(),
            line_of: Vec::new(),
            lines: vec![Vec::new(); IN_PLANE_DEG.len()],
            at_end: false,
        };
        let steps = |line| (-STEPS..=STEPS).map(move |k| (line, f64::from(k) * STEP_DEG));
        new.read((0..IN_PLANE_DEG.len()).flat_map(steps).collect());
        new
    }

    pub fn len(&self) -> usize {
        self.theta_o_deg.len()
    }

    /// Adds the middle of each gap.
    pub fn halve(&mut self, gaps: &[Gap]) {
        self.read(gaps.iter().map(|gap| (gap.line, gap.middle_deg())).collect());
    }

    /// Adds pairs (incidence, θo) in an order that moves the axes little: to and fro along one incidence after another, from the end at which they
    /// stand.
    fn read(&mut self, mut pairs: Vec<(usize, f64)>) {
        let along = |(line, theta): (usize, f64)| if line % 2 == 0 { theta } else { -theta };
        pairs.sort_by(|a, b| a.0.cmp(&b.0).then(along(*a).total_cmp(&along(*b))));
        if self.at_end {
            pairs.reverse();
        }
        self.at_end = !self.at_end;
        pairs.into_iter().for_each(|(line, theta)| self.push(line, theta));
    }

    fn push(&mut self, line: usize, theta_o_deg: f64) {
        let place = self.lines[line].partition_point(|&i| self.theta_o_deg[i] < theta_o_deg);
        self.lines[line].insert(place, self.theta_o_deg.len());
        self.theta_o_deg.push(theta_o_deg);
        self.line_of.push(line);
    }

    /// As a list in the order of time. Each pair stands for its cell of θo, as wide as half the way to either neighbour: a fit that does not weigh by σ
    /// then sees the curve as a uniform scan would, however many readings lie where it bends.
    pub fn scan(&self, wish: &Adaptive<'_>) -> Scan {
        let wi = self.line_of.iter().map(|&line| direction_deg(IN_PLANE_DEG[line], 0.0)).collect();
        let wo = self.theta_o_deg.iter().map(|&theta| direction_deg(theta, 180.0)).collect();
        Scan::List {
            name: format!("adaptive:{}", wish.pairs),
            directions: Directions::List { wi, wo },
            weights: Weights::Column(self.cells_deg()),
            dimension: wish.dimension,
            rows: Vec::new(),
        }
    }

    /// The width of each pair's cell of θo, degrees.
    fn cells_deg(&self) -> Vec<f64> {
        let mut cells = vec![0.0; self.len()];
        let end = f64::from(STEPS) * STEP_DEG + 0.5 * STEP_DEG;
        for line in &self.lines {
            let nodes: Vec<f64> = line.iter().map(|&i| self.theta_o_deg[i]).collect();
            let borders = cell_borders(&nodes, -end, end);
            line.iter().zip(borders.windows(2)).for_each(|(&i, border)| cells[i] = border[1] - border[0]);
        }
        cells
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::mirror;
    use crate::gonio::Instrument;
    use crate::measurement::Dimension;

    #[test]
    fn the_first_look_meets_every_mirror_direction_and_cells_add_up_to_the_plane() {
        let mut chosen = Chosen::first_look();
        assert_eq!(chosen.len(), FIRST_PAIRS as usize);
        chosen.halve(&[Gap { line: 2, left_deg: 30.0, right_deg: 35.0, off: 1.0 }]);
        assert_eq!(chosen.theta_o_deg.last(), Some(&32.5));
        let instrument = Instrument::default();
        let wish = Adaptive { pairs: 300, dimension: Dimension::Space, instrument: &instrument };
        let (directions, weights) = chosen.scan(&wish).directions().expect("a list");
        let is_mirror = |i: &usize| {
            let (wi, wo) = directions.pair(*i);
            (mirror(wi) - wo).length() < 1e-12
        };
        assert_eq!((0..directions.len()).filter(is_mirror).count(), IN_PLANE_DEG.len());
        let all: Vec<f64> = (0..directions.len()).map(|i| weights.get(i)).collect();
        assert!((all.iter().sum::<f64>() - 6.0 * 175.0).abs() < 1e-9);
        assert_eq!((all[0], all[FIRST_PAIRS as usize]), (5.0, 2.5));
    }
}
