//! Every command explains itself, with an example.

use crate::support::Place;

#[test]
fn every_help_has_an_example() {
    let place = Place::new();
    for command in [
        &[][..],
        &["run"],
        &["advise"],
        &["color"],
        &["mesh"],
        &["mesh", "info"],
        &["mesh", "convert"],
        &["mesh", "generate"],
        &["scene"],
        &["completions"],
        &["man"],
    ] {
        for flag in ["--help", "-h"] {
            let help = place.good(&[command, &[flag]].concat());
            let example = help
                .lines()
                .find(|line| line.starts_with("Example: incise "));
            let example = example.unwrap_or_else(|| panic!("{command:?} has no example:\n{help}"));
            assert!(example.contains(&command.join(" ")), "{example}");
        }
    }
    assert!(place.list().is_empty());
}

#[test]
fn graphs_are_mentioned() {
    let place = Place::new();
    let help = place.good(&["color", "--help"]);
    for part in [".mtx", ".col", "graph"] {
        assert!(help.contains(part), "{part} is not in\n{help}");
    }
}

#[test]
fn the_version_is_that_of_the_package() {
    let version = Place::new().good(&["--version"]);
    assert_eq!(
        version.trim(),
        concat!("incise ", env!("CARGO_PKG_VERSION"))
    );
}

#[test]
fn shells_complete_commands_and_options() {
    let place = Place::new();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = place.good(&["completions", shell]);
        for word in ["advise", "tetrahedralize", "wireframe"] {
            assert!(script.contains(word), "{shell} does not complete {word}");
        }
    }
}

#[test]
fn every_command_has_a_manual_page() {
    let place = Place::new();
    std::fs::create_dir(place.path("man1")).unwrap();
    place.good(&["man", "man1"]);
    for name in [
        "incise",
        "incise-run",
        "incise-scene",
        "incise-mesh-convert",
    ] {
        let page = std::fs::read_to_string(place.path(&format!("man1/{name}.1"))).unwrap();
        assert!(
            page.contains(".TH") && page.contains(".SH SYNOPSIS"),
            "{name}"
        );
    }
    let refused = place.incise(&["man", "absent"]);
    assert_eq!(refused.code, 2);
    assert!(
        refused.stderr.contains("absent: cannot write manual pages"),
        "{}",
        refused.stderr
    );
}
