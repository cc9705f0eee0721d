//! Numbers as text in messages: percentages, and counts in singular and plural.
//!
//! Cost: O(1).

use std::fmt;

/// A fraction in percent, with a digit after the point where it is small.
pub(crate) fn percent(fraction: f64) -> String {
    let percent = 100.0 * fraction;
    let number = match percent {
        _ if percent >= 100.0 => return "100% or more".to_owned(),
        _ if percent >= 10.0 => format!("{percent:.0}"),
        _ if percent >= 0.1 => format!("{percent:.1}"),
        _ => format!("{percent:.0e}"),
    };
    format!("{}%", number.trim_end_matches(".0"))
}

/// A number with its noun, in the plural unless it is 1.
pub(crate) fn counted(count: impl fmt::Display, noun: &str) -> String {
    let count = count.to_string();
    let ending = if count == "1" { "" } else { "s" };
    format!("{count} {noun}{ending}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_as_text() {
        let texts = [1.5, 0.42, 0.1, 0.05, 0.0123, 0.002, 2e-9].map(percent);
        let expected = ["100% or more", "42%", "10%", "5%", "1.2%", "0.2%", "2e-7%"];
        assert_eq!(texts, expected);
        assert_eq!(counted(1, "substep"), "1 substep");
        assert_eq!(counted(21, "substep"), "21 substeps");
    }
}
