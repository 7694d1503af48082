//! OBJ files (crate `tobj`).

use std::io::BufReader;
use std::path::Path;

use glam::DVec3;

use super::{Mesh, Vertices};
use crate::render::RenderError;

/// The mesh in an OBJ file.
pub fn read(path: &Path, bytes: &[u8], vertex_normals: bool) -> Result<Mesh, RenderError> {
    let models = parse(bytes).map_err(|error| parse_error(path, bytes, error))?;
    let mut mesh = Mesh::default();
    let mut before = 0;
    for model in &models {
        append(&mut mesh, &model.mesh, vertex_normals).map_err(|fault| {
            let line = fault.triangle.and_then(|i| line_of(bytes, before + i));
            RenderError::Mesh { path: path.into(), place: place(line), message: fault.message }
        })?;
        before += model.mesh.indices.len() / 3;
    }
    Ok(mesh)
}

/// What is wrong with a model, and with which of its triangles, if with one.
struct Fault {
    triangle: Option<usize>,
    message: String,
}

fn place(line: Option<usize>) -> String {
    line.map(|line| format!(", line {line}")).unwrap_or_default()
}

fn parse(bytes: &[u8]) -> Result<Vec<tobj::Model>, tobj::LoadError> {
    let options =
        tobj::LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..Default::default() };
    let no_materials = |_: &Path| Ok((Vec::new(), std::collections::HashMap::default()));
    tobj::load_obj_buf(&mut BufReader::new(bytes), &options, no_materials).map(|(models, _)| models)
}

/// The first line up to which the file already fails the same way.
fn parse_error(path: &Path, bytes: &[u8], error: tobj::LoadError) -> RenderError {
    let ends: Vec<usize> = bytes.iter().enumerate().filter(|(_, b)| **b == b'\n').map(|(i, _)| i + 1).collect();
    let fails = |end: &usize| parse(bytes.get(..*end).unwrap_or(bytes)).is_err_and(|e| e == error);
    let line = ends.partition_point(|end| !fails(end)) + 1;
    RenderError::Mesh { path: path.into(), place: place(Some(line)), message: error.to_string() }
}

/// The line with the face that became the file's triangle `triangle`, from 0. The parser keeps the order of faces but
/// numbers vertices anew, so a line is what finds them; it makes triangles of `l` with three vertices or more, too.
fn line_of(bytes: &[u8], triangle: usize) -> Option<usize> {
    let triangles = |line: &[u8]| {
        let line = String::from_utf8_lossy(line);
        let mut words = line.split_whitespace();
        if matches!(words.next(), Some("f" | "l")) { words.count().saturating_sub(2) } else { 0 }
    };
    let mut up_to = bytes.split(|b| *b == b'\n').map(triangles).scan(0, |sum, n| {
        *sum += n;
        Some(*sum)
    });
    up_to.position(|n| n > triangle).map(|i| i + 1)
}

fn append(mesh: &mut Mesh, obj: &tobj::Mesh, vertex_normals: bool) -> Result<(), Fault> {
    if vertex_normals && obj.normal_indices.len() != obj.indices.len() {
        let message = "vertex normals are asked for, but not every corner of a face has one (`vn` and `f v//n`)".into();
        return Err(Fault { triangle: None, message });
    }
    let normals = if vertex_normals { vectors(&obj.normals) } else { Vec::new() };
    let vertices = Vertices { positions: vectors(&obj.positions), normals };
    if let Some((vertex, p)) = vertices.not_finite() {
        let corner = obj.indices.iter().position(|i| *i as usize == vertex);
        let message = format!("the face has a corner at {p}, expected finite coordinates");
        return Err(Fault { triangle: corner.map(|c| c / 3), message });
    }
    let triples = |list: &[u32]| list.as_chunks::<3>().0.to_vec();
    let (faces, at_corners) = (triples(&obj.indices), triples(&obj.normal_indices));
    for (i, corners) in faces.iter().enumerate() {
        let of_face = |what: String| Fault { triangle: Some(i), message: format!("the face {what}") };
        let normals = at_corners.get(i).copied().unwrap_or_default();
        vertices.add_face(mesh, *corners, normals).map_err(of_face)?;
    }
    Ok(())
}

fn vectors(flat: &[f64]) -> Vec<DVec3> {
    flat.chunks_exact(3).map(|v| DVec3::new(v[0], v[1], v[2])).collect()
}
