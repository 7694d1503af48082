//! The container of an RGL file: named tensors behind a header, little-endian, nothing allocated by what a header claims.
//!
//! Layout: `tensor_file\0`, version (u8 1, u8 0), u32 field count; per field u16 length of its name, the name, u16 number of
//! dimensions, u8 type, u64 byte offset of its data from the file's start, u64 extents (last one fastest).

use std::path::{Path, PathBuf};

use crate::measurement::MeasurementError;

const MAGIC: &[u8] = b"tensor_file\0";

/// Type of a tensor's entries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Kind {
    /// Its name.
    pub name: &'static str,
    /// Bytes per entry.
    pub size: usize,
}

const U8: Kind = Kind { name: "u8", size: 1 };
const F32: Kind = Kind { name: "f32", size: 4 };

/// The types in the order of their codes, which start at 1.
const KINDS: [Kind; 11] = [
    U8,
    Kind { name: "i8", size: 1 },
    Kind { name: "u16", size: 2 },
    Kind { name: "i16", size: 2 },
    Kind { name: "u32", size: 4 },
    Kind { name: "i32", size: 4 },
    Kind { name: "u64", size: 8 },
    Kind { name: "i64", size: 8 },
    Kind { name: "f16", size: 2 },
    F32,
    Kind { name: "f64", size: 8 },
];

/// One named tensor; its data lie wholly inside the file.
#[derive(Debug, Clone)]
pub(super) struct Field<'a> {
    pub name: String,
    pub kind: Kind,
    pub shape: Vec<usize>,
    pub data: &'a [u8],
}

/// A parsed header over the bytes of a file.
#[derive(Debug)]
pub(super) struct TensorFile<'a> {
    path: PathBuf,
    fields: Vec<Field<'a>>,
}

/// A tensor of finite-or-not `f32`, as stored.
#[derive(Debug, Clone)]
pub(super) struct Floats {
    pub shape: Vec<usize>,
    pub values: Vec<f32>,
}

impl<'a> TensorFile<'a> {
    /// Reads the header and checks that every field lies inside the file.
    pub fn parse(path: &Path, bytes: &'a [u8]) -> Result<Self, MeasurementError> {
        let mut cursor = Cursor { path, bytes, at: 0 };
        cursor.magic()?;
        let count = cursor.u32("the number of fields (u32)")?;
        let mut fields: Vec<Field<'a>> = Vec::new();
        for index in 0..count {
            let start = cursor.at;
            let field = cursor.field(index, count)?;
            if fields.iter().any(|known| known.name == field.name) {
                return Err(cursor.invalid(start, "a field of a new name", format!("field `{}` again", field.name)));
            }
            fields.push(field);
        }
        Ok(Self { path: path.into(), fields })
    }

