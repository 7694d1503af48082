//! Broken input is refused with an error that names file, place, what was expected and what was found; nothing panics, and no
//! memory is taken because a file claims to be large.
#![allow(clippy::expect_used, clippy::panic)]

use std::io::Write;
use std::path::{Path, PathBuf};

use goniofit::measurement::formats::{self, Format};
use goniofit::measurement::{Measurement, MeasurementError, ReadOptions};
use goniofit::numeric::random::{Purpose, RngExt, stream};

/// A file of `data-fixtures/invalid`, and what its error must say of place, expected and found.
type Broken = (&'static str, [&'static str; 3]);

const CSV: [Broken; 39] = [
    ("csv-text-for-number.csv", ["line 3, column r", "expected a number", "found \"bright\""]),
    ("csv-text-for-angle.csv", ["line 2, column theta_o_deg", "expected a number", "found \"ten\""]),
    ("csv-extra-column.csv", ["line 3", "expected 5 cells", "found 6"]),
    ("csv-missing-cell.csv", ["line 3", "expected 5 cells", "found 4"]),
    ("csv-missing-angle-column.csv", ["line 1, header", "expected a column phi_i_deg", "found \"theta_i_deg,theta_o"]),
    ("csv-misspelt-angle-column.csv", ["line 1, header", "no others", "found \"theta_o\""]),
    ("csv-semicolons.csv", ["line 1, header", "separated by commas", "found \"theta_i_deg;phi_i_deg"]),
    ("csv-tabs.csv", ["line 1, header", "separated by commas, not tabs", "found \"theta_i_deg\\tphi_i_deg"]),
    ("csv-direction-not-finite.csv", ["line 2, column theta_o_deg", "expected a finite number", "found \"nan\""]),
    ("csv-negative-sigma.csv", ["line 2, column sigma_r", "expected a number ≥ 0", "found \"-0.01\""]),
    ("csv-row-without-sigma.csv", ["line 1, header", "expected sigma_… beside row_…", "found \"row_r\""]),
    ("csv-row-above-sigma.csv", ["line 2, column row_r", "so 0.01 at most", "found \"-0.02\""]),
    ("csv-sigma-of-unknown-channel.csv", ["line 1, header", "the name of a channel (r)", "found \"sigma_red\""]),
    (
        "csv-sigma-missing-for-valid-value.csv",
        ["line 3, column sigma_r", "expected a number, 1 σ of the value", "found \"\""],
    ),
    ("csv-sigma-for-one-channel-of-two.csv", ["line 1, header", "every channel (r, g) or for none", "sigma_r\""]),
    ("csv-common-without-number.csv", ["line 1, header", "expected common_<number>_<channel>", "found \"common_r\""]),
    ("csv-common-leading-zero.csv", ["line 1, header", "in plain digits (1, not 01 or +1)", "found \"common_01_r\""]),
    ("csv-common-plus-sign.csv", ["line 1, header", "in plain digits (1, not 01 or +1)", "found \"common_+1_r\""]),
    ("csv-common-for-one-channel-of-two.csv", ["line 1, header", "every channel (r, g) or for none", "common_2_g\""]),
    ("csv-theta-out-of-range.csv", ["line 3, column theta_o_deg", "from −180 to 180 degrees", "found 1000"]),
    ("csv-phi-out-of-range.csv", ["line 2, column phi_i_deg", "from −360 to 360 degrees", "found -400"]),
    ("csv-common-not-finite.csv", ["line 2, column common_1_r", "expected a finite number", "found \"inf\""]),
    ("csv-duplicate-column.csv", ["line 1, header", "expected each column once", "found \"r\" twice"]),
    ("csv-unnamed-column.csv", ["line 1, header", "expected a name for every column", "phi_o_deg,r,\""]),
    ("csv-no-channel.csv", ["line 1, header", "expected a column of values", "weight\""]),
    ("csv-no-rows.csv", ["after line 1", "expected a row of data", "found the end of the file"]),
    ("csv-only-comments.csv", ["the beginning", "expected a measurement in one of", "found nothing but comments"]),
    ("csv-unknown-quantity.csv", ["line 1, quantity", "expected brdf or brdf_cos", "found \"luminance\""]),
    ("csv-unknown-dimension.csv", ["line 1, dimension", "expected 2 or 3", "found \"4\""]),
    ("csv-flat-angle-out-of-range.csv", ["line 4, column theta_o_deg", "between −90 and 90", "found 95"]),
    ("csv-flat-with-azimuth.csv", ["line 2, header", "theta_i_deg, theta_o_deg and no others", "found \"phi_i_deg\""]),
    ("csv-grid-in-flat-world.csv", ["line 3", "expected a MERL grid in space", "found both"]),
    ("csv-grid-wrong-direction.csv", ["line 3", "expected the directions of entry 0", "found wi [0, 0, 1]"]),
    ("csv-grid-rows-missing.csv", ["after line 3", "expected 1458000 rows", "found the end of the file"]),
    ("csv-negative-weight.csv", ["line 2, column weight", "expected a number ≥ 0", "found \"-1\""]),
    (
        "csv-unknown-mask-reason.csv",
        ["line 3, column mask_reason", "expected saturated, unread, shadowed, unlit, or nothing", "found \"cloudy\""],
    ),
    (
        "csv-mask-reason-beside-a-value.csv",
        ["line 2, column mask_reason", "expected nothing, for every channel has a value", "found \"shadowed\""],
    ),
    ("csv-raw-readings.csv", ["line 1", "raw readings", "goniofit reduce"]),
    ("csv-not-utf8.csv", ["line 3", "expected text in UTF-8", "found other bytes"]),
];

