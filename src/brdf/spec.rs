//! Model specifications: lobes joined by `+`.

use std::fmt;
use std::str::FromStr;

use super::lobe::LobeKind;

/// A model to fit: its lobes in order, one to four, all of one world, at most one of them diffuse.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ModelSpec(Vec<LobeKind>);

/// Most lobes a model may have.
pub const MAX_LOBES: usize = 4;

/// Why a text is no model specification.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SpecError {
    /// A name that no lobe has.
    #[error("model \"{spec}\": no lobe is called \"{name}\"; known are {known}", known = LobeKind::ALL.map(LobeKind::name).join(", "))]
    UnknownLobe {
        /// The whole text.
        spec: String,
        /// The name.
        name: String,
    },
    /// Lobes that don't go together.
    #[error("model \"{spec}\": {reason}")]
    Combination {
        /// The whole text.
        spec: String,
        /// What is wrong with it.
        reason: &'static str,
    },
}

impl ModelSpec {
    /// The lobes in order.
    #[must_use]
    pub fn lobes(&self) -> &[LobeKind] {
        &self.0
    }

    /// Whether the model belongs to the flat world.
    #[must_use]
    pub fn is_flat(&self) -> bool {
        self.0.iter().any(|kind| kind.is_flat())
    }

    /// The same model in the flat world (`phong` → `phong2d`).
    #[must_use]
    pub fn flattened(&self) -> Self {
        Self(self.0.iter().map(|kind| kind.flat_twin()).collect())
    }
}

impl FromStr for ModelSpec {
    type Err = SpecError;

    fn from_str(spec: &str) -> Result<Self, SpecError> {
        let kind = |name: &str| {
            LobeKind::from_name(name.trim())
                .ok_or_else(|| SpecError::UnknownLobe { spec: spec.to_owned(), name: name.trim().to_owned() })
        };
        let lobes = spec.split('+').map(kind).collect::<Result<Vec<_>, _>>()?;
        let wrong = |reason| Err(SpecError::Combination { spec: spec.to_owned(), reason });
        if lobes.len() > MAX_LOBES {
            return wrong("a model has at most four lobes");
        }
        let flat = lobes.iter().filter(|kind| kind.is_flat()).count();
        if flat != 0 && flat != lobes.len() {
            return wrong("lobes of the flat world and of space don't mix");
        }
        if lobes.iter().filter(|kind| kind.lobe().parameters().is_empty()).count() > 1 {
            return wrong("two diffuse lobes can't be told apart");
        }
        Ok(Self(lobes))
    }
}

impl fmt::Display for ModelSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.iter().map(|kind| kind.name()).collect::<Vec<_>>().join("+"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn specifications_read_back_and_wrong_ones_say_why() {
        for text in ["lambert", "phong", "lambert+phong", "lambert+phong+phong", "lambert2d+phong2d"] {
            assert_eq!(text.parse::<ModelSpec>().expect(text).to_string(), text);
        }
        for (text, says) in [
            ("lambert+ward", "\"ward\""),
            ("", "\"\""),
            ("lambert+phong2d", "don't mix"),
            ("lambert+lambert", "told apart"),
            ("phong+phong+phong+phong+phong", "four"),
        ] {
            let error = text.parse::<ModelSpec>().expect_err(text).to_string();
            assert!(error.contains(says), "{text}: {error}");
        }
    }
}
