//! Checks as accessibility checkers make them (the rules that apply to such a page, after WCAG 2.2 AA and axe-core's names).

use serde_json::Value;

use crate::browser::{Page, page_or_skip};
use crate::run::Run;

/// Every violation as a line.
const STRUCTURE: &str = r#"(() => {
  const wrong = [];
  const all = (s) => [...document.querySelectorAll(s)];
  const name = (e) =>
    (e.getAttribute("aria-label") || (e.labels && [...e.labels].map((l) => l.textContent).join(" ")) || e.textContent || "").trim();
  if (!document.documentElement.lang) wrong.push("html-has-lang");
  if (!document.title.trim()) wrong.push("document-title");
  if (all("main").length !== 1) wrong.push("landmark-one-main");
  if (all("h1").length !== 1) wrong.push("page-has-heading-one");
  let level = 0;
  for (const h of all("h1,h2,h3,h4")) {
    const own = +h.tagName[1];
    if (own > level + 1) wrong.push(`heading-order: ${h.textContent}`);
    level = own;
    if (!h.textContent.trim()) wrong.push("empty-heading");
  }
  for (const e of all("img")) if (!e.alt || !e.alt.trim()) wrong.push("image-alt");
  for (const e of all("svg")) if (e.getAttribute("role") !== "img" || !name(e)) wrong.push(`svg-img-alt: ${e.outerHTML.slice(0, 80)}`);
  for (const e of all("svg"))
    if (e.querySelector("title")?.textContent !== e.getAttribute("aria-label")) wrong.push(`svg with two names: ${e.outerHTML.slice(0, 80)}`);
  for (const e of all("canvas")) if (e.getAttribute("role") !== "img" || !name(e)) wrong.push("canvas without a name");
  for (const e of all("input,button,a")) if (!name(e)) wrong.push(`label: ${e.outerHTML.slice(0, 80)}`);
  for (const e of all("fieldset")) if (!e.querySelector("legend")?.textContent.trim()) wrong.push("fieldset without a legend");
  for (const e of all("table")) {
    if (!e.caption?.textContent.trim()) wrong.push("table without a caption");
    for (const th of e.querySelectorAll("th")) {
      if (!th.scope) wrong.push(`scope-attr-valid: ${th.textContent}`);
      if (!th.textContent.trim()) wrong.push("empty-table-header");
    }
  }
  for (const e of all("[role=region],[role=group]")) if (!name(e)) wrong.push("region without a name");
  for (const e of all(".scroll,pre")) if (e.tabIndex !== 0) wrong.push("scrollable-region-focusable");
  const ids = all("[id]").map((e) => e.id);
  for (const id of ids) if (ids.filter((other) => other === id).length > 1) wrong.push(`duplicate-id: ${id}`);
  for (const e of all("[aria-labelledby]"))
    if (!document.getElementById(e.getAttribute("aria-labelledby"))) wrong.push(`aria-valid-attr-value: ${e.id}`);
  for (const e of all("a[href^='#']")) if (!document.getElementById(e.hash.slice(1))) wrong.push(`skip-link: ${e.hash}`);
  for (const e of all("dl > *")) if (!["DIV", "DT", "DD"].includes(e.tagName)) wrong.push("definition-list");
  for (const e of all("[tabindex]")) if (e.tabIndex > 0) wrong.push("tabindex");
  if (/user-scalable=no|maximum-scale/.test(document.querySelector("meta[name=viewport]").content)) wrong.push("meta-viewport");
  return wrong;
})()"#;

