//! Materials that come with the program.

use crate::brdf::{LobeKind, Material};

/// A material that comes with the program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BuiltInMaterial {
    /// Its name.
    pub name: &'static str,
    /// What it looks like.
    pub summary: &'static str,
    diffuse: [f64; 3],
    glossy: [f64; 3],
    exponent: f64,
}

/// All of them.
pub const MATERIALS: [BuiltInMaterial; 4] = [
    BuiltInMaterial {
        name: "glossy-paint",
        summary: "deep red gloss paint with a clear highlight",
        diffuse: [0.32, 0.06, 0.035],
        glossy: [0.12, 0.12, 0.12],
        exponent: 90.0,
    },
    BuiltInMaterial {
        name: "satin",
        summary: "blue satin finish, highlight broad and soft",
        diffuse: [0.08, 0.16, 0.30],
        glossy: [0.15, 0.15, 0.16],
        exponent: 12.0,
    },
    BuiltInMaterial {
        name: "matte-white",
        summary: "diffuse white standard, albedo 0.9",
        diffuse: [0.9, 0.9, 0.9],
        glossy: [0.0; 3],
        exponent: 1.0,
    },
    BuiltInMaterial {
        name: "mirror-like",
        summary: "polished metal, n = 20000",
        diffuse: [0.01, 0.01, 0.01],
        glossy: [0.75, 0.70, 0.60],
        exponent: 2e4,
    },
];

impl BuiltInMaterial {
    /// The material with this name.
    #[must_use]
    pub fn find(name: &str) -> Option<&'static Self> {
        MATERIALS.iter().find(|m| m.name == name)
    }

    /// The material as it is written in a scene file.
    #[must_use]
    pub fn toml(&self) -> String {
        let phong = match self.glossy {
            [0.0, 0.0, 0.0] => String::new(),
            ks => format!("phong = [{{ ks = {ks:?}, n = {:?} }}]\n", self.exponent),
        };
        format!("[materials.{}]\nkd = {:?}\n{phong}", self.name, self.diffuse)
    }

    /// The material itself, channels r, g, b.
    #[must_use]
    pub fn material(&self) -> Material {
        let channels = ["r", "g", "b"].map(str::to_owned).to_vec();
        let mut lobes = vec![(LobeKind::Lambert, self.diffuse.to_vec(), vec![])];
        if self.glossy != [0.0; 3] {
            lobes.push((LobeKind::Phong, self.glossy.to_vec(), vec![self.exponent]));
        }
        Material::new(channels, lobes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_material_conserves_energy() {
        for built_in in &MATERIALS {
            assert_eq!(BuiltInMaterial::find(built_in.name), Some(built_in));
            for theta in [0.0, 0.8, 1.5] {
                let albedo = built_in.material().directional_albedo(theta).expect("of space");
                assert!(albedo.iter().all(|a| (0.0..=1.0).contains(a)), "{}: {albedo:?}", built_in.name);
            }
        }
    }
}