    /// The field called `name`, if there is one.
    pub fn find(&self, name: &str) -> Option<&Field<'a>> {
        self.fields.iter().find(|field| field.name == name)
    }

    /// Bytes of the u8 field `name`, if there is one.
    pub fn bytes(&self, name: &str) -> Result<Option<&'a [u8]>, MeasurementError> {
        let Some(field) = self.find(name) else { return Ok(None) };
        self.expect_kind(field, U8)?;
        Ok(Some(field.data))
    }

    /// The f32 field `name` of `rank` dimensions.
    pub fn floats(&self, name: &str, rank: usize) -> Result<Floats, MeasurementError> {
        let field = self.find(name).ok_or_else(|| {
            let names: Vec<_> = self.fields.iter().map(|f| format!("`{}`", f.name)).collect();
            self.invalid("header", format!("a field `{name}`"), format!("only {}", names.join(", ")))
        })?;
        self.expect_kind(field, F32)?;
        if field.shape.len() != rank {
            return Err(self.wrong_shape(name, format!("{rank} dimensions"), &field.shape));
        }
        let (entries, _) = field.data.as_chunks::<4>();
        Ok(Floats { shape: field.shape.clone(), values: entries.iter().map(|b| f32::from_le_bytes(*b)).collect() })
    }

    /// The f32 field `name` of `rank` dimensions whose entries are all finite and at least `low` (−∞: any).
    pub fn bounded(&self, name: &str, rank: usize, low: f32) -> Result<Floats, MeasurementError> {
        let floats = self.floats(name, rank)?;
        match floats.values.iter().position(|v| !(v.is_finite() && *v >= low)) {
            None => Ok(floats),
            Some(i) => {
                let least = if low.is_finite() { format!(", at least {low:e}") } else { String::new() };
                let found = floats.values.get(i).map_or_else(String::new, f32::to_string);
                Err(self.invalid(entry(name, i), format!("a finite number{least}"), found))
            }
        }
    }

    fn expect_kind(&self, field: &Field<'_>, kind: Kind) -> Result<(), MeasurementError> {
        if field.kind == kind {
            return Ok(());
        }
        Err(self.invalid(
            format!("field `{}`", field.name),
            format!("type {}", kind.name),
            format!("type {}", field.kind.name),
        ))
    }

    /// An error about the shape of a field.
    pub fn wrong_shape(&self, name: &str, expected: impl Into<String>, found: &[usize]) -> MeasurementError {
        self.invalid(format!("field `{name}`, shape"), expected, shape_text(found))
    }

    /// An error about what stands at `place`.
    pub fn invalid(
        &self,
        place: impl Into<String>,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> MeasurementError {
        MeasurementError::Invalid {
            path: self.path.clone(),
            place: place.into(),
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// An error about what goniofit can't use.
    pub fn unsupported(&self, reason: impl Into<String>) -> MeasurementError {
        MeasurementError::Unsupported { path: self.path.clone(), reason: reason.into() }
    }
}

/// Place of an entry for an error or a note.
pub(super) fn entry(field: &str, index: usize) -> String {
    format!("field `{field}`, entry {index}")
}

/// A shape as 1×8×32×32.
pub(super) fn shape_text<T: ToString>(shape: &[T]) -> String {
    shape.iter().map(ToString::to_string).collect::<Vec<_>>().join("×")
}

/// Reads a header front to back.
struct Cursor<'a, 'p> {
    path: &'p Path,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a, '_> {
    fn magic(&mut self) -> Result<(), MeasurementError> {
        let magic = self.take(MAGIC.len(), "the mark `tensor_file\\0`")?;
        if magic != MAGIC {
            return Err(self.invalid(0, "the mark `tensor_file\\0`", format!("`{}`", magic.escape_ascii())));
        }
        let [major, minor] = self.array("the version (2 × u8)")?;
        if (major, minor) != (1, 0) {
            return Err(self.invalid(MAGIC.len(), "version 1.0", format!("version {major}.{minor}")));
        }
        Ok(())
    }

    fn field(&mut self, index: u32, count: u32) -> Result<Field<'a>, MeasurementError> {
        let length = self.u16(&format!("the name's length (u16) of field {} of {count}", index + 1))?;
        let start = self.at;
        let name = self.take(usize::from(length), &format!("a name of {length} bytes"))?;
        let name = std::str::from_utf8(name)
            .map_err(|_| self.invalid(start, "a field's name in UTF-8", format!("`{}`", name.escape_ascii())))?
            .to_string();
        let rank = self.u16(&format!("the number of dimensions (u16) of field `{name}`"))?;
        let kind = self.kind(&name)?;
        let offset = self.u64(&format!("the offset (u64) of field `{name}`"))?;
        let shape = (0..rank)
            .map(|_| self.u64(&format!("{rank} extents (u64) of field `{name}`")))
            .collect::<Result<Vec<u64>, _>>()?;
        let data = self.data(&name, kind, offset, &shape)?;
        Ok(Field { name, kind, shape: shape.iter().map(|&n| n as usize).collect(), data })
    }

    fn kind(&mut self, name: &str) -> Result<Kind, MeasurementError> {
        let at = self.at;
        let [code] = self.array(&format!("the type (u8) of field `{name}`"))?;
        usize::from(code)
            .checked_sub(1)
            .and_then(|i| KINDS.get(i).copied())
            .ok_or_else(|| self.invalid(at, format!("the type of field `{name}`, 1 to 11"), code.to_string()))
    }

    /// The bytes of a field; an extent of 0, a product that overflows and data past the end are all refused.
    fn data(&self, name: &str, kind: Kind, offset: u64, shape: &[u64]) -> Result<&'a [u8], MeasurementError> {
        let header = format!("field `{name}` has {} × {} at byte {offset}", shape_text(shape), kind.name);
        if shape.is_empty() || shape.contains(&0) {
            return Err(self.invalid(self.at, format!("positive extents of field `{name}`"), shape_text(shape)));
        }
        let length = shape.iter().try_fold(kind.size as u64, |product, &n| product.checked_mul(n));
        let end = length.and_then(|length| offset.checked_add(length)).unwrap_or(u64::MAX);
        let range = usize::try_from(offset).ok().zip(usize::try_from(end).ok());
        range.and_then(|(from, to)| self.bytes.get(from..to)).ok_or_else(|| MeasurementError::Length {
            path: self.path.into(),
            header,
            expected: end,
            found: self.bytes.len() as u64,
        })
    }

    fn take(&mut self, length: usize, what: &str) -> Result<&'a [u8], MeasurementError> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let taken = rest.get(..length).ok_or_else(|| {
            self.invalid(self.at, what, format!("the end of the file, {} bytes further on", rest.len()))
        })?;
        self.at += length;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], MeasurementError> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(N, what)?);
        Ok(out)
    }

    fn u16(&mut self, what: &str) -> Result<u16, MeasurementError> {
        Ok(u16::from_le_bytes(self.array(what)?))
    }

    fn u32(&mut self, what: &str) -> Result<u32, MeasurementError> {
        Ok(u32::from_le_bytes(self.array(what)?))
    }

    fn u64(&mut self, what: &str) -> Result<u64, MeasurementError> {
        Ok(u64::from_le_bytes(self.array(what)?))
    }

    fn invalid(&self, at: usize, expected: impl Into<String>, found: impl Into<String>) -> MeasurementError {
        MeasurementError::Invalid {
            path: self.path.into(),
            place: format!("byte {at}"),
            expected: expected.into(),
            found: found.into(),
        }
    }
}