const ALTA: [Broken; 17] = [
    ("alta-no-dim.alta", ["line 2", "expected #DIM", "found a row"]),
    ("alta-no-parameterisation.alta", ["line 2", "expected #PARAM_IN", "found a row"]),
    ("alta-dim-contradicts-parameterisation.alta", ["#DIM", "expected 1 coordinates for COS_TH", "found 2 1"]),
    ("alta-dim-not-a-number.alta", ["line 1, #DIM", "expected a whole number", "found \"three\""]),
    ("alta-dim-huge.alta", ["line 1, #DIM", "expected a whole number up to 64", "found \"4000000000\""]),
    ("alta-unknown-input.alta", ["line 2", "that is read (ISOTROPIC_TL_TV_PROJ_DPHI", "found \"STARK_2D\""]),
    ("alta-output-not-a-brdf.alta", ["line 4", "that is a BRDF", "found \"ENERGY\""]),
    ("alta-rgb-with-one-value.alta", ["line 4, #DIM", "expected 3 values a row", "found 1"]),
    ("alta-short-row.alta", ["line 5", "expected 4 numbers", "found 3"]),
    ("alta-text-for-number.alta", ["line 5, column 3", "expected a number", "found \"zero\""]),
    ("alta-direction-not-finite.alta", ["line 4, column 2", "expected a finite coordinate", "not finite"]),
    ("alta-in-degrees.alta", ["line 5, column 2", "expected an angle from −π to π radians", "found 15"]),
    ("alta-azimuth-out-of-range.alta", ["line 4, column 3", "an azimuth from −2π to 2π radians", "found 6.4"]),
    ("alta-projected-angle-out-of-range.alta", ["line 4, columns 2 and 3", "from −π to π radians", "found 3.535"]),
    ("alta-cosine-above-one.alta", ["line 3", "expected coordinates of a direction", "found [1.5]"]),
    ("alta-no-rows.alta", ["after line 3", "expected a row of data", "found the end of the file"]),
    ("alta-binary.alta", ["line 3", "only its text", "binary form is not read"]),
];

