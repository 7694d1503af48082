//! The plan of effects: what a scene or an instrument calls for, and why.

/// An effect and whether it runs.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Effect {
    /// Its name.
    pub name: &'static str,
    /// Whether it is simulated.
    pub on: bool,
    /// Because of what.
    pub why: String,
}

/// All effects that are known, in the order in which they act.
#[derive(Debug, Clone, PartialEq, Eq, Default, serde::Serialize)]
pub struct Plan {
    /// The effects.
    pub effects: Vec<Effect>,
}

impl Plan {
    /// Adds an effect.
    pub fn push(&mut self, name: &'static str, on: bool, why: impl Into<String>) {
        self.effects.push(Effect { name, on, why: why.into() });
    }
}
