//! Pages of other runs than the demo: a fit alone, one that determines little, a scan in one plane with a spectrum's channels, a validation, sweeps.

use std::path::{Path, PathBuf};

use crate::accessible::passes;
use crate::browser::page_or_skip;
use crate::layout::fits;
use crate::loading::loaded_itself_alone;
use crate::run::Run;

/// Three readings at two wavelengths: n is undetermined, and channels have names that are no colours.
const FEW: &str = "# channels: 450nm 650nm\ntheta_i,phi_i,theta_o,phi_o,450nm,650nm\n0,0,10,180,0.1,0.2\n30,0,30,180,0.3,0.4\n30,0,60,180,0.1,0.2\n";

/// Runs that each write a page, and the pages.
fn pages() -> Vec<PathBuf> {
    let run = Run::shared();
    let at = |name: &str| run.path(name);
    std::fs::write(at("few.csv"), FEW).expect("writes");
    let lines = [
        "simulate --material satin --instrument commercial --scan in-plane:10 --seed 3 --out plane.csv",
        "fit plane.csv --use-sigma --model auto --report --out plane.json",
        "fit few.csv --model lambert+phong --report --out few.json",
        "validate plane.csv plane.json --scene sphere --size 48 --samples 4 --report --out checked",
        "tradeoff fit plane.csv --parts 1,2,4,8 --trials 4 --out swept",
        "tradeoff simulate --material satin --instrument commercial --scan in-plane:15 --knobs readings,effects --average 1,4 --trials 2 --out swept",
        "report swept",
    ];
    for line in lines {
        run.json(&line.split_whitespace().collect::<Vec<_>>());
    }
    ["plane.html", "few.html", "checked/report.html", "swept/report.html"].map(at).to_vec()
}

#[test]
fn every_runs_page_loads_alone_fits_and_can_be_read() {
    let Some(mut page) = page_or_skip("every_runs_page_loads_alone_fits_and_can_be_read") else { return };
    for file in pages() {
        let name = |path: &Path| path.strip_prefix(Run::shared().path("")).expect("within").display().to_string();
        for (width, scheme) in [(1400, "light"), (380, "dark")] {
            let what = format!("{}, {width} px, {scheme}", name(&file));
            page.window(width, 900, scheme);
            page.load(&file);
            page.wait_for("document.readyState === 'complete'");
            loaded_itself_alone(&mut page, &file);
            fits(&mut page, &what);
            passes(&mut page, &what);
            fits(&mut page, &format!("{what}, unfolded"));
        }
    }
}
