//! PLY and glTF files against OBJ, instances against copies, and what a broken file says.

#![allow(clippy::expect_used, clippy::panic, clippy::float_cmp)] // these are tests

mod common;

use std::fmt::Write;
use std::path::Path;

use common::{excess, mean, picture};
use glam::{DVec3, Quat, Vec3};
use goniofit::render::{Materials, RenderError, Scene, SceneSpec};

/// Positions, normals and faces.
type Soup = (Vec<[f32; 3]>, Vec<[f32; 3]>, Vec<[u32; 3]>);

/// A bumpy patch of triangles with normals: coordinates that 32-bit floats hold.
fn patch() -> Soup {
    let n = 12u32;
    let height = |x: f32, z: f32| 0.5 + 0.2 * (3.0 * x).sin() * (4.0 * z).cos();
    let (mut points, mut normals, mut faces) = (Vec::new(), Vec::new(), Vec::new());
    for j in 0..=n {
        for i in 0..=n {
            let (x, z) = (i as f32 / 6.0 - 1.0, j as f32 / 6.0 - 1.0);
            points.push([x, height(x, z), z]);
            let slope = |dx: f32, dz: f32| (height(x + dx, z + dz) - height(x - dx, z - dz)) / 0.02;
            normals.push(Vec3::new(-slope(0.01, 0.0), 1.0, -slope(0.0, 0.01)).normalize().to_array());
        }
    }
    for k in 0..n * n {
        let a = k / n * (n + 1) + k % n;
        faces.push([a, a + n + 1, a + 1]);
        faces.push([a + 1, a + n + 1, a + n + 2]);
    }
    (points, normals, faces)
}

fn obj(points: &[[f32; 3]], normals: &[[f32; 3]], faces: &[[u32; 3]]) -> Vec<u8> {
    let mut text = String::new();
    // All digits: OBJ is read as 64-bit floats.
    for (word, list) in [("v", points), ("vn", normals)] {
        for [x, y, z] in list.iter().map(|v| v.map(f64::from)) {
            writeln!(text, "{word} {x:?} {y:?} {z:?}").expect("string");
        }
    }
    for [a, b, c] in faces.iter().map(|f| f.map(|i| i + 1)) {
        writeln!(text, "f {a}//{a} {b}//{b} {c}//{c}").expect("string");
    }
    text.into_bytes()
}

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

fn ply(points: &[[f32; 3]], normals: &[[f32; 3]], faces: &[[u32; 3]], encoding: Encoding) -> Vec<u8> {
    let name = match encoding {
        Encoding::Ascii => "ascii",
        Encoding::Little => "binary_little_endian",
        Encoding::Big => "binary_big_endian",
    };
    // An element and properties that are passed over stand between.
    let mut file = format!(
        "ply\nformat {name} 1.0\ncomment made by a test\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty float nx\nproperty float ny\nproperty float nz\nelement edge 1\nproperty int a\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        points.len(),
        faces.len()
    )
    .into_bytes();
    let float = |x: f32| if encoding == Encoding::Big { x.to_be_bytes() } else { x.to_le_bytes() };
    let int = |x: u32| if encoding == Encoding::Big { x.to_be_bytes() } else { x.to_le_bytes() };
    if encoding == Encoding::Ascii {
        let mut text = String::new();
        for ([x, y, z], [a, b, c]) in points.iter().zip(normals) {
            writeln!(text, "{x:?} {y:?} {z:?} 7 {a:?} {b:?} {c:?}").expect("string");
        }
        text.push_str("5\n");
        faces.iter().for_each(|[a, b, c]| writeln!(text, "3 {a} {b} {c}").expect("string"));
        file.extend(text.into_bytes());
        return file;
    }
    for (p, n) in points.iter().zip(normals) {
        file.extend(p.iter().flat_map(|x| float(*x)));
        file.push(7);
        file.extend(n.iter().flat_map(|x| float(*x)));
    }
    file.extend(int(5));
    for face in faces {
        file.push(3);
        file.extend(face.iter().flat_map(|i| int(*i)));
    }
    file
}

