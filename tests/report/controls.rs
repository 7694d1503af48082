//! The controls do what they say: what the page shows is what the run's files hold.

use goniofit::image::{ColorMap, Image, develop, read_exr};
use serde_json::Value;

use crate::browser::{Page, page_or_skip};
use crate::run::{Run, numbers_in};

fn open(page: &mut Page) {
    page.window(1400, 1000, "light");
    page.load(&Run::shared().page());
    page.wait_for("document.querySelector('#viewer').dataset.ready === 'true'");
}

fn click(page: &mut Page, name: &str, value: &str) {
    page.eval(&format!("document.querySelector('[name=\"{name}\"][value=\"{value}\"]').click()"));
}

fn text(page: &mut Page, selector: &str) -> String {
    page.eval(&format!("document.querySelector('{selector}').textContent")).as_str().expect("text").to_owned()
}

fn close(found: f64, want: f64, tolerance: f64, what: &str) {
    assert!((found - want).abs() <= tolerance * want.abs() + 1e-9, "{what}: {found} vs {want}");
}

/// The value of a curve of `plot slice --json` at an angle.
fn value_at(curve: &Value, theta: f64) -> f64 {
    let angles: Vec<f64> = curve["theta_o_deg"].as_array().unwrap().iter().map(|t| t.as_f64().unwrap()).collect();
    let k = angles.iter().position(|t| (t - theta).abs() < 1e-6).expect("an angle of the curve");
    curve["value"][k].as_f64().unwrap()
}

#[test]
fn lobes_show_the_readings_and_fits_of_the_incidence_that_is_chosen() {
    let Some(mut page) = page_or_skip("lobes_show_the_readings_and_fits_of_the_incidence_that_is_chosen") else {
        return;
    };
    open(&mut page);
    let run = Run::shared();
    let incidences = page.eval("JSON.parse(document.querySelector('#data').textContent).lobes.incidences");
    for (k, channel) in [(0, "r"), (3, "g"), (5, "b")] {
        let theta = incidences[k].as_f64().unwrap();
        let plotted = run.json(&[
            "plot",
            "slice",
            "demo/measurement.csv",
            "demo/lambert.json",
            "demo/lambert+phong.json",
            "--incidence",
            &theta.to_string(),
            "--channel",
            channel,
            "--out",
            "slice.svg",
        ]);
        let curves = &plotted["slices"][0]["curves"];
        click(&mut page, "incidence", &k.to_string());
        click(&mut page, "channel", &["r", "g", "b"].iter().position(|c| *c == channel).unwrap().to_string());
        assert_told(&mut page, &format!("θi = {}°, channel {channel}", theta.round()), curves);
        page.eval("document.querySelector('#lobe-frames').focus()");
        // The first key goes to the mirror direction or stays where it was; then to and fro.
        for key in ["ArrowRight", "ArrowRight", "ArrowLeft", "ArrowLeft"] {
            page.press(key);
            let said = text(&mut page, "#lobe-readout");
            let found = numbers_in(&said);
            let at = found[0];
            for (i, name) in [(1, "readings"), (4, "lambert"), (5, "lambert+phong")] {
                let curve = curves.as_array().unwrap().iter().find(|c| c["name"] == name).expect(name);
                close(found[i], value_at(curve, at), 1e-3, &format!("{name}, θi {theta}, {channel}: {said}"));
            }
        }
    }
}

/// Slice and polar chart tell those who can't see them what they show now: which each is, of what, and the peaks of its curves.
fn assert_told(page: &mut Page, of: &str, curves: &Value) {
    let told = page.eval(
        "(() => {
          const frame = [...document.querySelectorAll('#lobe-frames [data-channel]')].find((f) => !f.hidden);
          const read = (svg) => [svg.getAttribute('aria-label'), ...['title', 'desc'].map((e) => svg.querySelector(e).textContent)];
          return [...frame.querySelectorAll('svg')].map(read);
        })()",
    );
    assert_eq!(told.as_array().unwrap().len(), 2, "{told}");
    for (figure, kind) in told.as_array().unwrap().iter().zip(["BRDF over θo", "Polar chart"]) {
        let name = format!("{kind}, {of}");
        assert_eq!((&figure[0], &figure[1]), (&Value::from(&*name), &Value::from(&*name)));
        for curve in curves.as_array().unwrap() {
            let values = curve["value"].as_array().unwrap().iter().filter_map(Value::as_f64);
            let largest = format!("{}: largest ", curve["name"].as_str().unwrap());
            let said =
                figure[2].as_str().unwrap().split(&largest).nth(1).unwrap_or_else(|| panic!("{largest}{figure}"));
            close(numbers_in(said)[0], values.fold(0.0, f64::max), 1e-3, &format!("{name}: {said}"));
        }
    }
}

