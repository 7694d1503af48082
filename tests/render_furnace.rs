//! Hard case: in a white furnace every model and table shows its directional albedo, found independently, up to 89.9° from the normal.
//! `cargo bench --bench furnace` does the same with as many samples as 0.1 % takes.
#![allow(clippy::expect_used, clippy::float_cmp)] // these are tests

mod furnace_support;
mod table_support;

use std::sync::Arc;

use furnace_support::{Case, THETAS_DEG, models, rendered};
use glam::DVec3;
use goniofit::brdf::{Brdf, Reflectance};
use goniofit::geometry::angles::direction_deg;
use goniofit::geometry::mirror;
use goniofit::numeric::stats::{normal_quantile, sidak};
use goniofit::render::Material;
use table_support::{TENS, grey, lobe, merl_of, scan, scan_without_retro, table};

const SAMPLES: u32 = 1 << 17;

/// Renders all cases at all angles; every channel is tested at 1 % for all tests together.
fn check(cases: &[Case]) {
    let z = normal_quantile(1.0 - 0.5 * sidak(0.01, 6 * cases.len() * THETAS_DEG.len()));
    for case in cases {
        for theta in THETAS_DEG {
            let (want, error) = case.albedo(theta);
            for material in std::iter::once(case.material.clone()).chain(case.opaque()) {
                let (got, noise) = rendered(&material, theta, SAMPLES, 7, false);
                // What rounding leaves of a sum without noise.
                let bound = z * noise + error + 1e-12 * want;
                let off = (got - want).abs();
                assert!(off.cmple(bound).all(), "{}, θ {theta}°: {got} ± {noise} vs {want} ± {error}", case.name);
                println!("{:18} θ {theta:4}°: {:.6} vs {:.6}, σ {:.1e}", case.name, got.x, want.x, noise.x);
            }
        }
    }
}

#[test]
fn hard_case_models_in_a_white_furnace_show_their_albedo() {
    check(&models());
}

/// Lobes alone under an even sky need no samples.
#[test]
fn hard_case_lobes_in_a_white_furnace_have_a_closed_form() {
    for case in models() {
        for theta in THETAS_DEG {
            let ((want, error), (got, noise)) = (case.albedo(theta), rendered(&case.material, theta, 128, 7, true));
            let closed = noise.max_element() < 1e-7;
            assert!(closed || !case.name.starts_with("phong 1"), "{}: {noise}", case.name);
            if closed {
                let near = (got - want).abs().cmple(2e-6 * want + error).all();
                assert!(near, "{}, θ {theta}°: {got} vs {want} ± {error}", case.name);
            }
        }
    }
}

#[test]
fn hard_case_tables_in_a_white_furnace_show_their_albedo() {
    let gloss = |i: DVec3, o: DVec3| 0.1 + 3.0 * (-(o - mirror(i)).length_squared() / 0.02).exp();
    let retro = |i: DVec3, o: DVec3| 0.05 + 9.0 * (-(o - i).truncate().length_squared() / 0.03).exp();
    let tables = [
        ("matte MERL", table(&merl_of(|_| 0.25))),
        ("near-mirror MERL", table(&merl_of(lobe(0.02, 0.0)))),
        ("retro MERL", table(&merl_of(lobe(0.3, 20.0)))),
        ("glossy scan", table(&scan(&TENS, gloss))),
        ("retro scan", table(&scan(&[15.0, 30.0, 60.0], retro))),
    ];
    check(&tables.map(|(name, brdf)| Case::brdf(name, Arc::new(brdf))));
}

/// What nobody measured reflects nothing, in the picture and in the albedo alike.
#[test]
fn hard_case_a_table_without_its_retro_zone_in_a_white_furnace_shows_the_albedo_of_what_was_measured() {
    let gloss = |i: DVec3, o: DVec3| 0.1 + 3.0 * (-(o - mirror(i)).length_squared() / 0.02).exp();
    let brdf = table(&scan_without_retro(17.0, gloss));
    for theta in THETAS_DEG {
        let eye = direction_deg(theta, 0.0);
        let covered = brdf.directional_albedo(eye).covered;
        println!("θ {theta:4}°: {:.2} % of the light comes from where nothing is known", 100.0 * (1.0 - covered));
        // Far from the normal the zone is half below the horizon, and the rest of it counts with a small cosine.
        assert!(grey(&brdf, eye, eye).is_none() && (0.8..0.999).contains(&covered), "θ {theta}°: {covered}");
    }
    check(&[Case::brdf("scan, no retro", Arc::new(brdf))]);
}

#[test]
fn an_albedo_wrong_by_three_percent_would_be_found() {
    let wrong = Material::Brdf(
        Arc::new(Reflectance::lobes(vec![0.0; 3], [(vec![1.03, 0.515, 0.2575], 30.0)])) as Arc<dyn Brdf>
    );
    let case = models().into_iter().find(|case| case.name == "phong 3e1").expect("a case");
    let z = normal_quantile(1.0 - 0.5 * sidak(0.01, 1000));
    for theta in THETAS_DEG {
        let ((want, error), (got, noise)) = (case.albedo(theta), rendered(&wrong, theta, SAMPLES, 7, false));
        assert!((got - want).abs().cmpgt(z * noise + error).any(), "θ {theta}°: {got} ± {noise} vs {want}");
    }
}