/// A `.glb` whose one node is turned and moved by `node`, a piece of its JSON; the data undo that where it is empty.
fn glb(points: &[[f32; 3]], normals: &[[f32; 3]], faces: &[[u32; 3]], node: &str) -> Vec<u8> {
    let mut data: Vec<u8> = points.iter().chain(normals).flatten().flat_map(|x| x.to_le_bytes()).collect();
    data.extend(faces.iter().flatten().flat_map(|i| i.to_le_bytes()));
    let (v, f) = (points.len(), 3 * faces.len());
    let (low, high) = points.iter().fold(([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]), |(l, h), p| {
        ([0, 1, 2].map(|c| l[c].min(p[c])), [0, 1, 2].map(|c| h[c].max(p[c])))
    });
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0{node}}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"NORMAL":1}},"indices":2}}]}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":{v},"type":"VEC3","min":{low:?},"max":{high:?}}},
{{"bufferView":1,"componentType":5126,"count":{v},"type":"VEC3"}},{{"bufferView":2,"componentType":5125,"count":{f},"type":"SCALAR"}}],
"bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":{0}}},{{"buffer":0,"byteOffset":{0},"byteLength":{0}}},
{{"buffer":0,"byteOffset":{1},"byteLength":{2}}}],"buffers":[{{"byteLength":{3}}}]}}"#,
        12 * v,
        24 * v,
        4 * f,
        data.len()
    );
    while json.len() % 4 != 0 {
        json.push(' ');
    }
    let mut file = b"glTF".to_vec();
    let total = 12 + 8 + json.len() + 8 + data.len();
    file.extend([2u32, total as u32, json.len() as u32].iter().flat_map(|x| x.to_le_bytes()));
    file.extend(b"JSON");
    file.extend(json.into_bytes());
    file.extend((data.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(data);
    file
}

/// The sphere-on-plane scene with a mesh, described by `mesh`, in the place of its sphere.
fn scene(folder: &Path, mesh: &str) -> Result<Scene, RenderError> {
    let mut spec = goniofit::render::scene::builtin("sphere-on-plane").expect("built in");
    spec.spheres.clear();
    let meshes = format!("[[mesh]]\nmaterial = \"ball\"\n{mesh}");
    let table: toml::Table = toml::from_str(&meshes).expect("TOML");
    spec.meshes = table["mesh"].clone().try_into().expect("meshes");
    Scene::build(&spec, folder, &Materials::new())
}

fn radiance(scene: &Scene) -> Vec<[f64; 3]> {
    picture(scene, 40, 4, 1).to_image().radiance
}

#[test]
fn ply_and_gltf_hold_the_same_mesh_as_obj() {
    let folder = tempfile::tempdir().expect("folder");
    let (points, normals, faces) = patch();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).expect("written");
    write("a.obj", &obj(&points, &normals, &faces));
    write("ascii.ply", &ply(&points, &normals, &faces, Encoding::Ascii));
    write("little.PLY", &ply(&points, &normals, &faces, Encoding::Little));
    write("big.ply", &ply(&points, &normals, &faces, Encoding::Big));
    write("a.glb", &glb(&points, &normals, &faces, ""));
    for shading in ["face", "vertex"] {
        let of = |name: &str| {
            let mesh = format!("file = \"{name}\"\nnormals = \"{shading}\"");
            radiance(&scene(folder.path(), &mesh).unwrap_or_else(|e| panic!("{e}")))
        };
        let want = of("a.obj");
        assert!(want.iter().any(|p| p[0] > 0.1));
        for name in ["ascii.ply", "little.PLY", "big.ply", "a.glb"] {
            assert!(of(name) == want, "{name}, {shading} normals");
        }
    }
}

