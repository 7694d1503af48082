//! The displaced icosphere.

use glam::DVec3;

use super::super::shapes::Mesh;

/// Its triangles, each flat.
pub(super) fn mesh() -> Mesh {
    let (vertices, faces) = displaced_icosphere();
    let corner = |i: u32| vertices[i as usize];
    Mesh { triangles: faces.iter().map(|face| face.map(corner)).collect(), normals: Vec::new() }
}

/// The icosphere of 20·4⁷ = 327,680 triangles, each vertex v moved to r(v)·v with
/// r = 1 + 0.06 sin 9x sin(9y + 1) sin(9z + 2) + 0.015 sin 40x sin 40y sin 40z; counter-clockwise seen from outside.
fn displaced_icosphere() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut vertices, mut faces) = icosahedron();
    for _ in 0..7 {
        faces = subdivide(&mut vertices, &faces);
    }
    for v in &mut vertices {
        let waves =
            |f: f64, shift: DVec3| (f * v.x + shift.x).sin() * (f * v.y + shift.y).sin() * (f * v.z + shift.z).sin();
        let r = 1.0 + 0.06 * waves(9.0, DVec3::new(0.0, 1.0, 2.0)) + 0.015 * waves(40.0, DVec3::ZERO);
        *v = (*v * r).as_vec3().as_dvec3();
    }
    (vertices, faces)
}

fn icosahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let t = 0.5 * (1.0 + 5f64.sqrt());
    let corners = [(-1.0, t), (1.0, t), (-1.0, -t), (1.0, -t)];
    let turned: [fn(f64, f64) -> DVec3; 3] =
        [|a, b| DVec3::new(a, b, 0.0), |a, b| DVec3::new(0.0, a, b), |a, b| DVec3::new(b, 0.0, a)];
    let vertices = turned.iter().flat_map(|turn| corners.map(|(a, b)| unit(turn(a, b)))).collect();
    #[rustfmt::skip]
    let faces = [
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8],
        [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
    ];
    (vertices, faces.to_vec())
}

/// Divided by its length, as the scene's definition says; a product with the reciprocal is rounded differently.
fn unit(v: DVec3) -> DVec3 {
    v / v.length()
}

/// Each triangle in four; the new vertices are the edges' middles pushed out to the unit sphere, in the order of their edges.
fn subdivide(vertices: &mut Vec<DVec3>, faces: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let edge = |a: u32, b: u32| (a.min(b), a.max(b));
    let mut edges: Vec<_> = faces.iter().flat_map(|&[a, b, c]| [edge(a, b), edge(b, c), edge(c, a)]).collect();
    edges.sort_unstable();
    edges.dedup();
    let base = vertices.len();
    let middles = edges.iter().map(|&(a, b)| unit(vertices[a as usize] + vertices[b as usize]));
    let middles: Vec<DVec3> = middles.collect();
    vertices.extend(middles);
    // Every edge of a face is in the list.
    let middle = |a: u32, b: u32| (base + edges.partition_point(|e| *e < edge(a, b))) as u32;
    let parts = |&[a, b, c]: &[u32; 3]| {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
    };
    let parts: Vec<[[u32; 3]; 4]> = faces.iter().map(parts).collect();
    (0..4).flat_map(|k| parts.iter().map(move |part| part[k])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn the_mesh_is_closed_and_faces_outward() {
        let mesh = mesh();
        assert_eq!(mesh.triangles.len(), 327_680);
        let volume: f64 = mesh.triangles.iter().map(|[a, b, c]| a.dot(b.cross(*c)) / 6.0).sum();
        // Mean of r³ over the sphere, by the same faces: within the displacement's square of the ball's 4π/3.
        assert!((volume / 4.188_790_2 - 1.0).abs() < 0.01, "{volume}");
        assert!(mesh.triangles.iter().all(|[a, b, c]| (*b - *a).cross(*c - *a).dot(*a) > 0.0));
    }

    #[test]
    fn the_mesh_is_that_of_the_reference_scene() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/reference/scenes/s4.ply");
        let Ok(bytes) = std::fs::read(&path) else {
            eprintln!("skipped: the reference's mesh is not here");
            return;
        };
        let (vertices, faces) = displaced_icosphere();
        let end = b"end_header\n";
        let start = bytes.windows(end.len()).position(|w| w == end).expect("a header") + end.len();
        let (points, rest) = bytes[start..].split_at(12 * vertices.len());
        let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        let mut off = 0;
        for (v, p) in vertices.iter().zip(points.chunks_exact(12)) {
            for c in 0..3 {
                let (got, want) = (v[c] as f32, float(&p[4 * c..]));
                assert!((got - want).abs() <= f32::EPSILON * want.abs().max(1e-3), "{v}: {got} vs {want}");
                off += u32::from(got != want);
            }
        }
        println!("{off} of {} coordinates differ, by an ulp", 3 * vertices.len());
        let index = |b: &[u8]| u32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        assert_eq!(rest.len(), 13 * faces.len());
        for (face, record) in faces.iter().zip(rest.chunks_exact(13)) {
            assert_eq!([1, 5, 9].map(|at| index(&record[at..])), *face);
        }
    }
}
