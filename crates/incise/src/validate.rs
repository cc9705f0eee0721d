//! Validation of numbers against their ranges, and the errors for values outside.

use incise_mesh::glam::DVec3;

use crate::Error;

/// Coordinates beyond this many meters are taken for a mistake; squares and cubes stay finite in single precision.
pub(crate) const LARGEST_COORDINATE: f64 = 1e9;

/// An error about a value of the scene.
pub(crate) fn value(
    field: impl Into<String>,
    value: impl ToString,
    range: impl Into<String>,
) -> Error {
    Error::Value {
        field: field.into(),
        value: value.to_string(),
        range: range.into(),
    }
}

/// The vector, if it is finite and of a size that occurs.
pub(crate) fn coordinates(field: &str, v: [f64; 3]) -> Result<DVec3, Error> {
    for component in v {
        within(field, component, -LARGEST_COORDINATE, LARGEST_COORDINATE)?;
    }
    Ok(DVec3::from_array(v))
}

/// The vector with a largest component of 1, so that products with it neither overflow nor vanish.
pub(crate) fn direction(field: &str, v: [f64; 3]) -> Result<DVec3, Error> {
    if let Some(component) = v.into_iter().find(|c| !c.is_finite()) {
        return Err(value(field, component, "finite"));
    }
    let v = DVec3::from_array(v);
    match v.abs().max_element() {
        0.0 => Err(value(field, "zero", "a direction")),
        largest => Ok(v / largest),
    }
}

/// Refuses the number of a body if there are not as many.
pub(crate) fn existing(field: &str, body: usize, bodies: usize) -> Result<(), Error> {
    if body < bodies {
        return Ok(());
    }
    Err(value(field, body, "the number of a body, counted from 0"))
}

/// A bound as text: in digits unless it is very large or small.
fn plain(bound: f64) -> String {
    if bound == 0.0 || (1e-3..1e5).contains(&bound.abs()) {
        bound.to_string()
    } else {
        format!("{bound:e}")
    }
}

/// The number, if it lies in a range.
pub(crate) fn within(field: &str, number: f64, low: f64, high: f64) -> Result<f64, Error> {
    if (low..=high).contains(&number) {
        return Ok(number);
    }
    let range = if number.is_finite() {
        format!("from {} to {}", plain(low), plain(high))
    } else {
        "finite".to_owned()
    };
    Err(value(field, number, range))
}