#[test]
fn gltf_buffers_may_be_in_the_file_or_beside_it() {
    let folder = tempfile::tempdir().expect("folder");
    let (points, normals, faces) = patch();
    let whole = glb(&points, &normals, &faces, "");
    std::fs::write(folder.path().join("whole.glb"), &whole).expect("written");
    let json_length = u32::from_le_bytes([whole[12], whole[13], whole[14], whole[15]]) as usize;
    let (json, data) = (String::from_utf8_lossy(&whole[20..20 + json_length]), &whole[28 + json_length..]);
    std::fs::write(folder.path().join("data.bin"), data).expect("written");
    let with = |uri: String| json.replace("\"buffers\":[{", &format!("\"buffers\":[{{\"uri\":\"{uri}\","));
    std::fs::write(folder.path().join("beside.gltf"), with("data.bin".into())).expect("written");
    let text = base64::Engine::encode(&base64::prelude::BASE64_STANDARD, data);
    let inside = with(format!("data:application/octet-stream;base64,{text}"));
    std::fs::write(folder.path().join("inside.gltf"), inside).expect("written");
    let of =
        |name: &str| radiance(&scene(folder.path(), &format!("file = \"{name}\"")).unwrap_or_else(|e| panic!("{e}")));
    let want = of("whole.glb");
    assert!(of("beside.gltf") == want && of("inside.gltf") == want);
    // Escapes are undone; what is none, as a `%` that was not escaped itself, stands as it is.
    std::fs::remove_file(folder.path().join("data.bin")).expect("removed");
    for (uri, file) in [
        ("my%20mesh.bin", "my mesh.bin"),
        ("%C3%BCber%2dall.bin", "über-all.bin"),
        ("100%25.bin", "100%.bin"),
        ("50%.bin", "50%.bin"),
        ("%+f%zz%2", "%+f%zz%2"),
        ("%FF.bin", "%FF.bin"),
        ("%ü1.bin", "%ü1.bin"),
    ] {
        let file = folder.path().join(file);
        std::fs::write(&file, data).expect("written");
        std::fs::write(folder.path().join("escaped.gltf"), with(uri.into())).expect("written");
        assert!(of("escaped.gltf") == want, "{uri}");
        std::fs::remove_file(file).expect("removed");
    }
}

#[test]
fn gltf_nodes_must_form_trees() {
    let folder = tempfile::tempdir().expect("folder");
    let data: Vec<u8> = [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let data = base64::Engine::encode(&base64::prelude::BASE64_STANDARD, data);
    let read = |roots: &str, nodes: &str| {
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[{roots}]}}],"nodes":[{nodes}],
"buffers":[{{"byteLength":36,"uri":"data:application/octet-stream;base64,{data}"}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],"bufferViews":[{{"buffer":0,"byteLength":36}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}]}}"#
        );
        std::fs::write(folder.path().join("a.gltf"), text).expect("written");
        scene(folder.path(), "file = \"a.gltf\"").map(drop).map_err(|e| e.to_string())
    };
    let leaf = r#"{"mesh":0}"#;
    let with = |children: &str| format!(r#"{{"children":[{children}]}}"#);
    // Nodes may share a mesh.
    let tree = format!("{},{leaf},{leaf},{leaf}", with("2,1"));
    assert_eq!(read("0,3", &tree), Ok(()));
    // Each node names the next twice: without an error the last would be there 2^20 times.
    let doubling = (1..=20).map(|i| with(&format!("{i},{i}"))).collect::<Vec<_>>().join(",");
    for (roots, nodes, node, parents) in [
        ("0", format!("{},{},{},{leaf}", with("1,2"), with("3"), with("3")), 3, ["nodes[1]", "nodes[2]"]),
        ("0", format!("{doubling},{leaf}"), 20, ["nodes[19]", "nodes[19]"]),
        ("0,0", leaf.into(), 0, ["the scene", "the scene"]),
        ("0,1", format!("{},{leaf}", with("1")), 1, ["nodes[0]", "the scene"]),
        ("0", format!("{},{}", with("1"), with("0")), 0, ["the scene", "nodes[1]"]),
        ("0", with("0"), 0, ["the scene", "nodes[0]"]),
    ] {
        let message = read(roots, &nodes).expect_err(&nodes);
        let [first, second] = parents;
        let want = format!("a.gltf: nodes[{node}] is named by {first} and by {second}, expected one parent at most");
        assert!(message.ends_with(&want), "{nodes}: {message}");
    }
    let deep = (1..=257).map(|i| with(&i.to_string())).collect::<Vec<_>>().join(",");
    let message = read("0", &format!("{deep},{leaf}")).expect_err("too deep");
    assert!(message.ends_with("nodes are nested more than 256 deep"), "{message}");
}

