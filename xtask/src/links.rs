//! Rules about the pages: relative links name files and headings that exist, and the architecture page names sources
//! that exist.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::prose::texts;

/// The lines of a page outside of code blocks, numbered from 1.
fn prose(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut is_code = false;
    (1..).zip(text.lines()).filter(move |(_, line)| {
        let fence = line.trim_start().starts_with("```");
        is_code ^= fence;
        !is_code && !fence
    })
}

/// The anchors of a page's headings, by the rule of GitHub: lower case, spaces as hyphens, no punctuation, and a number
/// behind a repeated one.
fn anchors(text: &str) -> Vec<String> {
    let mut counts = BTreeMap::new();
    let headings = prose(text).filter(|(_, line)| line.starts_with('#'));
    headings
        .map(|(_, line)| {
            let title = line.trim_start_matches('#').trim().to_lowercase();
            let kept = title
                .chars()
                .filter(|c| c.is_alphanumeric() || "-_ ".contains(*c));
            let anchor: String = kept.map(|c| if c == ' ' { '-' } else { c }).collect();
            let count = counts.entry(anchor.clone()).or_insert(0);
            *count += 1;
            match *count {
                1 => anchor,
                more => format!("{anchor}-{}", more - 1),
            }
        })
        .collect()
}

/// The targets of the links in a page, each with its line.
fn targets(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (number, line) in prose(text) {
        for (at, _) in line.match_indices("](") {
            let rest = &line[at + 2..];
            found.push((
                number,
                rest[..rest.find(')').unwrap_or(rest.len())].to_owned(),
            ));
        }
    }
    found
}

/// What is wrong with a link of the page at `page`, if anything.
fn fault(page: &Path, text: &str, target: &str) -> Option<String> {
    if target.contains("://") || target.starts_with("mailto:") {
        return None;
    }
    let (file, anchor) = target.split_once('#').unwrap_or((target, ""));
    let path = page.with_file_name("").join(file);
    if !file.is_empty() && !path.exists() {
        return Some(format!("no file {file}"));
    }
    let is_page = file.is_empty() || path.extension().is_some_and(|e| e == "md");
    if anchor.is_empty() || !is_page {
        return None;
    }
    let other = if file.is_empty() {
        text.to_owned()
    } else {
        fs::read_to_string(&path).unwrap()
    };
    let is_known = anchors(&other).iter().any(|known| known == anchor);
    (!is_known).then(|| format!("no heading #{anchor} in {}", path.display()))
}

/// The Rust files that a section of a page names in backticks.
fn sources_named(section: &str) -> impl Iterator<Item = &str> {
    let words = section.split('`').skip(1).step_by(2);
    words.filter(|word| word.ends_with(".rs"))
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

#[test]
fn links_lead_to_files_and_headings() {
    let mut pages = Vec::new();
    texts(root(), &mut pages);
    pages.retain(|page| page.extension().is_some_and(|e| e == "md"));
    let (mut count, mut faults) = (0, Vec::new());
    for page in &pages {
        let text = fs::read_to_string(page).unwrap();
        for (line, target) in targets(&text) {
            count += 1;
            if let Some(fault) = fault(page, &text, &target) {
                faults.push(format!("{}:{line}: {fault}", page.display()));
            }
        }
    }
    assert!(count > 200, "{count} links");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn sources_that_the_architecture_page_names_exist() {
    let text = fs::read_to_string(root().join("docs/architecture.md")).unwrap();
    let mut all = Vec::new();
    texts(root(), &mut all);
    let (mut count, mut missing) = (0, Vec::new());
    for section in text.split("\n### ") {
        let title = section.lines().next().unwrap_or_default();
        let crates = title.split('`').filter(|word| word.starts_with("crates/"));
        let folders: Vec<PathBuf> = crates.map(|name| root().join(name).join("src")).collect();
        for name in sources_named(section).filter(|_| !folders.is_empty()) {
            count += 1;
            let is_there = |file: &PathBuf| {
                let in_crate = folders.iter().any(|folder| file.starts_with(folder));
                (in_crate && file.ends_with(name)) || *file == root().join(name)
            };
            if !all.iter().any(is_there) {
                missing.push(format!("{title}: {name}"));
            }
        }
    }
    assert!(count > 50, "{count} names");
    assert!(missing.is_empty(), "{}", missing.join("\n"));
}

/// Checks the rules on a page with known faults.
#[test]
fn faulty_links_are_found() {
    let text = "# A `b`: c\n## Two\n## Two\n```\n[x](gone.md)\n# Code\n```\n\
                [a](#a-b-c) [b](#two-1) [c](#code) [d](gone.md) [e](https://example.org) [f](README.md#none)\n";
    assert_eq!(anchors(text), ["a-b-c", "two", "two-1"]);
    let found = targets(text);
    assert_eq!(found.len(), 6, "{found:?}");
    let page = root().join("page.md");
    let faulty: Vec<&str> = found
        .iter()
        .filter(|(_, target)| fault(&page, text, target).is_some())
        .map(|(_, target)| target.as_str())
        .collect();
    assert_eq!(faulty, ["#code", "gone.md", "README.md#none"]);
    assert_eq!(
        sources_named("a `b.rs` `c` and `d/e.rs`").collect::<Vec<_>>(),
        ["b.rs", "d/e.rs"]
    );
}
