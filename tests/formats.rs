//! Measurements are read as their formats mean them: synthetic files of one known reflectance, real files where they are at hand.
#![allow(clippy::expect_used, clippy::panic)]

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use glam::DVec3;
use goniofit::geometry::angles::direction_deg;
use goniofit::geometry::mirror;
use goniofit::measurement::formats::{self, WriteReport};
use goniofit::measurement::{
    Dimension, Directions, Format, Measurement, MeasurementError, MerlAngles, MerlGrid, Quantity, ReadOptions, Weights,
};
use goniofit::numeric::quadrature::integrate_directions;
use goniofit::numeric::random::{Purpose, RngExt, stream};

/// The reflectance of the fixtures: 0.2/π + 0.3·22/(2π)·max(0, r·wo)²⁰.
fn brdf(wi: DVec3, wo: DVec3) -> f64 {
    0.2 / PI + 0.3 * 22.0 / (2.0 * PI) * mirror(wi).dot(wo).max(0.0).powi(20)
}

fn fixture_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data-fixtures/measurements").join(name)
}

fn fixture(name: &str) -> Measurement {
    formats::read(&fixture_path(name), &ReadOptions::default()).expect("a valid fixture")
}

/// A file measured for real, where it is at hand.
fn real(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data").join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: {} is not here", path.display());
    None
}

/// Checks every value against `scale`·[`brdf`] and returns how many are valid.
fn check_values(table: &Measurement, channel: usize, scale: f64, tolerance: f64) -> usize {
    let mut valid = 0;
    for i in 0..table.len() {
        let (wi, wo) = table.directions.pair(i);
        if let Some(value) = table.value(channel, i) {
            let want = scale * brdf(wi, wo);
            assert!((value / want - 1.0).abs() < tolerance, "{}, entry {i}: {value} for {want}", table.name);
            valid += 1;
        }
    }
    valid
}

#[test]
fn every_format_gives_the_same_reflectance() {
    // Numbers printed with 17 digits: rounding alone (the cosine is divided out at up to 80°). With n digits: 10⁻ⁿ.
    for (name, format, entries, valid, tolerance) in [
        ("brdf-cos-crlf-bom.csv", "CSV", 102, 100, 1e-13),
        ("projected-brdf-cos.alta", "ALTA text", 101, 100, 1e-13),
        ("view-light-dphi-intervals.alta", "ALTA text", 100, 100, 1e-13),
        ("plane-symmetrical.zemax.bsdf", "Zemax BSDF text", 741, 634, 1e-6),
        ("grid.fred.txt", "FRED BSDF text", 311, 311, 1e-9),
        ("grid-pole-for-every-azimuth.fred.txt", "FRED BSDF text", 347, 347, 1e-9),
        ("in-plane.fred.txt", "FRED BSDF text", 34, 34, 1e-9),
        ("in-plane-two-azimuths.fred.txt", "FRED BSDF text", 36, 36, 1e-9),
    ] {
        let table = fixture(name);
        assert_eq!((table.origin.as_str(), table.len()), (format, entries), "{name}");
        assert_eq!(check_values(&table, 0, 1.0, tolerance), valid, "{name}");
        assert_eq!(table.masked.marked, (entries - valid) as u64, "{name}");
    }
    let slice = fixture("half-angle-cosine-rgb.alta");
    assert_eq!(slice.channels, ["r", "g", "b"]);
    for (channel, scale) in [1.0, 2.0, 3.0].into_iter().enumerate() {
        assert_eq!(check_values(&slice, channel, scale, 1e-13), 9);
    }
}

#[test]
fn every_column_of_a_csv_finds_its_place() {
    let table = fixture("every-column-in-any-order.csv");
    assert_eq!(table.channels, ["a", "b"]);
    check_values(&table, 0, 1.0, 1e-13);
    check_values(&table, 1, 2.0, 1e-13);
    assert_eq!(table.common.len(), 2);
    assert!(matches!(table.weights, Weights::Column(_)));
    for i in 0..table.len() {
        for c in 0..2 {
            let value = table.value(c, i).expect("valid");
            assert!((table.sigma_plane(c).expect("sigma")[i] / value - 0.01).abs() < 1e-15);
            assert!((table.common_plane(0, c)[i] / value - 0.02).abs() < 1e-15);
            assert!((table.common_plane(1, c)[i] - [-0.25, 0.5][c]).abs() < 1e-15);
        }
        let (_, wo) = table.directions.pair(i);
        assert!((table.weights.get(i) - wo.x.hypot(wo.y) - 0.1).abs() < 1e-14);
    }
}

