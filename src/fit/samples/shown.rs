//! Lobes as a sight shows them, kept for the shapes that were last asked for: weights take several passes at the same shapes, each of which would
//! average over the instrument's cones and spot again.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::block::Block;
use crate::brdf::{LobeKind, Sight};

/// Most numbers that are kept, 16 MB; then all make room.
const MOST: usize = 2_000_000;

/// A lobe's kind and shapes, bit by bit, and the first sample of the block.
type Key = (LobeKind, Vec<u64>, u32);

/// A lobe's values and its derivatives by each shape at the samples of a block.
#[derive(Debug)]
struct Columns {
    index: Vec<u32>,
    values: Vec<f64>,
    derivatives: Vec<Vec<f64>>,
}

impl Columns {
    fn numbers(&self) -> usize {
        self.values.len() * (2 + self.derivatives.len())
    }
}

#[derive(Debug, Default)]
struct Known {
    columns: HashMap<Key, Arc<Columns>>,
    numbers: usize,
}

/// What [`Sight::fill`] gave, by shape and block.
#[derive(Debug, Default)]
pub(in crate::fit) struct Shown(Mutex<Known>);

impl Shown {
    /// As [`Sight::fill`] at the places of a block, the same bits.
    pub fn fill(
        &self,
        sight: &dyn Sight,
        (kind, shape): (LobeKind, &[f64]),
        block: &Block,
        values: &mut [f64],
        derivatives: &mut [Vec<f64>],
    ) {
        let Some(first) = block.index.first().filter(|_| !shape.is_empty()) else {
            return sight.fill(kind, shape, &block.places, values, derivatives);
        };
        let key = (kind, shape.iter().map(|s| s.to_bits()).collect(), *first);
        let known = self.0.lock().unwrap_or_else(PoisonError::into_inner).columns.get(&key).cloned();
        // Blocks in another order may begin with the same sample.
        if let Some(known) = known.filter(|known| known.index == block.index) {
            values.copy_from_slice(&known.values);
            derivatives.iter_mut().zip(&known.derivatives).for_each(|(to, from)| to.copy_from_slice(from));
            return;
        }
        sight.fill(kind, shape, &block.places, values, derivatives);
        let index = block.index.clone();
        self.keep(key, Columns { index, values: values.to_vec(), derivatives: derivatives.to_vec() });
    }

    fn keep(&self, key: Key, columns: Columns) {
        let more = columns.numbers();
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if known.numbers + more > MOST {
            *known = Known::default();
        }
        let replaced = known.columns.insert(key, Arc::new(columns));
        known.numbers = known.numbers + more - replaced.map_or(0, |columns| columns.numbers());
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use glam::DVec3;

    use super::*;
    use crate::brdf::Place;

    /// Counts how often it is asked; a value is shape + α.
    #[derive(Debug, Default)]
    struct Counted(AtomicUsize);

    impl Sight for Counted {
        fn describe(&self) -> String {
            String::new()
        }

        fn place(&self, _wi: DVec3, _wo: DVec3) -> Option<Place> {
            None
        }

        fn fill(&self, _: LobeKind, shape: &[f64], places: &[Place], values: &mut [f64], derivatives: &mut [Vec<f64>]) {
            self.0.fetch_add(1, Ordering::Relaxed);
            for (i, place) in places.iter().enumerate() {
                (values[i], derivatives[0][i]) = (shape[0] + place.alpha, -place.alpha);
            }
        }
    }

    fn block(alphas: &[(u32, f64)]) -> Block {
        let place = |(_, alpha): &(u32, f64)| Place { alpha: *alpha, ..Place::default() };
        Block {
            index: alphas.iter().map(|a| a.0).collect(),
            places: alphas.iter().map(place).collect(),
            ..Block::default()
        }
    }

    #[test]
    fn what_is_known_is_not_asked_again_and_other_shapes_and_blocks_are_their_own() {
        let (sight, shown) = (Counted::default(), Shown::default());
        let blocks =
            [block(&[(7, 0.1), (8, 0.2), (9, 0.3)]), block(&[(7, 0.1), (9, 0.3), (8, 0.2)]), block(&[(8, 0.2)])];
        let asked = |n: f64, block: &Block| {
            let (mut values, mut slopes) = (vec![0.0; block.index.len()], vec![vec![0.0; block.index.len()]]);
            shown.fill(&sight, (LobeKind::Phong, &[n]), block, &mut values, &mut slopes);
            let want: Vec<f64> = block.places.iter().map(|p| n + p.alpha).collect();
            assert_eq!(values, want);
            assert!(slopes[0].iter().zip(&block.places).all(|(s, p)| *s == -p.alpha));
            sight.0.load(Ordering::Relaxed)
        };
        assert_eq!((asked(2.0, &blocks[0]), asked(2.0, &blocks[0])), (1, 1));
        assert_eq!((asked(3.0, &blocks[0]), asked(2.0, &blocks[0])), (2, 2));
        assert_eq!((asked(2.0, &blocks[1]), asked(2.0, &blocks[2])), (3, 4));
    }

    #[test]
    fn what_is_kept_has_a_bound() {
        let (sight, shown) = (Counted::default(), Shown::default());
        let long = block(&(0..10_000).map(|i| (i, 0.0)).collect::<Vec<_>>());
        for n in 0..200 {
            let (mut values, mut slopes) = (vec![0.0; 10_000], vec![vec![0.0; 10_000]]);
            shown.fill(&sight, (LobeKind::Phong, &[f64::from(n)]), &long, &mut values, &mut slopes);
            let known = shown.0.lock().expect("whole");
            let kept: usize = known.columns.values().map(|c| c.numbers()).sum();
            assert_eq!(known.numbers, kept);
            assert!(kept <= MOST);
        }
    }
}