#[test]
fn a_face_beyond_the_vertices_is_named() {
    let folder = tempfile::tempdir().expect("folder");
    let (points, normals, _) = patch();
    let (points, normals, faces) = (&points[..4], &normals[..4], [[0, 1, 2], [1, 2, 3], [1, 2, 9]]);
    for (name, bytes, words) in [
        ("a.ply", ply(points, normals, &faces, Encoding::Ascii), "face 3 names vertex 10, there are 4"),
        ("b.ply", ply(points, normals, &faces, Encoding::Little), "face 3 names vertex 10, there are 4"),
        ("a.glb", glb(points, normals, &faces, ""), "meshes[0].primitives[0]: triangle 3 names vertex 10, there are 4"),
        ("a.obj", obj(points, normals, &faces), "line 11: face vertex index out of bounds"),
    ] {
        std::fs::write(folder.path().join(name), bytes).expect("written");
        for shading in ["face", "vertex"] {
            let mesh = format!("file = \"{name}\"\nnormals = \"{shading}\"");
            let Err(error) = scene(folder.path(), &mesh) else { panic!("{name} is taken") };
            let message = error.to_string();
            assert!(message.contains(name) && message.ends_with(words), "{message}");
        }
    }
}

#[test]
fn gltf_nodes_place_their_meshes_and_mirrors_keep_their_fronts() {
    let folder = tempfile::tempdir().expect("folder");
    let (points, normals, faces) = patch();
    let turn = Quat::from_axis_angle(Vec3::new(0.36, 0.48, 0.8), 0.7);
    let (moved, scale) = (Vec3::new(3.0, -2.0, 5.0), Vec3::new(-2.0, 0.5, 1.5));
    // What the node undoes; a mirrored mesh's faces run the other way.
    let away = |p: &[f32; 3]| ((turn.inverse() * (Vec3::from(*p) - moved)) / scale).to_array();
    let away_n = |n: &[f32; 3]| ((turn.inverse() * Vec3::from(*n)) * scale).normalize().to_array();
    let there: Vec<_> = points.iter().map(away).collect();
    let there_n: Vec<_> = normals.iter().map(away_n).collect();
    let turned: Vec<_> = faces.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    let node = format!(
        r#","rotation":{:?},"translation":{:?},"scale":{:?}"#,
        turn.to_array(),
        moved.to_array(),
        scale.to_array()
    );
    std::fs::write(folder.path().join("a.obj"), obj(&points, &normals, &faces)).expect("written");
    std::fs::write(folder.path().join("a.glb"), glb(&there, &there_n, &turned, &node)).expect("written");
    for shading in ["face", "vertex"] {
        let of = |name: &str| {
            let mesh = format!("file = \"{name}\"\nnormals = \"{shading}\"");
            mean(&picture(&scene(folder.path(), &mesh).unwrap_or_else(|e| panic!("{e}")), 40, 16, 1))
        };
        let ((want, noise), (got, _)) = (of("a.obj"), of("a.glb"));
        assert!(excess(got, want, noise) <= 1.0, "{shading}: {got} vs {want} ± {noise}");
    }
}

