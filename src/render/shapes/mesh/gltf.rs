//! glTF 2.0 files, `.gltf` and `.glb` (crate `gltf`): the triangles of the default scene's nodes, in place.

use std::collections::HashMap;
use std::path::Path;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use glam::{DMat3, DMat4, DVec3};
use gltf::buffer::Source;
use gltf::mesh::Mode;
use gltf::{Document, Gltf, Node, Primitive};

use super::{Mesh, Vertices, whole_file};
use crate::render::RenderError;

/// Nodes may be nested this deep: each takes room on the stack.
const DEEPEST: usize = 256;

/// The mesh in a glTF file. Its buffers are in the file itself or in files beside it.
pub fn read(path: &Path, bytes: &[u8], vertex_normals: bool) -> Result<Mesh, RenderError> {
    let gltf = Gltf::from_slice(bytes).map_err(|error| whole_file(path, error.to_string()))?;
    let buffers = buffers(path, &gltf)?;
    let mut reader = NodeReader { buffers, vertex_normals, parents: HashMap::new() };
    let mut mesh = Mesh::default();
    let wrong = |message: String| whole_file(path, message);
    for node in roots(&gltf.document) {
        reader.add_node(&mut mesh, &node, None, DMat4::IDENTITY, 0).map_err(wrong)?;
    }
    Ok(mesh)
}

/// The nodes of the default scene; of the first where none is marked.
fn roots(document: &Document) -> Vec<Node<'_>> {
    let scene = document.default_scene().or_else(|| document.scenes().next());
    scene.map(|scene| scene.nodes().collect()).unwrap_or_default()
}

fn buffers(path: &Path, gltf: &Gltf) -> Result<Vec<Vec<u8>>, RenderError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let read = |buffer: gltf::Buffer<'_>| {
        let bytes = match buffer.source() {
            Source::Bin => gltf.blob.clone().unwrap_or_default(),
            Source::Uri(uri) if uri.starts_with("data:") => {
                let text = uri.split_once(";base64,").map(|(_, text)| text);
                let bytes = text.and_then(|text| BASE64_STANDARD.decode(text).ok());
                let broken = || format!("buffer {}: expected base64 after `data:`", buffer.index());
                bytes.ok_or_else(|| whole_file(path, broken()))?
            }
            Source::Uri(uri) => {
                let file = folder.join(percent_decoded(uri));
                std::fs::read(&file).map_err(|source| RenderError::Io { path: file, source })?
            }
        };
        if bytes.len() < buffer.length() {
            let (index, found) = (buffer.index(), bytes.len());
            let message = format!("buffer {index} should hold {} bytes, found {found}", buffer.length());
            return Err(whole_file(path, message));
        }
        Ok(bytes)
    };
    gltf.document.buffers().map(read).collect()
}

/// A URI without its escapes `%xx` (RFC 3986, section 2.1). A `%` that no two hexadecimal digits follow stands for itself,
/// as in files that were written without escapes, and so does everything where the outcome is not UTF-8.
fn percent_decoded(uri: &str) -> String {
    let mut pieces = uri.split('%');
    let mut decoded = pieces.next().unwrap_or_default().as_bytes().to_vec();
    for piece in pieces {
        let (byte, rest) = escaped(piece).unwrap_or((b'%', piece));
        decoded.push(byte);
        decoded.extend(rest.as_bytes());
    }
    String::from_utf8(decoded).unwrap_or_else(|_| uri.into())
}

/// The byte that the first two characters are the digits of, and what follows them.
fn escaped(piece: &str) -> Option<(u8, &str)> {
    let (digits, rest) = piece.split_at_checked(2)?;
    let hexadecimal = digits.bytes().all(|b| b.is_ascii_hexdigit()); // the parser takes a sign, too
    u8::from_str_radix(digits, 16).ok().filter(|_| hexadecimal).map(|byte| (byte, rest))
}

struct NodeReader {
    buffers: Vec<Vec<u8>>,
    vertex_normals: bool,
    /// What named each node that has been entered, by index: a node, or the scene.
    parents: HashMap<usize, Option<usize>>,
}