/// Text whose contrast is too low: 4.5 to 1, or 3 to 1 where it is large.
const CONTRAST: &str = r#"(() => {
  const parse = (text) => {
    const [r, g, b, a = 1] = text.match(/[\d.]+/g).map(Number);
    return [r, g, b, a];
  };
  const over = ([r, g, b, a], [R, G, B]) => [r * a + R * (1 - a), g * a + G * (1 - a), b * a + B * (1 - a), 1];
  const background = (element) => {
    const layers = [];
    for (let e = element; e; e = e.parentElement) layers.push(parse(getComputedStyle(e).backgroundColor));
    return layers.reverse().reduce((below, layer) => over(layer, below), [255, 255, 255, 1]);
  };
  const luminance = (color) => {
    const [r, g, b] = color.map((v) => ((v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const wrong = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const e = walker.currentNode.parentElement;
    const skip = "script,style,title,desc,.off-screen,.skip,.halo";
    if (!walker.currentNode.textContent.trim() || e.closest(skip) || !e.getClientRects().length) continue;
    const style = getComputedStyle(e);
    const below = background(e.closest("svg") ? e.closest("svg").parentElement : e);
    const ink = over(parse(e.closest("svg") ? style.fill : style.color), below);
    const [a, b] = [luminance(ink), luminance(below)];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    const size = parseFloat(style.fontSize);
    const large = size >= 24 || (size >= 18.66 && +style.fontWeight >= 700);
    if (ratio < (large ? 3 : 4.5)) wrong.push(`${ratio.toFixed(2)}: ${e.tagName}.${e.getAttribute("class")} ${e.textContent.trim().slice(0, 40)}`);
  }
  return [...new Set(wrong)];
})()"#;

/// Lines of plots that stand for data: 3 to 1 against what is below (WCAG 1.4.11).
const LINES: &str = r#"(() => {
  const luminance = (text) => {
    const [r, g, b] = text.match(/[\d.]+/g).slice(0, 3).map((v) => ((v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const below = luminance(getComputedStyle(document.body).backgroundColor);
  const found = [...document.querySelectorAll(".plot .line, .plot .ref")].map((e) => getComputedStyle(e).stroke);
  const ratio = (a) => (Math.max(a, below) + 0.05) / (Math.min(a, below) + 0.05);
  return [...new Set(found)].filter((stroke) => ratio(luminance(stroke)) < 3);
})()"#;

#[test]
fn the_page_passes_the_checks_of_accessibility() {
    let Some(mut page) = page_or_skip("the_page_passes_the_checks_of_accessibility") else { return };
    for scheme in ["light", "dark"] {
        page.window(1400, 900, scheme);
        page.load(&Run::shared().page());
        page.wait_for("document.querySelector('#viewer').dataset.ready === 'true'");
        let is_dark = page.eval("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)";
        assert_eq!(is_dark, scheme == "dark", "the page follows the scheme");
        passes(&mut page, scheme);
    }
}

/// The page passes all checks, with everything unfolded.
pub fn passes(page: &mut Page, of: &str) {
    page.eval("document.querySelectorAll('details').forEach((d) => (d.open = true))");
    for (what, check) in [("structure", STRUCTURE), ("contrast", CONTRAST), ("lines", LINES)] {
        assert_eq!(page.eval(check), Value::Array(vec![]), "{what}, {of}");
    }
}

#[test]
fn the_checks_find_what_is_wrong() {
    let Some(mut page) = page_or_skip("the_checks_find_what_is_wrong") else { return };
    page.window(1400, 900, "light");
    page.load(&Run::shared().page());
    page.eval(
        "document.body.insertAdjacentHTML('beforeend', \
         '<h4></h4><img src=\"data:,\"><input><table><tr><th></th></tr></table><p id=title style=\"color:#999\">pale</p>')",
    );
    let found = page.eval(STRUCTURE).to_string();
    for rule in ["empty-heading", "image-alt", "label", "caption", "scope-attr-valid", "duplicate-id: title"] {
        assert!(found.contains(rule), "{rule}: {found}");
    }
    assert!(page.eval(CONTRAST).to_string().contains("pale"));
}

#[test]
fn all_controls_are_reached_and_worked_by_keyboard() {
    let Some(mut page) = page_or_skip("all_controls_are_reached_and_worked_by_keyboard") else { return };
    page.window(1400, 900, "light");
    page.load(&Run::shared().page());
    page.wait_for("document.querySelector('#viewer').dataset.ready === 'true'");
    let mut reached = Vec::new();
    for _ in 0..80 {
        page.call(
            "Input.dispatchKeyEvent",
            serde_json::json!({ "type": "keyDown", "key": "Tab", "code": "Tab", "windowsVirtualKeyCode": 9 }),
        );
        page.call(
            "Input.dispatchKeyEvent",
            serde_json::json!({ "type": "keyUp", "key": "Tab", "code": "Tab", "windowsVirtualKeyCode": 9 }),
        );
        let at = page.eval("(() => { const e = document.activeElement; return e.name || e.id || e.tagName; })()");
        reached.push(at.as_str().unwrap_or_default().to_owned());
    }
    for control in [
        "theme",
        "incidence",
        "channel",
        "scale",
        "lobe-frames",
        "statistic",
        "picture",
        "view",
        "exposure",
        "stage",
        "split",
    ] {
        assert!(reached.iter().any(|r| r == control), "{control} is not reached: {reached:?}");
    }
}
