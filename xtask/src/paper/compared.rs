//! Format of values next to those of the paper.

/// The header of three columns.
pub(super) fn header(what: &str) -> [String; 3] {
    [
        format!("{what}, paper"),
        "ours".to_owned(),
        "ours / paper".to_owned(),
    ]
}

/// Paper's value if it has one, measured value, and their ratio.
pub(super) fn compared(paper: Option<f64>, ours: f64) -> [String; 3] {
    let ratio = paper.map(|paper| ours / paper);
    [
        paper.map_or_else(String::new, number),
        number(ours),
        ratio.map_or_else(String::new, number),
    ]
}

/// Formats three digits, or all digits of an integer.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    if value == value.trunc() && size < 1e9 {
        format!("{value:.0}")
    } else if !(1e-4..1e6).contains(&size) {
        format!("{value:.2e}")
    } else if size >= 100.0 {
        format!("{value:.0}")
    } else if size >= 10.0 {
        format!("{value:.1}")
    } else if size >= 1.0 {
        format!("{value:.2}")
    } else if size >= 0.1 {
        format!("{value:.3}")
    } else if size >= 0.01 {
        format!("{value:.4}")
    } else {
        format!("{value:.5}")
    }
}

/// Mean of the values; 0 of none.
pub(super) fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value;
        count += 1.0;
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_ours_over_the_papers() {
        assert_eq!(compared(Some(50.0), 25.0), ["50", "25", "0.500"]);
        assert_eq!(compared(None, 1234.5), ["", "1234", ""]);
        assert_eq!(
            compared(Some(79084.0), 0.79084),
            ["79084", "0.791", "1.00e-5"]
        );
    }
}
