//! Encoded copies of measured tables, where they are beside the project: small networks whose expansion is a table in MERL's format.
#![allow(dead_code, clippy::expect_used, clippy::unwrap_used)] // each file uses a part

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use goniofit::measurement::{Measurement, MerlAngles, MerlGrid, ReadOptions, formats};
use rayon::prelude::*;

/// A file beside the project; says that it is skipped where it is not there.
pub fn shared(path: &str) -> Option<PathBuf> {
    let full = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared").join(path);
    if full.exists() {
        return Some(full);
    }
    println!("SKIPPED: {} is not here", full.display());
    None
}

/// An encoded table by its name, if it is there.
pub fn encoded(name: &str) -> Option<Measurement> {
    shared(&format!("data/merl-encoded/{name}.npz")).map(|file| expanded(&file))
}

/// The table that an encoded file stands for.
pub fn expanded(file: &Path) -> Measurement {
    formats::read_bytes(&file.with_extension("binary"), decode(file), &ReadOptions::default()).expect("a table")
}

/// A matrix of an `.npz` archive, row-major.
struct Matrix {
    columns: usize,
    values: Vec<f64>,
}

fn read_npz(path: &Path) -> HashMap<String, Matrix> {
    let mut archive = zip::ZipArchive::new(File::open(path).unwrap()).unwrap();
    let names: Vec<String> = archive.file_names().map(|n| n.unwrap().into_owned()).collect();
    let mut all = HashMap::new();
    for name in names {
        let mut bytes = Vec::new();
        archive.by_name(&name).unwrap().read_to_end(&mut bytes).unwrap();
        let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let text = String::from_utf8_lossy(&bytes[10..header]).into_owned();
        assert!(text.contains("'<f4'") && text.contains("'fortran_order': False"), "{text}");
        let shape = text.split("'shape': (").nth(1).unwrap().split(')').next().unwrap();
        let columns = shape.split(',').filter_map(|s| s.trim().parse().ok()).next_back().unwrap();
        let values = bytes[header..].chunks_exact(4).map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap())));
        all.insert(name.trim_end_matches(".npy").to_owned(), Matrix { columns, values: values.collect() });
    }
    all
}

/// x · k + b
fn layer(net: &HashMap<String, Matrix>, index: usize, x: &[f64], out: &mut Vec<f64>) {
    let (k, b) = (&net[&format!("k{index}")], &net[&format!("b{index}")]);
    out.clone_from(&b.values);
    for (row, x) in x.iter().enumerate() {
        let weights = &k.values[row * k.columns..(row + 1) * k.columns];
        out.iter_mut().zip(weights).for_each(|(o, w)| *o += x * w);
    }
}

/// The table that an encoded file stands for, as the bytes of a MERL file. The network was trained on the lower edges of the
/// bins, so it is evaluated there; what the format's entry is read at is the reader's business.
pub fn decode(path: &Path) -> Vec<u8> {
    let net = read_npz(path);
    let grid = MerlGrid { angles: MerlAngles::Edge };
    let scale = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];
    let stored: Vec<[f64; 3]> = (0..MerlGrid::LEN)
        .into_par_iter()
        .map_init(
            || (Vec::new(), Vec::new()),
            |(a, b), i| {
                let angles = grid.half_diff(i);
                let (wi, wo) = angles.to_pair();
                if !(wi.z > 0.0 && wo.z > 0.0) {
                    return [-1.0; 3];
                }
                let (sin_h, cos_h) = angles.theta_h.sin_cos();
                let (sin_d, cos_d) = angles.theta_d.sin_cos();
                let (sin_p, cos_p) = angles.phi_d.sin_cos();
                layer(&net, 1, &[sin_h, 0.0, cos_h, sin_d * cos_p, sin_d * sin_p, cos_d], a);
                a.iter_mut().for_each(|v| *v = v.max(0.0));
                layer(&net, 2, a, b);
                b.iter_mut().for_each(|v| *v = v.max(0.0));
                layer(&net, 3, b, a);
                std::array::from_fn(|c| a[c].exp_m1().max(0.0) / scale[c])
            },
        )
        .collect();
    let mut bytes: Vec<u8> = [90i32, 90, 180].iter().flat_map(|n| n.to_le_bytes()).collect();
    for c in 0..3 {
        bytes.extend(stored.iter().flat_map(|v| v[c].to_le_bytes()));
    }
    bytes
}
