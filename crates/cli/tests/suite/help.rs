//! The help of every command has a description and an example.

use crate::support::Sandbox;

#[test]
fn every_help_has_an_example() {
    let sandbox = Sandbox::new();
    for command in [
        &[][..],
        &["run"],
        &["advise"],
        &["sweep"],
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
            let help = sandbox.good(&[command, &[flag]].concat());
            let example = help
                .lines()
                .find(|line| line.starts_with("Example: incise "));
            let example = example.unwrap_or_else(|| panic!("{command:?} has no example:\n{help}"));
            assert!(example.contains(&command.join(" ")), "{example}");
        }
    }
    assert!(sandbox.list().is_empty());
}

#[test]
fn graphs_are_mentioned() {
    let sandbox = Sandbox::new();
    let help = sandbox.good(&["color", "--help"]);
    for part in [".mtx", ".col", "graph"] {
        assert!(help.contains(part), "{part} is not in\n{help}");
    }
}

#[test]
fn the_version_is_that_of_the_package() {
    let version = Sandbox::new().good(&["--version"]);
    assert_eq!(
        version.trim(),
        concat!("incise ", env!("CARGO_PKG_VERSION"))
    );
}

#[test]
fn shells_complete_commands_and_options() {
    let sandbox = Sandbox::new();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = sandbox.good(&["completions", shell]);
        for word in ["advise", "tetrahedralize", "wireframe"] {
            assert!(script.contains(word), "{shell} does not complete {word}");
        }
    }
}

#[test]
fn every_command_has_a_manual_page() {
    let sandbox = Sandbox::new();
    std::fs::create_dir(sandbox.path("man1")).unwrap();
    sandbox.good(&["man", "man1"]);
    for name in [
        "incise",
        "incise-run",
        "incise-scene",
        "incise-mesh-convert",
    ] {
        let page = std::fs::read_to_string(sandbox.path(&format!("man1/{name}.1"))).unwrap();
        assert!(
            page.contains(".TH") && page.contains(".SH SYNOPSIS"),
            "{name}"
        );
    }
    let refused = sandbox.incise(&["man", "absent"]);
    assert_eq!(refused.code, 2);
    assert!(
        refused.stderr.contains("absent: cannot write manual pages"),
        "{}",
        refused.stderr
    );
}
