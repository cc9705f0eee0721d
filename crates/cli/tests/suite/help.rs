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

/// The package has manual pages and completions as files, and they are those of this program.
#[test]
fn pages_and_completions_of_the_package_are_current() {
    let sandbox = Sandbox::new();
    let package = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: std::path::PathBuf| std::fs::read_to_string(path).unwrap_or_default();
    std::fs::create_dir(sandbox.path("man")).unwrap();
    sandbox.good(&["man", "man"]);
    for name in sandbox.names("man") {
        assert!(
            sandbox.read(&format!("man/{name}")) == read(package.join("man").join(&name)),
            "{name} is not current: cargo run -p incise-cli -- man crates/cli/man"
        );
    }
    let kept = std::fs::read_dir(package.join("man")).unwrap().count();
    assert_eq!(
        kept,
        sandbox.names("man").len(),
        "a page of a former command is left in crates/cli/man"
    );
    for (shell, name) in [
        ("bash", "incise.bash"),
        ("elvish", "incise.elv"),
        ("fish", "incise.fish"),
        ("powershell", "_incise.ps1"),
        ("zsh", "_incise"),
    ] {
        assert!(
            sandbox.good(&["completions", shell]) == read(package.join("completions").join(name)),
            "{name} is not current: cargo run -p incise-cli -- completions {shell} > crates/cli/completions/{name}"
        );
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
