//! Triangle meshes, and the files that hold them: one file a format.

mod gltf;
mod obj;
mod ply;

use std::path::Path;

use glam::DVec3;

use crate::render::RenderError;

/// A triangle mesh.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Corners of each triangle, m; counter-clockwise seen from the lit side.
    pub triangles: Vec<[DVec3; 3]>,
    /// Unit normals at the corners; empty where the faces are flat.
    pub normals: Vec<[DVec3; 3]>,
}

/// Reads a mesh from a file, whose name says the format: `.obj`, `.ply`, `.gltf` or `.glb`. Polygons become fans of triangles,
/// triangles without area are left out.
///
/// # Errors
/// [`RenderError`] naming the file and, where it is one, the line or the face (counted from 1).
pub fn read_mesh(path: &Path, vertex_normals: bool) -> Result<Mesh, RenderError> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let read = match extension.as_str() {
        "obj" => obj::read,
        "ply" => ply::read,
        "gltf" | "glb" => gltf::read,
        _ => return Err(whole_file(path, "expected a name that ends in .obj, .ply, .gltf or .glb".into())),
    };
    let bytes = std::fs::read(path).map_err(|source| RenderError::Io { path: path.into(), source })?;
    let mesh = read(path, &bytes, vertex_normals)?;
    if mesh.triangles.is_empty() {
        return Err(whole_file(path, "expected at least one face with an area, found none".into()));
    }
    Ok(mesh)
}

/// An error that concerns the file as a whole.
fn whole_file(path: &Path, message: String) -> RenderError {
    RenderError::Mesh { path: path.into(), place: String::new(), message }
}

/// Vertices of a file, as it lists them.
#[derive(Debug, Default)]
struct Vertices {
    /// Positions, m.
    positions: Vec<DVec3>,
    /// Normals of any length; empty where they are not asked for.
    normals: Vec<DVec3>,
}

impl Vertices {
    /// The first position that is not finite, and its index.
    fn not_finite(&self) -> Option<(usize, DVec3)> {
        self.positions.iter().copied().enumerate().find(|(_, p)| !p.is_finite())
    }

    /// The first position that is not finite is an error.
    fn check(&self) -> Result<(), String> {
        let wrong = |(i, p): (usize, DVec3)| Err(format!("vertex {} is {p}, expected finite coordinates", i + 1));
        self.not_finite().map_or(Ok(()), wrong)
    }

    /// Adds a triangle with these corners and, unless there are no normals, normals; one without area is left out. An
    /// error says what the face does, such as `names vertex 10, there are 3`.
    fn add_face(&self, mesh: &mut Mesh, corners: [u32; 3], normals: [u32; 3]) -> Result<(), String> {
        let at = |index: u32| {
            let outside = || format!("names vertex {}, there are {}", u64::from(index) + 1, self.positions.len());
            self.positions.get(index as usize).copied().ok_or_else(outside)
        };
        let triangle = [at(corners[0])?, at(corners[1])?, at(corners[2])?];
        if (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).try_normalize().is_none() {
            return Ok(());
        }
        mesh.triangles.push(triangle);
        if !self.normals.is_empty() {
            mesh.normals.push([self.normal(normals[0])?, self.normal(normals[1])?, self.normal(normals[2])?]);
        }
        Ok(())
    }

    fn normal(&self, index: u32) -> Result<DVec3, String> {
        let outside = || format!("names vertex normal {}, there are {}", u64::from(index) + 1, self.normals.len());
        let given = self.normals.get(index as usize).copied().ok_or_else(outside)?;
        given.try_normalize().ok_or_else(|| format!("has the vertex normal {given}"))
    }
}
