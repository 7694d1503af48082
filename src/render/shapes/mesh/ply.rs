//! PLY files, ASCII or binary (crate `ply-rs-bw`).

use std::path::Path;

use glam::DVec3;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

use super::{Mesh, Vertices, whole_file};
use crate::render::RenderError;

/// The mesh in a PLY file: elements `vertex` with x, y, z (and nx, ny, nz), and `face` with `vertex_indices` or `vertex_index`.
pub fn read(path: &Path, bytes: &[u8], vertex_normals: bool) -> Result<Mesh, RenderError> {
    let broken = |error: &ParseError| RenderError::Mesh {
        path: path.into(),
        place: error.line().map(|line| format!(", line {line}")).unwrap_or_default(),
        message: error.to_string().split_whitespace().collect::<Vec<_>>().join(" "),
    };
    let (points, faces) = parse(bytes).map_err(|e| broken(&e))?;
    assemble(&points, &faces, vertex_normals).map_err(|message| whole_file(path, message))
}

fn parse(mut bytes: &[u8]) -> Result<(Vec<Point>, Vec<Face>), ParseError> {
    let mut reader = Reader::new(&mut bytes);
    let header = Parser::<Other>::new().read_header(&mut reader)?;
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    for element in header.elements.values() {
        match element.name.as_str() {
            "vertex" => points = Parser::<Point>::new().read_payload_for_element(&mut reader, element, &header)?,
            "face" => faces = Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header)?,
            _ => drop(Parser::<Other>::new().read_payload_for_element(&mut reader, element, &header)?),
        }
    }
    Ok((points, faces))
}

fn assemble(points: &[Point], faces: &[Face], vertex_normals: bool) -> Result<Mesh, String> {
    if let Some(i) = points.iter().position(|p| p.found & 0b111 != 0b111) {
        return Err(format!("vertex {} has no x, y and z that are numbers", i + 1));
    }
    if vertex_normals && points.iter().any(|p| p.found != 0b11_1111) {
        return Err("vertex normals are asked for, but the vertices have no nx, ny and nz".into());
    }
    let vector = |v: &[f64]| DVec3::new(v[0], v[1], v[2]);
    let mut vertices = Vertices::default();
    vertices.positions.extend(points.iter().map(|p| vector(&p.values[..3])));
    if vertex_normals {
        vertices.normals.extend(points.iter().map(|p| vector(&p.values[3..])));
    }
    vertices.check()?;
    let mut mesh = Mesh::default();
    for (i, face) in faces.iter().enumerate() {
        if face.wrong || face.corners.len() < 3 {
            return Err(format!("face {} has no list `vertex_indices` of at least 3 vertices", i + 1));
        }
        for k in 1..face.corners.len() - 1 {
            let corners = [face.corners[0], face.corners[k], face.corners[k + 1]];
            let of_face = |what: String| format!("face {} {what}", i + 1);
            vertices.add_face(&mut mesh, corners, corners).map_err(of_face)?;
        }
    }
    Ok(mesh)
}

/// Position and normal of a vertex, and a bit for each number that was there.
#[derive(Debug, Default)]
struct Point {
    values: [f64; 6],
    found: u8,
}

impl Point {
    fn set(&mut self, name: &str, value: f64) -> PropertyAccessResult {
        let Some(i) = ["x", "y", "z", "nx", "ny", "nz"].iter().position(|known| *known == name) else {
            return PropertyAccessResult::Ignored;
        };
        self.values[i] = value;
        self.found |= 1 << i;
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Point {
    fn new() -> Self {
        Self::default()
    }

    fn set_float(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        self.set(name, f64::from(value))
    }

    fn set_double(&mut self, name: &str, value: f64) -> PropertyAccessResult {
        self.set(name, value)
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let value = match property {
            Property::Char(x) => f64::from(x),
            Property::UChar(x) => f64::from(x),
            Property::Short(x) => f64::from(x),
            Property::UShort(x) => f64::from(x),
            Property::Int(x) => f64::from(x),
            Property::UInt(x) => f64::from(x),
            _ => return PropertyAccessResult::Ignored,
        };
        self.set(name, value)
    }
}

/// Vertices of a polygon.
#[derive(Debug, Default)]
struct Face {
    corners: Vec<u32>,
    /// Whether a vertex was named by a negative number.
    wrong: bool,
}

impl Face {
    fn set<T: TryInto<u32>>(&mut self, name: &str, list: Vec<T>) -> PropertyAccessResult {
        if !matches!(name, "vertex_indices" | "vertex_index") {
            return PropertyAccessResult::Ignored;
        }
        let count = list.len();
        self.corners = list.into_iter().map_while(|i| i.try_into().ok()).collect();
        self.wrong = self.corners.len() != count;
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_list_char(&mut self, name: &str, list: Vec<i8>) -> PropertyAccessResult {
        self.set(name, list)
    }

    fn set_list_uchar(&mut self, name: &str, list: Vec<u8>) -> PropertyAccessResult {
        self.set(name, list)
    }

    fn set_list_short(&mut self, name: &str, list: Vec<i16>) -> PropertyAccessResult {
        self.set(name, list)
    }

    fn set_list_ushort(&mut self, name: &str, list: Vec<u16>) -> PropertyAccessResult {
        self.set(name, list)
    }

    fn set_list_int(&mut self, name: &str, list: Vec<i32>) -> PropertyAccessResult {
        self.set(name, list)
    }

    fn set_list_uint(&mut self, name: &str, list: Vec<u32>) -> PropertyAccessResult {
        self.set(name, list)
    }
}

/// An element that is passed over.
#[derive(Debug)]
struct Other;

impl PropertyAccess for Other {
    fn new() -> Self {
        Self
    }
}
