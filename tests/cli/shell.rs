//! What shells and `man` read.

use crate::bench::Bench;

#[test]
fn completions_of_every_shell_know_the_commands() {
    let b = Bench::new();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = b.ok(&["completions", shell]).text();
        assert!(
            ["tradeoff", "validate", "--target-error"].iter().all(|word| script.contains(word)),
            "{shell}: {script}"
        );
    }
    assert_eq!(b.run(&["completions", "tcsh"]).code, Some(2));
    let found = b.json(&["completions", "bash"]);
    assert_eq!(found["script"].as_str().map(str::trim_end), Some(b.ok(&["completions", "bash"]).text().trim_end()));
}

#[test]
fn every_manual_page_is_one_and_what_is_no_command_is_named() {
    let b = Bench::new();
    for args in [&["man"][..], &["man", "fit"], &["man", "tradeoff"]] {
        let page = b.ok(args).text();
        let name = args.get(1).map_or("goniofit".to_owned(), |name| format!("goniofit-{name}"));
        assert!(
            page.contains(".TH") && page.contains(".SH NAME") && page.contains(&name.replace('-', "\\-")),
            "{page}"
        );
    }
    let ran = b.run(&["man", "fti"]);
    assert!(ran.code == Some(2) && ran.err.contains("fti") && ran.err.contains("validate"), "{}", ran.err);
}
