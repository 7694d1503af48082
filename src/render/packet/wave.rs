//! Paths that are followed together: [`LANES`] to a group, those that still run at the front, so that no lane waits for a path that has ended.

use glam::DVec3;

use super::super::points::{Points, half_of};
use super::flat::OwnerNumber;
use crate::numeric::lanes::{self, LANES, Lanes, Mask, Vec3};
use crate::numeric::simd::Simd;

/// Paths of a wave: few enough for the second cache, enough that the last group's empty lanes don't matter.
pub(super) const WAVE: usize = 256;

/// What is known of a path. Vectors take three rows.
#[derive(Debug, Clone, Copy)]
#[repr(usize)]
pub(super) enum Row {
    /// The ray.
    Origin = 0,
    Direction = 3,
    Throughput = 6,
    Radiance = 9,
    /// The surface that it left, or has met.
    Position = 12,
    Normal = 15,
    Error = 18,
    /// Whose that is.
    Owner = 21,
    /// 1/density with which the ray was drawn, sr.
    Spread = 22,
    /// 1 where the surface that it left has no Phong lobes.
    Plain = 23,
    /// 1 where what that surface reflects of quads that nothing can hide has a closed form.
    Closed = 24,
    /// 1 where it runs.
    Alive = 25,
    /// Rays that were sent towards lights.
    Aimed = 26,
}

const ROWS: usize = 27;

/// Paths side by side.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(super) struct Group {
    rows: [lanes::Row; ROWS],
    keys: [u64; LANES],
    places: [u32; LANES],
    /// Which of the wave's paths they are.
    numbers: [u32; LANES],
}

impl Group {
    #[inline(always)]
    pub fn get<S: Simd>(&self, simd: S, row: Row) -> Lanes<S> {
        Lanes::load(simd, &self.rows[row as usize])
    }

    #[inline(always)]
    pub fn get3<S: Simd>(&self, simd: S, row: Row) -> Vec3<S> {
        let at = |k: usize| Lanes::load(simd, &self.rows[row as usize + k]);
        Vec3::new(at(0), at(1), at(2))
    }

    #[inline(always)]
    pub fn put<S: Simd>(&mut self, row: Row, value: Lanes<S>) {
        value.store(&mut self.rows[row as usize]);
    }

    #[inline(always)]
    pub fn put3<S: Simd>(&mut self, row: Row, value: Vec3<S>) {
        for (k, part) in [value.x, value.y, value.z].into_iter().enumerate() {
            part.store(&mut self.rows[row as usize + k]);
        }
    }

    /// Where a row says yes.
    #[inline(always)]
    pub fn says<S: Simd>(&self, simd: S, row: Row) -> Mask<S> {
        self.get(simd, row).above(Lanes::splat(simd, 0.0))
    }

    #[inline(always)]
    pub fn note<S: Simd>(&mut self, simd: S, row: Row, yes: Mask<S>) {
        self.put(row, yes.keep(Lanes::splat(simd, 1.0)));
    }

    /// The paths' points.
    #[inline(always)]
    pub fn points(&self) -> Points<LANES> {
        Points::of(self.keys, self.places)
    }
}

/// The paths.
#[derive(Debug)]
pub(super) struct Wave {
    groups: Vec<Group>,
    /// How many run: they come first.
    running: usize,
    /// Radiance of those that have ended, by their number.
    found: Vec<DVec3>,
    /// Rays that were sent out.
    rays: u64,
}

impl Wave {
    /// Room for a wave.
    pub fn new() -> Self {
        let (keys, places, numbers) = ([0; LANES], [0; LANES], [0; LANES]);
        let group = Group { rows: [[0.0; LANES]; ROWS], keys, places, numbers };
        Self { groups: vec![group; WAVE / LANES], running: 0, found: vec![DVec3::ZERO; WAVE], rays: 0 }
    }

