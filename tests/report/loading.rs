//! What loading takes: no network, no errors, little time; and what is left without scripts and on paper.

use std::path::Path;

use serde_json::json;

use crate::browser::{Page, page_or_skip};
use crate::run::Run;

#[test]
fn the_demos_page_is_small_loads_nothing_and_paints_at_once() {
    let Some(mut page) = page_or_skip("the_demos_page_is_small_loads_nothing_and_paints_at_once") else { return };
    let run = Run::shared();
    let bytes = std::fs::metadata(run.page()).expect("is there").len();
    assert!(bytes <= 5_000_000, "{bytes} bytes");
    page.window(1400, 900, "light");
    page.load(&run.page());
    page.wait_for("document.querySelector('#viewer').dataset.ready === 'true'");

    loaded_itself_alone(&mut page, &run.page());
    // Other work on the computer can hold up a load, but not five.
    let mut times = vec![first_paint(&mut page)];
    while times.iter().all(|t| *t >= MOST_MS) && times.len() < 5 {
        page.load(&run.page());
        times.push(first_paint(&mut page));
    }
    assert!(times.iter().any(|t| *t < MOST_MS), "first paint after {times:?} ms");
}

/// The page that was loaded asked for nothing else, and said nothing on the console.
pub fn loaded_itself_alone(page: &mut Page, file: &Path) {
    let asked: Vec<String> = page
        .events("Network.requestWillBeSent")
        .iter()
        .filter_map(|e| e["request"]["url"].as_str().map(str::to_owned))
        .filter(|url| !url.starts_with("data:"))
        .collect();
    assert_eq!(asked, [format!("file://{}", file.display())], "the page itself and nothing else");
    for method in ["Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded"] {
        let found = page.events(method);
        assert!(found.is_empty(), "{method}: {found:?}");
    }
}

/// Longest time to the first paint, ms.
const MOST_MS: f64 = 1000.0;

/// When the first text or picture was seen, ms after the load began; it is recorded some time after it is painted.
fn first_paint(page: &mut Page) -> f64 {
    let entries = "performance.getEntriesByName('first-contentful-paint')";
    page.wait_for(&format!("{entries}.length > 0"));
    page.eval(&format!("{entries}[0].startTime")).as_f64().expect("a time")
}

#[test]
fn without_scripts_pictures_and_lobes_are_there_and_controls_are_not() {
    let Some(mut page) = page_or_skip("without_scripts_pictures_and_lobes_are_there_and_controls_are_not") else {
        return;
    };
    page.window(1400, 900, "light");
    page.call("Emulation.setScriptExecutionDisabled", json!({ "value": true }));
    page.load(&Run::shared().page());
    let root = page.call("DOM.getDocument", json!({}))["root"]["nodeId"].clone();
    let mut is_shown = |selector: &str| {
        let found = page.call("DOM.querySelector", json!({ "nodeId": root, "selector": selector }));
        assert_ne!(found["nodeId"], 0, "{selector} is not in the page");
        // What is not laid out has no box.
        page.try_call("DOM.getBoxModel", json!({ "nodeId": found["nodeId"] })).is_ok()
    };
    for selector in
        [".shots img", "#lobe-frames [data-channel]:not([hidden]) svg .series path", "[data-statistic=rms] svg"]
    {
        assert!(is_shown(selector), "{selector}");
    }
    for selector in ["#lobe-controls", "#residual-controls", "#viewer", "#theme", "#lobe-readout"] {
        assert!(!is_shown(selector), "{selector} does nothing without scripts");
    }
}

#[test]
fn on_paper_still_pictures_take_the_place_of_controls() {
    let Some(mut page) = page_or_skip("on_paper_still_pictures_take_the_place_of_controls") else { return };
    page.window(1000, 900, "dark");
    page.load(&Run::shared().page());
    page.wait_for("document.querySelector('#viewer').dataset.ready === 'true'");
    page.call("Emulation.setEmulatedMedia", json!({ "media": "print" }));
    let shown = |selector: &str| format!("document.querySelector('{selector}').getClientRects().length > 0");
    for selector in [".shots", ".shots img", "#lobe-frames [data-channel]:not([hidden]) svg"] {
        assert_eq!(page.eval(&shown(selector)), true, "{selector}");
    }
    for selector in ["#viewer", "#lobe-controls", "nav", "#theme"] {
        assert_eq!(page.eval(&shown(selector)), false, "{selector}");
    }
    assert_eq!(page.eval("getComputedStyle(document.body).backgroundColor"), "rgb(255, 255, 255)", "paper is white");
    let pdf = page.call("Page.printToPDF", json!({ "printBackground": true }));
    assert!(pdf["data"].as_str().is_some_and(|d| d.len() > 100_000), "pages with pictures");
}
