//! The built-in instruments, embedded as the TOML that a user would write.

use super::spec::{SimulationSpec, SpecError};

/// An instrument that comes with the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Preset {
    /// Its name.
    pub name: &'static str,
    /// Its simulation file, of which only description and instrument are written.
    pub toml: &'static str,
}

/// All built-in instruments.
pub const PRESETS: [Preset; 5] = [
    Preset { name: "ideal", toml: include_str!("../../data-fixtures/instruments/ideal.toml") },
    Preset { name: "standards-lab", toml: include_str!("../../data-fixtures/instruments/standards-lab.toml") },
    Preset { name: "commercial", toml: include_str!("../../data-fixtures/instruments/commercial.toml") },
    Preset { name: "robot", toml: include_str!("../../data-fixtures/instruments/robot.toml") },
    Preset { name: "classroom", toml: include_str!("../../data-fixtures/instruments/classroom.toml") },
];

impl Preset {
    /// The one of this name.
    #[must_use]
    pub fn find(name: &str) -> Option<&'static Self> {
        PRESETS.iter().find(|preset| preset.name == name)
    }

    /// Its file, read.
    ///
    /// # Errors
    /// None of the built-in ones has any; the type is that of a user's file.
    pub fn spec(&self) -> Result<SimulationSpec, SpecError> {
        SimulationSpec::from_toml(self.toml)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gonio::Instrument;

    #[test]
    fn every_preset_reads_and_says_what_it_is_and_nothing_else() {
        for preset in &PRESETS {
            let spec = preset.spec().unwrap_or_else(|e| panic!("{}: {e}", preset.name));
            assert!(spec.description.is_some_and(|d| !d.is_empty()), "{}", preset.name);
            assert_eq!((spec.material, spec.scan, spec.seed), (None, None, None), "{}", preset.name);
            assert_eq!(Preset::find(preset.name), Some(preset));
        }
        assert_eq!(PRESETS[0].spec().expect("reads").instrument, Instrument::noiseless());
        assert_eq!(Preset::find("no-such"), None);
    }

    /// Each number of a part stands with its source, or says that it is assumed and why.
    #[test]
    fn every_figure_of_a_preset_has_its_source_or_says_assumed() {
        let is_number =
            |line: &&str| line.contains(" = ") && !line.starts_with("description") && *line != "version = 1";
        for preset in &PRESETS[1..] {
            for line in preset.toml.lines().filter(|l| !l.starts_with('#')).filter(is_number) {
                let free = ["readings = 1", "theta_o_deg = 45"].contains(&line); // beside a line that says it
                let said = line.split_once('#').is_some_and(|(_, why)| !why.trim().is_empty());
                assert!(free || said, "{}: {line}", preset.name);
            }
        }
    }
}
