//! Meshes: OBJ files against analytic shapes, watertightness, and what a bad file says.

#![allow(clippy::expect_used, clippy::panic, clippy::float_cmp)] // these are tests

mod common;

use std::collections::HashMap;
use std::fmt::Write;
use std::path::Path;

use common::{excess, mean, picture};
use glam::DVec3;
use goniofit::control::Control;
use goniofit::render::{Materials, Options, RenderError, Scene, SceneSpec, render};

/// Vertices and faces of an icosphere of radius 1, outward counter-clockwise, and the length of its longest edge.
fn icosphere(subdivisions: u32) -> (Vec<DVec3>, Vec<[usize; 3]>, f64) {
    let g = 0.5 * (1.0 + 5f64.sqrt());
    let mut vertices: Vec<DVec3> = [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)]
        .into_iter()
        .flat_map(|(a, b)| [DVec3::new(a, b, 0.0), DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a)])
        .map(DVec3::normalize)
        .collect();
    // Faces: all triples of vertices at the edge's distance, turned outward.
    let near = |a: DVec3, b: DVec3| (a - b).length() < 1.1;
    let mut faces = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let [a, b, c] = [vertices[i], vertices[j], vertices[k]];
                if near(a, b) && near(b, c) && near(a, c) {
                    faces.push(if (b - a).cross(c - a).dot(a) > 0.0 { [i, j, k] } else { [i, k, j] });
                }
            }
        }
    }
    for _ in 0..subdivisions {
        let mut middles = HashMap::new();
        let mut middle = |a: usize, b: usize| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                vertices.push((vertices[a] + vertices[b]).normalize());
                vertices.len() - 1
            })
        };
        faces = faces
            .into_iter()
            .flat_map(|[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    let edge =
        |f: &[usize; 3]| (0..3).map(|i| (vertices[f[i]] - vertices[f[(i + 1) % 3]]).length()).fold(0.0, f64::max);
    let longest = faces.iter().map(edge).fold(0.0, f64::max);
    (vertices, faces, longest)
}

fn obj(vertices: &[DVec3], faces: &[[usize; 3]], center: DVec3) -> String {
    let mut text = String::new();
    for v in vertices {
        let p = *v + center;
        writeln!(text, "v {:?} {:?} {:?}\nvn {:?} {:?} {:?}", p.x, p.y, p.z, v.x, v.y, v.z).expect("string");
    }
    for [a, b, c] in faces {
        writeln!(text, "f {0}//{0} {1}//{1} {2}//{2}", a + 1, b + 1, c + 1).expect("string");
    }
    text
}

/// The scene `name` with its sphere replaced by an OBJ file of the same name in `folder`.
fn mesh_scene(folder: &Path, name: &str, file: &str, normals: &str) -> SceneSpec {
    let mut spec = goniofit::render::scene::builtin(name).expect("built in");
    spec.spheres.clear();
    let mesh = format!("file = \"{file}\"\nmaterial = \"ball\"\nnormals = \"{normals}\"");
    spec.meshes = vec![toml::from_str(&mesh).expect("mesh")];
    assert!(folder.join(file).exists());
    spec
}

#[test]
fn an_icosphere_looks_like_the_sphere() {
    let folder = tempfile::tempdir().expect("folder");
    for (name, center) in [("sphere", DVec3::ZERO), ("sphere-on-plane", DVec3::Y)] {
        let sphere = goniofit::render::scene::builtin(name).expect("built in");
        let sphere = Scene::build(&sphere, folder.path(), &Materials::new()).expect("builds");
        let (want, noise) = mean(&picture(&sphere, 64, 64, 1));
        for (subdivisions, normals) in [(3, "vertex"), (4, "vertex"), (5, "face")] {
            let (vertices, faces, edge) = icosphere(subdivisions);
            std::fs::write(folder.path().join("ball.obj"), obj(&vertices, &faces, center)).expect("written");
            let spec = mesh_scene(folder.path(), name, "ball.obj", normals);
            let built = Scene::build(&spec, folder.path(), &Materials::new()).expect("builds");
            let (got, other) = mean(&picture(&built, 64, 64, 2));
            // A face's circumradius is at most edge/√3, so it lies at most edge²/6 inside the sphere: that share of the
            // outline's radius, twice that of its area; the irradiance (∝ 1/r² at a distance above 2) and the cosine lose less.
            let bound = 5.0 * (noise + other) + 4.0 * edge * edge / 6.0 * want;
            assert!(excess(got, want, bound) <= 1.0, "{name}, {subdivisions}: {got} vs {want} ± {noise}");
        }
    }
}

#[test]
fn a_closed_mesh_lets_no_ray_through() {
    // Inside of a closed surface that is lit outside everything is black; one ray through a seam would bring light of 10²⁰.
    let folder = tempfile::tempdir().expect("folder");
    for (subdivisions, center, stretch) in [
        (0, DVec3::ZERO, DVec3::ONE),
        (5, DVec3::new(1e3, 0.0, 0.0), DVec3::ONE),
        (4, DVec3::ZERO, DVec3::new(1.0, 1e-6, 1e3)),
    ] {
        let (vertices, faces, _) = icosphere(subdivisions);
        let stretched: Vec<DVec3> = vertices.iter().map(|v| *v * stretch).collect();
        std::fs::write(folder.path().join("shell.obj"), obj(&stretched, &faces, center)).expect("written");
        let mut spec = mesh_scene(folder.path(), "furnace", "shell.obj", "face");
        spec.lights.environment.iter_mut().for_each(|e| e.radiance = Some([1e20; 3]));
        for (i, target) in [DVec3::X, DVec3::Z, -DVec3::X, vertices[0], vertices[7]].into_iter().enumerate() {
            spec.camera.position = center.to_array();
            spec.camera.target = (center + target * stretch).to_array();
            spec.camera.up = [0.31, 0.53, 0.79];
            spec.camera.fov_deg = 120.0;
            let built = Scene::build(&spec, folder.path(), &Materials::new()).expect("builds");
            let film = picture(&built, 128, 4, i as u64);
            assert_eq!(mean(&film).0, DVec3::ZERO, "{subdivisions} subdivisions at {center}, towards {target}");
        }
    }
}

#[test]
fn scaled_meshes_have_the_same_bits() {
    let folder = tempfile::tempdir().expect("folder");
    let (vertices, faces, _) = icosphere(2);
    let of = |scale: f64| {
        let scaled: Vec<DVec3> = vertices.iter().map(|v| *v * scale).collect();
        std::fs::write(folder.path().join("ball.obj"), obj(&scaled, &faces, DVec3::ZERO)).expect("written");
        let mut spec = mesh_scene(folder.path(), "sphere", "ball.obj", "face");
        spec.max_bounces = 3;
        spec.camera.position = spec.camera.position.map(|x| x * scale);
        spec.lights.point[0].position = spec.lights.point[0].position.map(|x| x * scale);
        spec.lights.point[0].intensity = [100.0 * scale * scale; 3];
        let built = Scene::build(&spec, folder.path(), &Materials::new()).expect("builds");
        picture(&built, 32, 4, 1).to_image().radiance
    };
    let plain = of(1.0);
    assert!(plain.iter().any(|p| p[0] > 0.1));
    for exponent in [-30, -3, 20] {
        assert!(of(f64::exp2(f64::from(exponent))) == plain, "scaled by 2^{exponent}");
    }
}

#[test]
fn polygons_and_groups_are_read() {
    // A unit square as one polygon, split over two groups with relative indices and a material library that is not there.
    let folder = tempfile::tempdir().expect("folder");
    let text = "mtllib none.mtl\no a\nv -1 0 -1\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nusemtl x\nf 1 2 3 4\nl 1 2\n\
                o b\nv 9 0 0\nv 9 0 1\nv 10 0 0\nf -3 -2 -1\n";
    std::fs::write(folder.path().join("square.obj"), text).expect("written");
    let of = |shape: &str| {
        let head = common::spot_camera(DVec3::new(0.2, 3.0, 0.1), DVec3::new(0.3, 0.0, -0.4), 1);
        let world = format!(
            "{head}[materials]\nm = {{ kd = [0.5, 0.5, 0.5] }}\n{shape}material = \"m\"\n\
             [[light.directional]]\ntoward = [0, 1, 0]\nirradiance = [2, 2, 2]\n"
        );
        let spec = SceneSpec::parse(&world, "test").expect("parses");
        let built = Scene::build(&spec, folder.path(), &Materials::new()).expect("builds");
        common::one_pixel(&built, 2).0
    };
    let plane = of("[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\n");
    assert!(excess(of("[[mesh]]\nfile = \"square.obj\"\n"), plane, plane * 1e-12) <= 1.0);
    assert!(plane.x > 0.3);
}

#[test]
fn a_bad_mesh_file_says_where_and_what() {
    let folder = tempfile::tempdir().expect("folder");
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let cases = [
        ("v 0 0 0\nv 1 zero 0\nv 0 1 0\nf 1 2 3\n".to_owned(), "face", "line 2"),
        (format!("{triangle}f 1 2 three\n"), "face", "line 4"),
        (format!("{triangle}f 1 2 3\nf 1 2 9\nf 1 2 3\n"), "face", "line 5: face vertex index out of bounds"),
        (format!("{triangle}f 1 2 3\n"), "vertex", "vertex normals"),
        (
            format!("{triangle}vn 0 0 0\nf 1//1 2//1 3//1\n"),
            "vertex",
            "line 5: the face has the vertex normal [0, 0, 0]",
        ),
        // Polygons, groups, points and lines stand before the face.
        (
            format!(
                "{triangle}v 1 1 0\nvn 0 0 1\nvn 0 0 0\no a\nf 2//1 4//1 3//1 1//1\nl 1 2\np 1\nl 1//1 2//1 3//1\n\
                 # f 1 2 3\no b\n\nf 3//1 1//1 2//1\nf 4//1 3//1 2//2\n"
            ),
            "vertex",
            "line 16: the face has the vertex normal [0, 0, 0]",
        ),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n".to_owned(), "face", "at least one face"),
        (format!("{triangle}v nan 0 0\nf 1 2 3\nf 2 3 4\n"), "face", "line 6: the face has a corner at [NaN, 0, 0]"),
        (String::new(), "face", "at least one face"),
    ];
    for (text, normals, expected) in cases {
        std::fs::write(folder.path().join("bad.obj"), &text).expect("written");
        let spec = mesh_scene(folder.path(), "sphere", "bad.obj", normals);
        let error = Scene::build(&spec, folder.path(), &Materials::new()).expect_err(&text);
        let message = error.to_string();
        assert!(matches!(error, RenderError::Mesh { .. }), "{message}");
        assert!(message.contains("bad.obj") && message.contains(expected), "{text}: {message}");
    }
    let mut spec = goniofit::render::scene::builtin("sphere").expect("built in");
    spec.meshes = vec![toml::from_str("file = \"none.obj\"\nmaterial = \"ball\"").expect("mesh")];
    let error = Scene::build(&spec, folder.path(), &Materials::new()).expect_err("no file");
    assert!(matches!(error, RenderError::Io { .. }) && error.to_string().contains("none.obj"), "{error}");
}

#[test]
fn needles_and_touching_faces_give_finite_pictures() {
    // A fan of needles 10⁻⁷ wide that all share a corner, over a copy of itself, under light that touches it.
    let folder = tempfile::tempdir().expect("folder");
    let mut text = String::from("v 0 0 0\n");
    for i in 0..200 {
        let x = f64::from(i) * 1e-7;
        writeln!(text, "v {x:?} 0 -1").expect("string");
    }
    (0..199).for_each(|i| writeln!(text, "f 1 {} {}", i + 3, i + 2).expect("string"));
    std::fs::write(folder.path().join("ball.obj"), &text).expect("written");
    let mut spec = mesh_scene(folder.path(), "sphere-on-plane", "ball.obj", "face");
    spec.meshes.push(spec.meshes[0].clone());
    spec.lights.quad[0].center = [0.0, 0.5, 0.0];
    spec.lights.quad[0].u = [0.0, 0.5, 0.0];
    spec.camera.position = [1e-5, 1e-3, 0.5];
    spec.camera.target = [1e-5, 0.0, -0.5];
    spec.camera.fov_deg = 1e-3;
    let built = Scene::build(&spec, folder.path(), &Materials::new()).expect("builds");
    let options = Options { width: 48, height: 48, samples: 16, ..Options::default() };
    let film = render(&built, &options, Control::silent()).expect("renders");
    assert_eq!(film.not_finite, 0);
    assert!(film.to_image().radiance.iter().flatten().all(|x| x.is_finite() && *x >= 0.0));
}