#[test]
fn instances_are_the_copies_that_they_stand_for() {
    let folder = tempfile::tempdir().expect("folder");
    let (points, normals, faces) = patch();
    std::fs::write(folder.path().join("a.obj"), obj(&points, &normals, &faces)).expect("written");
    let places = [(1.0, 0.0, [0.0, 0.0, 0.0]), (0.5, 30.0, [0.5, 1.0, 0.5]), (0.7, 200.0, [-1.5, 0.2, 1.0])];
    let (mut instances, mut all, mut all_n, mut all_f) = (String::new(), Vec::new(), Vec::new(), Vec::new());
    let axis = Vec3::new(0.0, 0.6, 0.8);
    for (scale, angle, moved) in places {
        writeln!(
            instances,
            "[[mesh.instance]]\nscale = {scale:?}\naxis = [0, 3, 4]\nrotate_deg = {angle:?}\ntranslate = {moved:?}"
        )
        .expect("string");
        let turn = Quat::from_axis_angle(axis, f32::to_radians(angle as f32));
        let base = all.len() as u32;
        let place = |p: &[f32; 3]| {
            (scale as f32 * (turn * Vec3::from(*p)) + Vec3::from(moved.map(|x: f64| x as f32))).to_array()
        };
        all.extend(points.iter().map(place));
        all_n.extend(normals.iter().map(|n| (turn * Vec3::from(*n)).to_array()));
        all_f.extend(faces.iter().map(|f| f.map(|i| i + base)));
    }
    std::fs::write(folder.path().join("copies.obj"), obj(&all, &all_n, &all_f)).expect("written");
    for shading in ["face", "vertex"] {
        let of = |name: &str, rest: &str| {
            let mesh = format!("file = \"{name}\"\nnormals = \"{shading}\"\n{rest}");
            picture(&scene(folder.path(), &mesh).unwrap_or_else(|e| panic!("{e}")), 64, 16, 1)
        };
        let (copies, placed) = (of("copies.obj", ""), of("a.obj", &instances));
        assert_eq!(placed.not_finite, 0);
        let ((want, noise), (got, _)) = (mean(&copies), mean(&placed));
        assert!(excess(got, want, noise) <= 1.0, "{shading}: {got} vs {want} ± {noise}");
        let (a, b) = (copies.to_image().radiance, placed.to_image().radiance);
        let close = |p: &[f64; 3], q: &[f64; 3]| (0..3).all(|c| (p[c] - q[c]).abs() <= 1e-4 * p[c].max(q[c]));
        let same = a.iter().zip(&b).filter(|(p, q)| close(p, q)).count();
        // A path changes where rounding the copies to 32 bits moves it across an edge.
        assert!(same > 4096 * 95 / 100, "{shading}: {same} of 4096 pixels are the same");
    }
}

#[test]
fn an_instance_leaves_its_own_surface_at_any_scale() {
    // Convex and lit by an even sky, no point of the mesh sees another: every pixel of it is the albedo, but for shadow acne.
    let folder = tempfile::tempdir().expect("folder");
    let points =
        [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    let faces =
        [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]].map(|f: [u32; 3]| f);
    std::fs::write(folder.path().join("a.ply"), ply(&points, &points, &faces, Encoding::Little)).expect("written");
    for (scale, moved) in
        [(1.0, DVec3::ZERO), (1e-4, DVec3::new(3.0, -2.0, 1.0)), (1e6, DVec3::ONE), (1.0, DVec3::splat(1e6))]
    {
        let camera = moved + scale * DVec3::new(0.4, 0.9, 3.0);
        let text = format!(
            "version = 1\nname = \"acne\"\nmax_bounces = 1\n[camera]\nposition = {}\ntarget = {}\nfov_deg = 10\n\
             [materials]\nm = {{ kd = [0.5, 0.5, 0.5] }}\n[[mesh]]\nfile = \"a.ply\"\nmaterial = \"m\"\n\
             [[mesh.instance]]\nscale = {scale:?}\naxis = [1, 2, 3]\nrotate_deg = 77\ntranslate = {}\n[light.environment]\nradiance = [1, 1, 1]\n",
            common::toml(camera),
            common::toml(moved),
            common::toml(moved)
        );
        let spec = SceneSpec::parse(&text, "test").expect("parses");
        let built = Scene::build(&spec, folder.path(), &Materials::new()).expect("builds");
        for p in picture(&built, 48, 4, 3).to_image().radiance {
            assert!((p[0] - 0.5).abs() < 1e-12, "scale {scale:e} at {moved}: {p:?}");
        }
    }
}

