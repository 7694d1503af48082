//! Which format a file is in, by its first bytes. The name's extension says nothing: three formats share `.bsdf`.

use super::Format;
use super::source::Source;
use super::text::quoted;
use crate::measurement::MeasurementError;

/// Bytes looked at: comments may come first.
const HEAD: usize = 1 << 16;

/// Finds the format of `source`, or says what it looks like instead.
pub(super) fn sniff(source: &Source) -> Result<Format, MeasurementError> {
    let head = source.head(HEAD)?;
    if head.is_empty() {
        return Err(MeasurementError::invalid(source.path(), "byte 0", expected(), "an empty file"));
    }
    format_of(&head)
        .ok_or_else(|| MeasurementError::invalid(source.path(), "the beginning", expected(), looks_like(&head)))
}

/// The format whose signature `head` bears.
fn format_of(head: &[u8]) -> Option<Format> {
    if head.starts_with(b"tensor_file\0") {
        return Some(Format::Rgl);
    }
    if head.starts_with(&90i32.to_le_bytes()) || head.starts_with(&90i32.to_be_bytes()) {
        return Some(Format::Merl);
    }
    if head.contains(&0) {
        // No text format holds a NUL: a MERL file with other dimensions, if its header is plausible.
        return plausible_merl_header(head).then_some(Format::Merl);
    }
    let text = String::from_utf8_lossy(head.strip_prefix(b"\xef\xbb\xbf".as_slice()).unwrap_or(head));
    text_format_of(&text)
}

/// Whether three small integers stand first, in either byte order.
fn plausible_merl_header(head: &[u8]) -> bool {
    let dims = |decode: fn([u8; 4]) -> i32| {
        let (words, _) = head.as_chunks::<4>();
        words.len() >= 3 && words.iter().take(3).all(|word| (1..=100_000).contains(&decode(*word)))
    };
    dims(i32::from_le_bytes) || dims(i32::from_be_bytes)
}

fn text_format_of(text: &str) -> Option<Format> {
    const ALTA: [&str; 6] = ["#DIM", "#PARAM_IN", "#PARAM_OUT", "#VS", "#ALTA", "#FORMAT"];
    const ZEMAX: [&str; 6] =
        ["Source", "Symmetry", "SpectralContent", "ScatterType", "SampleRotation", "AngleOfIncidence"];
    for line in text.lines().map(str::trim).filter(|line| !line.is_empty()) {
        let word = line.split_whitespace().next().unwrap_or_default();
        if ALTA.contains(&word) {
            return Some(Format::Alta);
        }
        if line.starts_with('#') {
            continue;
        }
        return match word {
            "type" if line.split_whitespace().nth(1) == Some("bsdf_data") => Some(Format::Fred),
            _ if ZEMAX.contains(&word) => Some(Format::Zemax),
            _ if line.starts_with('{') => None,
            _ if line.contains(',') || line.contains("theta_i_deg") => Some(Format::Csv),
            _ => None,
        };
    }
    None
}

/// The formats that there are, for a message.
fn expected() -> String {
    let names: Vec<&str> = Format::ALL.iter().map(|f| f.name()).collect();
    format!("a measurement in one of the formats {}", names.join(", "))
}

/// What an unknown file looks like, for a message.
fn looks_like(head: &[u8]) -> String {
    let known: [(&[u8], &str); 6] = [
        (b"\xff\xfe", "UTF-16 text (save it as UTF-8)"),
        (b"\xfe\xff", "UTF-16 text (save it as UTF-8)"),
        (b"\x76\x2f\x31\x01", "an OpenEXR image"),
        (b"\x89PNG", "a PNG image"),
        (b"PK\x03\x04", "a ZIP archive or spreadsheet (export it as CSV)"),
        (b"{", "JSON, as of a fitted material"),
    ];
    if let Some((_, what)) = known.iter().find(|(magic, _)| head.starts_with(magic)) {
        return (*what).to_string();
    }
    let line = head.split(|b| *b == b'\n').map(<[u8]>::trim_ascii).find(|l| !l.is_empty() && !l.starts_with(b"#"));
    match line {
        Some(line) if !line.contains(&0) => format!("text that begins with {}", quoted(&String::from_utf8_lossy(line))),
        Some(_) => "unknown binary data".to_string(),
        None => "nothing but comments".to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signatures_decide() {
        let merl = |dims: [i32; 3]| dims.iter().flat_map(|d| d.to_le_bytes()).collect::<Vec<u8>>();
        assert_eq!(format_of(b"tensor_file\0\x01\x00"), Some(Format::Rgl));
        assert_eq!(format_of(&merl([90, 90, 180])), Some(Format::Merl));
        assert_eq!(format_of(&merl([45, 45, 90])), Some(Format::Merl));
        assert_eq!(format_of(&[0, 0, 0, 90, 0, 0, 0, 90, 0, 0, 0, 180]), Some(Format::Merl));
        assert_eq!(format_of(&[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]), None);
        assert_eq!(format_of(b"# c\r\n#DIM 3 1\r\n"), Some(Format::Alta));
        assert_eq!(format_of(b"# c\n\nSource\tMeasured\n"), Some(Format::Zemax));
        assert_eq!(format_of(b"type bsdf_data\nformat\n"), Some(Format::Fred));
        assert_eq!(format_of(b"\xef\xbb\xbf# c\ntheta_i_deg,r\n"), Some(Format::Csv));
        assert_eq!(format_of(b"{\"format\": \"goniofit-material\", \"a\": 1}"), None);
        assert_eq!(format_of(b"type other\n"), None);
    }

    #[test]
    fn what_is_not_a_measurement_is_called_by_its_name() {
        for (bytes, what) in
            [(&b"{}"[..], "JSON"), (b"\x89PNG\r\n", "PNG"), (b"\xff\xfea\0", "UTF-16"), (b"# a\n# b\n", "comments")]
        {
            assert!(looks_like(bytes).contains(what), "{}", looks_like(bytes));
        }
        assert!(looks_like(b"# a\nhello world\n").contains("hello world"));
    }
}
