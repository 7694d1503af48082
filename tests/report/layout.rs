//! Nothing sticks out of a phone or a desk's screen.

use serde_json::Value;

use crate::browser::{Page, page_or_skip};
use crate::run::Run;

/// Elements that reach beyond the window and do not lie in something that scrolls or is hidden on purpose.
const OUTSIDE: &str = "(() => {
  const width = document.documentElement.clientWidth;
  const scrolls = (e) => e.closest('.scroll, pre, .off-screen, .skip, [hidden]');
  return [...document.querySelectorAll('body *')]
    .filter((e) => !scrolls(e))
    .map((e) => [e, e.getBoundingClientRect()])
    .filter(([, box]) => box.width > 0 && (box.right > width + 1 || box.left < -1))
    .map(([e, box]) => `${e.tagName}.${e.getAttribute('class')} ${box.left} to ${box.right} of ${width}`);
})()";

/// Nothing on the page reaches beyond the window.
pub fn fits(page: &mut Page, what: &str) {
    let beyond = page.eval("document.scrollingElement.scrollWidth - document.documentElement.clientWidth");
    assert_eq!(beyond, 0, "{what}: wider than the window");
    assert_eq!(page.eval(OUTSIDE), Value::Array(vec![]), "{what}");
}

#[test]
fn nothing_overflows_at_any_width() {
    let Some(mut page) = page_or_skip("nothing_overflows_at_any_width") else { return };
    for width in [380, 760, 1024, 1400] {
        page.window(width, 900, "light");
        page.load(&Run::shared().page());
        page.wait_for("document.querySelector('#viewer').dataset.ready === 'true'");
        for view in ["slider", "side", "difference"] {
            page.eval(&format!("document.querySelector('[name=view][value={view}]').click()"));
            fits(&mut page, &format!("{view} at {width} px"));
        }
    }
}

#[test]
fn text_is_large_enough_to_read_on_a_phone() {
    let Some(mut page) = page_or_skip("text_is_large_enough_to_read_on_a_phone") else { return };
    page.window(380, 800, "light");
    page.load(&Run::shared().page());
    let small = page.eval(
        "[...document.querySelectorAll('#lobe-frames [data-channel]:not([hidden]) text, p, td, th, dd')]
          .filter((e) => e.getClientRects().length && e.textContent.trim())
          .map((e) => {
            const svg = e.closest('svg');
            const scale = svg ? svg.getBoundingClientRect().width / svg.viewBox.baseVal.width : 1;
            return [parseFloat(getComputedStyle(e).fontSize) * scale, e.textContent.trim().slice(0, 40)];
          })
          .filter(([size]) => size < 9)",
    );
    assert_eq!(small, Value::Array(vec![]), "text below 9 px");
}
