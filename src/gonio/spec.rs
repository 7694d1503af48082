//! A simulation as a TOML file.

use super::instrument::Instrument;

/// What to simulate: the material's name or file, the scan, the seed, the instrument.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulationSpec {
    /// 1.
    pub version: u32,
    /// What this is, in a few words; changes nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// A built-in material or a file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// `in-plane[:STEP]`, `adaptive[:N]`, `hemisphere[:STEP]`, `merl`, `flat[:STEP]` or `list:FILE`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scan: Option<String>,
    /// Seed of the noise.
    #[serde(default)]
    pub seed: Option<u64>,
    /// The instrument.
    #[serde(default)]
    pub instrument: Instrument,
}

/// What is wrong with a simulation's text.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpecError {
    /// Not TOML, an unknown key, or a wrong type; says line and column.
    #[error("{0}")]
    Toml(String),
    /// A value out of its range.
    #[error("{0}")]
    Value(String),
}

impl SimulationSpec {
    /// Reads and checks the text.
    ///
    /// # Errors
    /// [`SpecError`] naming the place or the field.
    pub fn from_toml(text: &str) -> Result<Self, SpecError> {
        if let Ok(table) = text.parse::<toml::Table>()
            && !table.contains_key("version")
        {
            let found = if table.is_empty() { "a file without any key" } else { "none" };
            return Err(SpecError::Value(format!(
                "version: expected the line `version = 1` at the beginning, found {found}"
            )));
        }
        let spec: Self = toml::from_str(text).map_err(|e| SpecError::Toml(e.to_string()))?;
        if spec.version != 1 {
            return Err(SpecError::Value(format!("version: expected 1, found {}", spec.version)));
        }
        match spec.instrument.fault() {
            Some(fault) => Err(SpecError::Value(fault)),
            None => Ok(spec),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spec_reads_and_wrong_ones_name_the_place() {
        let spec = SimulationSpec::from_toml(
            "version = 1\nmaterial = \"m.json\"\nscan = \"merl\"\n[instrument]\nelectrons = 1e4\n",
        )
        .expect("valid");
        assert_eq!(spec.instrument.electrons, 1e4);
        assert_eq!(spec.instrument.read_noise, Instrument::default().read_noise);
        for (text, says) in [
            ("version = 2", "version: expected 1"),
            ("version = 1\ncolour = 3", "colour"),
            ("version = 1\n[instrument]\nread_noise = -2", "read_noise"),
            ("version = ", "line 1"),
            ("", "expected the line `version = 1` at the beginning, found a file without any key"),
            ("seed = 3", "expected the line `version = 1` at the beginning, found none"),
        ] {
            let error = SimulationSpec::from_toml(text).expect_err(text).to_string();
            assert!(error.contains(says), "{text}: {error}");
        }
    }
}
