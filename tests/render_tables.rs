//! Rendering a measured table converges as fast as rendering its fit. `cargo bench --bench table_convergence` does it for all tables.
#![allow(clippy::expect_used)] // these are tests

mod convergence_support;
mod encoded_tables;

use convergence_support::{noise, pair};
use encoded_tables::encoded;

#[test]
fn a_measured_table_converges_as_fast_as_its_fit_within_a_factor_of_2() {
    for name in ["chrome", "steel", "red-plastic", "alumina-oxide"] {
        let Some(table) = encoded(name) else { return };
        let both = pair(&table);
        for scene in ["sphere-on-plane", "mesh-env"] {
            let [of_table, of_fit] = [&both.table, &both.fit].map(|m| noise(scene, m, 32, 256));
            println!("{name:14} n {:8.1} {scene:16} {of_table:?} vs {of_fit:?}", both.exponent);
            // The noise is measured itself: in 1000 pixels of 256 samples to about 5 %.
            assert!(of_table.of_samples <= 2.1 * of_fit.of_samples, "{name}, {scene}: {of_table:?} vs {of_fit:?}");
        }
    }
}
