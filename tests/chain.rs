//! The rooms joined: what is measured, fitted and rendered stays the same light.
#![allow(clippy::expect_used, clippy::panic)] // helpers of tests

use goniofit::brdf::{LobeKind, Material};
use goniofit::chain::{self, MATERIALS, Source, Stage};
use goniofit::control::Control;
use goniofit::fit::{FitOptions, fit};
use goniofit::geometry::direction;
use goniofit::gonio::{Instrument, Scan};
use goniofit::measurement::interpolate::TableBrdf;
use goniofit::measurement::{Format, MeasurementError, ReadOptions, formats};
use goniofit::render::Options;

/// Mean radiance and its standard error (channel 0) of the furnace's sphere seen at polar angle `theta`, by a camera whose single
/// pixel is a pinprick.
fn furnace(source: &Source, theta: f64, samples: u32) -> (f64, f64) {
    let mut stage = Stage::built_in("furnace").expect("built in");
    let pole = [0.0, 0.0, 1.0];
    stage.spec.camera.position = [3.0 * theta.sin(), 0.0, 1.0 + 3.0 * theta.cos()];
    stage.spec.camera.target = pole;
    stage.spec.camera.fov_deg = 1e-4;
    let subject = chain::render_material("subject", source, None).expect("renders");
    let options = Options { width: 1, height: 1, samples, seed: 3, ..Options::default() };
    let image = chain::picture(&stage, Some(subject), &options, Control::silent()).expect("a picture");
    (image.radiance[0][0], image.standard_error.expect("known")[0][0])
}

#[test]
fn in_a_white_furnace_every_material_shows_its_directional_albedo() {
    for built_in in &MATERIALS {
        let material = built_in.material();
        for theta in [0.0f64, 0.7, 1.2, 1.5] {
            let want = material.directional_albedo(theta).expect("of space")[0];
            let (got, error) = furnace(&Source::Fitted(Box::new(material.clone())), theta, 4000);
            assert!((got - want).abs() < 5.0 * error + 1e-6, "{} θ {theta}: {got} ± {error} vs {want}", built_in.name);
        }
    }
}

#[test]
fn in_a_white_furnace_a_table_shows_its_directional_albedo() {
    let truth = chain::load_material("glossy-paint").expect("built in");
    for scan in ["merl", "hemisphere:7.5"] {
        let table = chain::tabulate("paint", &truth, &scan.parse::<Scan>().expect("a scan"), Control::silent());
        let table = table.expect("of usual size");
        let brdf = TableBrdf::new(&table, &[0, 1, 2]).expect("interpolates");
        let source = Source::Measured(Box::new(table));
        for theta in [0.2f64, 0.8, 1.2] {
            let want = brdf.directional_albedo(direction(theta, 0.0)).per_channel[0];
            let (got, error) = furnace(&source, theta, 20_000);
            // The quadrature's own error on a triangulated list is about 0.2 %.
            assert!((got - want).abs() < 5.0 * error + 2e-3 * want, "{scan} θ {theta}: {got} ± {error} vs {want}");
        }
    }
}

#[test]
fn a_fit_sampled_onto_the_merl_grid_and_through_its_file_fits_to_itself() {
    let truth = chain::load_material("satin").expect("built in");
    let table = chain::tabulate("satin", &truth, &Scan::Merl, Control::silent()).expect("a table");
    let mut bytes = Vec::new();
    formats::write(&table, Format::Merl, "satin.binary".as_ref(), &mut bytes).expect("writes");
    let back = formats::read_bytes("satin.binary".as_ref(), bytes, &ReadOptions::default()).expect("reads");
    let fitted = fit(&back, &FitOptions::new("lambert+phong".parse().expect("a model"))).expect("a fit").material;
    for (got, want) in fitted.lobes.iter().zip(&truth.lobes) {
        for (a, b) in got.weight.iter().zip(&want.weight) {
            assert!((a / b - 1.0).abs() < 1e-9, "{a} vs {b}");
        }
    }
    assert!((fitted.lobes[1].shape_of(0).expect("a shape")[0] / 12.0 - 1.0).abs() < 1e-9);
}

#[test]
fn worlds_do_not_mix_and_the_message_says_what_to_do() {
    let flat =
        Source::Fitted(Box::new(Material::new(vec!["i".into()], vec![(LobeKind::Lambert2d, vec![0.5], vec![])])));
    let space = Source::Fitted(Box::new(chain::load_material("satin").expect("built in")));
    let hemisphere = Scan::Hemisphere { step_deg: 15.0 };
    let measure = |source: &Source, scan: &Scan| {
        chain::measure("m", source, &Instrument::noiseless(), scan, 0, Control::silent()).map(|_| ())
    };
    let error = measure(&flat, &hemisphere).expect_err("worlds differ").to_string();
    assert!(error.contains("flat"), "{error}");
    assert!(measure(&space, &Scan::Flat { step_deg: 5.0 }).is_err());
    assert!(measure(&flat, &Scan::Flat { step_deg: 5.0 }).is_ok());
    assert!(chain::render_material("flat", &flat, None).is_err());
    let in_plane = chain::tabulate(
        "satin",
        &chain::load_material("satin").expect("built in"),
        &Scan::InPlane { step_deg: 5.0 },
        Control::silent(),
    );
    let refused = TableBrdf::new(&in_plane.expect("a table"), &[0]);
    assert!(matches!(refused, Err(MeasurementError::Unsupported { .. })));
}
