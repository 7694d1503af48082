//! A picture in tiles: what is worked on at a time, and gets its number of samples together.

/// Width and height of a tile, pixels.
pub(super) const TILE: usize = 16;
/// Room for its pixels; tiles at the right and lower border fill less.
pub(super) const TILE_ROOM: usize = TILE * TILE;

/// How a picture is cut up: rows of tiles, each of whose pixels lie together, row after row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tiles {
    pub width: usize,
    pub height: usize,
}

/// The pixels of a tile: columns from `x` on, rows from `y` on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tile {
    pub x: usize,
    pub y: usize,
    pub width: usize,
    pub height: usize,
}

impl Tiles {
    fn across(&self) -> usize {
        self.width.div_ceil(TILE)
    }

    /// Number of tiles.
    pub fn count(&self) -> usize {
        self.across() * self.height.div_ceil(TILE)
    }

    /// A tile.
    pub fn tile(&self, index: usize) -> Tile {
        let (x, y) = (index % self.across() * TILE, index / self.across() * TILE);
        Tile { x, y, width: TILE.min(self.width - x), height: TILE.min(self.height - y) }
    }

    /// Where a pixel lies.
    pub fn slot(&self, x: usize, y: usize) -> usize {
        (y / TILE * self.across() + x / TILE) * TILE_ROOM + y % TILE * TILE + x % TILE
    }

    /// Where the pixels lie, row after row of the picture.
    pub fn slots(self) -> impl Iterator<Item = usize> {
        (0..self.height).flat_map(move |y| (0..self.width).map(move |x| self.slot(x, y)))
    }
}

impl Tile {
    /// Where its pixels lie in it.
    pub fn slots(self) -> impl Iterator<Item = usize> {
        (0..self.height).flat_map(move |y| (0..self.width).map(move |x| y * TILE + x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_has_its_place() {
        for (width, height) in [(1, 1), (16, 16), (17, 33), (40, 5)] {
            let tiles = Tiles { width, height };
            let mut by_rows: Vec<usize> = tiles.slots().collect();
            let by_tiles = |i: usize| tiles.tile(i).slots().map(move |s| i * TILE_ROOM + s);
            let mut all: Vec<usize> = (0..tiles.count()).flat_map(by_tiles).collect();
            assert_eq!(by_rows.len(), width * height);
            by_rows.sort_unstable();
            all.sort_unstable();
            assert_eq!(by_rows, all, "{width} × {height}");
        }
    }
}
