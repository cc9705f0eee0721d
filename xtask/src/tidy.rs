//! Rules about the source beyond the compiler's: the modules of a crate have no cyclic dependencies.
//!
//! A module is a file or folder directly under `src`; it depends on each module in a path that begins with `crate::`,
//! tests excluded, also through a re-export of the crate's root. Source of the search: Tarjan 1972.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Dependencies of each module.
type Modules = BTreeMap<String, BTreeSet<String>>;

fn sources(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

/// The text without comments and without the tests at its end.
fn code(text: &str) -> String {
    let lines = text.lines().take_while(|line| *line != "#[cfg(test)]");
    let bare = lines.map(|line| line.split("//").next().unwrap_or(""));
    bare.collect::<Vec<_>>().join("\n")
}

/// Names directly after each `prefix` in a text: one, or those at the first level of braces.
fn names_after<'a>(text: &'a str, prefix: &str) -> Vec<&'a str> {
    let mut names = Vec::new();
    let mut add = |text: &'a str| {
        let text = text.trim_start();
        let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_'));
        names.push(&text[..end.unwrap_or(text.len())]);
    };
    for (at, _) in text.match_indices(prefix) {
        let rest = &text[at + prefix.len()..];
        if !rest.starts_with('{') {
            add(rest);
            continue;
        }
        let (mut depth, mut start) = (0, 1);
        for (i, c) in rest.char_indices() {
            depth += i32::from(c == '{') - i32::from(c == '}');
            if depth == 1 && c == ',' || depth == 0 {
                add(&rest[start..i]);
                start = i + 1;
            }
            if depth == 0 {
                break;
            }
        }
    }
    names
}

fn modules(src: &Path) -> Modules {
    let mut files = Vec::new();
    sources(src, &mut files);
    let module = |file: &Path| {
        let first = file.strip_prefix(src).unwrap().iter().next().unwrap();
        first.to_str().unwrap().trim_end_matches(".rs").to_owned()
    };
    let root = fs::read_to_string(src.join("lib.rs")).unwrap_or_default();
    // A re-export of the root belongs to its module.
    let mut homes = BTreeMap::new();
    for line in code(&root).split(';') {
        let Some(path) = line
            .trim()
            .rsplit('\n')
            .next()
            .and_then(|l| l.strip_prefix("pub use "))
        else {
            continue;
        };
        if let Some((home, _)) = path.split_once("::") {
            let inside = format!("{home}::");
            for name in names_after(path, &inside) {
                homes.insert(name.to_owned(), home.to_owned());
            }
        }
    }
    let mut modules = Modules::new();
    for file in &files {
        modules.entry(module(file)).or_default();
    }
    for file in &files {
        let own = module(file);
        let is_test = file.file_name().is_some_and(|name| name == "tests.rs");
        if own == "lib" || own == "main" || is_test {
            continue;
        }
        let text = code(&fs::read_to_string(file).unwrap());
        for name in names_after(&text, "crate::") {
            let home = homes.get(name).map_or(name, String::as_str).to_owned();
            if home != own && modules.contains_key(&home) {
                modules.get_mut(&own).unwrap().insert(home);
            }
        }
    }
    modules
}

/// Finds a dependency cycle of modules.
fn circle(modules: &Modules) -> Option<Vec<String>> {
    modules.keys().find_map(|start| {
        let mut ways = vec![vec![start.clone()]];
        let mut seen = BTreeSet::new();
        while let Some(way) = ways.pop() {
            for next in &modules[way.last().unwrap()] {
                if next == start {
                    return Some(way);
                }
                if seen.insert(next.clone()) {
                    ways.push([&way[..], std::slice::from_ref(next)].concat());
                }
            }
        }
        None
    })
}

#[test]
fn modules_do_not_depend_on_each_other_in_a_circle() {
    let xtask = Path::new(env!("CARGO_MANIFEST_DIR"));
    let crates = fs::read_dir(xtask.with_file_name("crates")).unwrap();
    let crates = crates.map(|entry| entry.unwrap().path());
    for folder in crates.chain([xtask.to_owned()]) {
        let modules = modules(&folder.join("src"));
        assert!(modules.len() > 5, "{}: {modules:?}", folder.display());
        assert_eq!(circle(&modules), None, "{}", folder.display());
    }
}

/// The rule's own oracle: a folder with a circle through a re-export, and names in all forms.
#[test]
fn circles_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write(
        "lib.rs",
        "mod a;\nmod b;\nmod c;\npub use c::{Thing, Other};\n",
    );
    write("a.rs", "use crate::{Other, b::{self, X}};\n// crate::a\n");
    write(
        "b.rs",
        "fn f() {}\n#[cfg(test)]\nmod tests { use crate::a; }\n",
    );
    write("c.rs", "use crate::b::X;\n");
    let found = modules(folder.path());
    let of = |name: &str| found[name].iter().map(String::as_str).collect::<Vec<_>>();
    assert_eq!(
        (of("a"), of("b"), of("c")),
        (vec!["b", "c"], vec![], vec!["b"])
    );
    assert_eq!(circle(&found), None);
    write("b.rs", "fn f() -> crate::Thing {}\n");
    let found = circle(&modules(folder.path())).unwrap();
    assert_eq!(found, ["b", "c"]);
}
