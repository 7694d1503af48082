//! What is printed fits a terminal of 80 columns, and is not coloured where colours are not wanted.

use goniofit::brdf::{LobeKind, Material};

use crate::bench::{Bench, broken};

fn fits(what: &str, text: &str) {
    for line in text.lines() {
        assert!(line.chars().count() <= 80, "{what}: {line}");
    }
}

/// The widths of the lines after the first that begins so.
fn widths(text: &str, begin: &str, count: usize) -> Vec<usize> {
    let below = text.lines().skip_while(|line| !line.starts_with(begin));
    below.skip(1).take(count).map(|line| line.chars().count()).collect()
}

#[test]
fn fits_comparisons_and_long_names_keep_to_eighty_columns() {
    let b = Bench::new();
    std::fs::create_dir_all(b.path("measurements/second-lot")).expect("a folder");
    let [csv, json] = ["csv", "json"].map(|end| format!("measurements/second-lot/hemisphere-of-paint.{end}"));
    b.paint(&csv);
    for model in ["lambert", "auto", "lambert+phong+phong"] {
        fits(model, &b.ok(&["fit", &csv, "--model", model, "--robust", "huber", "--out", &json]).text());
    }
    b.ok(&["fit", &csv, "--out", "p.json"]);
    let validated = ["validate", &csv, &json, "p.json", "--size", "24", "--samples", "4", "--out", "measurements/v"];
    let text = b.ok(&validated).text();
    fits("validate", &text);
    // The columns of a long name are those of a short one.
    let head = text.lines().find(|line| line.contains("relMSE")).expect("a header").chars().count();
    let rows = text.lines().filter(|line| line.contains("e-") && line.ends_with(|c: char| c.is_ascii_digit()));
    assert_eq!(rows.map(|line| line.chars().count()).collect::<Vec<_>>(), [head, head], "{text}");
}

#[test]
fn info_keeps_to_eighty_columns_and_its_values_stand_below_their_names() {
    let b = Bench::new();
    b.paint("p.csv");
    // A spectrum: more channels than there is room for side by side.
    let names: Vec<String> = (0..16).map(|k| format!("{}nm", 400 + 20 * k)).collect();
    let lobes = vec![(LobeKind::Lambert, vec![0.5; 16], vec![])];
    b.write("s.json", Material::new(names, lobes).to_json().expect("writes"));
    b.ok(&["simulate", "--material", "s.json", "--scan", "hemisphere:10", "--out", "s.csv"]);
    for (file, channels) in [("p.csv", 3), ("s.csv", 16)] {
        let (text, found) = (b.ok(&["info", file]).text(), b.json(&["info", file]));
        fits(file, &text);
        let names = text.lines().find(|line| line.starts_with("  channel")).expect("a header").chars().count();
        assert_eq!(widths(&text, "  channel", channels), vec![names; channels], "{text}");
        let rows = found["integrated_scatter"].as_array().expect("a row an incidence").len();
        let block = widths(&text, "  scatter", rows + 1);
        assert!(rows > 1 && block.iter().all(|width| *width == block[0]), "{text}");
        let last = found["integrated_scatter"][rows - 1]["scatter"][channels - 1].as_f64().expect("a number");
        assert!(text.lines().any(|line| line.ends_with(&format!(" {last:.4}"))), "{last} is there: {text}");
    }
}

#[test]
fn no_color_leaves_no_escape_codes() {
    let b = Bench::new();
    b.write("broken.csv", broken());
    let escapes = |args: &[&str], no_color: Option<&str>| {
        let mut command = b.command(args);
        // As on a terminal that shows colours.
        command.env("CLICOLOR_FORCE", "1").env_remove("NO_COLOR");
        command.envs(no_color.map(|value| ("NO_COLOR", value)));
        let output = command.output().expect("runs");
        [output.stdout, output.stderr].concat().contains(&0x1b)
    };
    for args in [&["--help"][..], &["fit", "--help"], &["fit"], &["fit", "broken.csv"], &["models"]] {
        assert!(!escapes(args, Some("1")), "{args:?}");
    }
    assert!(escapes(&["--help"], None), "there are colours to leave out");
}
