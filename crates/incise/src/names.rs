//! [`suggestion`]: the known name that is most similar to an unknown one, for "did you mean" messages.

/// Returns the known name that is most similar to `unknown`; `None` without any known name.
#[must_use]
pub fn nearest<'a>(unknown: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    known
        .into_iter()
        .max_by(|a, b| similarity(unknown, a).total_cmp(&similarity(unknown, b)))
}

/// Returns the end of a message about an unknown name: `; did you mean 'liver'?`, or nothing if no known name is
/// similar.
///
/// A parameter after a colon, as in `serial:10`, does not count.
///
/// ```
/// use incise::scene::suggestion;
///
/// assert_eq!(suggestion("livr", ["box", "liver"]), "; did you mean 'liver'?");
/// assert_eq!(suggestion("bx", ["box", "liver"]), "; did you mean 'box'?");
/// assert_eq!(suggestion("17", ["box", "liver"]), "");
/// ```
#[must_use]
pub fn suggestion<'a>(unknown: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let name = unknown.split(':').next().unwrap_or(unknown).to_lowercase();
    match nearest(&name, known) {
        Some(nearest) if similarity(&name, nearest) >= SIMILAR => {
            format!("; did you mean '{nearest}'?")
        }
        _ => String::new(),
    }
}

/// Similarity from which a name is suggested.
const SIMILAR: f64 = 0.65;

/// Similarity of two names from 0 to 1. Jaro-Winkler finds common beginnings, the edit distance letters that are missing.
fn similarity(a: &str, b: &str) -> f64 {
    strsim::jaro_winkler(a, b).max(strsim::normalized_damerau_levenshtein(a, b))
}
