//! OBJ files (crate `tobj`).

use std::io::BufReader;
use std::path::Path;

use glam::DVec3;

use super::{Mesh, Vertices, whole_file};
use crate::render::RenderError;

/// The mesh in an OBJ file.
pub fn read(path: &Path, bytes: &[u8], vertex_normals: bool) -> Result<Mesh, RenderError> {
    let models = parse(bytes).map_err(|error| parse_error(path, bytes, error))?;
    let mut mesh = Mesh::default();
    for model in &models {
        append(&mut mesh, &model.mesh, vertex_normals).map_err(|message| whole_file(path, message))?;
    }
    Ok(mesh)
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
    RenderError::Mesh { path: path.into(), place: format!(", line {line}"), message: error.to_string() }
}

fn append(mesh: &mut Mesh, obj: &tobj::Mesh, vertex_normals: bool) -> Result<(), String> {
    if vertex_normals && obj.normal_indices.len() != obj.indices.len() {
        return Err("vertex normals are asked for, but not every corner of a face has one (`vn` and `f v//n`)".into());
    }
    let normals = if vertex_normals { vectors(&obj.normals) } else { Vec::new() };
    let vertices = Vertices { positions: vectors(&obj.positions), normals };
    vertices.check()?;
    let triples = |list: &[u32]| list.as_chunks::<3>().0.to_vec();
    let (faces, at_corners) = (triples(&obj.indices), triples(&obj.normal_indices));
    for (i, corners) in faces.iter().enumerate() {
        vertices.add_face(mesh, *corners, at_corners.get(i).copied().unwrap_or_default())?;
    }
    Ok(())
}

fn vectors(flat: &[f64]) -> Vec<DVec3> {
    flat.chunks_exact(3).map(|v| DVec3::new(v[0], v[1], v[2])).collect()
}
