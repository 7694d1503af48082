//! `tradeoff`: curves, their slopes, files, advice. All that is tested is the same whatever the clock says.

use goniofit::chain;
use goniofit::control::Control;
use goniofit::measurement::{ReadOptions, formats};
use goniofit::tradeoff::render::scanned;
use serde_json::{Value, json};

use crate::bench::{Bench, number};

fn curve<'a>(found: &'a Value, name: &str) -> &'a Value {
    let curves = found["curves"].as_array().expect("curves");
    curves.iter().find(|c| c["name"] == name).unwrap_or_else(|| panic!("{name} is not among the curves of {found}"))
}

/// The index of a measure.
fn measure(found: &Value, name: &str) -> usize {
    let measures = found["measures"].as_array().expect("measures");
    measures.iter().position(|m| m["name"] == name).expect("a measure")
}

fn errors(found: &Value, curve_name: &str, name: &str) -> Vec<f64> {
    let m = measure(found, name);
    let points = curve(found, curve_name)["points"].as_array().expect("points");
    points.iter().map(|p| number(&p["errors"][m]["value"])).collect()
}

fn slope(found: &Value, curve_name: &str, name: &str) -> f64 {
    let slopes = curve(found, curve_name)["slopes"].as_array().expect("slopes");
    number(&slopes.iter().find(|s| s["measure"] == name).expect("a slope")["slope"]["value"])
}

/// What theory says of a slope: its kind, and the exponents that it names.
fn theory(found: &Value, curve_name: &str, name: &str) -> (String, Vec<f64>) {
    let slopes = curve(found, curve_name)["slopes"].as_array().expect("slopes");
    let theory = &slopes.iter().find(|s| s["measure"] == name).expect("a slope")["law"]["theory"];
    let slopes = match &theory["slope"] {
        Value::Array(list) => list.iter().map(number).collect(),
        slope => slope.as_f64().into_iter().collect(),
    };
    (theory["kind"].as_str().expect("a kind").to_owned(), slopes)
}