#[test]
fn what_channels_of_a_row_share_comes_back() {
    let head = "# quantity: brdf_cos\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,row_b,a,b,sigma_a,sigma_b,row_a\n";
    let table = read_bytes(format!("{head}0,0,60,0,-0.2,1,2,0.1,0.25,0.05\n0,0,0,0,,3,,0.1,,0.1\n").into_bytes(), None);
    // BRDF·cosθo: the cosine of 60° is divided out of errors too.
    let [a, b] = [0, 1].map(|c| table.row_plane(c).expect("a part"));
    assert!((a[0] - 0.1).abs() < 1e-12 && (b[0] + 0.4).abs() < 1e-12 && a[1] == 0.1 && b[1].is_nan(), "{a:?} {b:?}");
    let back = read_bytes(written(&table, Format::Csv).0, None);
    assert!(same_bits(back.row.as_ref().expect("a part"), table.row.as_ref().expect("a part")));
}

#[test]
fn masks_are_kept_by_reason_and_channel() {
    let table = fixture("masked-values.csv");
    assert_eq!((table.masked.marked, table.masked.not_finite), (1, 2));
    assert_eq!(table.masked.first_not_finite.as_deref(), Some("line 3, column r"));
    let row = |i| [0, 1, 2].map(|c| table.value(c, i));
    assert_eq!(row(0), [Some(0.1), None, Some(-0.001)]);
    assert_eq!(row(1), [None, Some(0.2), None]);
    // −30° at azimuth 0 is 30° at azimuth 180°.
    let (wi, wo) = table.directions.pair(2);
    assert!((wi.x + 0.5).abs() < 1e-15 && wo.x < 0.0);
}

#[test]
fn the_flat_world_is_read_as_one() {
    let table = fixture("in-plane-flat-world.csv");
    assert_eq!((table.dimension, table.len()), (Dimension::Flat, 36));
    // Γ(23/2) / (√π Γ(11)) = 21!! / (2¹¹ · 10!)
    let odd: f64 = (1..=21).step_by(2).map(f64::from).product();
    let norm = odd / (2f64.powi(11) * (1..=10).map(f64::from).product::<f64>());
    for i in 0..table.len() {
        let (wi, wo) = table.directions.pair(i);
        let want = 0.1 + 0.3 * norm * mirror(wi).dot(wo).max(0.0).powi(20);
        assert!(wi.y.abs() + wo.y.abs() < 1e-300);
        // θo = −90° is on the horizon.
        let Some(value) = table.value(0, i) else {
            assert!(wo.z == 0.0, "entry {i}");
            continue;
        };
        assert!(wo.z > 0.0 && (value / want - 1.0).abs() < 1e-13, "{value} for {want}");
    }
    assert_eq!(table.masked.marked, 3);
    assert_eq!(table.notes, ["masked as at the horizon: 3 of the values, the first at line 3, column r"]);
    let both = b"# dimension: 2\ntheta_i_deg,theta_o_deg,r\n90,0,0.1\n0,90,0.1\n-90,0,0.1\n0,-90,0.1\n0,89.9,0.1\n";
    let table = read_bytes(both.to_vec(), None);
    assert_eq!((0..5).map(|i| table.value(0, i)).collect::<Vec<_>>(), [None, None, None, None, Some(0.1)]);
}

#[test]
fn quantity_and_format_can_be_overridden() {
    let path = fixture_path("brdf-cos-crlf-bom.csv");
    let as_brdf = ReadOptions { quantity: Some(Quantity::Brdf), ..ReadOptions::default() };
    let table = formats::read(&path, &as_brdf).expect("valid");
    let (wi, wo) = table.directions.pair(7);
    assert!((table.value(0, 7).expect("valid") / (brdf(wi, wo) * wo.z) - 1.0).abs() < 1e-13);
    let (merl, _) = written(&merl_table(MerlAngles::Center), Format::Merl);
    for (quantity, refused) in [(Quantity::Brdf, false), (Quantity::BrdfCos, true)] {
        let options = ReadOptions { quantity: Some(quantity), ..ReadOptions::default() };
        match formats::read_bytes(Path::new("t.binary"), merl.clone(), &options) {
            Err(error @ MeasurementError::Unsupported { .. }) if refused => {
                assert!(
                    error.to_string().contains("holds the BRDF by definition; read it without --quantity brdf_cos")
                );
            }
            other => assert!(other.is_ok() && !refused, "{quantity:?}"),
        }
    }
    let as_fred = ReadOptions { format: Some(Format::Fred), ..ReadOptions::default() };
    let error = formats::read(&path, &as_fred).expect_err("not FRED").to_string();
    assert!(error.contains("expected type bsdf_data"), "{error}");
}