#[test]
fn curves_stand_where_their_values_are_on_both_scales() {
    let Some(mut page) = page_or_skip("curves_stand_where_their_values_are_on_both_scales") else { return };
    open(&mut page);
    click(&mut page, "incidence", "0");
    click(&mut page, "channel", "1");
    for scale in ["linear", "log"] {
        click(&mut page, "scale", scale);
        let shown = page.eval(
            "(() => {
              const frame = [...document.querySelectorAll('#lobe-frames [data-channel]')].find((f) => !f.hidden);
              const svg = frame.querySelector('svg[data-area]');
              const peak = [...svg.querySelectorAll('.series .s2')][0].getAttribute('d');
              const top = Math.min(...peak.match(/[ML][^ML]+/g).map((p) => +p.slice(1).split(' ')[1]));
              return { log: frame.dataset.log, y: svg.dataset.y, area: svg.dataset.area, top };
            })()",
        );
        assert_eq!(shown["log"], if scale == "log" { "true" } else { "false" });
        let numbers = |key: &str| -> Vec<f64> {
            shown[key].as_str().unwrap().split(' ').filter_map(|w| w.parse().ok()).collect()
        };
        let (area, y) = (numbers("area"), numbers("y"));
        // The best fit's peak at normal incidence, from numbers.json.
        let lobes = Run::shared().numbers()["fits"][1]["material"]["lobes"].clone();
        let (kd, ks) = (lobes[0]["weight"][1].as_f64().unwrap(), lobes[1]["weight"][1].as_f64().unwrap());
        let n = lobes[1]["shape"]["exponent"].as_f64().unwrap();
        let peak = kd / std::f64::consts::PI + ks * (n + 2.0) / std::f64::consts::TAU;
        let of = |v: f64| if scale == "log" { v.log10() } else { v };
        let place = (of(peak) - of(y[0])) / (of(y[1]) - of(y[0]));
        let want = area[1] + area[3] * (1.0 - place);
        let found = shown["top"].as_f64().unwrap();
        assert!((found - want).abs() < 0.5, "{scale}: the peak stands at {found}, not at {want}");
    }
}

#[test]
fn residual_maps_tell_the_cells_that_the_plot_command_tells() {
    let Some(mut page) = page_or_skip("residual_maps_tell_the_cells_that_the_plot_command_tells") else { return };
    open(&mut page);
    let plotted =
        Run::shared().json(&["plot", "residuals", "demo/measurement.csv", "demo/lambert.json", "--out", "r.svg"]);
    let map = &plotted["maps"][1];
    click(&mut page, "statistic", "rms");
    assert_eq!(page.eval("[...document.querySelectorAll('[data-statistic]')].filter((f) => !f.hidden).every((f) => f.dataset.statistic === 'rms')"), true);
    click(&mut page, "statistic", "mean");
    let svg = "document.querySelector('[data-fit=\"0\"] [data-over=pair][data-statistic=mean] svg')";
    page.eval(&format!("{svg}.scrollIntoView({{ block: 'center', behavior: 'instant' }})"));
    let list = |v: &Value| v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect::<Vec<f64>>();
    let (x, y) = (list(&map["columns_deg"]), list(&map["rows_deg"]));
    for (theta_i, theta_o) in [(30.0, 30.0), (60.0, 60.0), (45.0, -20.0)] {
        let at = page.eval(&format!(
            "(() => {{
              const svg = {svg};
              const [left, top, width, height] = svg.dataset.area.split(' ').map(Number);
              const point = new DOMPoint(left + {theta_i} / 90 * width, top + height - ({theta_o} + 90) / 180 * height);
              const p = point.matrixTransform(svg.getScreenCTM());
              return [p.x, p.y];
            }})()"
        ));
        page.point_at(at[0].as_f64().unwrap(), at[1].as_f64().unwrap());
        let said = text(&mut page, "#residual-readout");
        let cell = |borders: &[f64], v: f64| borders.partition_point(|b| *b <= v) - 1;
        let k = cell(&y, theta_o) * (x.len() - 1) + cell(&x, theta_i);
        let mean = said.split("mean ").nth(1).unwrap_or_else(|| panic!("{said}"));
        close(numbers_in(mean)[0], map["value"][k].as_f64().unwrap(), 1e-3, &said);
    }
}

