//! What each stage costs: `cargo bench`. Inputs are made here; nothing is read but what was written. `benches/performance.py stages` runs it and makes a
//! table of it.
#![allow(clippy::expect_used, missing_docs)] // a bench may fail loudly; criterion's macros make undocumented items

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use goniofit::brdf::{Brdf, LobeKind, Material};
use goniofit::chain::{DemoOptions, Source, Stage, demo, measure, measure_raw, picture, reduced};
use goniofit::control::Control;
use goniofit::fit::{FitOptions, fit};
use goniofit::geometry::direction;
use goniofit::gonio::{Instrument, Preset, Scan};
use goniofit::image::{compare, read_exr};
use goniofit::measurement::interpolate::TableBrdf;
use goniofit::measurement::{Format, Measurement, ReadOptions, formats};
use goniofit::render::{Materials, Options, Scene, SceneSpec};
use goniofit::report::page;
use goniofit::report::run::{Run, RunOptions};

fn truth(exponent: f64) -> Source {
    let channels = ["r", "g", "b"].map(str::to_owned).to_vec();
    let lobes =
        vec![(LobeKind::Lambert, vec![0.3, 0.2, 0.1], vec![]), (LobeKind::Phong, vec![0.2, 0.2, 0.2], vec![exponent])];
    Source::Fitted(Box::new(Material::new(channels, lobes)))
}

fn merl_table(exponent: f64) -> Measurement {
    let instrument = Instrument { electrons: 1e6, ..Instrument::default() };
    measure("merl", &truth(exponent), &instrument, &Scan::Merl, 1, Control::silent()).expect("a table")
}

fn files(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("table.binary");
    let mut bytes = Vec::new();
    formats::write(&merl_table(80.0), Format::Merl, Path::new("table"), &mut bytes).expect("writes");
    std::fs::write(&path, bytes).expect("writes");
    let mut group = c.benchmark_group("files");
    group.sample_size(20);
    group.bench_function("read a MERL table (35 MB, warm)", |b| {
        b.iter(|| formats::read(black_box(&path), &ReadOptions::default()).expect("reads"));
    });
    group.finish();
}

fn fits(c: &mut Criterion) {
    let mut group = c.benchmark_group("fit");
    group.sample_size(10);
    for exponent in [3.0, 90.0, 6000.0] {
        let table = merl_table(exponent);
        let options = FitOptions::new("lambert+phong".parse().expect("a model"));
        group.bench_function(format!("lambert+phong to a MERL table, n {exponent}"), |b| {
            b.iter(|| fit(black_box(&table), &options).expect("a fit"));
        });
    }
    let table =
        measure("h", &truth(90.0), &Instrument::default(), &Scan::Hemisphere { step_deg: 5.0 }, 1, Control::silent())
            .expect("a table");
    for model in ["lambert", "lambert+phong", "lambert+phong+phong"] {
        let options = FitOptions::new(model.parse().expect("a model"));
        group.bench_function(format!("{model} to a hemisphere scan of 22,050 pairs"), |b| {
            b.iter(|| fit(black_box(&table), &options).expect("a fit"));
        });
    }
    group.finish();
}

fn instrument(c: &mut Criterion) {
    let mut group = c.benchmark_group("simulate");
    group.sample_size(10);
    for (name, instrument) in [("ideal", Instrument::noiseless()), ("noisy", Instrument::default())] {
        group.bench_function(format!("{name}, MERL grid (4.4 million readings)"), |b| {
            b.iter(|| measure("m", &truth(90.0), &instrument, &Scan::Merl, 1, Control::silent()).expect("a table"));
        });
    }
    group.finish();
}

/// An instrument with faults: its raw readings, and the way back.
fn faults(c: &mut Criterion) {
    let instrument = Preset::find("commercial").expect("built in").spec().expect("valid").instrument;
    let scan = Scan::InPlane { step_deg: 5.0 };
    let readings = || measure_raw("m", &truth(90.0), &instrument, &scan, 1, Control::silent()).expect("readings");
    let raw = readings().as_written();
    let mut group = c.benchmark_group("faults");
    group.sample_size(10);
    group.bench_function("simulate `commercial`, all effects, in the plane of incidence", |b| b.iter(readings));
    group.bench_function("reduce those readings", |b| {
        b.iter(|| reduced("m", black_box(&raw), &instrument).expect("a reduction"));
    });
    group.finish();
}

fn tables(c: &mut Criterion) {
    let table = merl_table(200.0);
    let mut group = c.benchmark_group("table as BRDF");
    group.sample_size(20);
    group.bench_function("build (interpolation and sampler)", |b| {
        b.iter(|| TableBrdf::new(black_box(&table), &[0, 1, 2]).expect("a BRDF"));
    });
    let brdf = TableBrdf::new(&table, &[0, 1, 2]).expect("a BRDF");
    let (wi, wo) = (direction(0.6, 0.3), direction(0.7, 3.3));
    let mut out = [0.0; 3];
    group.bench_function("eval", |b| b.iter(|| brdf.eval(black_box(wi), black_box(wo), &mut out)));
    group.bench_function("sample with density", |b| b.iter(|| brdf.sample(black_box(wo), black_box([0.3, 0.6, 0.2]))));
    group.finish();
}