#[test]
fn a_file_cut_anywhere_is_an_error_and_no_panic() {
    let folder = tempfile::tempdir().expect("folder");
    let (points, normals, _) = patch();
    let (points, normals, faces) = (&points[..4], &normals[..4], [[0, 1, 2], [1, 2, 3]]);
    for (name, bytes) in [
        ("cut.ply", ply(points, normals, &faces, Encoding::Little)),
        ("cut-ascii.ply", ply(points, normals, &faces, Encoding::Ascii)),
        ("cut.glb", glb(points, normals, &faces, "")),
    ] {
        for length in 0..bytes.len() {
            std::fs::write(folder.path().join(name), &bytes[..length]).expect("written");
            let Err(error) = scene(folder.path(), &format!("file = \"{name}\"")) else {
                // Without its last line end an ASCII file is whole; its last number may have lost digits it does not need.
                assert!(name == "cut-ascii.ply" && length + 1 == bytes.len(), "{name} cut at {length}");
                continue;
            };
            assert!(error.to_string().contains(name), "{error}");
        }
    }
}

#[test]
fn a_bad_mesh_file_says_what_is_wrong() {
    let folder = tempfile::tempdir().expect("folder");
    let head = |vertices: &str, faces: usize| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\nelement face {faces}\n\
             property list uchar int vertex_indices\nend_header\n"
        )
    };
    let points = "0 0 0\n1 0 0\n0 1 0\n";
    let gltf = |buffer: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],"buffers":[{buffer}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],"bufferViews":[{{"buffer":0,"byteLength":36}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,1]}}]}}"#
        )
    };
    std::fs::write(folder.path().join("short.bin"), [0; 7]).expect("written");
    for (name, text, normals, words) in [
        (
            "a.ply",
            format!("{}{points}4 0 1 2 0\n3 0 1 9\n", head("3", 2)),
            "face",
            "face 2 names vertex 10, there are 3",
        ),
        ("a.ply", format!("{}{points}3 0 1 -1\n", head("3", 1)), "face", "face 1 has no list"),
        ("a.ply", format!("{}{points}2 0 1\n", head("3", 1)), "face", "at least 3 vertices"),
        ("a.ply", format!("{}0 0 0\n1 zero 0\n", head("3", 1)), "face", "line 11"),
        ("a.ply", format!("{}{points}3 0 1 2\n", head("3", 1)), "vertex", "no nx, ny and nz"),
        ("a.ply", format!("{}{points}", head("3", 0)), "face", "at least one face"),
        ("a.ply", format!("{}1e39 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", head("3", 1)), "face", "vertex 1"),
        ("a.ply", format!("{}{points}", head("999999999999", 1)), "face", "a.ply"),
        ("a.ply", "not a mesh\n".into(), "face", "line 1"),
        ("a.gltf", "{}".into(), "face", "a.gltf"),
        ("a.gltf", gltf(r#"{"byteLength":36,"uri":"none.bin"}"#), "face", "none.bin"),
        ("a.gltf", gltf(r#"{"byteLength":36,"uri":"short.bin"}"#), "face", "should hold 36 bytes, found 7"),
        (
            "a.gltf",
            gltf(r#"{"byteLength":36,"uri":"data:application/octet-stream;base64,AAAA"}"#),
            "face",
            "should hold 36 bytes, found 3",
        ),
        (
            "a.gltf",
            gltf(r#"{"byteLength":36,"uri":"data:application/octet-stream;base64,A*"}"#),
            "face",
            "expected base64 after `data:`",
        ),
        ("a.stl", "solid".into(), "face", ".obj, .ply, .gltf or .glb"),
    ] {
        std::fs::write(folder.path().join(name), &text).expect("written");
        let message = match scene(folder.path(), &format!("file = \"{name}\"\nnormals = \"{normals}\"")) {
            Ok(_) => panic!("{text} is taken"),
            Err(error) => error.to_string(),
        };
        assert!(
            message.contains(words) && message.contains(folder.path().to_str().expect("path")),
            "{text}: {message}"
        );
    }
}