/// Half and difference angles: columns are spaced by the root of θh.
#[test]
fn the_map_of_half_and_difference_angles_tells_the_cells_that_the_plot_command_tells() {
    let test = "the_map_of_half_and_difference_angles_tells_the_cells_that_the_plot_command_tells";
    let Some(mut page) = page_or_skip(test) else { return };
    open(&mut page);
    let plotted = |statistic: &str| {
        let files = ["demo/measurement.csv", "demo/lambert+phong.json", "--out", "r.svg", "--statistic", statistic];
        let map = Run::shared().json(&[&["plot", "residuals"][..], &files].concat())["maps"][0].clone();
        assert_eq!(map["over"], serde_json::json!(["theta_h", "theta_d"]));
        map
    };
    let maps = ["mean", "rms", "over-noise"].map(plotted);
    let list = |v: &Value| v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap_or(f64::NAN)).collect::<Vec<f64>>();
    let (x, y, count) = (list(&maps[0]["columns_deg"]), list(&maps[0]["rows_deg"]), list(&maps[0]["count"]));
    let filled: Vec<usize> = (0..count.len()).filter(|k| count[*k] > 0.0).collect();
    let svg = "document.querySelector('[data-fit=\"1\"] [data-over=half][data-statistic=mean] svg')";
    click(&mut page, "statistic", "mean");
    page.eval(&format!("{svg}.scrollIntoView({{ block: 'center', behavior: 'instant' }})"));
    for k in [filled[0], filled[filled.len() / 3], filled[filled.len() / 2], filled[filled.len() - 1]] {
        let (i, j) = (k % (x.len() - 1), k / (x.len() - 1));
        let (theta_h, theta_d) = (0.5 * (x[i] + x[i + 1]), 0.5 * (y[j] + y[j + 1]));
        let at = page.eval(&format!(
            "(() => {{
              const svg = {svg};
              const [left, top, width, height] = svg.dataset.area.split(' ').map(Number);
              const point = new DOMPoint(left + Math.sqrt({theta_h} / 90) * width, top + height - {theta_d} / 90 * height);
              const p = point.matrixTransform(svg.getScreenCTM());
              return [p.x, p.y];
            }})()"
        ));
        page.point_at(at[0].as_f64().unwrap(), at[1].as_f64().unwrap());
        let said = text(&mut page, "#residual-readout");
        assert!(said.starts_with("lambert+phong, θh "), "{said}");
        let found = numbers_in(&said);
        let values = maps.each_ref().map(|map| map["value"][k].as_f64().expect("a filled cell"));
        let want = [&[x[i], x[i + 1], y[j], y[j + 1]][..], &values, &[count[k]]].concat();
        assert_eq!(found.len(), want.len(), "{said}");
        // Borders and means over their error have three digits, the others four.
        for (found, want) in found.iter().zip(&want) {
            close(*found, *want, 6e-3, &said);
        }
        close(found[4], values[0], 1e-3, &said);
        close(found[5], values[1], 1e-3, &said);
    }
}