/// The words of a command line.
fn typed(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// What does not depend on the clock.
fn timeless(found: &Value) -> Vec<Value> {
    let curves = found["curves"].as_array().expect("curves");
    let points = curves.iter().flat_map(|c| c["points"].as_array().expect("points"));
    points.map(|p| p["errors"].clone()).collect()
}

#[test]
fn a_fit_to_a_part_is_off_as_theory_says_and_the_files_say_what_was_printed() {
    let b = Bench::new();
    b.ok(&["simulate", "--material", "glossy-paint", "--seed", "3", "--out", "paint.csv"]);
    let args = typed("tradeoff fit paint.csv --parts 1,10,20,40 --targets 1% --trials 24 --out t");
    let found = b.json(&args);
    let excess = errors(&found, "lambert+phong", "excess");
    assert_eq!(excess.last(), Some(&0.0), "the fit to all is the reference: {excess:?}");
    assert!(excess[0] > excess[1] && excess[1] > excess[2], "{excess:?}");
    let [parameters, of_cost] = ["parameters", "excess"].map(|name| slope(&found, "lambert+phong", name));
    // Of 24 trials each an error is known to 10 to 15 %, and the sizes differ by a factor of 4: the slope to about 0.1, of the square twice that.
    assert!((parameters + 0.5).abs() < 0.2 && (of_cost + 1.0).abs() < 0.4, "{parameters} and {of_cost}");
    assert_eq!(theory(&found, "lambert+phong", "excess"), ("exactly".into(), vec![-1.0]), "noise, and no more");
    assert_eq!(theory(&found, "lambert+phong", "parameters"), ("exactly".into(), vec![-0.5]));
    let target = &curve(&found, "lambert+phong, as many as a target takes")["points"][0];
    assert_eq!(target["kept"], 24);
    for name in ["tradeoff.csv", "tradeoff.json", "excess-time.svg", "excess-time.png", "parameters-part.svg"] {
        assert!(!b.bytes(&format!("t/{name}")).is_empty(), "{name}");
    }
    assert_eq!(timeless(&b.json_file("t/tradeoff.json")), timeless(&found));
    rings_are_the_front_and_points_say_what_they_are(&b.text("t/excess-time.svg"), &found);
    let again = b.json(&["plot", "tradeoff", "t/tradeoff.json", "--only", "parameters-part", "--out", "p.svg"]);
    assert!(b.text("p.svg") == b.text("t/parameters-part.svg"), "the file holds all that the plot shows");
    let drawn = &again["plots"][0]["curves"][0];
    let want: Vec<f64> = errors(&found, "lambert+phong", "parameters").into_iter().filter(|e| *e > 0.0).collect();
    assert_eq!(drawn["y"], Value::from(want));
    let name = drawn["name"].as_str().expect("a name");
    assert!(name.starts_with("lambert+phong, slope −0."), "{name}");
    let all = b.json(&["plot", "tradeoff", "t/tradeoff.json", "--out", "all.png"]);
    let mut names: Vec<&str> =
        all["plots"].as_array().expect("plots").iter().map(|p| p["name"].as_str().unwrap()).collect();
    names.sort_unstable();
    let files = b.list("t");
    assert_eq!(names, files.iter().filter_map(|n| n.strip_suffix(".svg")).collect::<Vec<_>>());
    let csv = b.text("t/tradeoff.csv");
    let rows = csv.lines().filter(|l| !l.starts_with('#')).count();
    assert_eq!(rows, 1 + 5, "{csv}");
    // How all of it is made again: no more and no less than was typed.
    let made = format!("goniofit {}: goniofit {}", env!("CARGO_PKG_VERSION"), args.join(" "));
    assert_eq!(csv.lines().next(), Some(&*format!("# {made}")));
    let run = &b.json_file("t/tradeoff.json")["run"];
    let words: Vec<&str> = run["command"].as_array().expect("words").iter().filter_map(Value::as_str).collect();
    assert_eq!(format!("{}: {}", run["program"].as_str().expect("a name"), words.join(" ")), made);
    let text = b.ok(&[&args[..], &["--advise", "excess=20%"]].concat()).text();
    assert!(text.lines().all(|l| l.chars().count() <= 80), "{text}");
    assert!(text.contains("goniofit fit paint.csv --model lambert+phong --loss cosine-l2 --part"), "{text}");
}

/// Of settings that have an error at all.
fn rings_are_the_front_and_points_say_what_they_are(svg: &str, found: &Value) {
    let settings: Vec<&Value> =
        found["curves"].as_array().expect("curves").iter().flat_map(|c| c["points"].as_array().unwrap()).collect();
    let shown = |p: &&&Value| p["errors"][measure(found, "excess")]["value"].as_f64() > Some(0.0);
    for (standing, class) in [("front", "ring"), ("undecided", "ring dashed")] {
        let want = settings.iter().filter(shown).filter(|p| p["standing"] == standing).count();
        let drawn = svg.matches(&format!("<circle class=\"{class}\"")).count();
        // One more is in the legend.
        assert_eq!(drawn, if want > 0 { want + 1 } else { 0 }, "{standing}: {svg}");
    }
    assert!(settings.iter().any(|p| p["standing"] == "front"));
    // Rings have no bars of their own.
    assert_eq!(svg.matches("class=\"error").count(), found["curves"].as_array().expect("curves").len(), "{svg}");
    for setting in settings.iter().filter(shown) {
        let title = format!(": {}: ", setting["setting"].as_str().expect("a setting"));
        assert!(svg.split("<title>").any(|t| t.contains(&title)), "{title} {svg}");
    }
}

/// A sweep is of the fit that one makes: by its loss, its weights, its limits, through its instrument.
#[test]
fn a_sweep_of_fits_takes_what_a_fit_takes_and_says_it_again() {
    let b = Bench::new();
    b.write("wide.toml", "version = 1\n[instrument]\nelectrons = 1e6\n[instrument.detector]\naperture_deg = 4.0\n");
    b.ok(&typed("simulate --material glossy-paint --instrument wide.toml --scan in-plane:6 --seed 3 --out m.csv"));
    let own = "--robust huber --through wide.toml --max-angle 70 --use-sigma --bound phong.exponent=1..1e4";
    let again = "--robust huber:1.345 --through wide.toml --max-angle 70 --use-sigma --bound phong.exponent=1..10000";
    let args = format!("tradeoff fit m.csv {own} --parts 1,2,4 --targets 5% --trials 3 --out t");
    let found = b.json(&typed(&args));
    let command = format!("goniofit fit m.csv --model lambert+phong --loss cosine-l2 {again}");
    assert_eq!(found["commands"], Value::from(vec![Value::from(typed(&command))]));
    assert_eq!(b.json_file("t/tradeoff.json")["commands"], found["commands"]);
    // The yardstick is the fit with these options, judged by one robust scale.
    let fit = b.json(&typed(&format!("fit m.csv {own}")));
    assert_eq!((&fit["fit"]["weights"], &fit["fit"]["robust"]), (&"sigma".into(), &"huber:1.345".into()));
    let reference = found["reference"].to_string();
    let rmse = format!("rmse {:.4e}", number(&fit["fit"]["rmse"]));
    assert!(
        reference.contains(&rmse) && reference.contains("all fits are judged by huber:1.345"),
        "{rmse}: {reference}"
    );
    let plain = b.json(&typed("tradeoff fit m.csv --parts 1,2,4 --targets 5% --trials 3"));
    assert_ne!(timeless(&plain), timeless(&found));
    let excess = errors(&found, "lambert+phong", "excess");
    assert!(excess[0] > 0.0 && excess.last() == Some(&0.0), "the fit to all is its own reference: {excess:?}");
    let text = b.ok(&typed(&format!("{args} --advise excess=50%"))).text();
    assert!(text.contains(again), "{text}");
    follow(&b, &text, 1);
    // Each channel apart, with shapes of its own.
    let args =
        typed("tradeoff fit m.csv --per-channel --fix lambert.weight[r]=0.2 --parts 1,3 --targets 5% --trials 2");
    let found = b.json(&args);
    assert!(found["commands"].to_string().contains(r#""--per-channel","--fix","lambert.weight[r]=0.2""#), "{found}");
    let excess = errors(&found, "lambert+phong", "excess");
    assert!(excess[0] > 0.0 && excess.last() == Some(&0.0), "{excess:?}");
    for (wrong, says) in [("--through ideal", "aperture_deg"), ("--use-sigma --weights uniform", "--weights")] {
        let ran = b.run(&typed(&format!("tradeoff fit m.csv {wrong}")));
        assert!(ran.code == Some(2) && ran.err.contains(says), "{wrong}: {ran:?}");
    }
}

#[test]
fn independent_samples_have_their_slope_and_a_cut_path_its_bias_whatever_the_threads() {
    let b = Bench::new();
    let args = typed(
        "tradeoff render --scene sphere-on-plane --size 24 --samples 8,16,64,256 --trials 6 --ways scene,independent --depths 1 --seed 5",
    );
    let found = b.json(&args);
    let independent = slope(&found, "independent samples", "error");
    assert!((independent + 0.5).abs() < 0.05, "{independent}");
    assert!(slope(&found, "plan of the scene", "error") < independent, "Sobol' points are more even");
    // A mean of one picture of 8 samples has no other that it is independent of.
    let points = |name: &str| curve(&found, name)["slopes"][0]["points"].clone();
    assert_eq!((points("independent samples"), points("plan of the scene")), (3.into(), 4.into()));
    assert!(found["notes"].to_string().contains("8 Sobol' points"), "{}", found["notes"]);
    let m = measure(&found, "bias");
    let bias = |name: &str| curve(&found, name)["points"][2]["errors"][m].clone();
    assert_eq!(number(&bias("plan of the scene")["low"]), 0.0, "{}", bias("plan of the scene"));
    assert!(number(&bias("max_bounces = 1")["low"]) > 0.01, "{}", bias("max_bounces = 1"));
    let again = b.json(&[&args[..], &["--threads", "1"]].concat());
    assert_eq!(timeless(&again), timeless(&found));
}

/// Lights found by one way alone: the same picture, with noise of their own, and no advice.
#[test]
fn ways_to_find_lights_differ_in_noise_alone() {
    let b = Bench::new();
    let args = typed(
        "tradeoff render --scene cornell --size 12 --samples 16,64,256 --trials 4 --ways scene,chance,aimed --seed 3 --out t",
    );
    let found = b.json(&args);
    let (noise, bias) = (measure(&found, "noise"), measure(&found, "bias"));
    let names = ["plan of the scene", "lights met by chance", "lights aimed at only"];
    for name in names {
        let last = &curve(&found, name)["points"][2];
        // What the mean of four pictures is off by noise is half of one's: a bias would stand above that.
        let [noise, bias] = [&last["errors"][noise]["value"], &last["errors"][bias]["low"]].map(number);
        assert!(bias < 0.5 * noise, "{name}: off by {bias} at least, noise {noise}");
        let slope = slope(&found, name, "error");
        assert!((-0.9..-0.3).contains(&slope), "{name}: {slope}");
        assert_eq!(theory(&found, name, "error"), ("at-most".into(), vec![-0.5]), "{name}");
    }
    // A lamp that fills a small part of the sky of a wall is hard to meet.
    let [by_plan, by_chance, aimed] = names.map(|name| errors(&found, name, "error"));
    for k in 0..3 {
        assert!(
            by_chance[k] > 2.0 * aimed[k] && by_chance[k] > 2.0 * by_plan[k],
            "{by_chance:?} {aimed:?} {by_plan:?}"
        );
    }
    let csv = b.text("t/tradeoff.csv");
    assert!(names.iter().all(|name| csv.matches(name).count() >= 3), "{csv}");
    // `render` has no option for them.
    let text = b.ok(&[&args[..], &["--advise", "time=10m"]].concat()).text();
    let advice = text.rsplit_once("time=10m").expect("advice").1;
    assert!(advice.contains("(plan of the scene"), "{advice}");
    let ran = b.run(&typed("tradeoff render --size 8 --ways luck"));
    assert!(
        ran.code == Some(2) && ran.err.contains("known are scene, full, independent, chance, aimed"),
        "{}",
        ran.err
    );
}

/// What a table's step costs: a lobe of n = 20 that is joined by straight lines is off by the square of it, and the table's end below 90° stands apart.
#[test]
fn a_table_is_off_by_the_square_of_its_step() {
    let b = Bench::new();
    let material = json!({ "format": "goniofit-material", "version": 1, "model": "lambert+phong", "channels": ["r"],
        "lobes": [ { "kind": "lambert", "weight": [0.1] },
                   { "kind": "phong", "weight": [0.5], "shape": { "exponent": 20.0 } } ] });
    b.write("gloss.json", material.to_string());
    let args = "tradeoff render --scene sphere --material gloss.json --size 24 --samples 128 --reference 256 --trials 8 --ways scene --seed 3";
    let found = b.json(&typed(&format!("{args} --resolutions 5,15,10")));
    let name = "resolution of the table";
    let points = curve(&found, name)["points"].as_array().expect("points");
    let steps: Vec<f64> = points.iter().map(|p| number(&p["size"])).collect();
    assert_eq!(steps, [15.0, 10.0, 5.0]);
    // A second a pair: of 15° six incidences of the normal and five rings of 24.
    assert_eq!(number(&points[0]["instrument_s"]), 726.0);
    let bias = errors(&found, name, "bias");
    println!("bias {bias:?}, slope {}", slope(&found, name, "bias"));
    // n h² is 1.37, 0.61 and 0.15: a lobe alone would be off by 2.16 and 3.89 times as much as the next. The bias of 5° is known to a tenth.
    assert!((1.7..2.8).contains(&(bias[0] / bias[1])) && (2.8..5.3).contains(&(bias[1] / bias[2])), "{bias:?}");
    let slope = slope(&found, name, "bias");
    assert!((1.6..2.3).contains(&slope), "{slope}");
    assert_eq!(theory(&found, name, "bias"), ("between".into(), vec![2.0, 1.7]));
    // The rim beyond the last ring is as wide as the step, and dark.
    let unmeasured = errors(&found, name, "unmeasured");
    assert!(unmeasured.windows(2).all(|pair| pair[0] > pair[1]), "{unmeasured:?}");
    let laws = curve(&found, name)["slopes"].as_array().expect("slopes").iter().filter(|s| !s["law"].is_null()).count();
    assert_eq!(laws, 1, "of the bias alone");
    // A lobe that is narrower than the step has no law, and neither has a table.
    b.ok(&typed("simulate --material gloss.json --noiseless --scan hemisphere:5 --out gloss.csv"));
    let quick = "tradeoff render --scene sphere --size 16 --samples 64 --reference 128 --trials 6 --ways scene --resolutions 30,20,15";
    for (material, why) in [("glossy-paint", "narrower than the coarsest step"), ("gloss.csv", "not known")] {
        let found = b.json(&typed(&format!("{quick} --material {material}")));
        assert_eq!(theory(&found, name, "bias").0, "unknown", "{material}");
        let slopes = curve(&found, name)["slopes"].to_string();
        assert!(slopes.contains(why), "{material}: {slopes}");
    }
}

/// A setting of a table is of two commands, which do what was swept; advice takes none of them.
#[test]
fn the_commands_of_a_table_read_it_and_render_it() {
    let b = Bench::new();
    let args = typed(
        "tradeoff render --scene sphere --material satin --size 8 --samples 4,16 --trials 2 --ways scene --resolutions 15,30 --out t",
    );
    let found = b.json(&args);
    assert_eq!(timeless(&b.json(&[&args[..], &["--threads", "1"]].concat())), timeless(&found));
    let curve = curve(&found, "resolution of the table");
    let read = typed("goniofit simulate --material satin --instrument ideal --out OUT.csv");
    let render = typed("goniofit render --scene sphere --material OUT.csv --size 8x8 --out OUT.exr");
    assert_eq!(curve["commands"], json!([read, render]));
    let settings: Vec<&str> =
        curve["points"].as_array().expect("points").iter().map(|p| p["setting"].as_str().expect("a setting")).collect();
    assert_eq!(settings, ["--scan hemisphere:30 --samples 16", "--scan hemisphere:15 --samples 16"]);
    let options = typed(settings[1]);
    b.ok(&[&read[1..], &options[..2]].concat());
    b.ok(&[&render[1..], &options[2..]].concat());
    let picture = b.exr("OUT.exr");
    assert_eq!((picture.width, picture.metadata.samples), (8, Some(16)));
    // What is swept is what is written, bit by bit.
    let written = formats::read(&b.path("OUT.csv"), &ReadOptions::default()).expect("reads");
    let satin = chain::load("satin", &ReadOptions::default()).expect("built in");
    let swept = scanned("satin", &satin, 15.0, Control::silent()).expect("measures");
    let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&written.values), bits(&swept.values));
    let text = b.ok(&[&args[..], &["--advise", "time=10m"]].concat()).text();
    let (table, advice) = text.rsplit_once("time=10m").expect("advice");
    assert!(table.contains(&format!("\n    {}\n    {}\n", read.join(" "), render.join(" "))), "{table}");
    assert!(advice.contains("(plan of the scene"), "{advice}");
    assert!(table.lines().filter(|l| !l.contains("goniofit ")).all(|l| l.chars().count() <= 80), "{table}");
    assert!(b.text("t/tradeoff.csv").contains("unmeasured_low"), "a column of its own");
    b.ok(&["report", "t"]);
    let page = b.text("t/report.html");
    assert!(page.contains("Settings of resolution of the table are options of: goniofit simulate"), "{page}");
}

#[test]
fn steps_that_no_table_can_have_are_refused_before_any_picture() {
    let b = Bench::new();
    for (args, says) in [
        ("--material satin --resolutions 10,60", "from 0.1 to 45 degrees"),
        ("--material satin --resolutions 10,0.5", "at most 16 million pairs of directions in all, found 23.2 million"),
        ("--material satin --resolutions 45", "satin along hemisphere:45: 0 of 2 incidences cover the hemisphere"),
        ("--resolutions 10", "--material"),
        ("--scene gradient-sweep --material satin --resolutions 30", "other exponents, which a table has not"),
    ] {
        let ran = b.run(&typed(&format!("tradeoff render --size 8 --samples 4 --trials 1 --ways scene {args}")));
        assert!(ran.code == Some(2) && ran.err.contains(says), "{args}: {}", ran.err);
    }
}

#[test]
fn readings_average_out_and_take_the_instruments_time() {
    let b = Bench::new();
    let args =
        typed("tradeoff simulate --material satin --scan hemisphere:15 --knobs readings --average 1,4,16 --trials 12");
    let found = b.json(&args);
    for name in ["reading", "brdf", "parameters"] {
        let slope = slope(&found, "readings averaged", name);
        let most = if name == "parameters" { 0.15 } else { 0.05 };
        assert!((slope + 0.5).abs() < most, "{name}: {slope}");
        assert_eq!(theory(&found, "readings averaged", name), ("exactly".into(), vec![-0.5]), "{name}");
    }
    let points = curve(&found, "readings averaged")["points"].as_array().expect("points");
    let times: Vec<f64> = points.iter().map(|p| number(&p["instrument_s"])).collect();
    assert!((times[2] / times[0] - 16.0).abs() < 1e-9, "{times:?}");
}

/// Where what theory needs is not given it is a bound, or none, and the reason is said.
#[test]
fn theory_is_stated_where_it_holds() {
    let b = Bench::new();
    b.paint("paint.csv");
    // A gloss paint without its gloss: what is left is no noise.
    let found = b.json(&typed("tradeoff fit paint.csv --models lambert --parts 1,10,20,40 --targets 1% --trials 4"));
    assert_eq!(theory(&found, "lambert", "excess"), ("unknown".into(), vec![]));
    let why = curve(&found, "lambert")["slopes"][0]["law"]["why"].as_str().expect("a reason");
    assert!(why.contains("the model's own error"), "{why}");
    // Strides may keep step with the rows.
    let found = b.json(&typed("tradeoff fit paint.csv --strides 40,20,10 --targets 1% --trials 4"));
    assert_eq!(theory(&found, "lambert+phong, every N-th entry", "parameters"), ("unknown".into(), vec![]));
    let exposed = |more: &str| {
        let args = format!(
            "tradeoff simulate --material satin --scan hemisphere:15 --knobs exposure --exposures 1,2,4 --trials 6 {more}"
        );
        let found = b.json(&typed(&args));
        (slope(&found, "exposure", "reading"), theory(&found, "exposure", "reading"), b.ok(&typed(&args)).text())
    };
    // Of thousands of readings, six times, an error is known to 1 %, and of a factor of 4 a slope to 0.01.
    let (slope, law, text) = exposed("");
    assert!((-1.03..-0.47).contains(&slope) && law == ("between".into(), vec![-1.0, -0.5]), "{slope} {law:?}");
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words.contains("theory -1 to -0.5: shot noise"), "{text}");
    let (slope, law, _) = exposed("--read-noise 0");
    assert!((slope + 0.5).abs() < 0.05 && law == ("exactly".into(), vec![-0.5]), "{slope} {law:?}");
    let (slope, law, _) = exposed("--electrons 300");
    assert!(
        slope > -1.03 && law == ("at-least".into(), vec![-1.0]),
        "readings darker than their noise: {slope} {law:?}"
    );
    // What readings share bounds their average.
    let args = "tradeoff simulate --material satin --instrument commercial --scan in-plane:15 --knobs readings --average 1,2,4 --trials 3";
    let found = b.json(&typed(args));
    assert_eq!(theory(&found, "readings averaged", "brdf"), ("at-least".into(), vec![-0.5]));
}

