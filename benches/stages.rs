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
use goniofit::render::Options;
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

criterion_group!(stages, files, fits, instrument, faults, tables, pictures, results);
criterion_main!(stages);