    /// Begins with the samples of pixels that `path` tells by number: the pixel's keys and the sample.
    #[inline(always)]
    pub fn begin(&mut self, paths: usize, path: impl Fn(usize) -> ([u64; 2], u32)) {
        self.running = paths;
        for (g, group) in self.groups[..paths.div_ceil(LANES)].iter_mut().enumerate() {
            for k in 0..LANES {
                // Lanes that are left over repeat the last path, and are not alive.
                let number = g * LANES + k;
                let (keys, sample) = path(number.min(paths - 1));
                (group.keys[k], group.places[k]) = (keys[half_of(sample)], sample >> 1);
                group.numbers[k] = number as u32;
                group.rows[Row::Alive as usize][k] = f64::from(u8::from(number < paths));
            }
        }
    }

    /// How many paths run.
    #[inline(always)]
    pub fn running(&self) -> usize {
        self.running
    }

    /// Every path sends out a ray.
    #[inline(always)]
    pub fn count_rays(&mut self) {
        self.rays += self.running as u64;
    }

    /// Rays that were sent out by paths that have ended, and on their ways.
    pub fn rays(&self) -> u64 {
        self.rays
    }

    /// Groups that hold them.
    #[inline(always)]
    pub fn groups(&mut self) -> &mut [Group] {
        &mut self.groups[..self.running.div_ceil(LANES)]
    }

    /// Radiance of the paths that have ended.
    #[inline(always)]
    pub fn found(&self) -> &[DVec3] {
        &self.found
    }

    /// Paths that don't run any more hand in what they found; the last ones take their places.
    #[inline(always)]
    pub fn close_ranks(&mut self) {
        let mut i = 0;
        while i < self.running {
            if self.groups[i / LANES].rows[Row::Alive as usize][i % LANES] > 0.0 {
                i += 1;
                continue;
            }
            let (group, k) = (&self.groups[i / LANES], i % LANES);
            let radiance = |c: usize| group.rows[Row::Radiance as usize + c][k];
            self.found[group.numbers[k] as usize] = DVec3::new(radiance(0), radiance(1), radiance(2));
            self.rays += group.rows[Row::Aimed as usize][k] as u64;
            self.running -= 1;
            if i < self.running {
                self.copy(self.running, i);
            }
            self.groups[self.running / LANES].rows[Row::Alive as usize][self.running % LANES] = 0.0;
        }
    }

    /// Puts the paths first that have met a surface for which this holds; how many they are.
    #[inline(always)]
    pub fn sort(&mut self, comes_first: impl Fn(OwnerNumber) -> bool) -> usize {
        let (mut low, mut high) = (0, self.running);
        let first = |wave: &Self, i: usize| comes_first(wave.groups[i / LANES].rows[Row::Owner as usize][i % LANES]);
        loop {
            while low < high && first(self, low) {
                low += 1;
            }
            while low < high && !first(self, high - 1) {
                high -= 1;
            }
            if low >= high {
                return low;
            }
            self.swap(low, high - 1);
        }
    }

    #[inline(always)]
    fn copy(&mut self, from: usize, to: usize) {
        let (f, t) = (from % LANES, to % LANES);
        for row in 0..ROWS {
            self.groups[to / LANES].rows[row][t] = self.groups[from / LANES].rows[row][f];
        }
        self.groups[to / LANES].keys[t] = self.groups[from / LANES].keys[f];
        self.groups[to / LANES].places[t] = self.groups[from / LANES].places[f];
        self.groups[to / LANES].numbers[t] = self.groups[from / LANES].numbers[f];
    }

    #[inline(always)]
    fn swap(&mut self, a: usize, b: usize) {
        let ((ga, ka), (gb, kb)) = ((a / LANES, a % LANES), (b / LANES, b % LANES));
        let Ok([first, second]) = self.groups.get_disjoint_mut([ga, gb]) else {
            return self.groups[ga].swap(ka, kb);
        };
        for (x, y) in first.rows.iter_mut().zip(&mut second.rows) {
            std::mem::swap(&mut x[ka], &mut y[kb]);
        }
        std::mem::swap(&mut first.keys[ka], &mut second.keys[kb]);
        std::mem::swap(&mut first.places[ka], &mut second.places[kb]);
        std::mem::swap(&mut first.numbers[ka], &mut second.numbers[kb]);
    }
}

impl Group {
    #[inline(always)]
    fn swap(&mut self, a: usize, b: usize) {
        self.rows.iter_mut().for_each(|row| row.swap(a, b));
        self.keys.swap(a, b);
        self.places.swap(a, b);
        self.numbers.swap(a, b);
    }
}
