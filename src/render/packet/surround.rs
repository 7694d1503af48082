//! An even environment in closed form: where nothing can stand in the way, its light needs no samples.

use std::f64::consts::FRAC_PI_2;

use glam::DVec3;
use rayon::prelude::*;

use super::flat::Lobes;
use crate::brdf::phong;
use crate::numeric::lanes::{LANES, Lanes, Row, Vec3};
use crate::numeric::simd::Simd;

/// Steps of [`Surround`]'s table.
const STEPS: usize = 512;

/// A convex body alone in an even environment of radiance 1: what it reflects is the directional albedo of its material.
#[derive(Debug)]
pub(super) struct Surround {
    /// Albedo at cosθo = (k/[`STEPS`])², with one value beyond each end: near grazing it bends within a width of n^−½ in cosθo.
    table: Vec<DVec3>,
}

impl Surround {
    pub fn new(material: &Lobes) -> Self {
        let albedo = |k: usize| {
            // Beyond an end the table goes on like its mirror image through that end's value.
            let at = |k: usize| {
                let cos = (k as f64 / STEPS as f64).powi(2);
                let lobes = material
                    .phong
                    .iter()
                    .map(|(weight, n, _)| *weight * phong::directional_albedo(*n, cos.acos().min(FRAC_PI_2)));
                material.diffuse + lobes.sum::<DVec3>()
            };
            match k {
                0 => 2.0 * at(0) - at(1),
                k if k > STEPS + 1 => 2.0 * at(STEPS) - at(STEPS - 1),
                k => at(k - 1),
            }
        };
        Self { table: (0..STEPS + 3).into_par_iter().map(albedo).collect() }
    }

    /// The albedo for light towards directions of these cosines, above 0: cubic between four values (Catmull, Rom 1974).
    #[inline(always)]
    pub fn albedo<S: Simd>(&self, cos: Lanes<S>) -> Vec3<S> {
        let mut at: Row = [0.0; LANES];
        (cos.sqrt() * cos.number(STEPS as f64)).store(&mut at);
        let mut found = [[0.0; LANES]; 3];
        for (k, x) in at.iter().enumerate() {
            let first = (*x as usize).min(STEPS - 1);
            let t = x - first as f64;
            let p = &self.table[first..first + 4];
            let value = p[1]
                + 0.5
                    * t
                    * (p[2] - p[0]
                        + t * (2.0 * p[0] - 5.0 * p[1] + 4.0 * p[2] - p[3] + t * (3.0 * (p[1] - p[2]) + p[3] - p[0])));
            (found[0][k], found[1][k], found[2][k]) = (value.x, value.y, value.z);
        }
        let simd = cos.simd();
        Vec3::new(Lanes::load(simd, &found[0]), Lanes::load(simd, &found[1]), Lanes::load(simd, &found[2]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::simd::{Kernel, vectorised};

    struct Albedo<'a>(&'a Surround, f64);

    impl Kernel for Albedo<'_> {
        type Output = f64;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> f64 {
            let mut all = [0.0; LANES];
            self.0.albedo(Lanes::splat(simd, self.1)).x.store(&mut all);
            all[0]
        }
    }

    #[test]
    fn a_body_in_an_even_surround_shows_its_albedo() {
        for n in [0.0, 0.5, 3.0, 60.0, 1e3, 2e4, 1e6] {
            let phong = vec![(DVec3::splat(0.7), n, 0.5)];
            let material = Lobes { diffuse: DVec3::splat(0.2), diffuse_share: 0.5, phong, black: false };
            let surround = Surround::new(&material);
            for k in 1..400 {
                let cos = (f64::from(k) / 399.0).powi(3);
                let want = 0.2 + 0.7 * phong::directional_albedo(n, cos.acos());
                let got = vectorised(Albedo(&surround, cos));
                assert!((got - want).abs() < 2e-6 * want, "n {n}, cos {cos}: {got} vs {want}");
            }
        }
    }
}
