//! Pages of other runs than the demo: a fit alone, one that determines little, a scan in one plane with a spectrum's channels, a validation, sweeps.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::accessible::passes;
use crate::browser::{Page, page_or_skip};
use crate::layout::fits;
use crate::loading::loaded_itself_alone;
use crate::run::Run;

/// Three readings at two wavelengths: n is undetermined, and channels have names that are no colours.
const FEW: &str = "# channels: 450nm 650nm\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,450nm,650nm\n0,0,10,180,0.1,0.2\n30,0,30,180,0.3,0.4\n30,0,60,180,0.1,0.2\n";

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
        "tradeoff fit plane.csv --parts 1,2,4,8 --trials 4 --out swept/fit",
        "tradeoff simulate --material satin --instrument commercial --scan in-plane:15 --knobs readings,effects --average 1,4 --trials 2 --out swept/simulate",
        "report swept",
        "report swept/fit",
    ];
    for line in lines {
        run.json(&line.split_whitespace().collect::<Vec<_>>());
    }
    ["plane.html", "few.html", "checked/report.html", "swept/report.html", "swept/fit/report.html"].map(at).to_vec()
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
        if file.parent().is_some_and(|folder| folder.ends_with("swept") || folder.ends_with("fit")) {
            is_of_sweeps(&mut page, &file);
        }
    }
}

/// The page has the folder's sweeps, each with its front, and none of the parts that others have.
fn is_of_sweeps(page: &mut Page, file: &Path) {
    let folder = file.parent().expect("a folder");
    let own = folder.join("tradeoff.json");
    let files = if own.is_file() {
        vec![own]
    } else {
        ["fit", "simulate"].map(|f| folder.join(f).join("tradeoff.json")).to_vec()
    };
    let sweeps: Vec<Value> =
        files.iter().map(|f| serde_json::from_slice(&std::fs::read(f).expect("reads")).expect("JSON")).collect();
    let title = text(page, "h1");
    let name = if let [only] = &sweeps[..] { only["subject"].as_str().expect("a name") } else { "swept" };
    assert_eq!(title, format!("{name}: accuracy for time"));
    let parts =
        page.eval("[...document.querySelectorAll('section')].map((s) => s.getAttribute('aria-labelledby')).join(' ')");
    assert_eq!(parts, "title time reproduce");
    for sweep in &sweeps {
        let [stage, subject] = ["stage", "subject"].map(|key| sweep[key].as_str().expect("a name"));
        let rows = format!(
            "document.querySelectorAll('[aria-label=\"Best settings of {stage}: {subject}\"] tbody tr').length"
        );
        let points =
            sweep["curves"].as_array().expect("curves").iter().flat_map(|c| c["points"].as_array().expect("points"));
        let best = points.filter(|p| p["standing"] == "front" || p["standing"] == "undecided").count();
        assert!(best > 0);
        assert_eq!(page.eval(&rows), best, "{stage}");
        let words: Vec<&str> =
            sweep["run"]["command"].as_array().expect("words").iter().filter_map(Value::as_str).collect();
        assert!(text(page, "#time ~ .caption").contains("Measured by goniofit"), "{stage}");
        assert!(text(page, "body").contains(&words.join(" ")), "{words:?}");
    }
}

fn text(page: &mut Page, selector: &str) -> String {
    page.eval(&format!("document.querySelector('{selector}').textContent")).as_str().expect("text").to_owned()
}
