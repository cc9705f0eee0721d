//! Rules about sentences: words for people are not the subjects of code and data, and a doc comment stands alone,
//! because it is read in a tooltip.

use std::fs;
use std::path::{Path, PathBuf};

/// Words forbidden in all texts of the project, in two parts so that this list is not a hit itself.
const WORDS: [(&str, &str); 8] = [
    ("any", "body"),
    ("dear", "er"),
    ("every", "body"),
    ("no", "body"),
    ("some", "body"),
    ("who", "ever"),
    ("a", "new"),
    ("there", "by"),
];

/// Phrases forbidden in all texts of the project, in two parts as well.
const PHRASES: [(&str, &str); 2] = [("as far", " as"), ("put", " right")];

/// Forbidden beginnings of doc comments: they refer to text that a tooltip does not show.
const BEGINNINGS: [&str; 5] = ["The same", "As ", "Likewise", "Ditto", "Whether it is"];

/// Folders without sources.
const SKIPPED: [&str; 3] = ["target", "out", ".git"];

/// Collects the text files below a folder.
pub(crate) fn texts(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap_or_default();
        if path.is_dir() {
            if !SKIPPED.iter().any(|skipped| name == *skipped) {
                texts(&path, into);
            }
        } else if path
            .extension()
            .is_some_and(|e| ["rs", "md", "wgsl"].iter().any(|text| e == *text))
        {
            into.push(path);
        }
    }
}

/// Violations in the lines of a text, each with its line number from 1.
fn faults(text: &str) -> Vec<(usize, String)> {
    let words = WORDS.map(|(first, last)| format!("{first}{last}"));
    let phrases = PHRASES.map(|(first, last)| format!("{first}{last}"));
    let mut faults = Vec::new();
    let mut is_inside = false;
    for (number, line) in (1..).zip(text.lines()) {
        let used = line.split(|c: char| !(c.is_alphanumeric() || c == '_'));
        for word in used.map(str::to_lowercase) {
            if words.contains(&word) {
                faults.push((number, format!("the word `{word}`")));
            }
        }
        let lower = line.to_lowercase();
        for phrase in phrases.iter().filter(|phrase| lower.contains(*phrase)) {
            faults.push((number, format!("the phrase `{phrase}`")));
        }
        let trimmed = line.trim_start();
        let comment = ["///", "//!"]
            .into_iter()
            .find_map(|mark| trimmed.strip_prefix(mark));
        if let (Some(comment), false) = (comment, is_inside) {
            let comment = comment.trim_start();
            if let Some(beginning) = BEGINNINGS.iter().find(|b| comment.starts_with(**b)) {
                faults.push((
                    number,
                    format!("a doc comment that begins with `{beginning}`"),
                ));
            }
        }
        is_inside = comment.is_some();
    }
    faults
}

#[test]
fn sentences_keep_the_rules() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut files = Vec::new();
    texts(root, &mut files);
    assert!(files.len() > 500, "{} texts", files.len());
    let mut all = Vec::new();
    for file in files {
        for (line, fault) in faults(&fs::read_to_string(&file).unwrap()) {
            let file = file.strip_prefix(root).unwrap().display();
            all.push(format!("{file}:{line}: {fault}"));
        }
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}

/// Checks the rule on a text with known violations.
#[test]
fn faults_are_found() {
    let [word, other] = [WORDS[3], WORDS[6]].map(|(first, last)| format!("{first}{last}"));
    let phrase = format!("As far{}", PHRASES[0].1);
    let text = format!(
        "/// As before.\nfn f() {{}}\n\n/// Names the thing.\n/// As a list.\n//! The same here.\n\
         // Made {other}.\nlet not_{word} = {word};\n// It goes {phrase} that.\n"
    );
    let found = faults(&text);
    let lines: Vec<usize> = found.iter().map(|(line, _)| *line).collect();
    assert_eq!(lines, [1, 7, 8, 9], "{found:?}");
}