#[test]
fn means_over_cones_are_as_good_as_they_are_asked_for_and_effects_have_their_size() {
    let b = Bench::new();
    let args = typed(
        "tradeoff simulate --material satin --instrument commercial --scan in-plane:15 --knobs quadrature,effects --trials 2 --target-errors 1e-2,1e-6 --out t",
    );
    let found = b.json(&args);
    let points = curve(&found, "means over cones")["points"].as_array().expect("points");
    assert!(points.iter().all(|p| p["kept"] == 2), "{points:?}");
    let names: Vec<&str> = curve(&found, "an effect left out")["points"]
        .as_array()
        .expect("points")
        .iter()
        .map(|p| p["setting"].as_str().expect("a name"))
        .collect();
    let readings = errors(&found, "an effect left out", "reading");
    let of = |name: &str| readings[names.iter().position(|n| *n == name).expect("an effect")];
    assert_eq!(of("all effects"), 0.0);
    assert!(of("without detector aperture") > 1e-5 && of("without shot noise") > 1e-3, "{names:?} {readings:?}");
    // What is off all effects is not drawn beside what is off the finest means.
    let drawn = b.json(&["plot", "tradeoff", "t/tradeoff.json", "--out", "all.svg"]);
    let plots = drawn["plots"].as_array().expect("plots");
    let names = |plot: &Value| -> Vec<Value> {
        plot["curves"].as_array().expect("curves").iter().map(|c| c["name"].clone()).collect()
    };
    let effects = Value::from("an effect left out");
    let with_effects: Vec<&Value> = plots.iter().filter(|plot| names(plot).contains(&effects)).collect();
    assert!(with_effects.len() == 1 && with_effects[0]["name"] == "reading-effects-time", "{plots:?}");
    assert_eq!(names(with_effects[0]), [effects]);
}