const ZEMAX: [Broken; 15] = [
    ("zemax-transmission.bsdf", ["line 4, ScatterType", "expected BRDF", "found a BTDF"]),
    ("zemax-unknown-symmetry.bsdf", ["line 2, Symmetry", "expected PlaneSymmetrical or", "found \"Round\""]),
    ("zemax-anisotropic.bsdf", ["line 6, SampleRotation", "expected one rotation", "found 2"]),
    ("zemax-short-row.bsdf", ["line 18", "expected the 3 values of incidence 30°, azimuth 180°", "found 2"]),
    ("zemax-extra-value.bsdf", ["line 17", "expected the 3 values of incidence 30°, azimuth 0°", "found 4"]),
    ("zemax-text-for-number.bsdf", ["line 18, column 2", "expected a number", "found \"high\""]),
    ("zemax-row-missing.bsdf", ["line 18", "expected the 3 values of incidence 30°", "found \"DataEnd\""]),
    ("zemax-cut-before-end.bsdf", ["after line 18", "expected DataEnd", "found the end of the file"]),
    ("zemax-no-tis.bsdf", ["line 16", "expected TIS and its value", "found \"0.3 0.2 0.1\""]),
    ("zemax-tis-not-finite.bsdf", ["line 16, TIS", "expected a finite number", "found \"nan\""]),
    ("zemax-angles-descend.bsdf", ["line 12, ScatterRadial", "expected ascending angles", "found 5 as number 3"]),
    ("zemax-angle-out-of-range.bsdf", ["line 12, ScatterRadial", "from 0 to 180 degrees", "found 190"]),
    ("zemax-count-too-small.bsdf", ["line 12, ScatterRadial", "expected 2 angles", "found 3"]),
    ("zemax-count-huge.bsdf", ["line 14", "expected 4000000000 angles of ScatterRadial", "found \"Monochrome\""]),
    ("zemax-count-not-a-number.bsdf", ["line 11, ScatterRadial", "expected how many angles", "found \"many\""]),
];

const OTHERS: [Broken; 17] = [
    ("fred-row-before-block.txt", ["line 3", "expected a block's two angles first", "found \"5 0 0.1\""]),
    ("fred-four-numbers.txt", ["line 5", "expected 2 numbers", "found 4"]),
    ("fred-text-for-number.txt", ["line 4, column 3", "expected a number", "found \"low\""]),
    ("fred-angle-not-finite.txt", ["line 4", "expected finite angles", "found \"inf 0 0.1\""]),
    ("fred-block-angle-out-of-range.txt", ["line 3, column 1", "from −180 to 180 degrees", "found -190"]),
    ("fred-theta-out-of-range.txt", ["line 5, column 1", "from −180 to 180 degrees", "found 185"]),
    ("fred-phi-out-of-range.txt", ["line 4, column 2", "from −360 to 360 degrees", "found 365"]),
    ("fred-no-rows.txt", ["after line 3", "expected a row of data", "found the end of the file"]),
    ("fred-direction-cosines.txt", ["line 2", "expected angles=deg", "found angles=sin"]),
    ("fred-logarithms.txt", ["line 2", "expected bsdf=value", "found bsdf=log"]),
    ("fred-scale-not-finite.txt", ["line 2, scale", "expected a finite number", "found \"nan\""]),
    ("fred-no-format-line.txt", ["line 2", "expected format angles=deg", "found \"10 0\""]),
    ("empty-file.csv", ["byte 0", "expected a measurement in one of", "found an empty file"]),
    ("json-no-measurement.csv", ["the beginning", "expected a measurement in one of", "found JSON"]),
    ("unknown-text.bsdf", ["the beginning", "expected a measurement in one of", "begins with \"Once upon a time\""]),
    ("unknown-binary.binary", ["the beginning", "expected a measurement in one of", "found unknown binary data"]),
    ("utf16.csv", ["the beginning", "expected a measurement in one of", "found UTF-16 text"]),
];

