//! What the page's script reads.

use base64::{Engine, engine::general_purpose::STANDARD};
use serde_json::{Value, json};

use super::lobes::Lobes;
use super::pictures::Pictures;
use super::residuals::Residuals;

/// All of it as JSON that no HTML parser takes for markup.
pub(super) fn json(lobes: Option<&Lobes>, residuals: &[Residuals], pictures: Option<&Pictures>) -> String {
    let object = json!({
        "lobes": lobes.map(|l| &l.data),
        "residuals": residuals.iter().map(|r| &r.data).collect::<Vec<_>>(),
        "pictures": pictures.map(|p| &p.data),
    });
    object.to_string().replace('<', "\\u003c")
}

/// Five significant digits; `null` for what is no number.
pub(super) fn rounded(x: f64) -> Value {
    if !x.is_finite() {
        return Value::Null;
    }
    // Printed and read back, so that it is the shortest number of these digits.
    format!("{x:.4e}").parse::<f64>().map_or(Value::Null, |short| {
        if short.fract() == 0.0 && short.abs() < 1e15 { json!(short as i64) } else { json!(short) }
    })
}

/// Numbers as base64 of little-endian single precision.
pub(super) fn encoded(values: impl Iterator<Item = f32>) -> String {
    let bytes: Vec<u8> = values.flat_map(f32::to_le_bytes).collect();
    STANDARD.encode(bytes)
}

/// Bytes as a data URI.
pub(super) fn data_uri(kind: &str, bytes: &[u8]) -> String {
    format!("data:{kind};base64,{}", STANDARD.encode(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_markup_is_not_closed() {
        assert_eq!([rounded(0.1234567), rounded(30.0), rounded(f64::NAN)], [json!(0.12346), json!(30), Value::Null]);
        let text = json(None, &[], None);
        assert!(!text.contains('<'));
    }
}
