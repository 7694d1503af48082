//! What pictures are judged by: the material's own, and for each table the material's as far as the table is known.

use super::accumulate::{Gathered, Truth};
use super::resolution::Tables;
use crate::chain::{self, ChainError, Stage};
use crate::image::Image;
use crate::numeric::estimate::Estimate;
use crate::render::{Material, Scene};

/// All references.
pub(super) struct Judges {
    own: Truth,
    of_tables: Vec<OfTable>,
}

/// Of a table.
struct OfTable {
    truth: Truth,
    /// How far it is off the material's own picture.
    unmeasured: Option<Estimate>,
}

impl Judges {
    /// Of the stage with `subject` on it, and of tables. `shot` takes a picture with a seed that no other number has.
    pub fn new(
        stage: &Stage,
        subject: Option<&Material>,
        tables: &Tables,
        shot: impl Fn(&Scene, u64) -> Result<Image, ChainError>,
    ) -> Result<Self, ChainError> {
        let halves = |subject: Option<Material>, k: u64| {
            let scene = chain::scene(stage, subject)?;
            Ok::<_, ChainError>([shot(&scene, 2 * k)?, shot(&scene, 2 * k + 1)?])
        };
        let [a, b] = halves(subject.cloned(), 0)?;
        let own = Truth::of(&a, &b);
        let of_table = |(k, truth): (usize, &Material)| {
            let halves = halves(Some(truth.clone()), 1 + k as u64)?;
            Ok(OfTable::new(&own, halves.map(seen_whole)))
        };
        let of_tables = tables.all.iter().map(|table| &table.truth).enumerate().map(of_table);
        let of_tables = of_tables.collect::<Result<Vec<OfTable>, ChainError>>()?;
        Ok(Self { own, of_tables })
    }

    /// What judges a picture of the material, or of the table with this index.
    pub fn of(&self, table: Option<usize>) -> &Truth {
        table.and_then(|k| self.of_tables.get(k)).map_or(&self.own, |of| &of.truth)
    }

    /// What the directions that a table does not hold are worth.
    pub fn unmeasured(&self, table: Option<usize>) -> Option<Estimate> {
        self.of_tables.get(table?)?.unmeasured
    }

    /// What an error that could not be told stays below, whatever is judged.
    pub fn untold(&self) -> f64 {
        self.of_tables.iter().map(|of| of.truth.untold()).fold(self.own.untold(), f64::max)
    }

    /// What the references are, of so many samples each, and how good; `smallest` is the least error that the first has told.
    pub fn said(&self, samples: u32, smallest: f64) -> Vec<String> {
        let mut said = vec![self.own.said(samples, smallest)];
        if !self.of_tables.is_empty() {
            let worst = self.of_tables.iter().map(|of| of.truth.deviation()).fold(0.0, f64::max);
            said.push(format!(
                "tables: the material itself as far as each is known, likewise, off by {worst:.2e} at most; what lies beyond is black in both"
            ));
        }
        said
    }
}

impl OfTable {
    fn new(own: &Truth, [a, b]: [Image; 2]) -> Self {
        let mut gathered = Gathered::default();
        [&a, &b].into_iter().for_each(|image| gathered.add(own, image));
        Self { truth: Truth::of(&a, &b), unmeasured: gathered.bias(own) }
    }
}

/// A picture of which no pixel is left out: what is unknown in it is unknown in what it is compared with.
pub(super) fn seen_whole(image: Image) -> Image {
    Image { mask: None, ..image }
}
