//! The fit of real tables (encoded copies of MERL and RGL measurements) against optima found independently by brute force.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)] // helpers of tests

mod encoded_tables;

use std::path::PathBuf;

use encoded_tables::{expanded, shared};

use goniofit::fit::{FitOptions, fit};
use goniofit::measurement::{Format, ReadOptions, formats};

#[test]
fn all_16_tables_reach_the_optimum_found_by_brute_force_from_no_start_value() {
    let (Some(folder), Some(reference)) = (shared("data/merl-encoded"), shared("reference/merl_lambert_phong.json"))
    else {
        return;
    };
    let reference: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(reference).unwrap()).unwrap();
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "npz"));
    files.sort();
    assert_eq!(files.len(), 16);
    for file in files {
        let name = file.file_stem().unwrap().to_string_lossy().into_owned();
        let table = expanded(&file);
        let run = |model: &str| fit(&table, &FitOptions::new(model.parse().unwrap())).unwrap().material;
        let (lambert, both) = (run("lambert"), run("lambert+phong"));
        let want = |key: &str| reference[&name][key].as_f64().unwrap();
        let record = both.fit.as_ref().unwrap();
        let exponent = both.lobes[1].shape_of(0).unwrap()[0];
        let rmse_error = record.rmse / want("rmse") - 1.0;
        let lambert_error = lambert.fit.as_ref().unwrap().rmse / want("rmse_lambert") - 1.0;
        let exponent_error = exponent / want("exponent") - 1.0;
        println!(
            "{name:24} n {exponent:12.4} ({exponent_error:+.1e}), rmse {:.6} ({rmse_error:+.1e}), lambert ({lambert_error:+.1e}), {:.3} s",
            record.rmse, record.seconds
        );
        assert_eq!(record.samples, reference[&name]["samples"].as_u64().unwrap());
        assert_eq!(record.status, "converged");
        // Asked for: 0.1 % in rmse, 0.5 % in the exponent. Reached: what the reference's own search leaves (1e-6 in n).
        assert!(rmse_error.abs() < 1e-9 && lambert_error.abs() < 1e-9, "{name}");
        assert!(exponent_error.abs() < 1e-5, "{name}");
        for (l, key) in [(0, "kd"), (1, "ks")] {
            for c in 0..3 {
                let want = reference[&name][key][c].as_f64().unwrap();
                assert!((both.lobes[l].weight[c] / want - 1.0).abs() < 1e-4, "{name} {key}[{c}]");
            }
        }
    }
}

/// Entries, masked values (samples × channels) and samples of a fit: pairs of directions with a valid value, above the horizon and
/// both angles up to 80°. They were counted by a script in Python that reads the files itself and shares no code with this project
/// (for the tensor files it draws the nodes' directions through a warp of its own).
struct Counted {
    file: &'static str,
    format: Format,
    entries: usize,
    masked: u64,
    samples: u64,
}

const COUNTED: [Counted; 10] = [
    counted("measured/retro-3M-yellow.alta.dat", Format::Alta, 7397, 86, 7053),
    counted("measured/retro-gray-tape.alta.dat", Format::Alta, 7405, 0, 7061),
    counted("measured/pink-felt-1d.alta", Format::Alta, 90, 0, 89),
    counted("lab/AnoBlackEC1onAlum.zemax.bsdf", Format::Zemax, 912, 193, 719),
    counted("lab/AnoBlackEC1onAlum.fred.txt", Format::Fred, 1144, 0, 1144),
    counted("rgl/aurora_white_rgb.bsdf", Format::Rgl, 8192, 2688, 5842),
    counted("rgl/cc_ibiza_sunset_rgb.bsdf", Format::Rgl, 8192, 1440, 6302),
    counted("rgl/chm_mint_rgb.bsdf", Format::Rgl, 8192, 864, 5946),
    counted("rgl/irid_flake_paint1_rgb.bsdf", Format::Rgl, 8192, 1584, 6326),
    counted("rgl/vch_silk_blue_rgb.bsdf", Format::Rgl, 8192, 1038, 5766),
];

const fn counted(file: &'static str, format: Format, entries: usize, masked: u64, samples: u64) -> Counted {
    Counted { file, format, entries, masked, samples }
}

#[test]
fn the_real_files_of_every_format_load_and_fit() {
    for Counted { file, format, entries, masked, samples } in COUNTED {
        let Some(path) = shared(&format!("data/{file}")) else { return };
        let table = formats::read(&path, &ReadOptions::default()).unwrap();
        assert_eq!(table.origin, format.description(), "{file}");
        assert_eq!((table.len(), table.masked.total()), (entries, masked), "{file}");
        for model in ["lambert", "phong", "lambert+phong"] {
            let material = fit(&table, &FitOptions::new(model.parse().unwrap())).unwrap().material;
            let record = material.fit.as_ref().unwrap();
            let finite = material.lobes.iter().all(|l| {
                l.weight.iter().all(|w| w.is_finite() && *w >= 0.0)
                    && l.shape_of(0).is_none_or(|s| s.iter().all(|x| x.is_finite()))
            });
            println!(
                "{file:36} {model:14} {:12} {:6} samples, rmse {:.5}, {:?}",
                record.status,
                record.samples,
                record.rmse,
                material.lobes.last().and_then(|l| l.shape_of(0))
            );
            assert!(finite && record.rmse.is_finite(), "{file} {model}: {material:?}");
            assert_eq!(record.samples, samples, "{file} {model}");
        }
    }
}