#[test]
fn rules_over_the_cones_of_a_table_have_the_order_of_its_kinks() {
    let b = Bench::new();
    b.ok(&typed("simulate --material glossy-paint --noiseless --scan merl --out paint.binary"));
    let args = typed(
        "tradeoff simulate --material paint.binary --instrument commercial --scan in-plane:45 --knobs order --orders 1,2,3 --trials 2",
    );
    let found = b.json(&args);
    let slope = slope(&found, "order of the rules", "reading");
    println!("error by order to the power {slope}");
    assert!((-5.0..-2.0).contains(&slope), "{slope}");
    let ran = b.run(&[&args[..], &["--advise", "error=1%"]].concat());
    assert_eq!(ran.code, Some(1), "no command has an option for an order: {}", ran.err);
    let ran = b.run(&typed("tradeoff simulate --material satin --knobs order --orders 17"));
    assert!(ran.code == Some(2) && ran.err.contains("17"), "{}", ran.err);
}

#[test]
fn the_whole_chain_is_off_by_what_its_links_say() {
    let b = Bench::new();
    let args = typed(
        "tradeoff chain --material satin --scan hemisphere:15 --electrons 300 --size 24 --average 1,4 --strides 1,3 --samples 16,64 --trials 6 --budget 10h",
    );
    let found = b.json(&args);
    let share = &found["chain"][0];
    assert_eq!((number(&share["readings"]), number(&share["stride"]), number(&share["samples"])), (4.0, 1.0, 64.0));
    let predicted = number(&share["from_data"]).hypot(number(&share["from_pixels"]));
    let measured = number(&share["measured"]["value"]);
    assert!((measured / predicted - 1.0).abs() < 0.2, "{measured} of {predicted}");
    // From reading to image: four times the readings leave half of each error; of readings darker than their noise, whose change is 1 at most, less.
    for (name, least) in [("brdf", 1.3), ("parameters", 1.4), ("image", 1.4)] {
        let errors = errors(&found, "readings, all fitted", name);
        let ratio = errors[0] / errors[1];
        assert!((least..2.9).contains(&ratio), "{name}: {errors:?}");
    }
    // Links leave out what the others bring: advice is of the whole.
    let asked = b.json(&[&args[..], &["--advise", "error=50%"]].concat());
    let advice = &asked["advice"][0]["advice"];
    assert_eq!(advice["curve"], "whole chain, time shared out");
    assert!(number(&advice["error"]["expected"]) > 0.5 * predicted, "{advice}");
    let ran = b.run(&[&args[..], &["--advise", "time=1h"]].concat());
    assert!(ran.code == Some(1) && ran.err.contains("instrument=T"), "{}", ran.err);
}

