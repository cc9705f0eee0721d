//! [`suggestion`]: the known name that is most similar to an unknown one, for "did you mean" messages.

/// Returns the known name that is most similar to `unknown`; `None` if none is similar.
pub(crate) fn similar<'a>(
    unknown: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let rated = known
        .into_iter()
        .map(|name| (similarity(unknown, name), name));
    rated
        .filter(|(similarity, _)| *similarity >= SIMILAR)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name)
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
    match similar(&name, known) {
        Some(similar) => format!("; did you mean '{similar}'?"),
        None => String::new(),
    }
}

/// Similarity from which a name is suggested.
const SIMILAR: f64 = 0.65;

/// Similarity of two names from 0 to 1. Jaro-Winkler finds common beginnings, the edit distance letters that are missing.
fn similarity(a: &str, b: &str) -> f64 {
    strsim::jaro_winkler(a, b).max(strsim::normalized_damerau_levenshtein(a, b))
}