/// From the system's scheme to dark, to light, and back; each colours the page and its figures, and the button says which it is.
#[test]
fn the_theme_button_goes_round_and_outweighs_the_systems_scheme() {
    let Some(mut page) = page_or_skip("the_theme_button_goes_round_and_outweighs_the_systems_scheme") else { return };
    open(&mut page);
    let shown = |page: &mut Page| {
        page.eval(
            "(() => {
              const style = (e) => getComputedStyle(e);
              const figure = document.querySelector('#lobe-frames [data-channel]:not([hidden]) svg text');
              return {
                said: document.querySelector('#theme').textContent, chosen: document.documentElement.dataset.theme ?? 'auto',
                scheme: style(document.documentElement).colorScheme, paper: style(document.body).backgroundColor,
                ink: style(document.body).color, figure: style(figure).fill,
              };
            })()",
        )
    };
    let colors = |shown: &Value| ["scheme", "paper", "ink", "figure"].map(|key| shown[key].clone());
    let light = colors(&shown(&mut page));
    page.window(1400, 1000, "dark");
    let dark = colors(&shown(&mut page));
    assert!(light.iter().zip(&dark).all(|(a, b)| a != b), "{light:?} {dark:?}");
    for (system, clicks) in [("light", ["dark", "light", "auto"]), ("dark", ["dark", "light", "auto"])] {
        page.window(1400, 1000, system);
        let own = if system == "dark" { &dark } else { &light };
        assert_eq!(&colors(&shown(&mut page)), own, "{system}");
        for theme in clicks {
            page.eval("document.querySelector('#theme').click()");
            let now = shown(&mut page);
            assert_eq!(
                (now["chosen"].as_str(), &now["said"]),
                (Some(theme), &format!("Theme: {theme}").into()),
                "{system}"
            );
            let want = match theme {
                "dark" => &dark,
                "light" => &light,
                _ => own,
            };
            assert_eq!(&colors(&now), want, "{theme} where the system is {system}");
        }
    }
}

fn pictures() -> [Image; 2] {
    ["truth", "lambert"].map(|name| read_exr(&Run::shared().path(&format!("demo/{name}.exr"))).expect("reads"))
}

/// Colour of a pixel of a canvas.
fn painted(page: &mut Page, canvas: &str, x: usize, y: usize) -> Vec<i64> {
    let color = page.eval(&format!(
        "[...document.querySelector('{canvas}').getContext('2d').getImageData({x}, {y}, 1, 1).data].slice(0, 3)"
    ));
    color.as_array().unwrap().iter().map(|v| v.as_i64().unwrap()).collect()
}