fn fixtures(folder: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data-fixtures").join(folder)
}

/// Peak of this process's address space (bytes), which counts allocations never touched too; `None` where the system does not
/// tell.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmPeak"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib * 1024)
}

/// Reads `path`, which must fail, and checks that this took less than 1 GiB: the heap of each thread that starts meanwhile
/// reserves 64 MiB, and another test may hold a table or two.
fn error_of(path: &Path, options: &ReadOptions) -> MeasurementError {
    let before = peak_memory();
    let result = formats::read(path, options);
    if let (Some(before), Some(after)) = (before, peak_memory()) {
        assert!(after - before < 1 << 30, "{}: {} bytes", path.display(), after - before);
    }
    result.expect_err("refused")
}

fn check(broken: &[Broken]) {
    for (name, facts) in broken {
        let error = error_of(&fixtures("invalid").join(name), &ReadOptions::default()).to_string();
        for fact in std::iter::once(name).chain(facts) {
            assert!(error.contains(fact), "{name}: {fact:?} is not in: {error}");
        }
    }
}

#[test]
fn broken_csv_text_for_numbers_extra_columns_and_others() {
    check(&CSV);
}

#[test]
fn broken_alta() {
    check(&ALTA);
}

#[test]
fn broken_zemax() {
    check(&ZEMAX);
}

#[test]
fn broken_fred_empty_file_and_what_is_no_measurement() {
    check(&OTHERS);
}

#[test]
fn every_broken_file_has_its_test() {
    let entries = std::fs::read_dir(fixtures("invalid")).expect("folder");
    let name = |e: std::io::Result<std::fs::DirEntry>| e.expect("entry").file_name().to_string_lossy().into_owned();
    // Tensor files and scenes have tests of their own: tests/rgl, tests/scene_files.rs.
    let here = |name: &String| name != "make.py" && name != "scenes" && !name.starts_with("rgl-");
    let mut names: Vec<String> = entries.map(name).filter(here).collect();
    names.sort();
    let all = CSV.iter().chain(&ALTA).chain(&ZEMAX).chain(&OTHERS);
    let mut tested: Vec<String> = all.map(|(name, _)| (*name).to_string()).collect();
    tested.sort();
    assert_eq!(names, tested);
}

#[test]
fn a_directory_and_a_missing_file_are_named() {
    let error = error_of(&fixtures("invalid"), &ReadOptions::default()).to_string();
    assert!(error.contains("invalid") && error.contains("expected a measurement file, found a directory"), "{error}");
    let error = error_of(&fixtures("nowhere.csv"), &ReadOptions::default());
    assert!(matches!(error, MeasurementError::Io { .. }) && error.to_string().contains("nowhere.csv"));
}

/// A file of `len` bytes in all that begins with `head`; the rest is zero and takes no room on the disk.
fn sparse_file(head: [u8; 12], len: u64) -> tempfile::NamedTempFile {
    let mut file = tempfile::NamedTempFile::new().expect("file");
    let shown = usize::try_from(len.min(12)).expect("small");
    file.write_all(&head[..shown]).expect("header");
    file.as_file().set_len(len).expect("length");
    file
}

fn header(dims: [i32; 3], encode: fn(i32) -> [u8; 4]) -> [u8; 12] {
    let bytes: Vec<u8> = dims.into_iter().flat_map(encode).collect();
    bytes.try_into().expect("12 bytes")
}

const DIMS: [i32; 3] = [90, 90, 180];
const MERL_BYTES: u64 = 34_992_012;

fn as_merl() -> ReadOptions {
    ReadOptions { format: Some(Format::Merl), ..ReadOptions::default() }
}

