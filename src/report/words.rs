//! Numbers as people read them.

use crate::report::plot::minus;

/// Four significant digits, by a power of ten where it is very small or large; `–` for what is no number.
pub(in crate::report) fn number(x: f64) -> String {
    digits(x, 4)
}

/// So many significant digits.
pub(in crate::report) fn digits(x: f64, digits: usize) -> String {
    if !x.is_finite() {
        return "–".into();
    }
    let size = x.abs();
    if size != 0.0 && !(1e-3..1e6).contains(&size) {
        return by_power(x, digits);
    }
    let before = if size == 0.0 { 0 } else { size.log10().floor() as i32 };
    let places = (digits as i32 - 1 - before).max(0) as usize;
    let text = format!("{x:.places$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    minus(text)
}

fn by_power(x: f64, digits: usize) -> String {
    let text = format!("{x:.*e}", digits.saturating_sub(1));
    let Some((digits, power)) = text.split_once('e') else { return minus(&text) };
    let raised: String = power.chars().map(raised).collect();
    minus(&format!("{digits}·10{raised}"))
}

/// A digit or sign as an exponent.
fn raised(c: char) -> char {
    match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => digit.to_digit(10).and_then(|d| char::from_u32(0x2070 + d)).unwrap_or(digit),
    }
}

/// A share in per cent.
pub(in crate::report) fn percent(share: f64) -> String {
    match share {
        0.0 => "0\u{a0}%".into(),
        s if s < 1e-3 => format!("{}\u{a0}%", digits(100.0 * s, 2)),
        s if s > 0.9995 && s < 1.0 => format!("{}\u{a0}%", digits(100.0 * s, 5)),
        s => format!("{}\u{a0}%", digits(100.0 * s, 3)),
    }
}

/// A time.
pub(in crate::report) fn time(seconds: f64) -> String {
    match seconds {
        s if s < 1e-3 => format!("{}\u{a0}µs", digits(s * 1e6, 2)),
        s if s < 1.0 => format!("{}\u{a0}ms", digits(s * 1e3, 3)),
        s if s < 120.0 => format!("{}\u{a0}s", digits(s, 3)),
        s if s < 7200.0 => format!("{}\u{a0}min", digits(s / 60.0, 3)),
        s => format!("{}\u{a0}h", digits(s / 3600.0, 3)),
    }
}

/// A count with thin spaces between groups of three digits.
pub(in crate::report) fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (k, c) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(c);
    }
    text
}

/// A value with the digits that its error lets count: two of the error.
pub(in crate::report) fn to_error(value: f64, error: f64) -> (String, String) {
    let sound = error > 0.0 && error.is_finite() && value.is_finite();
    if !sound {
        return (number(value), number(error));
    }
    let places = 1 - error.log10().floor() as i32;
    if !(0..=9).contains(&places) {
        return (number(value), digits(error, 2));
    }
    let places = places as usize;
    (minus(&format!("{value:.places$}")), format!("{error:.places$}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!([number(0.0), number(1.0), number(90.016), number(-0.05)], ["0", "1", "90.02", "−0.05"]);
        assert_eq!([number(7.374e-4), number(f64::NAN), number(2e7)], ["7.374·10⁻⁴", "–", "2.000·10⁷"]);
        assert_eq!(
            [percent(0.1874), percent(0.99998), percent(2e-5), percent(1.0)],
            ["18.7\u{a0}%", "99.998\u{a0}%", "0.002\u{a0}%", "100\u{a0}%"]
        );
        assert_eq!([time(0.0093), time(3.2), time(2e-5)], ["9.3\u{a0}ms", "3.2\u{a0}s", "20\u{a0}µs"]);
        assert_eq!([count(5), count(22050), count(1458000)], ["5", "22\u{202f}050", "1\u{202f}458\u{202f}000"]);
        assert_eq!(to_error(0.320032, 0.000049), ("0.320032".into(), "0.000049".into()));
        assert_eq!(to_error(90.0163, 0.0192), ("90.016".into(), "0.019".into()));
    }
}
