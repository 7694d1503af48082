//! From what a user names to a material: a built-in name, a fitted `.json`, or a measurement.

use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use super::error::ChainError;
use super::library::{BuiltInMaterial, MATERIALS};
use crate::brdf::{Brdf, Material};
use crate::measurement::interpolate::TableBrdf;
use crate::measurement::{Dimension, Measurement, ReadOptions, formats};
use crate::render;

/// What a name or file turned out to be.
#[derive(Debug)]
pub enum Source {
    /// A fitted or built-in material.
    Fitted(Box<Material>),
    /// A measurement.
    Measured(Box<Measurement>),
}

impl Source {
    /// Channel names.
    #[must_use]
    pub fn channels(&self) -> &[String] {
        match self {
            Self::Fitted(m) => &m.channels,
            Self::Measured(m) => &m.channels,
        }
    }

    /// The world that it belongs to.
    #[must_use]
    pub fn dimension(&self) -> Dimension {
        match self {
            Self::Fitted(m) if m.is_flat() => Dimension::Flat,
            Self::Fitted(_) => Dimension::Space,
            Self::Measured(m) => m.dimension,
        }
    }
}

/// Loads a built-in material by name, or a material or measurement from a file (`-` is stdin).
///
/// # Errors
/// [`ChainError`] naming what was looked for and what was found.
pub fn load(name: &str, options: &ReadOptions) -> Result<Source, ChainError> {
    if let Some(built_in) = BuiltInMaterial::find(name) {
        return Ok(Source::Fitted(Box::new(built_in.material())));
    }
    let path = Path::new(name);
    if let Some(bytes) = stream(path)? {
        return from_bytes(path, bytes, options);
    }
    if !path.exists() && path.extension().is_none() {
        let known = MATERIALS.map(|m| m.name).join(", ");
        return Err(ChainError::NoSuchMaterial { name: name.into(), known });
    }
    // Tables are large: only a material's text is read here.
    if starts_like_json(path)? {
        let bytes = std::fs::read(path).map_err(|source| ChainError::io(path, source))?;
        return from_bytes(path, bytes, options);
    }
    Ok(Source::Measured(Box::new(formats::read(path, options)?)))
}

/// Loads a fitted (or built-in) material.
///
/// # Errors
/// [`ChainError`]; a measurement is refused.
pub fn load_material(name: &str) -> Result<Material, ChainError> {
    match load(name, &ReadOptions::default())? {
        Source::Fitted(material) => Ok(*material),
        Source::Measured(_) => Err(ChainError::NotAMaterial { path: name.into() }),
    }
}

/// The bytes of a pipe, which gives them once: they are read before they are looked at. What can't be opened is left to the
/// reader, who says why.
fn stream(path: &Path) -> Result<Option<Vec<u8>>, ChainError> {
    let there = path == Path::new("-") || path.exists();
    Ok(if there { formats::read_stream(path)? } else { None })
}

/// Whether the first byte that is not blank is `{`. What can't be opened is left to the reader, who says why.
fn starts_like_json(path: &Path) -> Result<bool, ChainError> {
    let Ok(mut file) = std::fs::File::open(path) else { return Ok(false) };
    if path.is_dir() {
        return Ok(false);
    }
    let mut head = [0u8; 64];
    let read = file.read(&mut head).map_err(|source| ChainError::io(path, source))?;
    Ok(looks_like_json(&head[..read]))
}

fn looks_like_json(bytes: &[u8]) -> bool {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    text.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{')
}

fn from_bytes(path: &Path, bytes: Vec<u8>, options: &ReadOptions) -> Result<Source, ChainError> {
    if !looks_like_json(&bytes) {
        return Ok(Source::Measured(Box::new(formats::read_bytes(path, bytes, options)?)));
    }
    let text = String::from_utf8(bytes).map_err(|e| ChainError::io(path, std::io::Error::other(e)))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let material = Material::from_json(text).map_err(|source| ChainError::Material { path: path.into(), source })?;
    Ok(Source::Fitted(Box::new(material)))
}

/// Which channels to show: three as red, green and blue, or one as grey.
///
/// # Errors
/// [`ChainError::Channels`] where the names asked for are not there, or none were asked for and the choice is not plain.
pub fn shown_channels(name: &str, channels: &[String], rgb: Option<&[String; 3]>) -> Result<Vec<usize>, ChainError> {
    let find = |wanted: &str| channels.iter().position(|c| c.eq_ignore_ascii_case(wanted));
    let refuse = |reason: String| ChainError::Channels { name: name.into(), reason, found: channels.join(", ") };
    if let Some(wanted) = rgb {
        return wanted.iter().map(|w| find(w).ok_or_else(|| refuse(format!("there is no channel {w}")))).collect();
    }
    if channels.len() == 1 {
        return Ok(vec![0]);
    }
    for names in [["r", "g", "b"], ["red", "green", "blue"]] {
        if let Some(all) = names.iter().map(|n| find(n)).collect::<Option<Vec<usize>>>() {
            return Ok(all);
        }
    }
    Err(refuse("say which three to show with --rgb A,B,C".into()))
}

/// The source as the tracer takes it.
///
/// # Errors
/// [`ChainError`] where it can't be rendered, with the reason.
pub fn render_material(name: &str, source: &Source, rgb: Option<&[String; 3]>) -> Result<render::Material, ChainError> {
    let channels = shown_channels(name, source.channels(), rgb)?;
    let brdf: Arc<dyn Brdf> = match source {
        Source::Fitted(material) => match material.reflectance(&channels) {
            Some(reflectance) => Arc::new(reflectance),
            None => return Err(ChainError::Flat { name: name.into() }),
        },
        Source::Measured(table) => Arc::new(TableBrdf::new(table, &channels)?),
    };
    Ok(render::Material::Brdf(brdf))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(list: &[&str]) -> Vec<String> {
        list.iter().map(|s| (*s).to_owned()).collect()
    }

    #[test]
    fn channels_are_chosen_where_the_choice_is_plain() {
        assert_eq!(shown_channels("m", &names(&["b", "R", "g"]), None).expect("rgb"), [1, 2, 0]);
        assert_eq!(shown_channels("m", &names(&["650nm"]), None).expect("grey"), [0]);
        let spectral = names(&["450nm", "550nm", "650nm"]);
        assert!(shown_channels("m", &spectral, None).expect_err("not plain").to_string().contains("--rgb"));
        let rgb = ["650nm", "550nm", "450nm"].map(str::to_owned);
        assert_eq!(shown_channels("m", &spectral, Some(&rgb)).expect("named"), [2, 1, 0]);
    }

    #[test]
    fn an_unknown_name_lists_the_known_ones() {
        let error = load("velvet", &ReadOptions::default()).expect_err("unknown").to_string();
        assert!(error.contains("velvet") && error.contains("glossy-paint"), "{error}");
    }
}