#[test]
fn a_merl_file_cut_at_every_length() {
    let plane = 8 * 90 * 90 * 180;
    let edges =
        (0..=3i64).flat_map(|k| [-8, -1, 0, 1, 8].map(|d| 12 + k * plane + d)).filter_map(|e| u64::try_from(e).ok());
    let mut rng = stream(23, Purpose::Study, 0);
    let random: Vec<u64> = (0..200).map(|_| rng.random::<u64>() % MERL_BYTES).collect();
    let lengths = (0..=64).chain(edges).chain(random).chain([MERL_BYTES + 1, 1 << 40]);
    for len in lengths.filter(|len| *len != MERL_BYTES) {
        let file = sparse_file(header(DIMS, i32::to_le_bytes), len);
        let error = error_of(file.path(), &as_merl());
        let MeasurementError::Length { found, expected, .. } = &error else { panic!("{len}: {error}") };
        assert_eq!((*found, *expected), (len, MERL_BYTES));
        let text = error.to_string();
        let name = file.path().display().to_string();
        assert!(text.contains(&name) && text.contains("34992012 bytes"), "{text}");
        assert!(text.contains(&format!("holds {len}")), "{text}");
        // From the fourth byte on the content tells the format by itself.
        if len >= 4 {
            assert!(matches!(error_of(file.path(), &ReadOptions::default()), MeasurementError::Length { .. }), "{len}");
        }
    }
    // The whole file, all zeros, is valid.
    let whole = sparse_file(header(DIMS, i32::to_le_bytes), MERL_BYTES);
    let table = formats::read(whole.path(), &ReadOptions::default()).expect("readable");
    assert_eq!((table.len(), table.masked.total()), (1_458_000, 0));
}

#[test]
fn wrong_and_huge_merl_dimensions() {
    for dims in [[90, 90, 360], [45, 45, 90], [i32::MAX; 3], [-90, 90, 180], [90, -1, 180], [0, 0, 0], [180, 90, 90]] {
        for len in [12, 1000, MERL_BYTES] {
            let file = sparse_file(header(dims, i32::to_le_bytes), len);
            let error = error_of(file.path(), &as_merl()).to_string();
            let [a, b, c] = dims;
            assert!(error.contains("bytes 0 to 11: expected the dimensions 90, 90, 180"), "{error}");
            assert!(error.contains(&format!("found {a}, {b}, {c}")), "{error}");
        }
    }
}

#[test]
fn a_big_endian_merl_file_is_recognised() {
    let file = sparse_file(header(DIMS, i32::to_be_bytes), MERL_BYTES);
    let error = error_of(file.path(), &ReadOptions::default()).to_string();
    assert!(error.contains("found the same in big-endian order"), "{error}");
}

/// Whether a fixture is a text format's: neither a generator nor a tensor file.
fn is_text(path: &Path) -> bool {
    let name = path.file_name().expect("name").to_string_lossy().into_owned();
    path.extension().is_none_or(|e| e != "py") && !name.starts_with("rgl-")
}

/// Name and content of the valid text fixtures.
fn text_fixtures() -> Vec<(String, Vec<u8>)> {
    let entries = std::fs::read_dir(fixtures("measurements")).expect("folder");
    let paths = entries.map(|e| e.expect("entry").path()).filter(|p| is_text(p));
    let read =
        |p: PathBuf| (p.file_name().expect("name").to_string_lossy().into_owned(), std::fs::read(&p).expect("bytes"));
    let mut all: Vec<_> = paths.map(read).collect();
    all.sort();
    assert_eq!(all.len(), 12);
    all
}

/// Whether lengths agree, directions are unit vectors, and exactly the masked values are not numbers.
fn well_formed(table: &Measurement) -> bool {
    let n = table.len();
    let unit = |i| {
        let (wi, wo) = table.directions.pair(i);
        (wi.length() - 1.0).abs() < 1e-12 && (wo.length() - 1.0).abs() < 1e-12
    };
    let masked = table.values.iter().filter(|v| v.is_nan()).count() as u64;
    table.values.len() == n * table.channels.len()
        && (0..n).all(unit)
        && !table.values.iter().any(|v| v.is_infinite())
        && masked == table.masked.total()
}

