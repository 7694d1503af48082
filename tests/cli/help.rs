//! Help: every command has one, with an example that its parser accepts.

use crate::bench::Bench;

fn commands(b: &Bench) -> Vec<String> {
    let text = b.ok(&["--help"]).text();
    let list = text.split("Commands:").nth(1).expect("a list of commands");
    let names = list.lines().skip(1).take_while(|l| !l.trim().is_empty()).filter_map(|l| {
        let continued = l.starts_with("    "); // the wrapped rest of a summary
        l.split_whitespace().next().filter(|_| !continued).map(str::to_owned)
    });
    names.filter(|n| n != "help").collect()
}

/// The command lines under `Example:`.
fn examples(help: &str) -> Vec<Vec<String>> {
    let lines = help.lines().skip_while(|l| !l.starts_with("Example")).skip(1);
    let typed = lines.filter_map(|l| l.trim().strip_prefix("goniofit "));
    typed.map(|l| l.split('>').next().unwrap_or(l).split_whitespace().map(str::to_owned).collect()).collect()
}

#[test]
fn help_lists_every_command() {
    let found = commands(&Bench::new());
    let expected = [
        "demo",
        "simulate",
        "reduce",
        "effects",
        "plan",
        "info",
        "fit",
        "render",
        "validate",
        "compare",
        "plot",
        "report",
        "convert",
        "tradeoff",
        "models",
        "scenes",
        "instruments",
        "completions",
        "man",
    ];
    for name in expected {
        assert!(found.iter().any(|f| f == name), "{name} is missing of {found:?}");
    }
}

#[test]
fn the_help_of_every_command_has_an_example_that_its_parser_accepts() {
    let b = Bench::new();
    for name in commands(&b) {
        let ran = b.ok(&[&name, "--help"]);
        assert!(ran.err.is_empty(), "{name}: help belongs on stdout");
        let examples = examples(&ran.text());
        assert!(!examples.is_empty(), "{name} has no example:\n{}", ran.text());
        for example in examples {
            assert_eq!(example[0], name, "{example:?}");
            if name == "demo" {
                continue; // runs for long with its defaults
            }
            // The files are not there, which is all that may be wrong.
            let args: Vec<&str> = example.iter().map(String::as_str).collect();
            let ran = b.run(&args);
            let misread = ["Usage:", "unexpected argument", "invalid value"].iter().any(|s| ran.err.contains(s));
            assert!(!misread, "{example:?}: {}", ran.err);
        }
    }
}

#[test]
fn alone_it_says_what_to_start_with() {
    let b = Bench::new();
    let ran = b.ok(&[]);
    assert!(ran.err.is_empty(), "{}", ran.err);
    let text = ran.text();
    assert!(text.lines().all(|l| l.chars().count() <= 80) && text.lines().count() <= 24, "fits a terminal: {text}");
    assert!(text.contains("goniofit --help"), "{text}");
    let (known, mut named) = (commands(&b), 0);
    for line in text.lines().filter_map(|l| l.trim().strip_prefix("goniofit ").filter(|_| l.starts_with("   "))) {
        let args: Vec<&str> = line.split_whitespace().collect();
        assert!(known.iter().any(|name| name == args[0]), "{line}");
        // With `--help` nothing runs, but what stands before it is read.
        b.ok(&[&args[..], &["--help"]].concat());
        named += 1;
    }
    assert!((5..=6).contains(&named), "{text}");
    // Options without a command are a mistake.
    for args in [&["--quiet"][..], &["--threads", "2"], &["--json"]] {
        assert_eq!(b.run(args).code, Some(2), "{args:?}");
    }
    assert!(b.run(&["--json"]).json()["error"].is_string());
}

#[test]
fn every_command_knows_json_quiet_and_threads() {
    let b = Bench::new();
    for name in commands(&b) {
        let help = b.ok(&[&name, "--help"]).text();
        for option in ["--json", "--quiet", "--threads"] {
            assert!(help.contains(option), "{name} lacks {option}");
        }
    }
}

#[test]
fn the_version_is_the_crates() {
    let said = Bench::new().ok(&["--version"]).text();
    assert_eq!(said.trim(), concat!("goniofit ", env!("CARGO_PKG_VERSION")));
}