impl NodeReader {
    /// Refuses a node that was entered before: nodes form strict trees (glTF 2.0, section 3.5.2). Otherwise copies of
    /// copies would double with every level.
    fn enter(&mut self, node: &Node<'_>, parent: Option<usize>) -> Result<(), String> {
        let Some(first) = self.parents.insert(node.index(), parent) else { return Ok(()) };
        let [first, second] = [first, parent].map(|p| p.map_or("the scene".into(), |i| format!("nodes[{i}]")));
        Err(format!("nodes[{}] is named by {first} and by {second}, expected one parent at most", node.index()))
    }

    fn add_node(
        &mut self,
        mesh: &mut Mesh,
        node: &Node<'_>,
        parent: Option<usize>,
        parent_to_scene: DMat4,
        depth: usize,
    ) -> Result<(), String> {
        self.enter(node, parent)?;
        if depth > DEEPEST {
            return Err(format!("nodes are nested more than {DEEPEST} deep"));
        }
        let local = node.transform().matrix().map(|column| column.map(f64::from));
        let to_scene = parent_to_scene * DMat4::from_cols_array_2d(&local);
        if let Some(shape) = node.mesh() {
            for primitive in shape.primitives() {
                let (m, p) = (shape.index(), primitive.index());
                let placed = |what: String| format!("meshes[{m}].primitives[{p}]: {what}");
                self.add_primitive(mesh, &primitive, &to_scene).map_err(placed)?;
            }
        }
        let this = Some(node.index());
        node.children().try_for_each(|child| self.add_node(mesh, &child, this, to_scene, depth + 1))
    }

    fn add_primitive(&self, mesh: &mut Mesh, primitive: &Primitive<'_>, to_scene: &DMat4) -> Result<(), String> {
        match primitive.mode() {
            Mode::Triangles => self.add_triangles(mesh, primitive, to_scene),
            Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => Ok(()),
            Mode::TriangleStrip | Mode::TriangleFan => {
                Err("strips and fans of triangles are not read; save as separate triangles".into())
            }
        }
    }

    fn add_triangles(&self, mesh: &mut Mesh, primitive: &Primitive<'_>, to_scene: &DMat4) -> Result<(), String> {
        let readable = |(_, accessor): (_, gltf::Accessor<'_>)| accessor.count() > 0 && accessor.sparse().is_none();
        let indices = primitive.indices().map(|accessor| (gltf::Semantic::Positions, accessor));
        if !primitive.attributes().chain(indices).all(readable) {
            return Err("empty and sparse accessors are not read".into());
        }
        let reader = primitive.reader(|buffer| self.buffers.get(buffer.index()).map(Vec::as_slice));
        let vector = |v: [f32; 3]| DVec3::from(v.map(f64::from));
        let positions = reader.read_positions().ok_or("there are no positions within the buffer")?;
        let mut vertices = Vertices::default();
        vertices.positions.extend(positions.map(|p| to_scene.transform_point3(vector(p))));
        if self.vertex_normals {
            let normals = reader.read_normals().ok_or("vertex normals are asked for, but there are none")?;
            let turn = DMat3::from_mat4(*to_scene).inverse().transpose();
            vertices.normals.extend(normals.map(|n| turn * vector(n)));
        }
        vertices.check()?;
        let indices: Vec<u32> = match (primitive.indices(), reader.read_indices()) {
            (None, _) => (0..vertices.positions.len() as u32).collect(),
            (Some(_), Some(indices)) => indices.into_u32().collect(),
            (Some(_), None) => return Err("the indices lie outside of their buffer".into()),
        };
        // A mirrored node turns its faces round (glTF 2.0, section 3.7.4).
        let mirrored = to_scene.determinant() < 0.0;
        for (i, &[a, b, c]) in indices.as_chunks::<3>().0.iter().enumerate() {
            let corners = if mirrored { [a, c, b] } else { [a, b, c] };
            let of_triangle = |what: String| format!("triangle {} {what}", i + 1);
            vertices.add_face(mesh, corners, corners).map_err(of_triangle)?;
        }
        Ok(())
    }
}
