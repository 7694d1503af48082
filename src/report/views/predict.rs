//! A material's values at many pairs of directions, as they are or as an instrument sees them.

use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::DVec3;

use crate::brdf::lobe::MAX_PARAMETERS;
use crate::brdf::{Brdf, Material, Place, Reflectance, Sight};

/// A material to be compared with readings.
#[derive(Debug, Clone)]
pub struct Predicted {
    material: Material,
    reflectance: Option<Reflectance>,
    sight: Option<Arc<dyn Sight>>,
}

impl Predicted {
    /// The material, seen through an instrument where one is given.
    #[must_use]
    pub fn new(material: &Material, sight: Option<Arc<dyn Sight>>) -> Self {
        let all: Vec<usize> = (0..material.channels.len()).collect();
        Self { material: material.clone(), reflectance: material.reflectance(&all), sight }
    }

    /// The material.
    #[must_use]
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// The instrument that it is seen through, if any.
    #[must_use]
    pub fn sight(&self) -> Option<Arc<dyn Sight>> {
        self.sight.clone()
    }

    /// Values of every channel (1/sr, 1/rad in the flat world) at these pairs; NaN where the instrument reaches below the horizon.
    #[must_use]
    pub fn values(&self, pairs: &[(DVec3, DVec3)]) -> Vec<Vec<f64>> {
        let channels = self.material.channels.len();
        if let Some(sight) = &self.sight {
            return self.seen(sight.as_ref(), pairs);
        }
        let mut values = vec![vec![0.0; pairs.len()]; channels];
        let mut one = vec![0.0; channels];
        for (k, (wi, wo)) in pairs.iter().enumerate() {
            match &self.reflectance {
                Some(reflectance) => _ = reflectance.eval(*wi, *wo, &mut one),
                None => self.material.write_value(*wi, *wo, &mut one),
            }
            values.iter_mut().zip(&one).for_each(|(list, v)| list[k] = *v);
        }
        values
    }

    fn seen(&self, sight: &dyn Sight, pairs: &[(DVec3, DVec3)]) -> Vec<Vec<f64>> {
        let places: Vec<Option<Place>> = pairs.iter().map(|(wi, wo)| sight.place(*wi, *wo)).collect();
        let known: Vec<Place> = places.iter().flatten().copied().collect();
        let mut sums = vec![vec![0.0; known.len()]; self.material.channels.len()];
        for term in &self.material.lobes {
            for (c, sum) in sums.iter_mut().enumerate() {
                let Some(shape) = term.shape_of(c) else { continue };
                let mut values = vec![0.0; known.len()];
                let mut derivatives = vec![vec![0.0; known.len()]; MAX_PARAMETERS.min(shape.len())];
                sight.prepare(term.kind, &shape, Instant::now() + Duration::from_hours(1));
                sight.fill(term.kind, &shape, &known, &mut values, &mut derivatives);
                sum.iter_mut().zip(&values).for_each(|(s, v)| *s += term.weight[c] * v);
            }
        }
        let spread = |sum: Vec<f64>| {
            let mut values = sum.into_iter();
            places.iter().map(|place| place.and_then(|_| values.next()).unwrap_or(f64::NAN)).collect()
        };
        sums.into_iter().map(spread).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::LobeKind;
    use crate::geometry::direction;
    use crate::gonio::{Preset, sight::Cones};
    use std::f64::consts::PI;

    #[test]
    fn values_are_the_materials_and_a_wide_view_lowers_the_peak() {
        let channels = vec!["a".to_owned(), "b".to_owned()];
        let lobes = vec![(LobeKind::Lambert, vec![0.3, 0.1], vec![]), (LobeKind::Phong, vec![0.2, 0.4], vec![200.0])];
        let material = Material::new(channels, lobes);
        let pairs: Vec<_> = [0.0, 0.3, 0.5].iter().map(|t| (direction(0.5, PI), direction(*t, 0.0))).collect();
        let plain = Predicted::new(&material, None).values(&pairs);
        for (k, (wi, wo)) in pairs.iter().enumerate() {
            let want = material.value(*wi, *wo);
            assert!((plain[0][k] - want[0]).abs() < 1e-13 && (plain[1][k] - want[1]).abs() < 1e-13);
        }
        let commercial = Preset::find("commercial").expect("built in").spec().expect("valid").instrument;
        let sight: Arc<dyn Sight> = Arc::new(Cones::of(&commercial).expect("an aperture"));
        let seen = Predicted::new(&material, Some(sight)).values(&pairs);
        let (peak, want) = (seen[1][2], plain[1][2]);
        assert!(peak < want && peak > 0.5 * want, "{peak} vs {want}");
        let side = seen[0][0] / plain[0][0];
        assert!((side - 1.0).abs() < 0.05, "{side}");
    }
}
