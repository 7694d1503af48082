//! What classes look like: colours for paper and for dark screens, line widths, type.
//!
//! Series have the colours of Okabe and Ito (2008), lightened where they stand on black, and dashes of their own besides.

use std::fmt::Write;

/// Colours by name, on white.
pub(in crate::report) const LIGHT: [(&str, &str); 12] = [
    ("plot-paper", "#ffffff"),
    ("plot-ink", "#1d2330"),
    ("plot-muted", "#59616f"),
    ("plot-axis", "#8b93a1"),
    ("plot-grid", "#e4e7ec"),
    ("plot-0", "#1d2330"),
    ("plot-1", "#d55e00"),
    ("plot-2", "#0072b2"),
    ("plot-3", "#00845f"),
    ("plot-4", "#b0568c"),
    ("plot-5", "#a86f00"),
    ("plot-6", "#2f7fb5"),
];

/// The same on a dark screen.
pub(in crate::report) const DARK: [(&str, &str); 12] = [
    ("plot-paper", "#171b22"),
    ("plot-ink", "#e7eaf0"),
    ("plot-muted", "#a4adbb"),
    ("plot-axis", "#6a7383"),
    ("plot-grid", "#2b313b"),
    ("plot-0", "#e7eaf0"),
    ("plot-1", "#ff8f45"),
    ("plot-2", "#5bb4ee"),
    ("plot-3", "#35c79c"),
    ("plot-4", "#e39ac6"),
    ("plot-5", "#e6b13d"),
    ("plot-6", "#8fd0f5"),
];

/// Colours of series.
pub(super) const COLORS: usize = 7;

/// The number of a series that is a reference: thin and grey.
pub(super) const REFERENCE: usize = usize::MAX;

const RULES: &str = include_str!("../templates/plot.css");

/// Rules of a figure that stands alone.
pub(super) fn paper_css() -> String {
    let mut css = RULES.to_owned();
    for (name, color) in LIGHT {
        css = css.replace(&format!("var(--{name})"), color);
    }
    css
}

/// Rules of figures in a page, which defines the colours as variables.
pub(in crate::report) fn page_css() -> &'static str {
    RULES
}

/// Colours as definitions of variables.
pub(in crate::report) fn variables(colors: &[(&str, &str)]) -> String {
    let mut css = String::new();
    for (name, color) in colors {
        // Writing to a String can't fail.
        let _ = write!(css, "--{name}:{color};");
    }
    css
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paper_has_no_variables_left_and_both_have_the_same_names() {
        assert!(!paper_css().contains("var("), "{}", paper_css());
        assert_eq!(LIGHT.map(|c| c.0), DARK.map(|c| c.0));
    }
}