fn pictures(c: &mut Criterion) {
    let mut group = c.benchmark_group("render");
    group.sample_size(10);
    for scene in ["sphere", "sphere-on-plane", "cornell"] {
        let stage = Stage::built_in(scene).expect("a scene");
        let options = Options { width: 256, height: 256, samples: 8, ..Options::of(&stage.spec) };
        group.throughput(criterion::Throughput::Elements(256 * 256 * 8));
        group.bench_function(format!("{scene}, samples"), |b| {
            b.iter(|| picture(black_box(&stage), None, &options, Control::silent()).expect("a picture"));
        });
    }
    group.finish();
}

/// What a run leaves, compared and put on a page.
fn results(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder");
    let options = DemoOptions { size: 256, samples: 16, ..DemoOptions::default() };
    demo(folder.path(), &options, Control::silent()).expect("a run");
    let [a, b] = ["lambert.exr", "truth.exr"].map(|name| read_exr(&folder.path().join(name)).expect("a picture"));
    let mut group = c.benchmark_group("results");
    group.sample_size(10);
    group.bench_function("compare two pictures of 256², all metrics", |bench| {
        bench.iter(|| compare(black_box(&a), black_box(&b)).expect("numbers"));
    });
    group.bench_function("report: read the demo's folder, write the page", |bench| {
        bench.iter(|| page(&Run::read(folder.path(), &RunOptions::default()).expect("a run")).expect("a page"));
    });
    group.finish();
}

/// A wavy sheet of 2 · `SHEET`² triangles.
const SHEET: u32 = 500;

fn sheet() -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let side = SHEET + 1;
    let at = |k: u32| {
        let (x, y) = ((k % side) as f32 / SHEET as f32, (k / side) as f32 / SHEET as f32);
        [x, 0.1 * (20.0 * x).sin() * (30.0 * y).cos(), y]
    };
    let cell = |k: u32| {
        let a = k / SHEET * side + k % SHEET;
        [[a, a + side, a + 1], [a + 1, a + side, a + side + 1]]
    };
    ((0..side * side).map(at).collect(), (0..SHEET * SHEET).flat_map(cell).collect())
}

fn ply(points: &[[f32; 3]], faces: &[[u32; 3]]) -> Vec<u8> {
    let mut file = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        points.len(),
        faces.len()
    )
    .into_bytes();
    file.extend(points.iter().flatten().flat_map(|x| x.to_le_bytes()));
    for face in faces {
        file.push(3);
        file.extend(face.iter().flat_map(|i| i.to_le_bytes()));
    }
    file
}

fn obj(points: &[[f32; 3]], faces: &[[u32; 3]]) -> Vec<u8> {
    let vertices = points.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n"));
    let faces = faces.iter().map(|f| format!("f {} {} {}\n", f[0] + 1, f[1] + 1, f[2] + 1));
    vertices.chain(faces).collect::<String>().into_bytes()
}

fn glb(points: &[[f32; 3]], faces: &[[u32; 3]]) -> Vec<u8> {
    let data: Vec<u8> = points
        .iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .chain(faces.iter().flatten().flat_map(|i| i.to_le_bytes()))
        .collect();
    let (first, all) = (12 * points.len(), data.len());
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],"buffers":[{{"byteLength":{all}}}],
        "bufferViews":[{{"buffer":0,"byteLength":{first}}},{{"buffer":0,"byteOffset":{first},"byteLength":{}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{},"type":"VEC3","min":[0,-0.1,0],"max":[1,0.1,1]}},
        {{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}]}}"#,
        all - first,
        points.len(),
        3 * faces.len()
    )
    .into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let chunk = |kind: &[u8; 4], bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes()[..], kind, bytes].concat();
    let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &data)].concat();
    let total = 12 + chunks.len() as u32;
    [b"glTF", &2u32.to_le_bytes()[..], &total.to_le_bytes(), &chunks].concat()
}

fn meshes(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder");
    let (points, faces) = sheet();
    let mut group = c.benchmark_group("meshes");
    group.sample_size(10);
    for (name, bytes) in [("ply", ply(&points, &faces)), ("obj", obj(&points, &faces)), ("glb", glb(&points, &faces))] {
        std::fs::write(folder.path().join(format!("sheet.{name}")), bytes).expect("writes");
        let scene = format!(
            "version = 1\nname = \"sheet\"\nmax_bounces = 1\n[camera]\nposition = [0, 2, 3]\ntarget = [0, 0, 0]\nfov_deg = 40\n\
             [materials]\nm = {{ kd = [0.5, 0.5, 0.5] }}\n[[mesh]]\nfile = \"sheet.{name}\"\nmaterial = \"m\"\n\
             [[light.point]]\nposition = [0, 3, 0]\nintensity = [1, 1, 1]\n"
        );
        let spec = SceneSpec::parse(&scene, "sheet").expect("a scene");
        group.bench_function(format!("read a .{name} of 500,000 triangles (warm), build its hierarchy"), |b| {
            b.iter(|| Scene::build(black_box(&spec), folder.path(), &Materials::new()).expect("builds"));
        });
    }
    group.finish();
}

criterion_group!(stages, files, fits, instrument, faults, tables, meshes, pictures, results);
criterion_main!(stages);
