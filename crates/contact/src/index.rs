//! Numbers of 32 bits for places in arrays.

/// Stands for no place.
pub(crate) const NONE: u32 = u32::MAX;

/// A place in an array.
///
/// # Panics
/// From 2³² on. A mesh has fewer than 2²⁹ tets, which keeps all arrays shorter.
pub(crate) fn index(place: usize) -> u32 {
    u32::try_from(place).expect("arrays have fewer than 2³² elements")
}
