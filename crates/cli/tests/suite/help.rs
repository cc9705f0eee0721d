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