#[test]
fn the_viewer_develops_compares_and_reads_the_pictures_radiance() {
    let Some(mut page) = page_or_skip("the_viewer_develops_compares_and_reads_the_pictures_radiance") else { return };
    open(&mut page);
    let [truth, lambert] = pictures();
    click(&mut page, "picture", "1");
    let data = page.eval("(({ exposure, range, factor }) => ({ exposure, range, factor }))(JSON.parse(document.querySelector('#data').textContent).pictures)");
    assert_eq!(data["factor"], 1);
    let places = [(180, 180), (200, 120), (20, 340), (150, 230)];
    for stops in [0.0, -2.5, 3.0] {
        page.eval(&format!("(() => {{ const e = document.querySelector('#exposure'); e.value = {stops}; e.dispatchEvent(new Event('input')); }})()"));
        let exposure = data["exposure"].as_f64().unwrap() + stops;
        for (canvas, image) in [("#canvas-a", &truth), ("#canvas-b", &lambert)] {
            let developed = develop(image, exposure);
            for (x, y) in places {
                let want = developed.pixels[y * image.width + x];
                let found = painted(&mut page, canvas, x, y);
                let far = found.iter().zip(want).map(|(a, b)| (a - i64::from(b)).abs()).max();
                assert!(far <= Some(2), "{canvas} at {stops} stops, ({x}, {y}): {found:?} vs {want:?}");
            }
        }
    }
    page.eval("(() => { const e = document.querySelector('#exposure'); e.value = 0; e.dispatchEvent(new Event('input')); })()");
    click(&mut page, "view", "difference");
    let range = data["range"].as_f64().unwrap();
    let luminance = |p: [f64; 3]| 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2];
    for (x, y) in places {
        let i = y * truth.width + x;
        let difference = luminance(lambert.radiance[i]) - luminance(truth.radiance[i]);
        let want = ColorMap::Diverging.color(0.5 + 0.5 * difference / range);
        let found = painted(&mut page, "#canvas-b", x, y);
        assert!(
            found.iter().zip(want).all(|(a, b)| (a - i64::from(b)).abs() <= 3),
            "({x}, {y}): {found:?} vs {want:?}"
        );
    }
    click(&mut page, "view", "slider");
    page.eval("document.querySelector('#stage').scrollIntoView({ block: 'center', behavior: 'instant' })");
    for (x, y) in places {
        let at = page.eval(&format!(
            "(() => {{ const b = document.querySelector('#canvas-a').getBoundingClientRect();
              return [b.left + ({x} + 0.5) / {0} * b.width, b.top + ({y} + 0.5) / {1} * b.height]; }})()",
            truth.width, truth.height
        ));
        page.point_at(at[0].as_f64().unwrap(), at[1].as_f64().unwrap());
        let said = text(&mut page, "#pixel-readout");
        let found = numbers_in(&said);
        assert_eq!((found[0], found[1]), (x as f64, y as f64), "{said}");
        let i = y * truth.width + x;
        let want = truth.radiance[i].iter().chain(&lambert.radiance[i]);
        for (found, want) in found[2..8].iter().zip(want) {
            close(*found, *want, 1.5e-3, &said);
        }
    }
    // The slider divides the two.
    page.eval(
        "(() => { const e = document.querySelector('#split'); e.value = 20; e.dispatchEvent(new Event('input')); })()",
    );
    assert_eq!(page.eval("getComputedStyle(document.querySelector('.second')).clipPath"), "inset(0px 0px 0px 20%)");
}

#[test]
fn the_tables_hold_the_numbers_of_the_json() {
    let Some(mut page) = page_or_skip("the_tables_hold_the_numbers_of_the_json") else { return };
    open(&mut page);
    let rows = page.eval(
        "[...document.querySelectorAll('table.values tbody tr')].map((r) => [...r.cells].map((c) => c.innerText))",
    );
    let numbers = Run::shared().numbers();
    let rows = rows.as_array().unwrap();
    assert_eq!(rows.len(), 7);
    for (fit, column) in [(0, 3), (1, 4)] {
        let material = &numbers["fits"][fit]["material"];
        for (l, lobe) in material["lobes"].as_array().unwrap().iter().enumerate() {
            let errors = &material["fit"]["standard_error"][l];
            for c in 0..3 {
                let name = format!("{}.weight[{}]", lobe["kind"].as_str().unwrap(), ["r", "g", "b"][c]);
                let row = rows.iter().find(|r| r[0].as_str().unwrap().trim() == name).expect("a row");
                let found = numbers_in(&row[column].as_str().unwrap().replace('±', " "));
                close(found[0], lobe["weight"][c].as_f64().unwrap(), 2e-4, &name);
                close(found[1], errors["weight"][c].as_f64().unwrap(), 0.06, &format!("σ of {name}"));
            }
        }
    }
    let exponent = rows.iter().find(|r| r[0].as_str().unwrap().contains("exponent")).unwrap();
    let found = numbers_in(&exponent[4].as_str().unwrap().replace('±', " "));
    close(
        found[0],
        numbers["fits"][1]["material"]["lobes"][1]["shape"]["exponent"].as_f64().unwrap(),
        1e-5,
        "exponent",
    );
    let compared = page.eval("[...document.querySelectorAll('#pictures ~ .scroll tbody tr')].map((r) => [...r.cells].map((c) => c.innerText))");
    for (row, key) in [(0, "rmse"), (1, "rel_mse"), (2, "psnr"), (6, "max_abs")] {
        for fit in 0..2 {
            let want = numbers["fits"][fit]["image"][key].as_f64().unwrap();
            close(numbers_in(compared[row][fit + 1].as_str().unwrap())[0], want, 1e-3, key);
        }
    }
}
