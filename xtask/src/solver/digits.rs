//! Numbers in tables.

/// Two or three digits, up to five before the point.
pub(crate) fn digits(value: f64) -> String {
    let places = match value.abs() {
        ..0.001 => return format!("{value:.1e}"),
        ..0.01 => 5,
        ..0.1 => 4,
        ..1.0 => 3,
        ..10.0 => 2,
        ..100.0 => 1,
        ..1e5 => 0,
        _ => return format!("{value:.1e}"),
    };
    format!("{value:.places$}")
}
