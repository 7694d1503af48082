//! Triangle meshes, and reading them from OBJ files.

use std::io::BufReader;
use std::path::Path;

use glam::DVec3;

use super::super::RenderError;

/// A triangle mesh.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Corners of each triangle, m; counter-clockwise seen from the lit side.
    pub triangles: Vec<[DVec3; 3]>,
    /// Unit normals at the corners; empty where the faces are flat.
    pub normals: Vec<[DVec3; 3]>,
}

/// Reads a mesh from an OBJ file; polygons become fans of triangles, triangles without area are left out.
///
/// # Errors
/// [`RenderError`] naming the file and, where it is one, the line.
pub fn read_obj(path: &Path, vertex_normals: bool) -> Result<Mesh, RenderError> {
    let bytes = std::fs::read(path).map_err(|source| RenderError::Io { path: path.into(), source })?;
    let models = parse(&bytes).map_err(|error| parse_error(path, &bytes, error))?;
    let mut mesh = Mesh::default();
    for model in &models {
        append(&mut mesh, &model.mesh, vertex_normals).map_err(|message| whole_file(path, message))?;
    }
    if mesh.triangles.is_empty() {
        return Err(whole_file(path, "expected at least one face with an area, found none".into()));
    }
    Ok(mesh)
}

fn whole_file(path: &Path, message: String) -> RenderError {
    RenderError::Mesh { path: path.into(), place: String::new(), message }
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
    let positions = vectors(&obj.positions);
    let normals = vectors(&obj.normals);
    if let Some(i) = positions.iter().position(|p| !p.is_finite()) {
        return Err(format!("vertex {} is {}, expected finite coordinates", i + 1, positions[i]));
    }
    let outside = "a face names a vertex that the file does not hold".to_owned();
    for (face, corners) in obj.indices.chunks_exact(3).enumerate() {
        let corner = |list: &[DVec3], index: u32| list.get(index as usize).copied().ok_or_else(|| outside.clone());
        let triangle =
            [corner(&positions, corners[0])?, corner(&positions, corners[1])?, corner(&positions, corners[2])?];
        if (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).try_normalize().is_none() {
            continue;
        }
        mesh.triangles.push(triangle);
        if vertex_normals {
            let mut at_corners = [DVec3::ZERO; 3];
            for (normal, index) in at_corners.iter_mut().zip(&obj.normal_indices[3 * face..]) {
                let given = corner(&normals, *index)?;
                *normal = given.try_normalize().ok_or(format!("vertex normal {} is {given}", index + 1))?;
            }
            mesh.normals.push(at_corners);
        }
    }
    Ok(())
}

fn vectors(flat: &[f64]) -> Vec<DVec3> {
    flat.chunks_exact(3).map(|v| DVec3::new(v[0], v[1], v[2])).collect()
}