#[test]
fn grids_bring_their_solid_angles() {
    // ∫ f cosθo dωo by each grid's own cells against quadrature, at θi = 30°, over the hemisphere about the mirror direction
    // (Zemax) and up to θo = 85° (FRED), where the cells end. Cells of 5° × 15° and 10° × 15° over a lobe 15° wide: some per cent.
    let wi = DVec3::new(-0.5, 0.0, 0.75f64.sqrt());
    let integral = |theta_max: f64, keep: &dyn Fn(DVec3) -> bool| {
        let whole = |wo: DVec3| if keep(wo) { brdf(wi, wo) * wo.z } else { 0.0 };
        integrate_directions((0.0, theta_max), (0.0, 2.0 * PI), 200, whole)
    };
    let about_mirror = integral(0.5 * PI, &|wo| wo.dot(mirror(wi)) > 0.0);
    let up_to_85 = integral(85f64.to_radians(), &|_| true);
    // The weights carry the incidence's own cell too: ∫ sinθ dθ from 15° to 45°.
    let incidence = 15f64.to_radians().cos() - 45f64.to_radians().cos();
    for (name, truth) in [
        ("plane-symmetrical.zemax.bsdf", about_mirror),
        ("grid.fred.txt", up_to_85),
        ("grid-pole-for-every-azimuth.fred.txt", up_to_85),
    ] {
        let table = fixture(name);
        assert!(matches!(table.weights, Weights::SolidAngle(_)), "{name}");
        let mine = (0..table.len()).filter(|&i| (table.directions.pair(i).0 - wi).length() < 1e-12);
        let part = |i| Some(table.value(0, i)? * table.directions.pair(i).1.z * table.weights.get(i) / incidence);
        let sum: f64 = mine.filter_map(part).sum();
        println!("{name}: {sum} for {truth}");
        assert!((sum / truth - 1.0).abs() < 0.03, "{name}: {sum} for {truth}");
    }
    for name in ["in-plane.fred.txt", "in-plane-two-azimuths.fred.txt"] {
        assert!(matches!(fixture(name).weights, Weights::Uniform), "{name}");
    }
}

/// A FRED file of one block at 10° whose rows are these (θ, φ).
fn fred_block(rows: impl IntoIterator<Item = (u32, u32)>) -> Measurement {
    let rows: Vec<String> = rows.into_iter().map(|(theta, phi)| format!("{theta} {phi} 0.1\n")).collect();
    let text = format!("type bsdf_data\nformat angles=deg bsdf=value scale=1\n10 0\n{}", rows.concat());
    read_bytes(text.into_bytes(), None)
}