#[test]
fn advice_can_be_followed() {
    let b = Bench::new();
    // However quick the other ways are, `render` has no option for them.
    let args = typed(
        "tradeoff render --material satin --rgb b,g,r --size 16 --samples 4,16 --trials 3 --ways independent,full,scene --targets 20%",
    );
    let text = b.ok(&[&args[..], &["--advise", "time=10m"]].concat()).text();
    follow(&b, &text, 1);
    assert_eq!(b.exr("OUT.exr").width, 16);
    assert!(text.contains("--material satin --rgb b,g,r --size 16x16"), "{text}");
    let advice = text.rsplit_once("time=10m").expect("advice").1;
    assert!(advice.contains("plan of the scene") || advice.contains("where it is noisy"), "{text}");
    let args = typed(
        "tradeoff simulate --material satin --electrons 5000 --scan in-plane:15 --seed 4 --knobs readings --average 1,4 --trials 3",
    );
    let text = b.ok(&[&args[..], &["--advise", "instrument=10h"]].concat()).text();
    assert!(text.contains("--electrons 5000 --scan in-plane:15 --seed 4"), "{text}");
    follow(&b, &text, 1);
}

#[test]
fn advice_of_the_whole_chain_is_the_chains_commands_and_the_instruments_time_is_its_own() {
    let b = Bench::new();
    let args = typed(
        "tradeoff chain --material satin --instrument commercial --scan in-plane:15 --seed 7 --size 16 --average 2 --strides 1,2 --samples 4 --trials 2 --budget 10h --advise instrument=10h",
    );
    let text = b.ok(&args).text();
    assert!(
        text.contains("whole chain, time shared out    in all         image"),
        "the time that the whole takes: {text}"
    );
    follow(&b, &text, 3);
    let shared = "--instrument commercial --scan in-plane:15 --seed 7 --out OUT.csv --readings 2";
    for part in [shared, "goniofit fit OUT.csv --model lambert+phong --through commercial --out OUT.json --stride "] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let picture = b.exr("OUT.exr");
    assert_eq!((picture.width, picture.metadata.samples, picture.metadata.seed), (16, Some(4), Some(7)));
    // What the instrument takes is not what the computer takes.
    let found = b.json(&args);
    let readings = number(&curve(&found, "readings, all fitted")["points"][0]["instrument_s"]);
    let whole = &curve(&found, "whole chain, time shared out")["points"][0];
    assert_eq!(number(&whole["instrument_s"]), readings);
    assert!(number(&whole["seconds"]["value"]) > 0.0 && number(&whole["size"]) > readings, "{whole}");
}