#[test]
fn a_text_file_cut_at_every_length() {
    for (name, bytes) in text_fixtures() {
        let read = |len: usize| formats::read_bytes(Path::new(&name), bytes[..len].to_vec(), &ReadOptions::default());
        let whole = read(bytes.len()).expect("valid").len();
        for len in 0..bytes.len() {
            match read(len) {
                Err(error) => {
                    let text = error.to_string();
                    let facts = ["expected", "found", name.as_str()].iter().all(|fact| text.contains(fact));
                    assert!(facts, "{name}, {len} bytes: {text}");
                }
                Ok(table) if name.contains("zemax") => {
                    // The format ends by a word of its own: only the last line end may be missing.
                    assert!(len + 1 == bytes.len() && table.len() == whole, "{name}, {len} bytes");
                }
                Ok(table) => {
                    assert!(well_formed(&table) && table.len() <= whole, "{name}, {len} bytes");
                    // Nothing in these formats counts the rows; a cut inside a line is told of.
                    let told = table.notes.iter().any(|note| note.contains("has no line end"));
                    assert_eq!(told, bytes[len - 1] != b'\n', "{name}, {len} bytes");
                }
            }
        }
    }
}

#[test]
fn damaged_bytes_never_panic() {
    let alphabet = b"0123456789.-+eE,;#\n\r \t\"nai\0\xff";
    let mut rng = stream(29, Purpose::Study, 0);
    let mut below = |n: usize| usize::try_from(rng.random::<u64>() % n as u64).expect("small");
    let (mut refused, mut read) = (0, 0);
    for (name, bytes) in text_fixtures() {
        for _ in 0..400 {
            let mut damaged = bytes.clone();
            for _ in 0..=below(4) {
                let (at, new) = (below(damaged.len()), alphabet[below(alphabet.len())]);
                match below(3) {
                    0 => damaged[at] = new,
                    1 => damaged.insert(at, new),
                    _ => drop(damaged.drain(at..(at + 9).min(damaged.len()))),
                }
            }
            match formats::read_bytes(Path::new(&name), damaged, &ReadOptions::default()) {
                Ok(table) => {
                    assert!(well_formed(&table), "{name}");
                    read += 1;
                }
                Err(_) => refused += 1,
            }
        }
    }
    println!("{refused} refused, {read} read");
    assert!(refused > 100 && read > 100);
}

#[test]
fn a_header_of_60_000_columns_takes_no_longer_than_its_length_calls_for() {
    let header = |last: &str| {
        let names = (0..30_000).flat_map(|i| [format!("c{i}"), format!("sigma_c{i}")]);
        let names: Vec<String> = names.chain([last.to_string()]).collect();
        format!("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,{}\n", names.join(","))
    };
    let error_of = |text: String| {
        let start = std::time::Instant::now();
        let read = formats::read_bytes(Path::new("wide.csv"), text.into_bytes(), &ReadOptions::default());
        // Milliseconds, with room for a busy machine; comparing every name with every other took seconds.
        assert!(start.elapsed().as_secs_f64() < 1.0, "{:?}", start.elapsed());
        read.expect_err("refused").to_string()
    };
    assert!(error_of(header("weight")).contains("expected a row of data"));
    assert!(error_of(header("c17")).contains("expected each column once, found \"c17\" twice"));
    assert!(error_of(header("common_1_c5")).contains("c8, c9, …) or for none"));
}

#[test]
fn a_line_without_end_is_not_taken_into_memory() {
    let file = sparse_file(*b"theta_i_deg,", 2 << 30);
    let options = ReadOptions { format: Some(Format::Csv), ..ReadOptions::default() };
    let error = error_of(file.path(), &options).to_string();
    assert!(error.contains("line 1: expected a line of at most 1048576 bytes"), "{error}");
}