#[test]
fn rows_of_one_node_share_its_solid_angle() {
    // The pole at every azimuth against the pole once: with all rows there, and with one missing.
    for (pole, missing) in [(true, false), (true, true), (false, false), (false, true)] {
        let ring = |theta| [0, 60, 120, 180].map(move |phi| (theta, phi));
        let rows = (0..=80).step_by(10).flat_map(ring).filter(|row| pole || row.0 > 0 || row.1 == 0);
        let table = fred_block(rows.filter(|row| !(missing && *row == (40, 60))));
        let sum = |keep: &dyn Fn(f64) -> bool| -> f64 {
            (0..table.len()).filter(|&i| keep(table.directions.pair(i).1.z)).map(|i| table.weights.get(i)).sum()
        };
        assert!(matches!(table.weights, Weights::SolidAngle(_)));
        let cap = 2.0 * PI * (1.0 - 5f64.to_radians().cos());
        assert!((sum(&|z| z > 0.999) / cap - 1.0).abs() < 1e-12, "pole {pole}, missing {missing}");
        if !missing {
            assert!((sum(&|_| true) / (2.0 * PI * (1.0 - 85f64.to_radians().cos())) - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn azimuths_with_a_wide_gap_are_no_grid() {
    for (azimuths, grid) in [
        (vec![0, 180], false),
        (vec![0, 180, 360], false),
        (vec![0, 120, 240], false),
        (vec![60, 90, 120], false),
        (vec![0, 90], false),
        (vec![45, 135], false),
        (vec![0, 90, 180], true),
        (vec![0, 90, 180, 270], true),
    ] {
        let table = fred_block((10..=80).step_by(10).flat_map(|t| azimuths.iter().map(move |&p| (t, p))));
        assert_eq!(matches!(table.weights, Weights::SolidAngle(_)), grid, "{azimuths:?}");
    }
}

/// Writes `content` to a file and reads its directions.
fn directions_of(content: &[u8]) -> Result<(Directions, Weights, Dimension), MeasurementError> {
    let file = tempfile::NamedTempFile::new().expect("file");
    std::fs::write(file.path(), content).expect("written");
    formats::read_directions(file.path(), &ReadOptions::default())
}

#[test]
fn a_list_of_directions_needs_no_values() {
    let angles = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg";
    let (directions, weights, dimension) =
        directions_of(format!("{angles}\n30,0,60,180\n0,0,100,0\n").as_bytes()).expect("directions");
    assert_eq!((directions.len(), weights, dimension), (2, Weights::Uniform, Dimension::Space));
    assert_eq!(directions.pair(0), (direction_deg(30.0, 0.0), direction_deg(60.0, 180.0)));
    assert!(directions.pair(1).1.z < 0.0); // kept
    let (_, weights, _) = directions_of(format!("weight,{angles}\n2,30,0,60,180\n").as_bytes()).expect("weighted");
    assert_eq!(weights, Weights::Column(vec![2.0]));
    let flat = b"# dimension: 2\ntheta_i_deg,theta_o_deg\n-30,40\n10,-90\n";
    let (directions, _, dimension) = directions_of(flat).expect("flat");
    assert_eq!((directions.len(), dimension), (2, Dimension::Flat));
    // A measurement serves as well.
    for name in ["every-column-in-any-order.csv", "grid.fred.txt", "in-plane-flat-world.csv"] {
        let table = fixture(name);
        let (directions, weights, dimension) =
            formats::read_directions(&fixture_path(name), &ReadOptions::default()).expect("a measurement");
        assert_eq!((directions, weights, dimension), (table.directions, table.weights, table.dimension), "{name}");
    }
    // What is broken is refused as in a measurement.
    for (content, fact) in [
        (format!("{angles}\n"), "expected a row of data"),
        (format!("{angles}\n0,0,1000,0\n"), "line 2, column theta_o_deg"),
        (format!("{angles},sigma_r\n0,0,10,0,0.1\n"), "the name of a channel"),
        ("theta_i_deg,theta_o_deg\n0,10\n".to_string(), "`# dimension: 2`"),
    ] {
        let error = directions_of(content.as_bytes()).expect_err("refused").to_string();
        assert!(error.contains(fact), "{error}");
    }
}

#[cfg(unix)]
#[test]
fn a_pipe_is_read_once_and_whole() {
    let folder = tempfile::tempdir().expect("folder");
    let pipe = folder.path().join("pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo");
    assert!(made.success());
    let content = std::fs::read(fixture_path("masked-values.csv")).expect("bytes");
    let writer = std::thread::spawn({
        let (pipe, content) = (pipe.clone(), content.clone());
        move || std::fs::write(pipe, content)
    });
    let bytes = formats::read_stream(&pipe).expect("readable");
    writer.join().expect("thread").expect("written");
    assert_eq!(bytes.as_deref(), Some(content.as_slice()));
    let table = formats::read_bytes(&pipe, content, &ReadOptions::default()).expect("a measurement");
    assert_eq!(table.directions, fixture("masked-values.csv").directions);
    assert_eq!(formats::read_stream(&fixture_path("masked-values.csv")).expect("regular"), None);
    assert!(formats::read_stream(folder.path()).is_err());
}

/// A table on the MERL grid of many-digit values, some of them masked.
fn merl_table(angles: MerlAngles) -> Measurement {
    let mut rng = stream(17, Purpose::Study, 0);
    let value = |i: usize| if i % 1009 == 5 { f64::NAN } else { rng.random::<f64>() / (1.0 + (i % 4096) as f64) };
    let values: Vec<f64> = (0..3 * MerlGrid::LEN).map(value).collect();
    let channels = ["r", "g", "b"].map(String::from).to_vec();
    let mut table = Measurement::new("t", Directions::Merl(MerlGrid { angles }), channels, values);
    table.weights = Weights::Merl;
    table
}

fn same_bits(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(x, y)| x.to_bits() == y.to_bits() || (x.is_nan() && y.is_nan()))
}

fn written(table: &Measurement, format: Format) -> (Vec<u8>, WriteReport) {
    let mut bytes = Vec::new();
    let report = formats::write(table, format, Path::new("out"), &mut bytes).expect("writable");
    (bytes, report)
}

fn read_bytes(bytes: Vec<u8>, merl_angles: impl Into<Option<MerlAngles>>) -> Measurement {
    let options = ReadOptions { merl_angles: merl_angles.into(), ..ReadOptions::default() };
    formats::read_bytes(Path::new("t.any"), bytes, &options).expect("readable")
}

#[test]
fn a_merl_file_keeps_values_masks_and_first_places() {
    let mut table = merl_table(MerlAngles::Center);
    table.values[3] = -0.5;
    table.sigma = Some(vec![0.1; table.values.len()]);
    let masked = table.values.iter().filter(|v| v.is_nan()).count() as u64;
    let (mut bytes, report) = written(&table, Format::Merl);
    assert_eq!(bytes.len(), 34_992_012);
    assert_eq!(report, WriteReport { lost_negative: 1, lost_sigma: 3 * MerlGrid::LEN as u64, lost_common: 0 });
    table.values[3] = f64::NAN;
    // Not finite in two channels: green entry 7, blue entry 100.
    for (index, value) in [(MerlGrid::LEN + 7, f64::INFINITY), (2 * MerlGrid::LEN + 100, f64::NAN)] {
        let place = 12 + 8 * index;
        bytes[place..place + 8].copy_from_slice(&value.to_le_bytes());
        assert!(!table.values[index].is_nan());
        table.values[index] = f64::NAN;
    }
    let back = read_bytes(bytes.clone(), MerlAngles::Edge);
    assert_eq!(back.directions, Directions::Merl(MerlGrid { angles: MerlAngles::Edge }));
    assert_eq!((back.masked.marked, back.masked.not_finite), (masked + 1, 2));
    let place = format!("channel g, entry 7 (byte {})", 12 + 8 * (MerlGrid::LEN + 7));
    assert_eq!(back.masked.first_not_finite, Some(place));
    // A value that never was in a MERL file may move by its last bit (no stored number may give it); from then on it stays.
    for (a, b) in back.values.iter().zip(&table.values) {
        assert!((a.is_nan() && b.is_nan()) || (a / b - 1.0).abs() <= f64::EPSILON, "{a} for {b}");
    }
    let (again, _) = written(&back, Format::Merl);
    assert!(same_bits(&read_bytes(again, MerlAngles::Edge).values, &back.values));

    // A file on the disk takes the parallel path, on any number of threads.
    let file = tempfile::NamedTempFile::new().expect("file");
    std::fs::write(file.path(), &bytes).expect("written");
    for threads in [1, 2, 8] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
        let table = pool.install(|| formats::read(file.path(), &ReadOptions::default())).expect("readable");
        assert!(same_bits(&table.values, &back.values) && table.masked == back.masked);
    }
}

#[test]
fn merl_to_csv_to_merl_loses_nothing() {
    let (merl, _) = written(&merl_table(MerlAngles::Edge), Format::Merl);
    let table = read_bytes(merl, MerlAngles::Edge);
    let (csv, report) = written(&table, Format::Csv);
    assert_eq!(report, WriteReport::default());
    let back = read_bytes(csv, None);
    assert_eq!(back.directions, table.directions);
    assert_eq!((back.weights, back.origin.as_str()), (Weights::Merl, "CSV"));
    assert!(same_bits(&back.values, &table.values));
}

#[test]
fn csv_keeps_everything_of_every_fixture() {
    for name in [
        "every-column-in-any-order.csv",
        "masked-values.csv",
        "in-plane-flat-world.csv",
        "brdf-cos-crlf-bom.csv",
        "projected-brdf-cos.alta",
        "half-angle-cosine-rgb.alta",
        "plane-symmetrical.zemax.bsdf",
        "grid.fred.txt",
        "grid-pole-for-every-azimuth.fred.txt",
    ] {
        let table = fixture(name);
        let back = read_bytes(written(&table, Format::Csv).0, None);
        assert!(same_bits(&back.values, &table.values), "{name}");
        assert_eq!((back.dimension, &back.channels), (table.dimension, &table.channels), "{name}");
        assert_eq!(back.weights, table.weights, "{name}");
        let layers = |t: &Measurement| t.sigma.iter().chain(&t.common).cloned().collect::<Vec<_>>();
        assert_eq!((back.sigma.is_some(), back.common.len()), (table.sigma.is_some(), table.common.len()));
        assert!(layers(&back).iter().zip(&layers(&table)).all(|(a, b)| same_bits(a, b)), "{name}");
        for i in 0..table.len() {
            let ((ai, ao), (bi, bo)) = (table.directions.pair(i), back.directions.pair(i));
            assert!((ai - bi).length() < 1e-15 && (ao - bo).length() < 1e-15, "{name}, entry {i}");
        }
        // Round angles stay round: a second generation of them is the same file.
        assert!(!name.ends_with("csv") || written(&back, Format::Csv).0 == written(&table, Format::Csv).0, "{name}");
    }
}

/// Whoever fills them in, a reduction too: errors of a value that is masked are empty cells, which reading and writing again keeps.
#[test]
fn errors_of_masked_values_are_empty() {
    let mut table = fixture("every-column-in-any-order.csv");
    let (n, row) = (table.len(), 1);
    table.values[row] = f64::NAN; // of the first channel alone
    assert!(table.sigma.as_ref().is_some_and(|sigma| sigma[row].is_finite()) && table.common[0][row].is_finite());
    let text = String::from_utf8(written(&table, Format::Csv).0).expect("text");
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = lines.next().expect("a head").split(',').collect();
    let cells: Vec<&str> = lines.nth(row).expect("the row").split(',').collect();
    let [first, second] = [&table.channels[0], &table.channels[1]];
    for prefix in ["", "sigma_", "common_1_", "common_2_"] {
        let cell = |channel: &str| {
            cells[names.iter().position(|name| *name == format!("{prefix}{channel}")).expect("a column")]
        };
        assert_eq!(cell(first), "", "{prefix}{first}");
        assert_ne!(cell(second), "", "{prefix}{second}");
    }
    assert!(table.values[n + row].is_finite(), "the other channel has a value there");
    let again = written(&read_bytes(text.clone().into_bytes(), None), Format::Csv).0;
    assert_eq!(String::from_utf8(again).expect("text"), text);
}

#[test]
fn what_a_format_cannot_hold_is_refused_with_the_reason() {
    let refuse = |table: &Measurement, format| {
        let error = formats::write(table, format, Path::new("out.binary"), &mut Vec::new()).expect_err("refused");
        assert!(matches!(error, MeasurementError::Unsupported { .. }));
        error.to_string()
    };
    let mut listed = fixture("masked-values.csv");
    assert!(refuse(&listed, Format::Merl).contains("not 3 listed directions"));
    assert!(refuse(&listed, Format::Zemax).contains("Zemax BSDF text is read, not written"));
    listed.channels[1] = "weight".into();
    assert!(refuse(&listed, Format::Csv).contains("can't be called \"weight\""));
    let mut grey = merl_table(MerlAngles::Center);
    grey.channels = vec!["650nm".into()];
    grey.values.truncate(MerlGrid::LEN);
    assert!(refuse(&grey, Format::Merl).contains("three channels, r, g, b; this table has 650nm"));
}

/// Number of rows with the light at `theta` degrees.
fn rows_at(table: &Measurement, theta: f64) -> usize {
    (0..table.len()).filter(|&i| (table.directions.pair(i).0.z - theta.to_radians().cos()).abs() < 1e-9).count()
}

#[test]
fn real_retro_reflective_tapes() {
    // Counted by an independent script. The yellow tape's values are BRDF·cosθo; the grey one's file does not say.
    if let Some(path) = real("measured/retro-3M-yellow.alta.dat") {
        let table = formats::read(&path, &ReadOptions::default()).expect("readable");
        assert_eq!([15.0, 30.0, 60.0].map(|t| rows_at(&table, t)), [2637, 2665, 2095]);
        assert_eq!((table.len(), table.masked.marked, table.masked.not_finite), (7397, 86, 0));
        assert!(table.notes[0].contains("86 of the values, the first at line 8, column 4"), "{:?}", table.notes);
        let largest = table.values.iter().copied().fold(0.0, f64::max);
        assert!((largest / 38.972_929_698_188_32 - 1.0).abs() < 1e-13, "{largest}");
    }
    if let Some(path) = real("measured/retro-gray-tape.alta.dat") {
        let table = formats::read(&path, &ReadOptions::default()).expect("readable");
        assert_eq!([15.0, 30.0, 60.0].map(|t| rows_at(&table, t)), [2645, 2665, 2095]);
        assert_eq!((table.len(), table.masked.total()), (7405, 0));
        assert!(table.notes[0].contains("read as BRDF"), "{:?}", table.notes);
        // Brightest where a retro-reflector is: straight back at θi = 15°.
        let peak = (0..table.len()).max_by(|&a, &b| table.values[a].total_cmp(&table.values[b])).expect("rows");
        let (wi, wo) = table.directions.pair(peak);
        assert!((wi - wo).length() < 1e-12 && (table.values[peak] - 72.456_805_929_919_14).abs() < 1e-12);
    }
}

#[test]
fn real_pink_felt_slice() {
    let Some(path) = real("measured/pink-felt-1d.alta") else { return };
    let table = formats::read(&path, &ReadOptions::default()).expect("readable");
    assert_eq!((table.len(), table.masked.total()), (90, 0));
    assert_eq!(table.channels, ["r", "g", "b"]);
    assert!((0..90).all(|i| table.directions.pair(i).0 == table.directions.pair(i).1));
    assert_eq!(table.value(2, 0), Some(0.061_623_286_455_869_7));
    assert!((table.directions.pair(89).0.z - 0.105_117_666_245_532).abs() < 1e-15);
}

/// The FRED file's value at `wo` in the block of `wi`, bilinear in (θ, φ) on its 5° × 10° grid; `None` where a corner is missing.
fn interpolate(fred: &Measurement, wi: DVec3, wo: DVec3) -> Option<f64> {
    let theta = wo.x.hypot(wo.y).atan2(wo.z).to_degrees() / 5.0;
    let phi = wo.y.atan2(wo.x).abs().to_degrees() / 10.0;
    let corner = |t: f64, p: f64| {
        let at = direction_deg(5.0 * t, 10.0 * p);
        let same = |&i: &usize| {
            let (a, b) = fred.directions.pair(i);
            (a - wi).length() < 1e-9 && (b - at).length() < 1e-9
        };
        (0..fred.len()).find(same).and_then(|i| fred.value(0, i))
    };
    let mut sum = 0.0;
    for (t, weight_t) in [(theta.floor(), 1.0 - theta.fract()), (theta.floor() + 1.0, theta.fract())] {
        for (p, weight_p) in [(phi.floor(), 1.0 - phi.fract()), (phi.floor() + 1.0, phi.fract())] {
            if weight_t * weight_p > 1e-9 {
                sum += weight_t * weight_p * corner(t, p)?;
            }
        }
    }
    Some(sum)
}

/// The two files of one sample.
fn lab_files() -> Option<(Measurement, Measurement)> {
    let read = |name| formats::read(&real(name)?, &ReadOptions::default()).map(Some).expect("readable");
    Some((read("lab/AnoBlackEC1onAlum.zemax.bsdf")?, read("lab/AnoBlackEC1onAlum.fred.txt")?))
}

#[test]
fn real_zemax_and_fred_files_of_one_sample_agree() {
    let Some((zemax, fred)) = lab_files() else { return };
    assert_eq!((zemax.len(), fred.len(), zemax.masked.marked, fred.masked.total()), (912, 1144, 193, 0));
    assert_eq!((zemax.channels[0].as_str(), fred.channels[0].as_str()), ("650nm", "value"));
    assert!(matches!((&zemax.weights, &fred.weights), (Weights::SolidAngle(_), Weights::SolidAngle(_))));

    // The instrument measured up to θo = 80°: a node holds a value if and only if it lies there.
    let limit = 80.0001f64.to_radians().cos();
    for i in 0..zemax.len() {
        assert_eq!(zemax.value(0, i).is_some(), zemax.directions.pair(i).1.z > limit, "node {i}");
    }

    // Both files at the same directions; and with the azimuth about the mirror direction reversed.
    let median = |reversed: bool| {
        let difference = |i: usize| {
            let (wi, wo) = zemax.directions.pair(i);
            let m = mirror(wi);
            let wo = if reversed { 2.0 * wo.dot(m) * m - wo } else { wo };
            Some((zemax.value(0, i)? / interpolate(&fred, wi, wo)?).ln().abs())
        };
        let mut all: Vec<f64> = (0..zemax.len()).filter_map(difference).collect();
        all.sort_by(f64::total_cmp);
        (all[all.len() / 2], all.len())
    };
    let ((right, n), (wrong, _)) = (median(false), median(true));
    println!("median |ln(Zemax/FRED)|: {right:.4} over {n} nodes; azimuth reversed {wrong:.4}");
    assert!(n >= 680 && right < 0.07 && wrong > 0.1, "{right} {wrong} {n}");
}

#[test]
fn real_zemax_scatter_is_half_the_integral_without_cosine() {
    let Some((zemax, _)) = lab_files() else { return };
    assert_eq!(zemax.stated_scatter, [(10.0, 0.038655), (30.0, 0.039136), (50.0, 0.047596), (70.0, 0.106539)]);
    let per_incidence = zemax.len() / 4;
    for (k, &(theta, tis)) in zemax.stated_scatter.iter().enumerate() {
        // The incidence's own cell, 20° wide, is part of the weights.
        let incidence = (theta - 10.0).to_radians().cos() - (theta + 10.0).to_radians().cos();
        let sum = |factor: &dyn Fn(DVec3) -> f64| -> f64 {
            let part = |i| {
                let wo = zemax.directions.pair(i).1;
                Some(zemax.value(0, i)? * factor(wo) * zemax.weights.get(i) / incidence)
            };
            (k * per_incidence..(k + 1) * per_incidence).filter_map(part).sum()
        };
        let (half, cosine) = (sum(&|_| 0.5), sum(&|wo| wo.z));
        println!("TIS at {theta}°: {tis}; ½ ∫ f dω {half:.5}, ∫ f cosθo dω {cosine:.5}");
        assert!((half / tis - 1.0).abs() < 0.05, "{half} at {theta}°");
        assert!((cosine / tis - 1.0).abs() > 0.05, "{cosine} at {theta}°");
    }
    assert!(
        zemax.notes.iter().any(|note| note.contains("TIS") && note.contains("0.106539 against")),
        "{:?}",
        zemax.notes
    );
}

/// Whether a fixture is a text format's: neither a generator nor a tensor file.
fn is_text(path: &Path) -> bool {
    let name = path.file_name().expect("name").to_string_lossy().into_owned();
    path.extension().is_none_or(|e| e != "py") && !name.starts_with("rgl-")
}

#[test]
fn crlf_and_byte_order_mark_change_nothing() {
    let mut files = 0;
    for entry in std::fs::read_dir(fixture_path("")).expect("folder") {
        let path = entry.expect("entry").path();
        if !is_text(&path) {
            continue;
        }
        let plain = std::fs::read_to_string(&path).expect("text").trim_start_matches('\u{feff}').replace("\r\n", "\n");
        let read =
            |text: String| formats::read_bytes(&path, text.into_bytes(), &ReadOptions::default()).expect("valid");
        let (unix, windows) = (read(plain.clone()), read(format!("\u{feff}{}", plain.replace('\n', "\r\n"))));
        assert!(same_bits(&unix.values, &windows.values) && unix.directions == windows.directions, "{}", unix.name);
        assert_eq!((unix.channels, unix.masked, unix.notes), (windows.channels, windows.masked, windows.notes));
        files += 1;
    }
    assert_eq!(files, 12);
}

#[test]
fn zemax_tristimulus_blocks_become_channels_and_full_azimuth_is_kept() {
    let block = |name: &str, k: f64| {
        let rows = [0.0, 1.0, 2.0, 3.0].map(|a| format!("{} {}", 10.0 * k, k + a)).join("\n");
        format!("{name}\nDataBegin\nTIS {k}\n{rows}\nDataEnd\n")
    };
    let text = format!(
        "Source Measured\nSymmetry ASymmetrical\nSpectralContent XYZ\nScatterType BRDF\nSampleRotation 1\n0\n\
         AngleOfIncidence 1\n20\nScatterAzimuth 4\n0 90\n180 270\nScatterRadial 2\n0 30\n\n{}{}{}",
        block("TristimulusX", 1.0),
        block("TristimulusY", 2.0),
        block("TristimulusZ", 3.0)
    );
    let table = read_bytes(text.into_bytes(), None);
    assert_eq!((table.channels.join(""), table.len()), ("xyz".to_string(), 8));
    assert_eq!(table.stated_scatter, [(20.0, 1.0)]);
    for (c, k) in [1.0, 2.0, 3.0].into_iter().enumerate() {
        assert_eq!([0, 1, 3, 7].map(|i| table.value(c, i)), [10.0 * k, k, k + 1.0, k + 3.0].map(Some));
    }
    // Azimuths 90° and 270° are mirror images in the plane of incidence; 0° and 180° lie in it.
    let wo = |i| table.directions.pair(i).1;
    assert!((wo(3).y + wo(7).y).abs() < 1e-15 && (wo(3).y.abs() - 0.5).abs() < 1e-15);
    assert!(wo(1).y.abs() < 1e-15 && (wo(1) - direction_deg(-10.0, 0.0)).length() < 1e-15);
    assert!((wo(5) - direction_deg(50.0, 0.0)).length() < 1e-15);
}