/// Runs the commands that advice prints.
fn follow(b: &Bench, text: &str, commands: usize) {
    let lines: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("  goniofit ")).collect();
    assert_eq!(lines.len(), commands, "{text}");
    lines.into_iter().for_each(|line| _ = b.ok(&typed(line)));
}

/// A target that no picture reaches would go on without end.
#[test]
fn a_sweep_ends_when_its_time_is_up() {
    let b = Bench::new();
    let sweep =
        "tradeoff render --size 16 --samples 4,8 --trials 2 --targets 1e-9 --ways scene --time-budget 4s --out t";
    let ran = b.run(&typed(sweep));
    // On a machine that is too busy for one picture in that time nothing is told.
    assert!(matches!(ran.code, Some(0 | 1)) && ran.err.contains("the time ended it"), "{:?} {}", ran.code, ran.err);
    if ran.code == Some(0) {
        let found = b.json_file("t/tradeoff.json");
        assert_eq!(found["ended"], "the time ended it");
        let names: Vec<&str> =
            found["curves"].as_array().expect("curves").iter().filter_map(|c| c["name"].as_str()).collect();
        assert_eq!(names, ["plan of the scene"], "the target's trial was not over");
    }
}

#[test]
fn what_can_t_be_had_is_said() {
    let b = Bench::new();
    b.paint("paint.csv");
    let fit = typed("tradeoff fit paint.csv --parts 3,5 --trials 2 --targets 1%");
    let render = typed("tradeoff render --size 8 --samples 4,8 --trials 2 --ways scene");
    let ran = b.run(&[&render[..], &["--advise", "error=1e-9", "--json"]].concat());
    assert_eq!(ran.code, Some(1));
    let found = ran.json();
    assert!(found["error"].as_str().is_some_and(|e| e.contains("--samples 8")), "{found}");
    let ran = b.run(&[&render[..], &["--advise", "error=1e-9", "--advise", "time=1ns"]].concat());
    assert!(ran.err.contains("an error of 1.000e-9") && ran.err.contains("a time of 1.000e-9 s"), "{}", ran.err);
    assert!(found["advice"][0]["advice"].is_null() && found["curves"][0]["points"].is_array(), "{found}");
    let ran = b.run(&[&fit[..], &["--advise", "error"]].concat());
    assert_eq!(ran.code, Some(2));
    // Before any trial: errors that none tells, references worse than what is measured, what leaves nothing, outputs that are inputs.
    std::fs::create_dir(b.path("t")).expect("a folder");
    b.write("t/tradeoff.csv", b.bytes("paint.csv"));
    for (args, says) in [
        ("tradeoff fit paint.csv --advise noise=1%", "expected an error out of excess, parameters, image"),
        ("tradeoff render --size 8 --advise bias=1%", "expected an error out of error, flip"),
        ("tradeoff render --size 8 --samples 8,64 --reference 32", "no fewer samples than the 64"),
        ("tradeoff fit paint.csv --parts 1,1000000", "one of every 1000000 leaves nothing"),
        ("tradeoff simulate --material satin --steps 10,91", "from 0.1 to 45 degrees"),
        ("tradeoff fit t/tradeoff.csv --out t", "would destroy the input"),
        ("tradeoff render --size 8 --material t/tradeoff.csv --out t", "would destroy the input"),
        ("tradeoff simulate --material t/tradeoff.csv --out t", "would destroy the input"),
    ] {
        let ran = b.run(&typed(args));
        assert!(ran.code == Some(2) && ran.err.contains(says), "{args}: {:?} {}", ran.code, ran.err);
    }
    assert_eq!(b.bytes("t/tradeoff.csv"), b.bytes("paint.csv"));
    let ran = b.run(&typed("tradeoff simulate --material satin --knobs quadrature --trials 2"));
    assert!(ran.code == Some(1) && ran.err.contains("nothing to try"), "{}", ran.err);
    let ran = b.run(&[&fit[..], &["--time-budget", "1us"]].concat());
    assert!(ran.code == Some(1) && ran.err.contains("more time"), "{}", ran.err);
    // Before any picture is taken.
    let ran = b.run(&typed("tradeoff render --size 16384 --samples 4,8"));
    assert!(ran.code == Some(2) && ran.err.contains("at most 4.0 GiB") && ran.err.contains("36.0"), "{}", ran.err);
    let ran = b.run(&["tradeoff", "chain", "--material", "paint.csv"]);
    assert!(ran.code == Some(2) && ran.err.contains("measurement"), "{}", ran.err);
    let ran = b.run(&["tradeoff", "simulate", "--material", "satin", "--scan", "adaptive"]);
    assert!(ran.code == Some(2) && ran.err.contains("adaptive"), "{}", ran.err);
}
